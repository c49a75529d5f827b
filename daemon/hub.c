// SPDX-License-Identifier: MIT
#include "daemon/hub.h"

#include "base/cancel.h"
#include "base/clk.h"
#include "base/log.h"
#include "campaign/bench.h"
#include "campaign/state.h"
#include "daemon/api.h"
#include "daemon/decision.h"
#include "daemon/fitter.h"
#include "daemon/loop.h"
#include "daemon/material.h"
#include "daemon/messenger.h"
#include "daemon/note.h"
#include "daemon/runner.h"
#include "daemon/storer.h"
#include "daemon/view.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_EVENTS = 4096, MOST_EVENT_BYTES = 4 * 1024 * 1024, MOST_STOPS = 32, MOST_KEPT = 1000 };

struct hub {
    struct hub_options options;
    struct loop *loop;
    struct mail *box, *store_box, *run_box, *fit_box; // of each thread
    struct cancel *cancel;
    struct events *events;
    struct http *http;
    struct queue *queue;
    struct control control;
    struct arming arming;
    struct messenger *messenger;          // NULL: nobody is told
    const char *notify[BENCH_NOTIFY + 1]; // its command
    struct storer *storer;
    struct runner *runner;
    struct fitter *fitter;
    struct instrument_snapshot *snapshot; // NULL: none yet
    char last_error[480];
    json_t *put_back; // runs that waited when a stop came, for its answer; NULL: none
    int64_t start_ns;
    uint64_t readings;          // announced
    uint64_t stops[MOST_STOPS]; // tickets that wait for the end of a stop
    int stop_count;
    bool held; // somebody asked for the pause that the active run is in, or comes to
    bool restored; // the queue of the earlier life, so that ours may take its place on the disk
    bool ready_said, listed, ending, ended_said;
};

// --- what is told to those who watch -------------------------------------------------------------

static void publish(struct hub *h, const char *kind, json_t *data)
{
    char *text = view_text(data);
    if (text)
        events_add(h->events, kind, text);
    free(text);
    if (h->http)
        http_wake(h->http);
}

static void answer_stops(struct hub *h, int status, const char *body)
{
    for (int i = 0; i < h->stop_count; i++)
        http_answer(h->http, h->stops[i], status, strdup(body));
    h->stop_count = 0;
}

static void answer_stopped(struct hub *h, int status, json_t *o)
{
    json_object_set_new(o, "put_back", h->put_back ? h->put_back : json_array());
    h->put_back = NULL;
    json_object_set_new(o, "laser_off",
                        json_boolean(h->snapshot && instrument_is_dark(h->snapshot)));
    char *body = view_text(o);
    answer_stops(h, status, body);
    free(body);
}

// In the file's history; how a run ended goes there when it is closed.
static void keep_state(struct hub *h, const struct run *run)
{
    if (run->state != RUN_PREPARING && run->state != RUN_RUNNING && run->state != RUN_PAUSED)
        return;
    struct note *n = note_new(NOTE_STATE);
    n->run = run->id;
    n->state = run->state;
    n->text = note_text(run->text);
    note_post(h->store_box, n);
}

static void tell(struct hub *h, const struct run *run)
{
    if (run->state != RUN_PAUSED && run->state != RUN_FAILED && run->state != RUN_DONE)
        return;
    const struct message m = {run->id, run_state_name(run->state), run->name, run->path, run->text};
    messenger_tell(h->messenger, &m);
}

static void changed(void *ctx, const struct run *run)
{
    struct hub *h = ctx;
    const bool paused = run->state == RUN_PAUSED;
    const bool bad =
        run->state == RUN_FAILED || (paused && (!run->wanted || run->light != SAFETY_LIGHT_OFF));
    log_say(h->options.log, bad ? LOG_WARN : LOG_NOTICE, "run", "%d %s%s%s", run->id,
            run_state_name(run->state), *run->text ? ": " : "", run->text);
    if (bad)
        snprintf(h->last_error, sizeof h->last_error, "%s", run->text);
    else if (run->state == RUN_RUNNING || run->state == RUN_DONE)
        h->last_error[0] = 0; // it was overcome; the log and the file's events keep it
    publish(h, "state", view_run(run, false));
    tell(h, run);
    if (run == queue_active(h->queue))
        keep_state(h, run);
    if (run == queue_active(h->queue) || queue_idle(h->queue))
        h->held = h->held && run->state == RUN_PAUSED;
    if (queue_idle(h->queue) && h->stop_count)
        answer_stopped(h, 200, view_run(run, false));
}

