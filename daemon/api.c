// SPDX-License-Identifier: MIT
#include "daemon/api.h"

#include "daemon/decision.h"
#include "daemon/hub.h"
#include "daemon/inventory.h"
#include "daemon/metrics.h"
#include "daemon/view.h"

#include <jansson.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST_REASON = 160 };

struct call {
    struct hub *hub;
    const struct http_request *request;
    uint64_t ticket;
    const char *rest; // of the path after the resource's name
};

int api_status(int gon_code)
{
    switch (gon_code) {
    case GON_E_INPUT: return 400;
    case GON_E_REFUSED: return 409;
    case GON_E_GONE: return 404;
    default: return 500;
    }
}

static const char *what_to_do(int gon_code)
{
    switch (gon_code) {
    case GON_E_INPUT: return "mend it and try again";
    case GON_E_STORE: return "look at the disk of the campaign directory";
    default: return "see: gonio status";
    }
}

static struct http_reply reply(int status, char *body)
{
    return (struct http_reply){.status = status, .body = body};
}

static struct http_reply fail(int status, const char *error, const char *where, const char *next)
{
    return reply(status, http_error(error, where, next));
}

// "bad.cfg:4" of "bad.cfg:4: campaign...": cut off when there is one.
static char *cut_where(char **text)
{
    char *colon = strchr(*text, ':');
    size_t digits = colon ? strspn(colon + 1, "0123456789") : 0;
    if (!digits || strncmp(colon + 1 + digits, ": ", 2))
        return NULL;
    char *where = *text;
    colon[1 + digits] = 0;
    *text = colon + 1 + digits + 2;
    return where;
}

// Our sentences are "what; what to do".
char *api_error(int gon_code, const char *text)
{
    char copy[2000], *what = copy;
    snprintf(copy, sizeof copy, "%s", text);
    char *where = cut_where(&what), *next = strrchr(what, ';');
    if (next && next[1] == ' ' && !strchr(what, '\n'))
        *next = 0;
    else
        next = NULL;
    return http_error(what, where, next ? next + 2 : what_to_do(gon_code));
}

char *api_complaints(const char *text)
{
    char *copy = strdup(text), *what = copy, *where = copy ? cut_where(&what) : NULL;
    char *body = http_error(copy ? what : "out of memory", where, what_to_do(GON_E_INPUT));
    free(copy);
    return body;
}

char *api_no_run(int run)
{
    char path[40];
    snprintf(path, sizeof path, "/api/v1/runs/%d", run);
    return http_error("there is no such run", path, "see: gonio list");
}

static struct http_reply failed(const struct gon_error *err)
{
    return reply(api_status(err->code), api_error(err->code, err->text));
}

// --- reading ------------------------------------------------------------------------------------

static struct http_reply get_status(const struct call *c)
{
    struct hub_status s;
    hub_status(c->hub, &s);
    const struct queue *q = hub_queue(c->hub);
    const struct run *active = queue_active(q), *run;
    json_t *queued = json_array();
    for (size_t i = 0; (run = queue_at(q, i)); i++)
        if (run != active && run->state == RUN_QUEUED)
            json_array_append_new(queued, json_integer(run->id));
    json_t *o =
        json_pack("{s:s, s:i, s:b, s:I, s:f, s:s, s:I, s:s, s:o}", "version", GONIO_VERSION, "pid",
                  (int)getpid(), "simulator", s.simulator, "seed", (json_int_t)s.seed, "uptime_s",
                  s.uptime_s, "directory", s.directory, "event_id", (json_int_t)s.event_id,
                  "last_error", s.last_error, "queued", queued);
    json_object_set_new(o, "state", json_string(active ? run_state_name(active->state) : "idle"));
    json_object_set_new(o, "control", view_control(hub_control(c->hub)));
    json_object_set_new(o, "queue_held", json_boolean(queue_is_held(q)));
    json_object_set_new(o, "run", active ? view_run(active, true) : json_null());
    json_object_set_new(o, "suspenders", s.snapshot ? view_suspenders(s.snapshot) : json_array());
    json_object_set_new(o, "devices", s.snapshot ? view_devices(s.snapshot) : json_array());
    return reply(200, view_text(o));
}

