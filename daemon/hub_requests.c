// SPDX-License-Identifier: MIT
#include "daemon/hub_inside.h"

#include "base/clk.h"
#include "base/log.h"
#include "daemon/decision.h"
#include "daemon/note.h"
#include "daemon/view.h"

#include <stdio.h>
#include <string.h>

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

void hub_give_back(struct hub *h, struct note *n)
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

bool hub_is_paused(const struct hub *h, int run)
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
    if (hub_is_paused(h, run)) {
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

void hub_decide(struct hub *h, int run, struct decision *decision, const char *by,
                uint64_t ticket)
{
    struct note *n = note_new(NOTE_DECIDE);
    n->ticket = ticket;
    n->run = run;
    n->by = note_text(by);
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
    hub_publish(h, "control", json_pack("{s:o}", "control", view_control(&h->control)));
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
