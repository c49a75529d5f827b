// SPDX-License-Identifier: MIT
// status, stop, pause, ack: one question to the daemon each.
#include "cli/remote.h"

#include "campaign/catalog.h"
#include "cli/client.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct options {
    struct remote_options remote;
    bool now; // of pause
    const char *reason; // or note
};

static const struct option_row rows[] = {
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

static const struct option_row pause_rows[] = {
    {"--now", OPTION_FLAG, offsetof(struct options, now), NULL, 0, 0,
     "at once: the reading in progress is given up"},
    {"--reason", OPTION_TEXT, offsetof(struct options, reason), "TEXT", 0, 0,
     "what for, for the others and the file"},
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

static const struct option_row ack_rows[] = {
    {"--note", OPTION_TEXT, offsetof(struct options, reason), "TEXT", 0, 0,
     "what there is to say about it, for the file"},
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

json_t *remote_call(const struct remote_options *o, const char *method, const char *path,
                    const json_t *body, int *ret_status)
{
    return remote_call_until(o, -1, method, path, body, ret_status);
}

json_t *remote_call_until(const struct remote_options *o, int interrupt_fd, const char *method,
                          const char *path, const json_t *body, int *ret_status)
{
    struct client *c = NULL;
    struct gon_error err;
    json_t *reply = NULL;
    int rc = client_new(o->socket, &c, &err);
    if (rc == 0) {
        client_interrupt_by(c, interrupt_fd);
        rc = client_request(c, method, path, body, &reply, &err);
    }
    client_free(c);
    if (rc < 0)
        *ret_status = out_fail(&err);
    return reply;
}

static bool same_folder(const char *path, const char *folder)
{
    char copy[CATALOG_PATH];
    snprintf(copy, sizeof copy, "%s", path);
    char *slash = strrchr(copy, '/');
    if (slash)
        slash[slash == copy] = 0;
    char *ours = realpath(slash ? copy : ".", NULL), *theirs = folder ? realpath(folder, NULL) : NULL;
    const bool same = ours && theirs && !strcmp(ours, theirs);
    free(ours);
    free(theirs);
    return same;
}

int remote_has(struct client *c, const char *path, struct gon_error *err)
{
    json_t *status = NULL;
    int rc = client_request(c, "GET", "/api/v1/status", NULL, &status, err);
    if (rc == GON_OK)
        rc = same_folder(path, json_string_value(json_object_get(status, "directory")));
    json_decref(status);
    return rc;
}

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));
    return text ? text : "";
}

static int whole(const json_t *o, const char *key)
{
    return (int)json_integer_value(json_object_get(o, key));
}

static void put_number(const json_t *o, const char *key, const char *fmt_before, int decimals,
                       const char *unit)
{
    const json_t *v = json_object_get(o, key);
    if (json_is_number(v))
        printf("%s%.*f %s", fmt_before, decimals, json_number_value(v), unit);
}

// --- status -------------------------------------------------------------------------------------

static void print_axis(const json_t *d)
{
    const char *unit = text_of(d, "unit");
    put_number(d, "position", "", 3, unit);
    if (json_is_true(json_object_get(d, "moving")))
        put_number(d, "target", ", moving to ", 3, unit);
    if (json_is_false(json_object_get(d, "homed")))
        printf(", not homed");
    if (json_is_true(json_object_get(d, "alarm")))
        printf(", ALARM %d", whole(d, "alarm_code"));
}

static void print_laser(const json_t *d)
{
    printf("%s, emission %s", text_of(d, "state"),
           json_is_true(json_object_get(d, "emission")) ? "ON" : "off");
    put_number(d, "power_w", ", ", 4, "W");
    printf(", interlock %s",
           json_is_true(json_object_get(d, "interlock_closed")) ? "closed" : "OPEN");
    if (json_is_true(json_object_get(d, "off_unconfirmed")))
        printf(", LASER MAY BE ON: use the key or the interlock");
}

static void print_detector(const json_t *d)
{
    static const char *const keys[] = {"full_scale_v", "signal_v", "time_constant_s"};
    static const char *const names[] = {"full scale", "last", "time constant"};
    const char *between = "";
    for (int i = 0; i < 3; i++) {
        const json_t *v = json_object_get(d, keys[i]);
        if (!json_is_number(v))
            continue;
        printf("%s%s %.4g %s", between, names[i], json_number_value(v),
               i < 2 ? text_of(d, "unit") : "s");
        between = ", ";
    }
}