static struct http_reply get_devices(const struct call *c)
{
    struct hub_status s;
    hub_status(c->hub, &s);
    return reply(200, view_text(json_pack("{s:i, s:o}", "pid", (int)getpid(), "devices",
                                          inventory_view(s.snapshot))));
}

static struct http_reply get_metrics(const struct call *c)
{
    struct hub_status s;
    hub_status(c->hub, &s);
    const struct metrics_source m = {
        .uptime_s = s.uptime_s,
        .snapshot_age_s = s.snapshot_age_s,
        .simulator = s.simulator,
        .readings = s.readings,
        .run = queue_active(hub_queue(c->hub)),
        .snapshot = s.snapshot,
    };
    char *text = metrics_text(&m);
    if (!text)
        return fail(500, "out of memory", NULL, "try again");
    return (struct http_reply){.status = 200, .body = text, .type = METRICS_TYPE};
}

static struct http_reply get_runs(const struct call *c)
{
    const struct run *run;
    json_t *all = json_array();
    for (size_t i = 0; (run = queue_at(hub_queue(c->hub), i)); i++)
        json_array_append_new(all, view_run(run, false));
    return reply(200, view_text(json_pack("{s:o}", "runs", all)));
}

// A run has one address: its number without a sign, leading zeros or anything around it. 0: none.
static int run_number(const char *text)
{
    const size_t digits = strspn(text, "0123456789");
    const long id = digits && digits < 11 && *text != '0' && !text[digits] ? atol(text) : 0;
    return id <= INT_MAX ? (int)id : 0;
}

static struct http_reply get_run(const struct call *c)
{
    const int id = run_number(c->rest);
    const struct run *run = queue_run(hub_queue(c->hub), id);
    if (run)
        return reply(200, view_text(view_run(run, true)));
    if (id == 0)
        return fail(404, "there is no such run", c->request->path, "see: gonio list");
    hub_find(c->hub, id, c->ticket);
    return reply(HTTP_LATER, NULL);
}

static struct http_reply get_events(const struct call *c)
{
    (void)c;
    return reply(HTTP_STREAM, NULL);
}

// --- commands -----------------------------------------------------------------------------------

// By the name they give, or their account.
static const char *caller(const struct call *c, char text[40])
{
    snprintf(text, 40, "uid %ld", c->request->uid);
    return *c->request->name ? c->request->name : text;
}

static struct http_reply resume_run(const struct call *c, const json_t *what)
{
    struct gon_error err;
    char text[40];
    const char *by = caller(c, text);
    if (json_is_string(what)) {
        hub_submit_path(c->hub, json_string_value(what), by, c->ticket);
        return reply(HTTP_LATER, NULL);
    }
    json_int_t id = json_integer_value(what);
    if (!json_is_integer(what) || id < 1 || id > INT_MAX)
        return fail(400, "\"resume\" is neither a run's number nor a path", NULL,
                    "see: gonio list");
    uint64_t event_id = hub_event_id(c->hub);
    int rc = hub_submit(c->hub, (int)id, by, c->ticket, &err);
    if (rc < 0)
        return failed(&err);
    if (rc)
        hub_answer_kept(c->hub, c->ticket, 201, hub_submitted(c->hub, (int)id, event_id));
    return reply(HTTP_LATER, NULL);
}

static struct http_reply create_run(const struct call *c, json_t *body)
{
    json_error_t e;
    const char *config, *name = "campaign.cfg";
    if (json_unpack_ex(body, &e, JSON_STRICT, "{s:s, s?s}", "config", &config, "name", &name) < 0)
        return fail(400, e.text, "the request's body",
                    "send {\"config\": text, \"name\": path} or {\"resume\": run}");
    char text[40];
    hub_create(c->hub, config, name, caller(c, text), c->ticket);
    return reply(HTTP_LATER, NULL);
}