static void happened(struct hub *h, const struct note *n)
{
    static const char *const kinds[] = {"state", "reading", "sweep", "log"};
    const struct run *run = queue_run(h->queue, n->run);
    queue_engine_event(h->queue, n->run, &n->event);
    if (!run || n->event.kind == ENGINE_STATE)
        return;
    json_t *o = view_run(run, false);
    if (n->event.kind == ENGINE_LOG) {
        json_object_set_new(o, "text", json_string(n->text ? n->text : ""));
        log_say(h->options.log, LOG_NOTICE, "run", "%d: %s", n->run, n->text ? n->text : "");
    } else if (n->event.kind == ENGINE_READING) {
        h->readings++;
        json_object_set_new(o, "sweep", json_integer(n->sweep)); // the plan's own names for it
        json_object_set_new(o, "point", json_integer(n->point));
        log_say(h->options.log, LOG_INFO, "reading",
                "run %d, %d of %d, theta_i %g theta_r %g deg, f_r %.5g /sr", n->run, run->done,
                run->total, run->theta_i_deg, run->theta_r_deg, run->f_per_sr);
    } else {
        log_say(h->options.log, LOG_NOTICE, "run", "%d: sweep %d of %d", n->run, run->sweep,
                run->sweeps);
    }
    publish(h, kinds[n->event.kind], o);
}

static void fitted(struct hub *h, const struct note *n)
{
    json_t *fit = n->text ? json_loads(n->text, 0, NULL) : NULL;
    bool canceled = !fit && n->err.code == GON_E_CANCELED;
    json_t *o = json_pack("{s:i, s:i, s:b}", "run", n->run, "sweep", n->sweep, "last", n->last);
    if (fit)
        json_object_set_new(o, "fit", fit);
    else
        json_object_set_new(o, "error", json_string(n->err.text));
    if (!fit && !canceled)
        log_say(h->options.log, LOG_WARN, "fit", "run %d after sweep %d: %s", n->run, n->sweep,
                n->err.text);
    publish(h, "fit", o);
    queue_fitted(h->queue, n->run, fit ? n->text : NULL, &n->err);
}

// --- what the queue asks for ---------------------------------------------------------------------

static struct note *about(enum note_kind kind, const struct run *run)
{
    struct note *n = note_new(kind);
    n->run = run->id;
    n->name = note_text(run->path);
    return n;
}

static void open_port(void *ctx, const struct run *run)
{
    struct hub *h = ctx;
    note_post(h->store_box, about(NOTE_OPEN, run));
}

static void start_port(void *ctx, const struct run *run, void *material)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_START, run);
    n->thing = material;
    n->drop = run_material_free;
    note_post(h->run_box, n);
}

static void fit_port(void *ctx, const struct run *run, int sweep, bool last)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_FIT_WANTED, run);
    n->sweep = sweep;
    n->last = last;
    note_post(h->fit_box, n);
}

static void close_port(void *ctx, const struct run *run, enum run_state as)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_CLOSE, run);
    n->state = as;
    n->text = note_text(run->text);
    note_post(h->store_box, n);
}

static void cancel_port(void *ctx)
{
    struct hub *h = ctx;
    cancel_request(h->cancel);
}

static void keep_port(void *ctx)
{
    struct hub *h = ctx;
    if (!h->restored)
        return;
    struct queue_entry entries[MOST_KEPT];
    const size_t count = queue_entries(h->queue, entries, MOST_KEPT);
    struct note *n = note_new(NOTE_QUEUE);
    struct state_queue *kept = state_queue_new(count);
    for (size_t i = 0; kept && i < count; i++) {
        struct state_entry *e = &kept->entries[i];
        *e = (struct state_entry){
            .run = entries[i].run->id, .held = entries[i].run->held, .active = entries[i].active};
        snprintf(e->path, sizeof e->path, "%s", entries[i].run->path);
    }
    n->thing = kept;
    if (kept)
        note_post(h->store_box, n);
    else
        note_free(n);
    publish(h, "queue", view_queue(h->queue));
}

static void rearm_port(void *ctx)
{
    struct hub *h = ctx;
    if (!h->ending)
        cancel_reset(h->cancel); // no worker is at work: none can miss it
}