static void print_monitor(const json_t *d)
{
    const json_t *full = json_object_get(d, "full_scale"), *last = json_object_get(d, "value");
    if (json_is_number(full))
        printf("full scale %.4g %s%s", json_number_value(full), text_of(d, "unit"),
               json_is_number(last) ? ", " : "");
    if (json_is_number(last))
        printf("last %.4g %s", json_number_value(last), text_of(d, "unit"));
}

static void print_selector(const json_t *d)
{
    const char *position = text_of(d, "position");
    printf("%s, measures at %s", *position ? position : "at none of its positions",
           text_of(d, "measures_at"));
}

static void print_inputs(const json_t *d)
{
    const json_t *v;
    size_t i;
    json_array_foreach(json_object_get(d, "values"), i, v)
    {
        const json_t *number = json_object_get(v, "value");
        const char *unit = text_of(v, "unit");
        printf("%s%s ", i ? ", " : "", text_of(v, "name"));
        if (json_is_number(number))
            printf("%.6g%s%s", json_number_value(number), *unit ? " " : "", unit);
        else
            printf("?");
    }
}

static void print_lost(const json_t *d)
{
    printf("%sLOST%s: %s", out_begin(stdout, OUT_RED), out_end(stdout), text_of(d, "problem"));
    if (json_is_true(json_object_get(d, "emission")))
        printf("; LASER MAY BE ON: use its key or the interlock");
    else if (json_is_true(json_object_get(d, "off_unconfirmed")))
        printf("; it did not confirm that it is off");
}

static void print_device(const json_t *d)
{
    const char *name = text_of(d, "name"), *link = text_of(d, "link");
    printf("%-9s ", name);
    if (!strcmp(link, "lost"))
        print_lost(d);
    else if (!strcmp(name, "laser"))
        print_laser(d);
    else if (!strcmp(name, "detector"))
        print_detector(d);
    else if (!strcmp(name, "monitor"))
        print_monitor(d);
    else if (json_object_get(d, "measures_at"))
        print_selector(d);
    else if (json_object_get(d, "values"))
        print_inputs(d);
    else
        print_axis(d);
    putchar('\n');
}

// Those that keep the run, or would keep one.
static void print_suspender(const json_t *s)
{
    const json_t *left = json_object_get(s, "left_s");
    if (!json_is_true(json_object_get(s, "keeps")))
        return;
    printf("suspended by \"%s\": %s", text_of(s, "name"), text_of(s, "text"));
    if (json_is_true(json_object_get(s, "holds")))
        printf("; must then be quiet for %.3g s", json_number_value(left));
    else if (json_number_value(left) > 0)
        printf("; quiet now, for %.0f s more", json_number_value(left));
    if (!strcmp(text_of(s, "resume"), "manual"))
        printf("; waits for gonio resume");
    putchar('\n');
}

static void print_run(const json_t *r)
{
    const char *text = text_of(r, "text");
    printf("run %d    %s (%s)%s%s\n", whole(r, "run"), text_of(r, "state"), text_of(r, "name"),
           *text ? ": " : "", text);
    if (*text_of(r, "asks"))
        printf("to do     %s; when that is done: gonio ack\n", text_of(r, "asks"));
    printf("progress  sweep %d of %d, %d of %d readings", whole(r, "sweep"), whole(r, "sweeps"),
           whole(r, "done"), whole(r, "total"));
    put_number(r, "left_s", ", ", 0, "s left");
    const json_t *f = json_object_get(r, "f_r_per_sr");
    if (json_is_number(f)) {
        put_number(r, "theta_i_deg", "\nreading   theta_i ", 2, "deg");
        put_number(r, "theta_r_deg", ", theta_r ", 2, "deg");
        printf(", f_r %.4g /sr", json_number_value(f));
    }
    printf("\nfile      %s\n", text_of(r, "file"));
}

static void print_status(const json_t *s)
{
    const json_t *run = json_object_get(s, "run"), *each;
    size_t i;
    printf("goniod %s, pid %d%s, campaigns in %s\n", text_of(s, "version"), whole(s, "pid"),
           json_is_true(json_object_get(s, "simulator")) ? ", simulated bench" : "",
           text_of(s, "directory"));
    if (json_is_object(run))
        print_run(run);
    else
        printf("idle      start a run: gonio run FILE.cfg\n");
    if (json_array_size(json_object_get(s, "queued")))
        printf("waiting   %zu more\n", json_array_size(json_object_get(s, "queued")));
    if (json_is_object(json_object_get(s, "control")))
        printf("control   %s\n", text_of(json_object_get(s, "control"), "name"));
    if (json_is_true(json_object_get(s, "queue_held")))
        printf("queue     held; look: gonio queue, go on: gonio queue release\n");
    json_array_foreach(json_object_get(s, "suspenders"), i, each) print_suspender(each);
    json_array_foreach(json_object_get(s, "devices"), i, each) print_device(each);
    if (*text_of(s, "last_error"))
        printf("last error: %s\n", text_of(s, "last_error"));
}

