// SPDX-License-Identifier: MIT
#include "daemon/inventory.h"

#include "daemon/view.h"
#include "drivers/identity.h"

static json_t *latencies(const struct link_stats *stats)
{
    const double answers = (double)link_stats_answers(stats);
    json_t *o = json_pack("{s:I}", "count", (json_int_t)link_stats_answers(stats));
    json_object_set_new(o, "p50", view_number(link_stats_quantile_s(stats, 0.50)));
    json_object_set_new(o, "p95", view_number(link_stats_quantile_s(stats, 0.95)));
    json_object_set_new(o, "p99", view_number(link_stats_quantile_s(stats, 0.99)));
    json_object_set_new(o, "mean",
                        view_number((double)stats->latency_sum_ns * 1e-9 / answers)); // or null
    json_object_set_new(o, "last", view_number((double)stats->latency_last_ns * 1e-9));
    json_object_set_new(o, "worst", view_number((double)stats->latency_worst_ns * 1e-9));
    return o;
}

json_t *inventory_traffic(const struct link_stats *stats)
{
    json_t *errors = json_object();
    for (int kind = 0; kind < LINK_ERRORS; kind++)
        json_object_set_new(errors, link_error_name((enum link_error)kind),
                            json_integer((json_int_t)stats->errors[kind]));
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:o, s:o}", "requests",
                     (json_int_t)stats->requests, "bytes_out", (json_int_t)stats->bytes_out,
                     "bytes_in", (json_int_t)stats->bytes_in, "retries", (json_int_t)stats->retries,
                     "resyncs", (json_int_t)stats->resyncs, "reconnects",
                     (json_int_t)stats->reopened, "errors", errors, "latency_s", latencies(stats));
}

static void add_last_error(json_t *o, const struct part_state *p, int64_t now_ns)
{
    const bool any = *p->last_error;
    json_object_set_new(o, "last_error", any ? json_string(p->last_error) : json_null());
    json_object_set_new(o, "last_error_age_s",
                        any ? json_real((double)(now_ns - p->last_error_ns) * 1e-9) : json_null());
}

static json_t *one(const struct instrument_snapshot *s, int part)
{
    const struct part_state *p = &s->part[part];
    char serial[64];
    identity_serial(p->identity, serial, sizeof serial);
    json_t *o = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s, s:s, s:I, s:I}", "name", p->name,
                          "kind", view_kind(s, part), "driver", p->driver, "link", p->address,
                          "state", p->link == PART_OK ? "ok" : "lost", "why", p->problem,
                          "identity", p->identity, "serial", serial, "errors",
                          (json_int_t)p->errors, "returns", (json_int_t)p->returns);
    add_last_error(o, p, s->t_ns);
    json_object_set_new(o, "traffic", inventory_traffic(&p->stats));
    json_object_set_new(o, view_kind(s, part), view_part(s, part));
    return o;
}

json_t *inventory_view(const struct instrument_snapshot *s)
{
    json_t *all = json_array();
    for (int part = 0; s && part < PART_COUNT; part++)
        if (s->part[part].link != PART_ABSENT)
            json_array_append_new(all, one(s, part));
    return all;
}