// --- requests ------------------------------------------------------------------------------------

uint64_t hub_event_id(const struct hub *h)
{
    return events_last_id(h->events);
}

char *hub_submitted(const struct hub *h, int run, uint64_t event_id)
{
    const struct run *r = queue_run(h->queue, run);
    json_t *o = view_run(r, false);
    json_object_set_new(o, "event_id", json_integer((json_int_t)event_id));
    json_object_set_new(o, "queue_held", json_boolean(queue_is_held(h->queue)));
    return view_text(o);
}

void hub_answer_kept(struct hub *h, uint64_t ticket, int status, char *body)
{
    struct note *n = note_new(NOTE_KEPT);
    n->ticket = ticket;
    n->run = status;
    n->text = body;
    note_post(h->store_box, n);
}

static void kept(struct hub *h, struct note *n)
{
    http_answer(h->http, n->ticket, n->run, n->text);
    n->text = NULL; // is the answer's now
}

void hub_status(const struct hub *h, struct hub_status *ret_status)
{
    const int64_t now_ns = clk_now_ns(clk_system());
    *ret_status = (struct hub_status){
        .directory = h->options.directory,
        .last_error = h->last_error,
        .simulator = h->options.simulator,
        .seed = h->options.seed,
        .uptime_s = (double)(now_ns - h->start_ns) / 1e9,
        .event_id = events_last_id(h->events),
        .readings = h->readings,
        .snapshot = h->snapshot,
        .snapshot_age_s = h->snapshot ? (double)(now_ns - h->snapshot->t_ns) / 1e9 : 0.0,
    };
}

const struct queue *hub_queue(const struct hub *h)
{
    return h->queue;
}

void hub_create(struct hub *h, const char *config, const char *name, const char *by,
                uint64_t ticket)
{
    struct note *n = note_new(NOTE_CREATE);
    n->ticket = ticket;
    n->by = note_text(by);
    n->text = note_text(config);
    n->name = note_text(name);
    note_post(h->store_box, n);
}

void hub_submit_path(struct hub *h, const char *path, const char *by, uint64_t ticket)
{
    struct note *n = note_new(NOTE_LOOK);
    n->ticket = ticket;
    n->by = note_text(by);
    n->name = note_text(path);
    note_post(h->store_box, n);
}

static bool is_paused(const struct hub *h, int run)
{
    const struct run *active = queue_active(h->queue);
    return active && active->id == run && active->state == RUN_PAUSED;
}

// A run that only waits because it, or the queue, is held goes on first of all.
static bool release(struct hub *h, int id, const char *by)
{
    const struct run *run = queue_run(h->queue, id);
    if ((!run->held && !queue_is_held(h->queue)) || queue_move(h->queue, id, 1, NULL) < 0)
        return false;
    arming_start(&h->arming, by);
    queue_hold(h->queue, id, false, NULL);
    queue_hold(h->queue, 0, false, NULL);
    return true;
}

int hub_submit(struct hub *h, int run, const char *by, uint64_t ticket, struct gon_error *err)
{
    const struct run *known = queue_run(h->queue, run);
    if (is_paused(h, run)) {
        int rc = hub_resume(h, by, err);
        return rc < 0 ? rc : 1;
    }
    if (known && release(h, run, by))
        return 1;
    int rc = known ? queue_may_submit(h->queue, run, err) : GON_OK;
    if (rc < 0)
        return rc;
    struct note *n = note_new(NOTE_LOOK);
    n->ticket = ticket;
    n->by = note_text(by);
    n->run = run;
    n->name = note_text(known ? known->path : NULL);
    note_post(h->store_box, n);
    return 0;
}

void hub_find(struct hub *h, int run, uint64_t ticket)
{
    struct note *n = note_new(NOTE_FIND);
    n->ticket = ticket;
    n->run = run;
    note_post(h->store_box, n);
}

void hub_decide(struct hub *h, int run, struct decision *decision, uint64_t ticket)
{
    struct note *n = note_new(NOTE_DECIDE);
    n->ticket = ticket;
    n->run = run;
    n->last = decision->verb == DECISION_REMEASURE;
    n->thing = decision;
    n->drop = decision_free;
    note_post(h->store_box, n);
}

