// SPDX-License-Identifier: MIT
// run, watch, resume, remeasure: a campaign given to the daemon, and its progress until it ends.
#include "campaign/catalog.h"
#include "campaign/config.h"
#include "cli/check.h"
#include "cli/client.h"
#include "cli/follow.h"
#include "cli/interrupt.h"
#include "cli/out.h"
#include "cli/remote.h"
#include "cli/verb.h"

#include <jansson.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

struct options {
    struct remote_options remote;
    bool detach;
};

static const struct option_row run_rows[] = {
    {"--detach", OPTION_FLAG, offsetof(struct options, detach), NULL, 0, 0,
     "start it and do not follow"},
    REMOTE_SOCKET(struct options),
    {"--json", OPTION_FLAG, offsetof(struct options, remote.json), NULL, 0, 0,
     "one JSON object a line"},
    VERB_OPTIONS_END,
};

static const struct option_row watch_rows[] = {
    REMOTE_SOCKET(struct options),
    {"--json", OPTION_FLAG, offsetof(struct options, remote.json), NULL, 0, 0,
     "one JSON object a line"},
    VERB_OPTIONS_END,
};

static int number_of(const json_t *run)
{
    return (int)json_integer_value(json_object_get(run, "run"));
}

// Follows with its own connections, from the event that the reply names.
static int follow(const struct remote_options *o, const struct interrupt *i, const json_t *run,
                  const json_t *event_id)
{
    char id[32];
    const char *file = json_string_value(json_object_get(run, "file"));
    snprintf(id, sizeof id, "%" JSON_INTEGER_FORMAT, json_integer_value(event_id));
    const struct follow_run what = {number_of(run), file ? file : "", id, o->json};
    return follow_run(o->socket, i, &what);
}

// What is said of a run that the daemon took: while it is followed, detached, and after a Ctrl-C
// that came before the following.
struct wording {
    const char *begun, *goes_on;
};

// Says that a run is under way and follows it unless that is not wanted. Takes the reply.
static int begun(const struct options *o, const struct interrupt *i, json_t *reply,
                 const struct wording *w)
{
    const int run = number_of(reply);
    int status = EXIT_OK;
    if (o->remote.json && o->detach)
        out_json_line(reply);
    if (interrupt_came(i, 0)) {
        out_say("run %d %s. Stop it: gonio stop. Watch it: gonio watch", run, w->goes_on);
        status = EXIT_INTERRUPTED;
    } else {
        if (!o->remote.json)
            fprintf(stderr, "run %d %s%s\n", run, w->begun,
                    o->detach ? ". Watch it: gonio watch" : "");
        if (json_is_true(json_object_get(reply, "queue_held")))
            out_say("the queue is held: run %d waits; look: gonio queue, go on: gonio queue release",
                    run);
        if (!o->detach)
            status = follow(&o->remote, i, reply, json_object_get(reply, "event_id"));
    }
    json_decref(reply);
    return status;
}

// A Ctrl-C from here on does not leave a run behind without a word. Takes the body.
static int submit(const struct options *o, const char *path, json_t *body, const struct wording *w)
{
    struct interrupt i;
    int status = EXIT_FAILED;
    interrupt_open(&i);
    json_t *reply = remote_call_until(&o->remote, i.fd, "POST", path, body, &status);
    if (reply)
        status = begun(o, &i, reply, w);
    interrupt_close(&i);
    json_decref(body);
    return status;
}

static int run_run(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *file;
    char *text = NULL;
    if (verb_take(verb, argc, argv, &o, &file, 1, 1) < 0)
        return EXIT_INPUT;
    struct campaign_config config;
    int status = check_campaign(file, &config, &text);
    json_t *body = status ? NULL : json_pack("{s:s, s:s}", "config", text, "name", file);
    free(text);
    if (!body)
        return status ? status : EXIT_FAILED;
    return submit(&o, "/api/v1/runs", body,
                  &(struct wording){"started", "was started and goes on"});
}

const struct verb verb_run = {
    "run",
    "FILE.cfg",
    "measure a campaign and follow it to its end",
    "Gives the campaign to the daemon, shows its progress, and at the end the fitted parameters. "
    "Ctrl-C\n"
    "stops watching only; the run goes on until gonio stop. Look first with: gonio plan FILE.cfg\n",
    run_rows,
    run_run};

static int run_watch(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    struct interrupt i;
    interrupt_open(&i);
    json_t *s = remote_call_until(&o.remote, i.fd, "GET", "/api/v1/status", NULL, &status);
    json_t *run = json_object_get(s, "run");
    if (json_is_object(run)) {
        if (!o.remote.json)
            fprintf(stderr, "run %d %s\n", number_of(run),
                    json_string_value(json_object_get(run, "state")));
        status = follow(&o.remote, &i, run, json_object_get(s, "event_id"));
    } else if (s) {
        out_say("no run is active; start one: gonio run FILE.cfg, or see: gonio list");
    }
    interrupt_close(&i);
    json_decref(s);
    return status;
}

const struct verb verb_watch = {
    "watch", "", "follow the run that has the bench",
    "Shows the progress of the active run until its end. Ctrl-C stops watching; the run goes on.\n",
    watch_rows, run_watch};

// --- resume --------------------------------------------------------------------------------------

