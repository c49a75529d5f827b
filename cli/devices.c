// SPDX-License-Identifier: MIT
// devices: what the daemon's bench is made of and what its links have seen.
#include "cli/out.h"
#include "cli/remote.h"
#include "cli/verb.h"

#include <jansson.h>
#include <string.h>

struct options {
    struct remote_options remote;
};

static const struct option_row rows[] = {
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));
    return text && *text ? text : "-";
}

// "12 s", "3 min", "5 h", "2 d".
static void age_text(double s, char *text, size_t size)
{
    static const struct {
        double most_s, unit_s;
        const char *name;
    } units[] = {{100, 1, "s"}, {6000, 60, "min"}, {172800, 3600, "h"}, {1e300, 86400, "d"}};
    int i = 0;
    while (s >= units[i].most_s)
        i++;
    snprintf(text, size, "%.0f %s ago", s / units[i].unit_s, units[i].name);
}

static void put_age(struct table *t, const json_t *d)
{
    const json_t *age = json_object_get(d, "last_error_age_s");
    char text[40] = "-";
    if (json_is_number(age))
        age_text(json_number_value(age), text, sizeof text);
    table_cell(t, "%s", text);
}

static void put_ms(struct table *t, const json_t *traffic, const char *key)
{
    const json_t *s = json_object_get(json_object_get(traffic, "latency_s"), key);
    if (json_is_number(s))
        table_cell(t, "%.3g", json_number_value(s) * 1e3);
    else
        table_cell(t, "-");
}

// "silent 2, garbled 1": the kinds that there were.
static void put_errors(struct table *t, json_t *traffic)
{
    char text[200] = "";
    const char *kind;
    json_t *count;
    json_object_foreach(json_object_get(traffic, "errors"), kind, count)
    {
        const size_t used = strlen(text);
        if (json_integer_value(count))
            snprintf(text + used, sizeof text - used, "%s%s %" JSON_INTEGER_FORMAT,
                     used ? ", " : "", kind, json_integer_value(count));
    }
    table_cell(t, "%s", *text ? text : "none");
}

static void put_device(struct table *t, const json_t *d)
{
    json_t *traffic = json_object_get(d, "traffic");
    table_cell(t, "%s", text_of(d, "name"));
    table_cell(t, "%s", text_of(d, "driver"));
    table_cell(t, "%s", strcmp(text_of(d, "state"), "ok") ? "LOST" : "ok");
    put_ms(t, traffic, "p50");
    put_ms(t, traffic, "p95");
    put_errors(t, traffic);
    table_cell(t, "%s", text_of(d, "identity"));
    table_cell(t, "%s", text_of(d, "link"));
    put_age(t, d);
    table_cell(t, "%s", text_of(d, "last_error"));
}

static void print_devices(const json_t *devices)
{
    static const char *const heading[] = {"device",         "driver",    "state",    "p50_ms",
                                          "p95_ms",         "errors",    "identity", "link",
                                          "last_error_age", "last_error"};
    enum { COLUMNS = sizeof heading / sizeof *heading };
    struct table *t = table_new(COLUMNS);
    const json_t *d;
    size_t i;
    for (i = 0; i < COLUMNS; i++)
        table_cell(t, "%s", heading[i]);
    table_right(t, 3);
    table_right(t, 4);
    json_array_foreach(devices, i, d) put_device(t, d);
    table_print(t, stdout);
    fflush(stdout);
    json_array_foreach(devices, i, d) if (strcmp(text_of(d, "state"), "ok"))
        out_say("%s is lost: %s; see: gonio doctor", text_of(d, "name"), text_of(d, "why"));
}

static int run_devices(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    json_t *reply = remote_call(&o.remote, "GET", "/api/v1/devices", NULL, &status);
    if (reply && o.remote.json)
        out_json(reply);
    else if (reply)
        print_devices(json_object_get(reply, "devices"));
    json_decref(reply);
    return status;
}

const struct verb verb_devices = {
    "devices",
    "",
    "each device: link, identity, latency, errors by kind",
    "Shows what the daemon's bench is made of: driver, whether it answers, how long half and 95 % "
    "of the answers took at most, failed exchanges by kind (silent, garbled, misfit, refused, "
    "echo, stray, hung-up), who it said it is, its link, and the last failed call with its age. "
    "Devices on one bus share its counters. With --json also the positions, the histogram's "
    "quantiles and all counters. What is wrong, and what to do: gonio doctor.\n",
    rows,
    run_devices};
