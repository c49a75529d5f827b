// SPDX-License-Identifier: MIT
// plan: the dry run. Moves nothing.
#include "campaign/plan.h"

#include "cli/check.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct options {
    bool json;
    const char *bench;
};

static const struct option_row rows[] = {
    {"--bench", OPTION_TEXT, offsetof(struct options, bench), "FILE", 0, 0,
     "the bench (goniod.cfg): limits, and the time it takes"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0,
     "print JSON, with every point"},
    VERB_OPTIONS_END,
};

struct sweep {
    double theta_i_deg;
    int points, dense, skipped;
    int skipped_for[PLAN_SKIP_REASONS]; // by enum plan_skip_reason
};

static void duration_text(double s, char *text, size_t size)
{
    const size_t about = (size_t)snprintf(text, size, "about ");
    if (isfinite(s))
        out_duration(text + about, size - about, s);
    else
        snprintf(text, size, "time unknown without --bench");
}

static struct sweep sweep_of(const struct plan *p, const struct campaign_config *c, int sweep)
{
    struct sweep s = {.theta_i_deg =
                          sweep <= c->theta_i_count ? c->theta_i_deg[sweep - 1] : (double)NAN};
    for (int i = 0; i < p->count; i++)
        if (p->points[i].sweep == sweep) {
            s.theta_i_deg = p->points[i].theta_i_deg;
            s.points++;
            s.dense += p->points[i].dense;
        }
    for (int i = 0; i < p->skips_count; i++)
        if (p->skips[i].sweep == sweep) {
            s.skipped_for[p->skips[i].reason]++;
            s.skipped++;
        }
    return s;
}

// "4 in the detector's shadow, 11 beyond an axis's limits"
static void why_text(const struct sweep *s, char *text, size_t size)
{
    *text = 0;
    for (int reason = 0; reason < PLAN_SKIP_REASONS; reason++) {
        size_t used = strlen(text);
        if (s->skipped_for[reason])
            snprintf(text + used, size - used, "%s%d %s", used ? ", " : "", s->skipped_for[reason],
                     plan_skip_text((enum plan_skip_reason)reason));
    }
}

// Of a state of the light: unknown without a bench is what the laser will be.
static const char *light_name(int pol_in, bool has_bench)
{
    return pol_in == POL_UNKNOWN && !has_bench ? "laser"
                                               : polarisation_name((enum polarisation)pol_in);
}

// What each sweep is measured in, in order; as the plan resolved it.
static int states_of(const struct plan *p, struct campaign_channel ret_states[CAMPAIGN_CHANNELS])
{
    int n = 0;
    for (int i = 0; i < p->count; i++) {
        const struct plan_point *q = &p->points[i];
        int k = 0;
        while (k < n && (ret_states[k].in != q->pol_in || ret_states[k].out != q->pol_out))
            k++;
        if (q->kind == PLAN_SAMPLE && k == n)
            ret_states[n++] = (struct campaign_channel){q->pol_in, q->pol_out};
    }
    return n;
}

// "s, p" or, behind an analyser, "s>s, p>p".
static void say_states(const struct plan *p, bool has_bench)
{
    struct campaign_channel states[CAMPAIGN_CHANNELS];
    const int n = states_of(p, states);
    if (n == 1 && states[0].out == POL_U)
        return;
    fprintf(stderr, "each sweep in %d state%s of polarisation%s: ", n, n == 1 ? "" : "s",
            n == 1 ? "" : ", one after the other");
    for (int i = 0; i < n; i++)
        fprintf(stderr, "%s%s%s%s", i ? ", " : "", light_name(states[i].in, has_bench),
                states[i].out == POL_U ? "" : ">",
                states[i].out == POL_U ? "" : polarisation_name((enum polarisation)states[i].out));
    fprintf(stderr, "\n");
}

// In a terminal and in a log, before the warnings.
static void say_steps(const struct plan *p)
{
    for (int i = 0; i < p->steps_count; i++) {
        const struct plan_step *s = &p->steps[i];
        char when[60];
        if (s->sweep == 0)
            snprintf(when, sizeof when, "before the opening references");
        else if (s->sweep > p->sweeps)
            snprintf(when, sizeof when, "before the closing references");
        else
            snprintf(when, sizeof when, "before sweep %d", s->sweep);
        fprintf(stderr, "step: %s: %s (the run waits for gonio ack)\n", when, s->text);
    }
}

static json_t *steps_json(const struct plan *p)
{
    json_t *all = json_array();
    for (int i = 0; i < p->steps_count; i++)
        json_array_append_new(all, json_pack("{s:i, s:i, s:s}", "before", p->steps[i].before,
                                             "sweep", p->steps[i].sweep, "text", p->steps[i].text));
    return all;
}