// The run's number when the text is one, else the file's path as the daemon will need it.
static json_t *what_to_resume(const char *text)
{
    char *end, path[4096];
    long id = strtol(text, &end, 10);
    if (!*end && end != text)
        return json_pack("{s:I}", "resume", (json_int_t)id);
    return json_pack("{s:s}", "resume", realpath(text, path) ? path : text);
}

static int run_resume(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *operand;
    int count = verb_take(verb, argc, argv, &o, &operand, 0, 1);
    if (count < 0)
        return EXIT_INPUT;
    return submit(&o, count ? "/api/v1/runs" : "/api/v1/resume",
                  count ? what_to_resume(operand) : NULL,
                  &(struct wording){"goes on", "goes on"});
}

const struct verb verb_resume = {"resume",
                                 "[RUN]",
                                 "go on with a paused run, or with RUN where it was stopped",
                                 "Without RUN, goes on with the run that is paused. RUN is a "
                                 "number that gonio list shows, or a campaign\n"
                                 "file: it is queued again and goes on with its first point that "
                                 "has no accepted reading. A file that is\n"
                                 "damaged or that another process writes is refused. Follows it as "
                                 "gonio run does.\n",
                                 run_rows,
                                 run_resume};

// --- remeasure -----------------------------------------------------------------------------------

struct remeasure_options {
    struct options run;
    const char *dir, *reason;
};

static const struct option_row remeasure_rows[] = {
    {"--reason", OPTION_TEXT, offsetof(struct remeasure_options, reason), "TEXT", 0, 0,
     "why; it is kept with the readings"},
    {"--detach", OPTION_FLAG, offsetof(struct remeasure_options, run.detach), NULL, 0, 0,
     "start it and return"},
    {"--dir", OPTION_TEXT, offsetof(struct remeasure_options, dir), "DIR", 0, 0,
     "the folder of campaigns ($GONIO_DIR)"},
    {"--socket", OPTION_TEXT, offsetof(struct remeasure_options, run.remote.socket), "PATH", 0, 0,
     "the daemon's socket"},
    {"--json", OPTION_FLAG, offsetof(struct remeasure_options, run.remote.json), NULL, 0, 0,
     "print JSON"},
    VERB_OPTIONS_END,
};

// Another folder's file has a number that stands for another campaign here.
static int check_place(const struct remeasure_options *o, const char *path, struct gon_error *err)
{
    struct client *c = NULL;
    int rc = client_new(o->run.remote.socket, &c, err);
    rc = rc < 0 ? rc : remote_has(c, path, err);
    client_free(c);
    if (rc == 0 || (rc > 0 && !catalog_id(path)))
        rc = gon_fail(err, GON_E_INPUT,
                      "%s: no campaign of the daemon's folder; only these can be measured again",
                      path);
    return rc < 0 ? rc : catalog_id(path);
}

// The number of a campaign, or of its file or name.
static int run_of(const struct remeasure_options *o, const char *text, struct gon_error *err)
{
    char directory[CATALOG_PATH], path[CATALOG_PATH], *end;
    const long number = strtol(text, &end, 10);
    if (!*end && end != text && number > 0 && number <= INT_MAX)
        return (int)number;
    int rc = catalog_directory(o->dir, directory, sizeof directory, err);
    rc = rc < 0 ? rc : catalog_resolve(directory, text, path, sizeof path, err);
    return rc < 0 ? rc : check_place(o, path, err);
}

static int run_remeasure(const struct verb *verb, int argc, char **argv)
{
    struct remeasure_options o = {0};
    const char *operands[2];
    char path[60], *end;
    if (verb_take(verb, argc, argv, &o, operands, 2, 2) < 0)
        return EXIT_INPUT;
    const long sweep = strtol(operands[1], &end, 10);
    if (*end || end == operands[1] || sweep < 1 || sweep > 1000) {
        out_say("remeasure: '%s' is no sweep; see: gonio show %s", operands[1], operands[0]);
        return EXIT_INPUT;
    }
    if (!o.reason || !o.reason[strspn(o.reason, " ")]) {
        out_say("without a reason nobody will know later why; say it with --reason TEXT");
        return EXIT_INPUT;
    }
    struct gon_error err;
    const int run = run_of(&o, operands[0], &err);
    if (run < 0)
        return out_fail(&err);
    json_t *body = json_pack("{s:s, s:i, s:s}", "do", "remeasure", "sweep", (int)sweep, "reason",
                             o.reason); // NULL: not UTF-8
    if (!body) {
        out_say("the reason must be text (UTF-8)");
        return EXIT_INPUT;
    }
    snprintf(path, sizeof path, "/api/v1/runs/%d/exclusions", run);
    return submit(&o.run, path, body, &(struct wording){"is measured again", "goes on"});
}

const struct verb verb_remeasure = {
    "remeasure",
    "RUN SWEEP",
    "measure a sweep of a campaign again, with the reason",
    "What was measured of the sweep stays in the file, with the reason, and does not count any more; "
    "every point of it gets a new attempt. Beam and dark are measured again with it, before and "
    "after, beside the earlier ones, which the other sweeps need.\n"
    "RUN is a number that gonio list shows, or a campaign file. It is queued as by gonio resume, also "
    "when it was done; when it is being measured it goes on to its end first. Before it is measured, "
    "gonio restore takes it back. Follows it as gonio run does.\n",
    remeasure_rows,
    run_remeasure};