static struct http_reply post_runs(const struct call *c)
{
    json_error_t e;
    char where[80];
    struct gon_error err;
    if (!queue_is_held(hub_queue(c->hub)) && arming_may_start(hub_arming(c->hub), &err) < 0)
        return failed(&err);
    json_t *body = json_loadb(c->request->body, c->request->size, JSON_REJECT_DUPLICATES, &e);
    if (!body) {
        snprintf(where, sizeof where, "the request's body, line %d column %d", e.line, e.column);
        return fail(400, e.text, where, "send one JSON object");
    }
    const json_t *what = json_object_get(body, "resume");
    struct http_reply r =
        what && json_object_size(body) == 1 ? resume_run(c, what) : create_run(c, body);
    json_decref(body);
    return r;
}

static struct http_reply post_stop(const struct call *c)
{
    char why[100];
    snprintf(why, sizeof why, "stopped by uid %ld, pid %ld", c->request->uid, c->request->pid);
    if (!hub_stop(c->hub, why, c->ticket))
        return fail(503, "a stop is under way, and 32 others wait for its end already", NULL,
                    "see: gonio status");
    return reply(HTTP_LATER, NULL);
}

static struct http_reply told(const struct call *c, int run, const struct gon_error *err)
{
    if (run < 0)
        return failed(err);
    return reply(202, hub_submitted(c->hub, run, hub_event_id(c->hub)));
}

// " anna (uid 1000): lunch": behind "by the operator".
static void say_who(const struct call *c, const char *reason, char *text, size_t size)
{
    snprintf(text, size, "%s%s (uid %ld)%s%s", *c->request->name ? " " : "", c->request->name,
             c->request->uid, *reason ? ": " : "", reason);
}

// One line, which is shown and kept: no control characters.
static bool is_line(const char *text, size_t most)
{
    for (const char *p = text; *p; p++)
        if ((unsigned char)*p < ' ' || *p == 0x7f)
            return false;
    return strlen(text) <= most;
}

// An object; none is an empty one.
static json_t *body_of(const struct call *c, json_error_t *e)
{
    return c->request->size
               ? json_loadb(c->request->body, c->request->size, JSON_REJECT_DUPLICATES, e)
               : json_object();
}

static struct http_reply post_pause(const struct call *c)
{
    json_error_t e;
    struct gon_error err;
    char by[300];
    const char *reason = "";
    int now = 0;
    json_t *body = body_of(c, &e);
    const bool right = body && json_unpack_ex(body, &e, JSON_STRICT, "{s?b, s?s}", "now", &now,
                                              "reason", &reason) == 0;
    if (!right || !is_line(reason, MOST_REASON)) {
        struct http_reply r =
            fail(400, right ? "the reason is no short line" : e.text, "the request's body",
                 "send {\"now\": true|false, \"reason\": one line of at most 160 bytes}");
        json_decref(body);
        return r;
    }
    say_who(c, reason, by, sizeof by);
    const int run = hub_pause(c->hub, by, now, &err);
    json_decref(body);
    return told(c, run, &err);
}

static struct http_reply post_ack(const struct call *c)
{
    json_error_t e;
    struct gon_error err;
    char by[300];
    const char *note = "";
    char text[40];
    json_t *body = body_of(c, &e);
    const bool right = body && json_unpack_ex(body, &e, JSON_STRICT, "{s?s}", "note", &note) == 0;
    if (!right || !is_line(note, MOST_REASON)) {
        struct http_reply r =
            fail(400, right ? "the note is no short line" : e.text, "the request's body",
                 "send {\"note\": one line of at most 160 bytes}");
        json_decref(body);
        return r;
    }
    say_who(c, note, by, sizeof by);
    const int run = hub_ack(c->hub, by, caller(c, text), &err);
    json_decref(body);
    return told(c, run, &err);
}

