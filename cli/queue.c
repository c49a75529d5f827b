// SPDX-License-Identifier: MIT
// queue: what waits for the bench, in its order, when it will be done, and how the order is changed.
#include "cli/out.h"
#include "cli/remote.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct options {
    struct remote_options remote;
};

static const struct option_row rows[] = {
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

static double number(const json_t *o, const char *key)
{
    const json_t *value = json_object_get(o, key);
    return json_is_number(value) ? json_number_value(value) : (double)NAN;
}

// "about 3 h 05 min", and when that is by this machine's clock.
static void ready_text(double ready_s, char *text, size_t size)
{
    char time_text[40], clock_text[40];
    if (!isfinite(ready_s)) {
        snprintf(text, size, "-");
        return;
    }
    const time_t then = time(NULL) + (time_t)ready_s;
    struct tm tm;
    out_duration(time_text, sizeof time_text, ready_s);
    strftime(clock_text, sizeof clock_text, "%a %H:%M", localtime_r(&then, &tm));
    snprintf(text, size, "%s, in %s", clock_text, time_text);
}

static void put_left(struct table *t, const json_t *e)
{
    char text[40] = "-";
    const double left_s = number(e, "left_s");
    if (isfinite(left_s))
        out_duration(text, sizeof text, left_s);
    table_cell(t, "%s", text);
}

static void print_queue(const json_t *q)
{
    static const char *const head[] = {"place", "run", "name", "sample", "state", "takes", "done"};
    struct table *t = table_new(7);
    size_t i;
    const json_t *e;
    char ready[100] = "";
    for (int k = 0; k < 7; k++)
        table_cell(t, "%s", head[k]);
    table_right(t, 0);
    table_right(t, 1);
    json_array_foreach(json_object_get(q, "entries"), i, e) {
        table_cell(t, "%lld", (long long)json_integer_value(json_object_get(e, "place")));
        table_cell(t, "%lld", (long long)json_integer_value(json_object_get(e, "run")));
        table_cell(t, "%s", json_string_value(json_object_get(e, "name")));
        table_cell(t, "%s", json_string_value(json_object_get(e, "sample")));
        table_cell(t, "%s%s", json_string_value(json_object_get(e, "state")),
                   json_is_true(json_object_get(e, "held")) ? ", held" : "");
        put_left(t, e);
        ready_text(number(e, "ready_s"), ready, sizeof ready);
        table_cell(t, "%s", ready);
    }
    table_print(t, stdout);
}

static int show(const struct options *o, json_t *q)
{
    if (o->remote.json)
        out_json(q);
    else if (!json_array_size(json_object_get(q, "entries")))
        out_say("the queue is empty; start a run: gonio run FILE.cfg");
    else
        print_queue(q);
    fflush(stdout);
    if (!o->remote.json && json_is_true(json_object_get(q, "held")))
        fprintf(stderr, "the queue is held: nothing more starts; go on: gonio queue release\n");
    json_decref(q);
    return EXIT_OK;
}

// A whole number above 0; 0 after saying what is wrong.
static int whole(const char *text, const char *what)
{
    char *end;
    const long value = strtol(text, &end, 10);
    if (!*end && end != text && value > 0 && value < 1000000000)
        return (int)value;
    out_say("%s '%s' is not a number; see: gonio queue", what, text);
    return 0;
}

static const struct action {
    const char *name;
    int least, most; // operands
} actions[] = {{"hold", 0, 1}, {"release", 0, 1}, {"remove", 1, 1}, {"move", 2, 2}};
enum { ACTIONS = sizeof actions / sizeof *actions };

static const struct action *find(const char *name)
{
    const char *names[ACTIONS + 1] = {0};
    for (int i = 0; i < ACTIONS; i++) {
        if (!strcmp(actions[i].name, name))
            return &actions[i];
        names[i] = actions[i].name;
    }
    const char *meant = options_suggest(name, names);
    out_say("queue '%s': did you mean '%s'? hold, release, remove, move", name,
            meant ? meant : "hold");
    return NULL;
}

// {"do", "run", "place"}, or NULL after saying what is wrong.
static json_t *request(int count, const char **operands)
{
    const struct action *a = find(operands[0]);
    if (!a)
        return NULL;
    if (count - 1 < a->least || count - 1 > a->most) {
        out_say("queue %s takes %s; see: gonio help queue", a->name,
                a->most == 2   ? "a RUN and a PLACE"
                : a->least == 1 ? "a RUN"
                                : "one RUN or none");
        return NULL;
    }
    json_t *body = json_pack("{s:s}", "do", a->name);
    static const char *const keys[] = {"run", "place"};
    for (int i = 1; i < count; i++) {
        const int value = whole(operands[i], keys[i - 1]);
        if (!value) {
            json_decref(body);
            return NULL;
        }
        json_object_set_new(body, keys[i - 1], json_integer(value));
    }
    return body;
}

static int run_queue(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *operands[3];
    int status = EXIT_OK;
    const int count = verb_take(verb, argc, argv, &o, operands, 0, 3);
    if (count < 0)
        return EXIT_INPUT;
    json_t *body = count ? request(count, operands) : NULL;
    if (count && !body)
        return EXIT_INPUT;
    json_t *q = remote_call(&o.remote, count ? "POST" : "GET", "/api/v1/queue", body, &status);
    json_decref(body);
    return q ? show(&o, q) : status;
}

const struct verb verb_queue = {
    "queue",
    "[hold [RUN] | release [RUN] | remove RUN | move RUN PLACE]",
    "what waits for the bench, and its order",
    "Shows the queue in its order, place 0 being the run that has the bench, with what each will "
    "take and when it will be done.\n"
    "hold lets a run wait while the others pass it, without RUN the whole queue; release takes that "
    "back. remove takes a run that waits out of the queue, its file stays; gonio resume RUN brings "
    "it back. move gives it another place, 1 being the next. A new run is put last by gonio run "
    "--detach.\n"
    "The queue outlives goniod. After a restart it is held, the interrupted run first in it.\n",
    rows,
    run_queue};
