// SPDX-License-Identifier: MIT
#include "daemon/metrics.h"

#include "daemon/instrument.h"
#include "daemon/queue.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- the format ----------------------------------------------------------------------------------

static void head(FILE *out, const char *name, const char *type, const char *help)
{
    fprintf(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

static void put_quoted(FILE *out, const char *text)
{
    fputc('"', out);
    for (; *text; text++)
        if (*text == '\n')
            fputs("\\n", out);
        else
            fprintf(out, "%s%c", *text == '"' || *text == '\\' ? "\\" : "", *text);
    fputc('"', out);
}

// One sample; pairs of label and value follow, NULL after the last. None for NAN.
static void put(FILE *out, const char *name, double value, ...)
{
    va_list labels;
    int count = 0;
    if (isnan(value))
        return;
    fputs(name, out);
    va_start(labels, value);
    for (const char *key; (key = va_arg(labels, const char *)); count++) {
        fprintf(out, "%c%s=", count ? ',' : '{', key);
        put_quoted(out, va_arg(labels, const char *));
    }
    va_end(labels);
    fprintf(out, "%s %.15g\n", count ? "}" : "", value);
}

static void gauge(FILE *out, const char *name, double value, const char *help)
{
    head(out, name, "gauge", help);
    put(out, name, value, NULL);
}

// --- the daemon and its run ----------------------------------------------------------------------

static void put_daemon(FILE *out, const struct metrics_source *m)
{
    head(out, "gonio_build_info", "gauge", "Always 1; the version is its label.");
    put(out, "gonio_build_info", 1, "version", GONIO_VERSION, NULL);
    gauge(out, "gonio_uptime_seconds", m->uptime_s, "Since the daemon started.");
    gauge(out, "gonio_simulator", m->simulator, "1 when the bench is simulated.");
    gauge(out, "gonio_instrument_age_seconds", m->snapshot ? m->snapshot_age_s : (double)NAN,
          "Since the instrument thread last told how the bench is.");
    head(out, "gonio_readings_total", "counter", "Readings stored since the daemon started.");
    put(out, "gonio_readings_total", (double)m->readings, NULL);
}

static void put_run(FILE *out, const struct run *run)
{
    head(out, "gonio_run_state", "gauge", "1 for the state of the run that has the bench.");
    put(out, "gonio_run_state", run == NULL, "state", "idle", NULL);
    for (enum run_state s = RUN_QUEUED; s <= RUN_FAILED; s++)
        put(out, "gonio_run_state", run && run->state == s, "state", run_state_name(s), NULL);
    gauge(out, "gonio_run_number", run ? run->id : 0, "The run that has the bench; 0: none.");
    gauge(out, "gonio_run_readings", run ? run->total : 0, "Readings of that run's plan.");
    gauge(out, "gonio_run_readings_done", run ? run->done : 0, "Those that are stored.");
}

// --- devices -------------------------------------------------------------------------------------

static bool is_there(const struct instrument_snapshot *s, int part)
{
    return s->part[part].link != PART_ABSENT;
}

static double device_errors(const struct instrument_snapshot *s, int part)
{
    return (double)s->part[part].errors;
}

static double device_returns(const struct instrument_snapshot *s, int part)
{
    return (double)s->part[part].returns;
}

static double axis_moving(const struct instrument_snapshot *s, int part)
{
    return s->axis[part].moving;
}

static double axis_homed(const struct instrument_snapshot *s, int part)
{
    return s->axis[part].homed;
}

static double axis_alarm(const struct instrument_snapshot *s, int part)
{
    return s->axis[part].alarm;
}

// One sample a part, of the first so many.
static const struct family {
    const char *name, *type, *label, *help;
    int parts;
    double (*value)(const struct instrument_snapshot *s, int part);
} families[] = {
    {"gonio_device_errors_total", "counter", "device", "Calls to the device that failed.",
     PART_COUNT, device_errors},
    {"gonio_device_returns_total", "counter", "device", "Times the device came back.", PART_COUNT,
     device_returns},
    {"gonio_axis_moving", "gauge", "axis", "1 while it moves.", INSTRUMENT_AXES, axis_moving},
    {"gonio_axis_homed", "gauge", "axis", "1 while its controller knows its home.", INSTRUMENT_AXES,
     axis_homed},
    {"gonio_axis_alarm", "gauge", "axis", "1 while its controller reports an alarm.",
     INSTRUMENT_AXES, axis_alarm},
};

static void put_family(FILE *out, const struct family *f, const struct instrument_snapshot *s)
{
    head(out, f->name, f->type, f->help);
    for (int i = 0; i < f->parts; i++)
        if (is_there(s, i))
            put(out, f->name, f->value(s, i), f->label, s->part[i].name, NULL);
}

static void put_devices(FILE *out, const struct instrument_snapshot *s)
{
    head(out, "gonio_device_up", "gauge", "1 while the device answers.");
    for (int i = 0; i < PART_COUNT; i++)
        if (is_there(s, i))
            put(out, "gonio_device_up", s->part[i].link == PART_OK, "device", s->part[i].name,
                "driver", s->part[i].driver, "link", s->part[i].address, NULL);
    head(out, "gonio_axis_position", "gauge", "Where the axis is, in its unit.");
    for (int i = 0; i < INSTRUMENT_AXES; i++)
        if (is_there(s, i))
            put(out, "gonio_axis_position", s->axis[i].position, "axis", s->part[i].name, "unit",
                s->axis[i].unit, NULL);
    for (size_t i = 0; i < sizeof families / sizeof *families; i++)
        put_family(out, &families[i], s);
}

static void put_selectors(FILE *out, const struct instrument_snapshot *s)
{
    head(out, "gonio_selector_position", "gauge",
         "1, the position as its label; \"\" at none of its positions.");
    for (int i = 0; i < BENCH_DEVICES; i++)
        if (is_there(s, PART_DEVICES + i) && s->device[i].use != BENCH_INPUTS)
            put(out, "gonio_selector_position", 1, "device", s->part[PART_DEVICES + i].name,
                "position", s->device[i].position, NULL);
    head(out, "gonio_input_value", "gauge", "As of the last look; none while it is not known.");
    for (int i = 0; i < BENCH_DEVICES; i++)
        for (int k = 0; k < s->device[i].values; k++)
            put(out, "gonio_input_value", s->device[i].value[k].number, "device",
                s->part[PART_DEVICES + i].name, "value", s->device[i].value[k].name, "unit",
                s->device[i].value[k].unit, NULL);
}

static void put_light(FILE *out, const struct instrument_snapshot *s)
{
    gauge(out, "gonio_laser_emission", !instrument_is_dark(s),
          "0 only while a laser that can be reached was read back off.");
    gauge(out, "gonio_laser_off_unconfirmed", s->off_unconfirmed,
          "1 when it was told off and did not confirm it.");
    gauge(out, "gonio_laser_interlock_closed", s->laser.interlock_closed,
          "1 while its interlock is closed.");
    gauge(out, "gonio_laser_power_watts", s->laser.power_w, "As the laser measures it.");
    gauge(out, "gonio_detector_signal_volts", s->signal_v, "Of the last sample.");
    gauge(out, "gonio_detector_monitor_volts", s->monitor_v, "Of the last sample.");
}

// --- links ---------------------------------------------------------------------------------------

// The first part on a link stands for it; a part without one has none.
static bool leads_link(const struct instrument_snapshot *s, int part)
{
    if (!is_there(s, part) || !*s->part[part].address)
        return false;
    for (int i = 0; i < part; i++)
        if (strcmp(s->part[i].address, s->part[part].address) == 0)
            return false;
    return true;
}

static bool is_link_up(const struct instrument_snapshot *s, const char *address)
{
    for (int i = 0; i < PART_COUNT; i++)
        if (s->part[i].link == PART_OK && strcmp(s->part[i].address, address) == 0)
            return true;
    return false;
}

static void put_link_counters(FILE *out, const struct instrument_snapshot *s)
{
    static const struct {
        const char *name, *help;
        size_t offset;
    } counters[] = {
        {"gonio_link_requests_total", "Questions and commands sent.",
         offsetof(struct link_stats, requests)},
        {"gonio_link_sent_bytes_total", "Bytes sent.", offsetof(struct link_stats, bytes_out)},
        {"gonio_link_received_bytes_total", "Bytes received.",
         offsetof(struct link_stats, bytes_in)},
        {"gonio_link_retries_total", "Questions asked again.",
         offsetof(struct link_stats, retries)},
        {"gonio_link_resyncs_total", "Times the line had to fall silent first.",
         offsetof(struct link_stats, resyncs)},
        {"gonio_link_reconnects_total", "Times the link was opened again.",
         offsetof(struct link_stats, reopened)},
    };
    for (size_t c = 0; c < sizeof counters / sizeof *counters; c++) {
        head(out, counters[c].name, "counter", counters[c].help);
        for (int i = 0; i < PART_COUNT; i++) {
            const char *book = (const char *)&s->part[i].stats + counters[c].offset;
            if (leads_link(s, i))
                put(out, counters[c].name, (double)*(const uint64_t *)book, "link",
                    s->part[i].address, NULL);
        }
    }
}

static void put_link_errors(FILE *out, const struct instrument_snapshot *s)
{
    head(out, "gonio_link_errors_total", "counter", "Exchanges that failed, by what was seen.");
    for (int i = 0; i < PART_COUNT; i++)
        for (int kind = 0; kind < LINK_ERRORS && leads_link(s, i); kind++)
            put(out, "gonio_link_errors_total", (double)s->part[i].stats.errors[kind], "link",
                s->part[i].address, "kind", link_error_name((enum link_error)kind), NULL);
}

static void put_histogram(FILE *out, const char *link, const struct link_stats *stats)
{
    uint64_t sum = 0;
    for (int b = 0; b < LINK_BUCKETS; b++) {
        char bound[32];
        sum += stats->answers[b];
        snprintf(bound, sizeof bound, "%g", link_stats_bound_s(b));
        put(out, "gonio_link_latency_seconds_bucket", (double)sum, "link", link, "le",
            b == LINK_BUCKETS - 1 ? "+Inf" : bound, NULL);
    }
    put(out, "gonio_link_latency_seconds_sum", (double)stats->latency_sum_ns * 1e-9, "link", link,
        NULL);
    put(out, "gonio_link_latency_seconds_count", (double)sum, "link", link, NULL);
}

static void put_links(FILE *out, const struct instrument_snapshot *s)
{
    head(out, "gonio_link_up", "gauge", "1 while a device on it answers.");
    for (int i = 0; i < PART_COUNT; i++)
        if (leads_link(s, i))
            put(out, "gonio_link_up", is_link_up(s, s->part[i].address), "link", s->part[i].address,
                NULL);
    put_link_counters(out, s);
    put_link_errors(out, s);
    head(out, "gonio_link_latency_seconds", "histogram", "From a request sent to its answer.");
    for (int i = 0; i < PART_COUNT; i++)
        if (leads_link(s, i))
            put_histogram(out, s->part[i].address, &s->part[i].stats);
}

char *metrics_text(const struct metrics_source *m)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    put_daemon(out, m);
    put_run(out, m->run);
    if (m->snapshot) {
        put_devices(out, m->snapshot);
        put_selectors(out, m->snapshot);
        put_light(out, m->snapshot);
        put_links(out, m->snapshot);
    }
    return fclose(out) == 0 ? text : NULL;
}