static struct http_reply post_resume(const struct call *c)
{
    struct gon_error err;
    char text[40];
    int run = arming_may_start(hub_arming(c->hub), &err);
    run = run < 0 ? run : hub_resume(c->hub, caller(c, text), &err);
    return told(c, run, &err);
}

// --- readings -----------------------------------------------------------------------------------

static struct http_reply post_exclusions(const struct call *c)
{
    struct gon_error err;
    struct decision *d = NULL;
    char number[12], uid[40];
    const size_t digits = strcspn(c->rest, "/");
    snprintf(number, sizeof number, "%.*s", (int)digits, c->rest);
    snprintf(uid, sizeof uid, "uid %ld", c->request->uid);
    const bool whole = digits < sizeof number && !strcmp(c->rest + digits, "/exclusions");
    const int run = whole ? run_number(number) : 0;
    if (run == 0)
        return fail(404, "there is no such run", c->request->path, "see: gonio list");
    if (decision_parse(c->request->body, c->request->size,
                       *c->request->name ? c->request->name : uid, &d, &err) < 0)
        return failed(&err);
    char text[40];
    hub_decide(c->hub, run, d, caller(c, text), c->ticket);
    return reply(HTTP_LATER, NULL);
}

// --- who commands -------------------------------------------------------------------------------

static struct http_reply get_control(const struct call *c)
{
    return reply(200, view_text(json_pack("{s:o}", "control", view_control(hub_control(c->hub)))));
}

static int change_control(const struct call *c, const char *what, const char *reason,
                          const char *from, struct gon_error *err)
{
    if (!strcmp(what, "take"))
        return hub_control_take(c->hub, c->request->name, reason, from, err);
    if (!strcmp(what, "release"))
        return hub_control_release(c->hub, c->request->name, err);
    return gon_fail(err, GON_E_INPUT, "\"do\": \"%.40s\"; use take or release", what);
}

static struct http_reply post_control(const struct call *c)
{
    json_error_t e;
    struct gon_error err;
    const char *what, *reason = NULL, *from = NULL;
    json_t *body = json_loadb(c->request->body, c->request->size, JSON_REJECT_DUPLICATES, &e);
    if (!body || json_unpack_ex(body, &e, JSON_STRICT, "{s:s, s?s, s?s}", "do", &what, "reason",
                                &reason, "from", &from) < 0) {
        json_decref(body);
        return fail(400, e.text, "the request's body",
                    "send {\"do\": \"take\"|\"release\", \"reason\": text, \"from\": name}");
    }
    const int rc = change_control(c, what, reason, from, &err);
    json_decref(body);
    return rc < 0 ? failed(&err) : get_control(c);
}

// --- the arm ------------------------------------------------------------------------------------

static struct http_reply get_laser(const struct call *c)
{
    struct hub_status s;
    hub_status(c->hub, &s);
    return reply(200, view_text(view_laser(hub_arming(c->hub), s.snapshot)));
}

static int align(const struct call *c, double power_w, double for_s, struct gon_error *err)
{
    const struct run *active = queue_active(hub_queue(c->hub));
    if (active)
        return gon_fail(err, GON_E_REFUSED, "run %d has the bench; end it: gonio stop", active->id);
    if (!*c->request->name)
        return gon_fail(err, GON_E_INPUT, "alignment needs a name; set GONIO_NAME");
    arming_align(hub_arming(c->hub), c->request->name, power_w, for_s, c->ticket);
    return GON_OK;
}

static int change_arm(const struct call *c, const char *what, const char *reason, double for_s,
                      double power_w, struct gon_error *err)
{
    char text[40], why[120];
    if (!strcmp(what, "align"))
        return align(c, power_w, for_s, err);
    if (!strcmp(what, "arm") && for_s >= 0)
        arming_arm(hub_arming(c->hub), c->request->name, reason, for_s, c->ticket);
    else if (!strcmp(what, "disarm")) {
        snprintf(why, sizeof why, "disarmed by %s", caller(c, text));
        arming_disarm(hub_arming(c->hub), why, c->ticket);
    } else
        return gon_fail(err, GON_E_INPUT, "\"do\": \"%.40s\", for %g s; use arm, disarm or align", what,
                        for_s);
    return GON_OK;
}