static void note_waiting(struct hub *h)
{
    const struct run *run, *active = queue_active(h->queue);
    h->put_back = h->put_back ? h->put_back : json_array();
    for (size_t i = 0; (run = queue_at(h->queue, i)); i++)
        if (run != active && run->state == RUN_QUEUED)
            json_array_append_new(h->put_back, json_integer(run->id));
}

bool hub_stop(struct hub *h, const char *why, uint64_t ticket)
{
    const bool room = h->stop_count < MOST_STOPS;
    if (room)
        h->stops[h->stop_count++] = ticket;
    note_waiting(h);
    arming_disarm(&h->arming, why, 0);
    if (!queue_stop(h->queue, why))
        note_post(h->run_box, note_new(NOTE_HALT));
    return room;
}

// The note is given away. by: whose command starts light; NULL: it starts none.
static int to_active(struct hub *h, struct note *n, unsigned states, const char *by,
                     struct gon_error *err)
{
    const struct run *run = queue_active(h->queue);
    int rc = GON_OK;
    if (!run)
        rc = gon_fail(err, GON_E_REFUSED, "no run is active; see: gonio list");
    else if (!(states & 1u << run->state))
        rc = gon_fail(err, GON_E_REFUSED, "run %d is %s; see: gonio status", run->id,
                      run_state_name(run->state));
    if (rc < 0) {
        note_free(n);
        return rc;
    }
    if (by)
        arming_start(&h->arming, by);
    note_post(h->run_box, n);
    return run->id;
}

// One that waits for a device would go on by itself: it can be held too, once.
int hub_pause(struct hub *h, const char *by, bool now, struct gon_error *err)
{
    const unsigned waits = h->held ? 0 : 1u << RUN_PAUSED;
    struct note *n = note_new(NOTE_PAUSE);
    n->text = note_text(by);
    n->last = now;
    int rc = to_active(h, n, 1u << RUN_PREPARING | 1u << RUN_RUNNING | waits, NULL, err);
    h->held = h->held || rc > 0;
    return rc;
}

int hub_ack(struct hub *h, const char *said, const char *by, struct gon_error *err)
{
    const struct run *run = queue_active(h->queue);
    if (!run || !*run->asks)
        return gon_fail(err, GON_E_REFUSED, "nothing waits for a person; see: gonio status");
    struct note *n = note_new(NOTE_ACK);
    n->text = note_text(said);
    return to_active(h, n, 1u << RUN_PAUSED, by, err);
}

int hub_resume(struct hub *h, const char *by, struct gon_error *err)
{
    struct queue_entry first;
    if (queue_idle(h->queue) && queue_is_held(h->queue) && queue_entries(h->queue, &first, 1)) {
        hub_queue_hold(h, 0, false, by, NULL);
        return first.run->id;
    }
    const struct run *run = queue_active(h->queue);
    if (run && *run->asks)
        return gon_fail(err, GON_E_REFUSED,
                        "run %d waits for a person: %s; when that is done: gonio ack", run->id,
                        run->asks);
    return to_active(h, note_new(NOTE_RESUME), 1u << RUN_PAUSED, by, err);
}

struct arming *hub_arming(struct hub *h)
{
    return &h->arming;
}

// --- who commands --------------------------------------------------------------------------------

const struct control *hub_control(const struct hub *h)
{
    return &h->control;
}

static int control_changed(struct hub *h, int rc, const char *what)
{
    if (rc < 0)
        return rc;
    log_say(h->options.log, LOG_NOTICE, "control", "%s", what);
    publish(h, "control", json_pack("{s:o}", "control", view_control(&h->control)));
    return rc;
}

int hub_control_take(struct hub *h, const char *name, const char *reason, const char *from,
                     struct gon_error *err)
{
    char what[2 * CONTROL_NAME + CONTROL_REASON + 40];
    const char *before = h->control.name;
    snprintf(what, sizeof what, "%.64s takes control%s%s%s%.160s", name,
             *before && strcmp(before, name) ? " from " : "",
             *before && strcmp(before, name) ? before : "", reason && *reason ? ": " : "",
             reason ? reason : "");
    return control_changed(
        h, control_take(&h->control, name, reason, from, clk_utc_ns(clk_system()) / 1000000, err),
        what);
}

int hub_control_release(struct hub *h, const char *name, struct gon_error *err)
{
    char what[CONTROL_NAME + 40];
    snprintf(what, sizeof what, "%s releases control", name);
    return control_changed(h, control_release(&h->control, name, err), what);
}