static void print_plan(const struct plan *p, const struct campaign_config *c, const char *path,
                       bool has_bench)
{
    char time[60], dense[40];
    duration_text(p->duration_s, time, sizeof time);
    snprintf(dense, sizeof dense, "dense (±%g°)", c->dense_half_width_deg);
    fprintf(stderr,
            "%s: %d sweeps, %d points on the sample and %d reference readings, %d samples a point, "
            "%s\n",
            c->name, p->sweeps, p->samples, p->count - p->samples, c->readings, time);
    say_states(p, has_bench);
    struct table *t = table_new(6);
    bool terminal = out_is_terminal(stdout);
    const char *head[] = {"sweep",   terminal ? "θi" : "theta_i_deg",
                          "points",  terminal ? dense : "dense",
                          "skipped", "why"};
    for (int i = 0; i < 6; i++) {
        table_cell(t, "%s", head[i]);
        if (i < 5)
            table_right(t, i);
    }
    for (int i = 1; i <= p->sweeps; i++) {
        char why[200];
        struct sweep s = sweep_of(p, c, i);
        why_text(&s, why, sizeof why);
        table_cell(t, "%d", i);
        table_cell(t, "%g%s", s.theta_i_deg, terminal ? "°" : "");
        table_cell(t, "%d", s.points);
        table_cell(t, "%d", s.dense);
        table_cell(t, "%d", s.skipped);
        table_cell(t, "%s", why);
    }
    table_print(t, stdout);
    fflush(stdout);
    say_steps(p);
    for (int i = 0; i < p->warnings_count; i++)
        out_warn("%s", p->warnings[i]);
    fprintf(stderr, "%d %s.  Start it with:  gonio run %s\n", p->warnings_count,
            p->warnings_count == 1 ? "warning" : "warnings", path);
}

static json_t *states_json(const struct plan *p, bool has_bench)
{
    struct campaign_channel states[CAMPAIGN_CHANNELS];
    json_t *all = json_array();
    for (int i = 0, n = states_of(p, states); i < n; i++)
        json_array_append_new(all, json_pack("{s:s, s:s}", "pol_in",
                                             light_name(states[i].in, has_bench), "pol_out",
                                             polarisation_name((enum polarisation)states[i].out)));
    return all;
}

static json_t *points_json(const struct plan *p, bool has_bench)
{
    json_t *all = json_array();
    for (int i = 0; i < p->count; i++) {
        const struct plan_point *q = &p->points[i];
        json_array_append_new(
            all, json_pack("{s:i, s:i, s:s, s:s, s:f, s:f, s:s, s:s, s:f, s:b}", "sweep", q->sweep,
                           "point", q->point, "kind", plan_kind_name(q->kind), "station",
                           q->station, "theta_i_deg", q->theta_i_deg, "theta_r_deg", q->theta_r_deg,
                           "pol_in", light_name(q->pol_in, has_bench), "pol_out",
                           polarisation_name((enum polarisation)q->pol_out), "weight", q->weight,
                           "dense", q->dense));
    }
    return all;
}

static json_t *skips_json(const struct plan *p)
{
    json_t *all = json_array();
    for (int i = 0; i < p->skips_count; i++) {
        const struct plan_skip *k = &p->skips[i];
        json_array_append_new(all, json_pack("{s:i, s:f, s:f, s:s}", "sweep", k->sweep,
                                             "theta_i_deg", k->theta_i_deg, "theta_r_deg",
                                             k->theta_r_deg, "reason", plan_skip_text(k->reason)));
    }
    return all;
}

static json_t *sweeps_json(const struct plan *p, const struct campaign_config *c)
{
    json_t *all = json_array();
    for (int i = 1; i <= p->sweeps; i++) {
        struct sweep s = sweep_of(p, c, i);
        json_array_append_new(all, json_pack("{s:i, s:f, s:i, s:i, s:i}", "sweep", i, "theta_i_deg",
                                             s.theta_i_deg, "points", s.points, "dense", s.dense,
                                             "skipped", s.skipped));
    }
    return all;
}

static void print_json(const struct plan *p, const struct campaign_config *c, bool has_bench)
{
    json_t *warnings = json_array();
    for (int i = 0; i < p->warnings_count; i++)
        json_array_append_new(warnings, json_string(p->warnings[i]));
    json_t *o = json_pack("{s:s, s:s, s:i, s:i, s:i, s:i}", "name", c->name, "sample", c->sample,
                          "sweep_count", p->sweeps, "points", p->count, "sample_points", p->samples,
                          "samples_per_point", c->readings);
    json_object_set_new(o, "duration_s",
                        isfinite(p->duration_s) ? json_real(p->duration_s) : json_null());
    json_object_set_new(o, "sweeps", sweeps_json(p, c));
    json_object_set_new(o, "states", states_json(p, has_bench));
    json_object_set_new(o, "order", points_json(p, has_bench));
    json_object_set_new(o, "skipped", skips_json(p));
    json_object_set_new(o, "steps", steps_json(p));
    json_object_set_new(o, "warnings", warnings);
    out_json(o);
    json_decref(o);
}

static int run_plan(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    struct campaign_config config;
    struct bench_config bench;
    struct plan plan = {0};
    struct gon_error err;
    const char *path;
    if (verb_take(verb, argc, argv, &o, &path, 1, 1) < 0)
        return EXIT_INPUT;
    int status = check_campaign(path, &config, NULL);
    if (status == EXIT_OK && o.bench)
        status = check_bench(o.bench, &bench);
    if (status != EXIT_OK)
        return status;
    if (plan_make(&config, o.bench ? &bench : NULL, &plan, &err) < 0)
        return out_fail(&err);
    if (o.json)
        print_json(&plan, &config, o.bench);
    else
        print_plan(&plan, &config, path, o.bench);
    plan_clear(&plan);
    return EXIT_OK;
}

const struct verb verb_plan = {
    "plan",
    "CAMPAIGN.cfg",
    "the dry run: points, order, time, warnings; moves nothing",
    "Prints every sweep with its points, what is skipped and why, "
    "warnings, and with --bench the time it\n"
    "takes and the points that it cannot reach: beyond the axes' limits, or in or behind a\n"
    "keep-out.\n",
    rows,
    run_plan};