static int run_status(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    json_t *s = remote_call(&o.remote, "GET", "/api/v1/status", NULL, &status);
    if (s && o.remote.json)
        out_json(s);
    else if (s)
        print_status(s);
    json_decref(s);
    return status;
}

const struct verb verb_status = {
    "status",
    "",
    "what the daemon is doing: run, axes, laser, detector",
    "Shows the run that has the bench, what waits, each device, and the last error.\n",
    rows,
    run_status};

// --- stop, pause, resume -------------------------------------------------------------------------

static int command(const struct verb *verb, int argc, char **argv, const char *path,
                   json_t **ret_reply)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    *ret_reply = remote_call(&o.remote, "POST", path, NULL, &status);
    if (*ret_reply && o.remote.json)
        out_json(*ret_reply);
    return status;
}

static int run_stop(const struct verb *verb, int argc, char **argv)
{
    json_t *reply = NULL;
    int status = command(verb, argc, argv, "/api/v1/stop", &reply), run = whole(reply, "run");
    bool off = json_is_true(json_object_get(reply, "laser_off"));
    const json_t *other;
    size_t i;
    if (reply && run)
        fprintf(stderr, "run %d %s%s. Go on with: gonio resume %d\n", run, text_of(reply, "state"),
                off ? ": laser off, axes halted" : "", run);
    else if (reply)
        fprintf(stderr, "nothing was running%s\n",
                off ? "; laser off and axes halted all the same" : "");
    json_array_foreach(json_object_get(reply, "put_back"), i, other)
        fprintf(stderr, "run %d was waiting and waits no more. Start it with: gonio resume %d\n",
                (int)json_integer_value(other), (int)json_integer_value(other));
    if (reply && !off) {
        out_say("%s: use its key or the interlock; see: gonio status",
                strstr(text_of(reply, "text"), "LASER MAY BE ON")
                    ? "LASER MAY BE ON"
                    : "the laser does not confirm that it is off");
        status = EXIT_FAILED;
    }
    json_decref(reply);
    return status;
}

const struct verb verb_stop = {"stop",
                               "",
                               "laser off and axes halted, at once and without asking",
                               "Ends the run that has the bench and puts back those that wait. All "
                               "readings are kept; go on later\n"
                               "with gonio resume. Works in any state, and asks nothing.\n",
                               rows,
                               run_stop};

static int run_pause(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    json_t *body = json_pack("{s:b, s:s}", "now", o.now, "reason", o.reason ? o.reason : "");
    if (!body) {
        out_say("--reason is no UTF-8");
        return EXIT_INPUT;
    }
    json_t *reply = remote_call(&o.remote, "POST", "/api/v1/pause", body, &status);
    json_decref(body);
    if (reply && o.remote.json)
        out_json(reply);
    bool already = !strcmp(text_of(reply, "state"), "paused");
    if (reply)
        fprintf(stderr, "run %d %s. Go on with: gonio resume\n", whole(reply, "run"),
                already ? "stays paused"
                : o.now ? "pauses now, and gives the reading in progress up; the laser goes off"
                        : "pauses after the reading in progress; the laser goes off then");
    json_decref(reply);
    return status;
}

const struct verb verb_pause = {
    "pause",
    "",
    "hold the run, laser off, until gonio resume",
    "Holds the run that has the bench after the reading in progress: laser off, axes still. A run\n"
    "that waits for a device would go on by itself; paused, it waits for gonio resume. Name, user\n"
    "and reason stand in the campaign file.\n",
    pause_rows,
    run_pause};

// --- ack -----------------------------------------------------------------------------------------

static int run_ack(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    json_t *body = json_pack("{s:s}", "note", o.reason ? o.reason : "");
    if (!body) {
        out_say("--note is no UTF-8");
        return EXIT_INPUT;
    }
    json_t *reply = remote_call(&o.remote, "POST", "/api/v1/ack", body, &status);
    json_decref(body);
    if (reply && o.remote.json)
        out_json(reply);
    else if (reply)
        fprintf(stderr, "run %d goes on\n", whole(reply, "run"));
    json_decref(reply);
    return status;
}

const struct verb verb_ack = {
    "ack",
    "",
    "what the run waits for a person to do is done",
    "A plan may wait for a person (insert the mirror, change the sample): gonio status says for what,\n"
    "the laser is off meanwhile. This says that it is done; the run goes on, and the laser comes on.\n"
    "Name, user and note stand in the campaign file.\n",
    ack_rows,
    run_ack};