// --- the queue's order ---------------------------------------------------------------------------

int hub_queue_remove(struct hub *h, int run, const char *by, struct gon_error *err)
{
    return queue_remove(h->queue, run, by, err);
}

int hub_queue_move(struct hub *h, int run, int place, struct gon_error *err)
{
    return queue_move(h->queue, run, place, err);
}

int hub_queue_hold(struct hub *h, int run, bool held, const char *by, struct gon_error *err)
{
    if (!held)
        arming_start(&h->arming, by);
    return queue_hold(h->queue, run, held, err);
}

// --- what the workers say ------------------------------------------------------------------------

static int submit_known(struct hub *h, int run, const char *by, struct gon_error *err)
{
    if (!is_paused(h, run)) {
        const int rc = queue_submit(h->queue, run, err);
        if (rc >= 0 && !queue_is_held(h->queue)) // before the material that starts it
            arming_start(&h->arming, by);
        return rc;
    }
    int rc = hub_resume(h, by, err);
    return rc < 0 ? rc : GON_OK;
}

static void found(struct hub *h, const struct note *n)
{
    const struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    if (run)
        http_answer(h->http, n->ticket, 200, view_text(view_run(run, true)));
    else
        http_answer(h->http, n->ticket, 404, api_no_run(n->run));
}

static void known(struct hub *h, struct note *n)
{
    struct gon_error err = n->err;
    uint64_t event_id = hub_event_id(h);
    struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    int rc = run ? submit_known(h, run->id, n->by, &err) : (int)err.code;
    if (rc == 0) {
        hub_answer_kept(h, n->ticket, 201, hub_submitted(h, run->id, event_id));
    } else {
        if (rc == GON_E_STORE)
            snprintf(h->last_error, sizeof h->last_error, "%s", err.text);
        http_answer(h->http, n->ticket, api_status(rc),
                    n->text ? api_complaints(n->text) : api_error(rc, err.text));
    }
}

static void answer_failed(struct hub *h, uint64_t ticket, const struct gon_error *err)
{
    http_answer(h->http, ticket, api_status(err->code), api_error(err->code, err->text));
}

// One that has the bench or waits is measured again by itself.
static int submit_again(struct hub *h, int run, struct gon_error *err)
{
    struct queue_entry entries[MOST_KEPT];
    const size_t count = queue_entries(h->queue, entries, MOST_KEPT);
    for (size_t i = 0; i < count; i++)
        if (entries[i].run->id == run)
            return GON_OK;
    return queue_submit(h->queue, run, err);
}

static void decided(struct hub *h, const struct note *n)
{
    struct gon_error err = n->err;
    const uint64_t event_id = hub_event_id(h);
    const struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    if (!run || (n->last && submit_again(h, n->run, &err) < 0)) {
        answer_failed(h, n->ticket, &err);
        return;
    }
    log_say(h->options.log, LOG_NOTICE, "run", "%d: decided about %d readings, see: gonio show %d",
            n->run, n->count, n->run);
    char *text = hub_submitted(h, n->run, event_id);
    json_t *o = json_loads(text, 0, NULL);
    json_object_set_new(o, "readings", json_integer(n->count));
    http_answer(h->http, n->ticket, n->last ? 201 : 200, view_text(o));
    free(text);
}

static void halted(struct hub *h, const struct note *n)
{
    if (n->err.code) {
        snprintf(h->last_error, sizeof h->last_error, "%s", n->err.text);
        char *body = api_error(n->err.code, n->err.text);
        answer_stopped(h, 500, json_loads(body, 0, NULL));
        free(body);
    } else {
        answer_stopped(h, 200, json_pack("{s:n, s:s}", "run", "state", "idle"));
    }
}

static void armed(struct hub *h, const struct note *n)
{
    if (arming_told(&h->arming, n)) {
        char text[400];
        const struct align *a = &h->arming.align;
        arm_describe(&h->arming.seen, text, sizeof text);
        if (n->letter.kind == NOTE_ALIGNED && a->running)
            snprintf(text, sizeof text, "%s aligns at %g W", a->name, a->power_w);
        else if (n->letter.kind == NOTE_ALIGNED)
            snprintf(text, sizeof text, "the alignment of %s ended: %s", a->name, a->end);
        log_say(h->options.log, LOG_NOTICE, "laser", "%s", text);
        publish(h, "laser", view_laser(&h->arming, h->snapshot));
    }
    if (n->ticket && n->err.code)
        http_answer(h->http, n->ticket, api_status(n->err.code),
                    api_error(n->err.code, n->err.text));
    else if (n->ticket)
        http_answer(h->http, n->ticket, 200, view_text(view_laser(&h->arming, h->snapshot)));
}