// Whoever disarms makes things safer: that is everybody's.
static struct http_reply post_laser(const struct call *c)
{
    json_error_t e;
    struct gon_error err;
    const char *what, *reason = NULL;
    double for_s = 0, power_w = 0;
    json_t *body = json_loadb(c->request->body, c->request->size, JSON_REJECT_DUPLICATES, &e);
    if (!body || json_unpack_ex(body, &e, JSON_STRICT, "{s:s, s?s, s?F, s?F}", "do", &what,
                                "reason", &reason, "for_s", &for_s, "power_w", &power_w) < 0) {
        json_decref(body);
        return fail(400, e.text, "the request's body",
                    "send {\"do\": \"arm\"|\"disarm\"|\"align\", \"reason\": text, \"for_s\": seconds, "
                    "\"power_w\": watts}");
    }
    int rc = strcmp(what, "disarm")
                 ? control_check(hub_control(c->hub), c->request->name, &err)
                 : GON_OK;
    rc = rc < 0 ? rc : change_arm(c, what, reason, for_s, power_w, &err);
    json_decref(body);
    return rc < 0 ? failed(&err) : reply(HTTP_LATER, NULL);
}

// --- the queue ----------------------------------------------------------------------------------

static struct http_reply get_queue(const struct call *c)
{
    return reply(200, view_text(view_queue(hub_queue(c->hub))));
}

static int arrange(const struct call *c, const char *what, int run, int place,
                   struct gon_error *err)
{
    char by[40], who[40];
    snprintf(by, sizeof by, "uid %ld", c->request->uid);
    if (!strcmp(what, "release") && arming_may_start(hub_arming(c->hub), err) < 0)
        return GON_E_REFUSED;
    if (!strcmp(what, "hold") || !strcmp(what, "release"))
        return hub_queue_hold(c->hub, run, *what == 'h', caller(c, who), err);
    if (!strcmp(what, "remove"))
        return hub_queue_remove(c->hub, run, by, err);
    if (!strcmp(what, "move"))
        return hub_queue_move(c->hub, run, place, err);
    return gon_fail(err, GON_E_INPUT, "\"do\": \"%.40s\"; use hold, release, remove or move", what);
}

// JSON's numbers are wider than an int. One that does not fit is no run's and no place, and must
// not become another by being cut; 0 is not given, which names the whole queue.
static int whole(const char *name, json_int_t given, int *ret, struct gon_error *err)
{
    if (given < 1 || given > INT_MAX)
        return gon_fail(err, GON_E_INPUT, "\"%s\": %" JSON_INTEGER_FORMAT " is none; from 1", name,
                        given);
    *ret = (int)given;
    return GON_OK;
}

static int arrange_body(const struct call *c, const json_t *body, const char *what, json_int_t run,
                        json_int_t place, struct gon_error *err)
{
    int its_run = 0, its_place = 0;
    int rc = json_object_get(body, "run") ? whole("run", run, &its_run, err) : GON_OK;
    if (rc == GON_OK && json_object_get(body, "place"))
        rc = whole("place", place, &its_place, err);
    return rc < 0 ? rc : arrange(c, what, its_run, its_place, err);
}