static void restored(struct hub *h, const struct note *n)
{
    const struct state_queue *earlier = n->thing;
    for (size_t i = 0; earlier && i < earlier->count; i++)
        queue_restore(h->queue, earlier->entries[i].run, earlier->entries[i].held);
    h->restored = true;
    keep_port(h);
    if (queue_is_held(h->queue))
        log_say(h->options.log, LOG_NOTICE, "queue",
                "held, as goniod was started anew; look: gonio queue, go on: gonio queue release");
}

// Before the list is complete: it could not be read either, and the folder may be another's.
static void unkept(struct hub *h, const struct note *n)
{
    log_say(h->options.log, LOG_ERR, "queue", "%s", n->err.text);
    snprintf(h->last_error, sizeof h->last_error, "%s", n->err.text);
    if (!h->listed && !h->ended_said) {
        h->ended_said = true;
        h->options.ended(h->options.ctx, &n->err);
    }
}

static void take_snapshot(struct hub *h, struct note *n)
{
    free(h->snapshot);
    h->snapshot = note_steal(n);
    if (h->snapshot)
        h->options.looked(h->options.ctx, h->snapshot);
}

static void engine_ended(struct hub *h, const struct note *n)
{
    if (n->run)
        queue_ended(h->queue, n->run, n->state, n->err.code ? &n->err : NULL);
    else if (h->options.ended && !h->ended_said) { // the bench could not even be opened
        h->ended_said = true;
        h->options.ended(h->options.ctx, &n->err);
    }
}

static void take(struct hub *h, struct note *n)
{
    switch ((enum note_kind)n->letter.kind) {
    case NOTE_LISTED:
        if (n->thing)
            queue_know(h->queue, n->thing);
        else
            h->listed = true;
        if (n->err.code)
            log_say(h->options.log, LOG_WARN, "store", "%s", n->err.text);
        break;
    case NOTE_RESTORED: restored(h, n); break;
    case NOTE_UNKEPT: unkept(h, n); break;
    case NOTE_KNOWN: known(h, n); break;
    case NOTE_FOUND: found(h, n); break;
    case NOTE_KEPT: kept(h, n); break;
    case NOTE_OPENED: queue_opened(h->queue, n->run, note_steal(n), &n->err); break;
    case NOTE_FITTED: fitted(h, n); break;
    case NOTE_CLOSED:
        if (n->last && !n->err.code)
            queue_reopened(h->queue, n->run);
        else
            queue_closed(h->queue, n->run, n->err.code ? &n->err : NULL);
        break;
    case NOTE_DECIDED: decided(h, n); break;
    case NOTE_HAPPENED: happened(h, n); break;
    case NOTE_FIT_ASKED: queue_fit_asked(h->queue, n->run, n->sweep, n->last); break;
    case NOTE_ENDED: engine_ended(h, n); break;
    case NOTE_SNAPSHOT: take_snapshot(h, n); break;
    case NOTE_HALTED: halted(h, n); break;
    case NOTE_ARMED:
    case NOTE_ALIGNED: armed(h, n); break;
    default: break;
    }
}

static void say_when_ready(struct hub *h)
{
    if (!h->ready_said && h->listed && h->snapshot) {
        h->ready_said = true;
        h->options.ready(h->options.ctx, h->snapshot);
    }
}

static void say_when_ended(struct hub *h)
{
    if (h->ending && !h->ended_said && queue_idle(h->queue)) {
        h->ended_said = true;
        h->options.ended(h->options.ctx, NULL);
    }
}

static void mail_arrived(void *ctx)
{
    struct hub *h = ctx;
    for (struct note *n; (n = note_take(h->box));) {
        take(h, n);
        note_free(n);
    }
    say_when_ready(h);
    say_when_ended(h);
}

// --- beginning and end ---------------------------------------------------------------------------

static int start_workers(struct hub *h, struct gon_error *err)
{
    struct storer_links s = {clk_system(),         h->options.bench,    h->options.bench_text,
                             h->options.directory, h->store_box,        h->box,
                             h->run_box,           h->options.profiles, h->options.profiles_count};
    struct fitter_links f = {h->cancel, h->fit_box, h->box, h->store_box};
    struct runner_links r = {h->options.bench, h->options.guard, h->cancel,   h->options.directory,
                             h->run_box,       h->box,           h->store_box};
    int rc = storer_start(&s, &h->storer, err);
    rc = rc < 0 ? rc : fitter_start(&f, &h->fitter, err);
    return rc < 0 ? rc : runner_start(&r, &h->runner, err);
}

static int start_messenger(struct hub *h, struct gon_error *err)
{
    const struct bench_config *bench = h->options.bench;
    if (!bench->notify.argc)
        return GON_OK;
    for (int i = 0; i < bench->notify.argc; i++)
        h->notify[i] = bench->notify.argv[i];
    const struct messenger_command command = {h->notify, bench->notify.limit_s};
    return messenger_new(h->loop, &command, h->options.log, &h->messenger, err);
}

static int build(struct hub *h, int listen_fd, struct gon_error *err)
{
    struct queue_ports q = {h,           open_port,  start_port, fit_port, close_port,
                            cancel_port, rearm_port, changed,    keep_port};
    struct http_ports p = {h, api_request};
    // Ids go on rising from one life of the daemon to the next: a thousand a second and it would be
    // late.
    uint64_t first_id = (uint64_t)(clk_utc_ns(clk_system()) / 1000000000) * 1000;
    h->box = mail_new();
    h->store_box = mail_new();
    h->run_box = mail_new();
    h->fit_box = mail_new();
    h->arming.to_runner = h->run_box;
    h->cancel = cancel_new();
    h->events = events_new(MOST_EVENTS, MOST_EVENT_BYTES, first_id);
    h->queue = queue_new(&q);
    if (!h->box || !h->store_box || !h->run_box || !h->fit_box || !h->cancel || !h->events ||
        !h->queue)
        return gon_fail(err, GON_E_SYSTEM, "daemon: out of memory or descriptors");
    int rc = loop_add(h->loop, mail_fd(h->box), mail_arrived, h, err);
    rc = rc < 0 ? rc : start_messenger(h, err);
    rc = rc < 0 ? rc : start_workers(h, err);
    if (rc < 0)
        return rc;
    h->http = http_new(h->loop, listen_fd, h->events, &p, h->options.log, err);
    return h->http ? GON_OK : GON_E_SYSTEM;
}

int hub_new(struct loop *loop, int listen_fd, const struct hub_options *options,
            struct hub **ret_hub, struct gon_error *err)
{
    struct hub *h = calloc(1, sizeof *h);
    if (!h)
        return gon_fail(err, GON_E_SYSTEM, "daemon: out of memory");
    h->options = *options;
    h->loop = loop;
    h->arming.rule = &options->bench->laser;
    h->start_ns = clk_now_ns(clk_system());
    int rc = build(h, listen_fd, err);
    if (rc < 0) {
        hub_free(h);
        return rc;
    }
    note_post(h->store_box, note_new(NOTE_LIST));
    *ret_hub = h;
    return GON_OK;
}

void hub_end(struct hub *h)
{
    if (h->ending)
        return;
    h->ending = true;
    queue_end(h->queue);
    say_when_ended(h);
}

// The instrument thread goes first: it is the one that switches off. The store outlives those who
// write.
bool hub_free(struct hub *h)
{
    if (!h)
        return false;
    if (h->cancel)
        cancel_request(h->cancel);
    if (h->runner)
        note_post(h->run_box, note_new(NOTE_QUIT));
    if (h->fitter)
        note_post(h->fit_box, note_new(NOTE_QUIT));
    bool may_be_on = runner_join(h->runner);
    fitter_join(h->fitter);
    if (h->storer)
        note_post(h->store_box, note_new(NOTE_QUIT));
    storer_join(h->storer);
    http_free(h->http);
    queue_free(h->queue);
    messenger_free(h->messenger);
    events_free(h->events);
    if (h->box)
        loop_remove(h->loop, mail_fd(h->box));
    struct mail *const boxes[] = {h->box, h->store_box, h->run_box, h->fit_box};
    for (int i = 0; i < 4; i++)
        mail_free(boxes[i], note_drop);
    cancel_free(h->cancel);
    free(h->snapshot);
    json_decref(h->put_back);
    free(h);
    return may_be_on;
}