static struct http_reply post_queue(const struct call *c)
{
    json_error_t e;
    struct gon_error err;
    const char *what;
    json_int_t run = 0, place = 0;
    json_t *body = json_loadb(c->request->body, c->request->size, JSON_REJECT_DUPLICATES, &e);
    if (!body || json_unpack_ex(body, &e, JSON_STRICT, "{s:s, s?I, s?I}", "do", &what, "run", &run,
                                "place", &place) < 0) {
        json_decref(body);
        return fail(400, e.text, "the request's body",
                    "send {\"do\": \"hold\"|\"release\"|\"remove\"|\"move\", \"run\": number, "
                    "\"place\": number}");
    }
    const int rc = arrange_body(c, body, what, run, place, &err);
    json_decref(body);
    if (rc < 0)
        return failed(&err);
    hub_answer_kept(c->hub, c->ticket, 200, view_text(view_queue(hub_queue(c->hub))));
    return reply(HTTP_LATER, NULL);
}

// --- routes -------------------------------------------------------------------------------------

static const struct route {
    const char *method, *path; // a path that ends with '/' has a rest
    struct http_reply (*handle)(const struct call *c);
    const char *allow; // all methods of that path
    bool controlled;   // only for who has control, while somebody has
    const char *end;   // of the path, after its rest; NULL: any
} routes[] = {
    {"GET", "/api/v1/status", get_status, "GET", false, NULL},
    {"GET", "/api/v1/devices", get_devices, "GET", false, NULL},
    {"GET", "/metrics", get_metrics, "GET", false, NULL},
    {"GET", "/api/v1/runs", get_runs, "GET, POST", false, NULL},
    {"POST", "/api/v1/runs", post_runs, "GET, POST", true, NULL},
    {"GET", "/api/v1/runs/", get_run, "GET", false, NULL},
    {"POST", "/api/v1/runs/", post_exclusions, "POST", true, "/exclusions"},
    {"GET", "/api/v1/queue", get_queue, "GET, POST", false, NULL},
    {"POST", "/api/v1/queue", post_queue, "GET, POST", true, NULL},
    {"GET", "/api/v1/control", get_control, "GET, POST", false, NULL},
    {"POST", "/api/v1/control", post_control, "GET, POST", false, NULL},
    {"GET", "/api/v1/laser", get_laser, "GET, POST", false, NULL},
    {"POST", "/api/v1/laser", post_laser, "GET, POST", false, NULL},
    {"GET", "/api/v1/events", get_events, "GET", false, NULL},
    {"POST", HTTP_STOP_PATH, post_stop, "POST", false, NULL},
    {"POST", "/api/v1/pause", post_pause, "POST", true, NULL},
    {"POST", "/api/v1/resume", post_resume, "POST", true, NULL},
    {"POST", "/api/v1/ack", post_ack, "POST", true, NULL},
};

static const char *rest_of(const struct route *r, const char *path)
{
    size_t n = strlen(r->path);
    bool prefix = r->path[n - 1] == '/';
    const size_t size = strlen(path), end = r->end ? strlen(r->end) : 0;
    if (size < n + end || (end && strcmp(path + size - end, r->end)))
        return NULL;
    if (prefix ? strncmp(path, r->path, n) : strcmp(path, r->path))
        return NULL;
    return path + n;
}

struct http_reply api_request(void *hub, const struct http_request *request, uint64_t ticket)
{
    const struct route *same_path = NULL;
    for (size_t i = 0; i < sizeof routes / sizeof *routes; i++) {
        struct call c = {hub, request, ticket, rest_of(&routes[i], request->path)};
        if (!c.rest)
            continue;
        struct gon_error err;
        if (!strcmp(routes[i].method, request->method))
            return routes[i].controlled &&
                           control_check(hub_control(c.hub), request->name, &err) < 0
                       ? failed(&err)
                       : routes[i].handle(&c);
        same_path = &routes[i];
    }
    if (!same_path)
        return fail(404, "there is no such resource", request->path,
                    "see /api/v1/status, /api/v1/devices, /api/v1/runs, /api/v1/queue, "
                    "/api/v1/control, /api/v1/laser, /api/v1/events, /metrics");
    char use[40];
    snprintf(use, sizeof use, "use: %s", same_path->allow);
    struct http_reply r = fail(405, "that method is not for this resource", request->path, use);
    r.allow = same_path->allow;
    return r;
}
