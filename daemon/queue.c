// SPDX-License-Identifier: MIT
#include "daemon/queue.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Where the run that has the bench is on its way.
enum phase { IDLE, OPENING, MEASURING, FITTING, CLOSING };

struct queue {
    struct queue_ports ports;
    struct run **runs; // by rising id; each stays where it is, so that pointers do
    size_t count, room;
    int *waiting; // ids, first come first served
    size_t waiting_count;
    enum phase phase;
    struct run *active;
    enum run_state ended_as;
    bool stopping, ending;
    bool held; // starts nothing more
};

struct queue *queue_new(const struct queue_ports *ports)
{
    struct queue *q = calloc(1, sizeof *q);
    if (q)
        q->ports = *ports;
    return q;
}

void queue_free(struct queue *q)
{
    if (!q)
        return;
    for (size_t i = 0; i < q->count; i++) {
        free(q->runs[i]->fit);
        free(q->runs[i]);
    }
    free(q->runs);
    free(q->waiting);
    free(q);
}

static struct run *find(const struct queue *q, int id)
{
    for (size_t i = 0; i < q->count; i++)
        if (q->runs[i]->id == id)
            return q->runs[i];
    return NULL;
}

// Its place among those that wait; -1: it does not.
static int place_of(const struct queue *q, int id)
{
    for (size_t i = 0; i < q->waiting_count; i++)
        if (q->waiting[i] == id)
            return (int)i;
    return -1;
}

static bool is_waiting(const struct queue *q, int id)
{
    return place_of(q, id) >= 0;
}

static void keep(struct queue *q)
{
    if (!q->ending)
        q->ports.keep(q->ports.ctx);
}

static int take_out(struct queue *q, int place)
{
    const int id = q->waiting[place];
    q->waiting_count--;
    memmove(q->waiting + place, q->waiting + place + 1,
            (q->waiting_count - (size_t)place) * sizeof *q->waiting);
    return id;
}

static void put_in(struct queue *q, int place, int id)
{
    memmove(q->waiting + place + 1, q->waiting + place,
            (q->waiting_count - (size_t)place) * sizeof *q->waiting);
    q->waiting[place] = id; // there is room for every known run
    q->waiting_count++;
}

static bool make_room(struct queue *q)
{
    if (q->count < q->room)
        return true;
    size_t room = q->room ? 2 * q->room : 16;
    struct run **runs = realloc(q->runs, room * sizeof *runs);
    if (runs)
        q->runs = runs;
    int *waiting = realloc(q->waiting, room * sizeof *waiting);
    if (waiting)
        q->waiting = waiting;
    if (!runs || !waiting)
        return false;
    q->room = room;
    return true;
}

struct run *queue_know(struct queue *q, const struct run *run)
{
    struct run *known = find(q, run->id);
    if (known) {
        if (known != q->active && !is_waiting(q, run->id)) {
            char *fit = known->fit;
            *known = *run;
            known->fit = fit;
        }
        return known;
    }
    known = make_room(q) ? malloc(sizeof *known) : NULL;
    if (!known)
        return NULL;
    *known = *run;
    known->fit = NULL;
    size_t at = q->count++;
    for (; at > 0 && q->runs[at - 1]->id > run->id; at--)
        q->runs[at] = q->runs[at - 1];
    q->runs[at] = known;
    return known;
}

static void change(struct queue *q, struct run *run, enum run_state state, const char *text)
{
    run->state = state;
    if (text != run->text)
        snprintf(run->text, sizeof run->text, "%s", text ? text : "");
    if (state == RUN_DONE || state == RUN_FAILED || state == RUN_STOPPED)
        *run->asks = 0;
    if (state == RUN_DONE || state == RUN_FAILED || state == RUN_STOPPED)
        run->light = SAFETY_LIGHT_OFF; // no longer this run's: the devices' state tells on
    q->ports.changed(q->ports.ctx, run);
}

// The first that is not held; -1: none.
static int first_ready(const struct queue *q)
{
    for (size_t i = 0; i < q->waiting_count && !q->held; i++)
        if (!find(q, q->waiting[i])->held)
            return (int)i;
    return -1;
}

static void next(struct queue *q)
{
    const int place = q->active || q->ending ? -1 : first_ready(q);
    if (place < 0)
        return;
    q->active = find(q, take_out(q, place));
    q->phase = OPENING;
    q->ports.open(q->ports.ctx, q->active);
}

int queue_may_submit(const struct queue *q, int id, struct gon_error *err)
{
    const struct run *run = find(q, id);
    if (q->ending)
        return gon_fail(err, GON_E_REFUSED, "the daemon is ending; start it again");
    if (!run)
        return gon_fail(err, GON_E_INPUT, "there is no run %d; see: gonio list", id);
    if (run == q->active || is_waiting(q, id))
        return gon_fail(err, GON_E_REFUSED, "run %d is %s already; see: gonio watch", id,
                        run_state_name(run->state));
    if (run->state == RUN_DONE)
        return gon_fail(err, GON_E_REFUSED, "run %d is done; see: gonio show %d", id, id);
    return GON_OK;
}

int queue_submit(struct queue *q, int id, struct gon_error *err)
{
    struct run *run = find(q, id);
    int rc = queue_may_submit(q, id, err);
    if (rc < 0)
        return rc;
    put_in(q, (int)q->waiting_count, id);
    run->fits_open = 0;
    run->fit_failed = run->held = false;
    change(q, run, RUN_QUEUED, NULL);
    next(q);
    keep(q);
    return GON_OK;
}

// --- the order -----------------------------------------------------------------------------------

size_t queue_entries(const struct queue *q, struct queue_entry *ret_entries, size_t most)
{
    size_t n = 0;
    if (q->active && n < most)
        ret_entries[n++] = (struct queue_entry){q->active, true};
    for (size_t i = 0; i < q->waiting_count && n < most; i++)
        ret_entries[n++] = (struct queue_entry){find(q, q->waiting[i]), false};
    return n;
}

void queue_restore(struct queue *q, int id, bool held)
{
    struct run *run = find(q, id);
    if (!run || run->state == RUN_DONE || is_waiting(q, id))
        return;
    run->held = held;
    q->held = true;
    put_in(q, (int)q->waiting_count, id);
}

static int waits(const struct queue *q, int id, struct gon_error *err)
{
    const int place = place_of(q, id);
    if (place < 0)
        return gon_fail(err, GON_E_INPUT, "run %d does not wait in the queue; see: gonio queue", id);
    return place;
}

int queue_remove(struct queue *q, int id, const char *by, struct gon_error *err)
{
    char why[100];
    const int place = waits(q, id, err);
    if (place < 0)
        return place;
    take_out(q, place);
    snprintf(why, sizeof why, "taken out of the queue by %s", by);
    change(q, find(q, id), RUN_STOPPED, why);
    keep(q);
    return GON_OK;
}

int queue_move(struct queue *q, int id, int place, struct gon_error *err)
{
    const int from = waits(q, id, err);
    if (from < 0)
        return from;
    if (place < 1 || (size_t)place > q->waiting_count)
        return gon_fail(err, GON_E_INPUT, "place %d: the queue has 1 to %zu", place,
                        q->waiting_count);
    put_in(q, place - 1, take_out(q, from));
    keep(q);
    return GON_OK;
}

// Until then they are what they were when the daemon died.
static void wake_restored(struct queue *q)
{
    for (size_t i = 0; i < q->waiting_count && !q->held; i++) {
        struct run *run = find(q, q->waiting[i]);
        if (run->state != RUN_QUEUED)
            change(q, run, RUN_QUEUED, NULL);
    }
}

int queue_hold(struct queue *q, int id, bool held, struct gon_error *err)
{
    const int place = id ? waits(q, id, err) : 0;
    if (place < 0)
        return place;
    if (id)
        find(q, id)->held = held;
    else
        q->held = held;
    wake_restored(q);
    next(q);
    keep(q);
    return GON_OK;
}

bool queue_is_held(const struct queue *q)
{
    return q->held;
}

static void put_back(struct queue *q, const char *why)
{
    while (q->waiting_count) {
        struct run *run = find(q, q->waiting[--q->waiting_count]);
        change(q, run, RUN_STOPPED, why);
    }
}

bool queue_stop(struct queue *q, const char *why)
{
    bool any = q->active || q->waiting_count;
    put_back(q, why);
    q->held = false;
    if (q->active && q->phase < CLOSING && !q->stopping) {
        q->stopping = true;
        q->ports.cancel(q->ports.ctx);
        change(q, q->active, RUN_STOPPING, why);
    }
    keep(q);
    return any;
}

void queue_end(struct queue *q)
{
    q->ending = true;
    queue_stop(q, "the daemon ended");
}

static void finish(struct queue *q, enum run_state state, const char *text)
{
    struct run *run = q->active;
    bool stopped = q->stopping;
    q->active = NULL;
    q->phase = IDLE;
    q->stopping = false;
    if (stopped)
        q->ports.rearm(q->ports.ctx);
    change(q, run, state, text);
    next(q);
    keep(q);
}

// How it ended, for the file and for those who watch; the warning first.
static void word_end(struct run *run, enum run_state as)
{
    char why[sizeof run->text];
    const bool off = run->light == SAFETY_LIGHT_OFF;
    snprintf(why, sizeof why, "%s", as == RUN_DONE ? "" : run->text);
    snprintf(run->text, sizeof run->text, "%s%s%.400s", off ? "" : safety_light_text(run->light),
             off || !*why ? "" : "; ", why);
}

// Measured, and no fit is under way: the file can be closed.
static void close_if_ready(struct queue *q)
{
    if (q->phase != FITTING || q->active->fits_open > 0)
        return;
    q->phase = CLOSING;
    word_end(q->active, q->ended_as);
    q->ports.close(q->ports.ctx, q->active, q->ended_as);
}

void queue_opened(struct queue *q, int id, void *material, const struct gon_error *err)
{
    assert(q->phase == OPENING && q->active->id == id);
    if (!material) {
        finish(q, q->stopping ? RUN_STOPPED : RUN_FAILED, err ? err->text : "");
        return;
    }
    q->phase = MEASURING;
    q->ports.start(q->ports.ctx, q->active,
                   material); // also when stopping: the engine then ends at once
}

void queue_engine_event(struct queue *q, int id, const struct engine_event *event)
{
    struct run *run = find(q, id);
    if (!run || run != q->active)
        return;
    run->light = event->light;
    run->wanted = event->wanted;
    memcpy(run->asks, event->asks, sizeof run->asks);
    run->left_s = event->left_s;
    run->sweeps = event->sweeps;
    run->sweep = event->sweep;
    run->done = event->point;
    run->total = event->points;
    if (event->kind == ENGINE_READING) {
        run->theta_i_deg = event->theta_i_deg;
        run->theta_r_deg = event->theta_r_deg;
        run->f_per_sr = event->f_per_sr;
        run->u_per_sr = event->u_per_sr;
        run->flags = event->flags;
    }
    // How it ends is said when the file is closed, and a stop under way is not taken back.
    bool ends =
        event->state == RUN_DONE || event->state == RUN_STOPPED || event->state == RUN_FAILED;
    if (event->kind == ENGINE_STATE && !ends && !q->stopping)
        change(q, run, event->state, event->text);
}

void queue_fit_asked(struct queue *q, int id, int sweep, bool last)
{
    struct run *run = find(q, id);
    if (!run || run != q->active)
        return;
    run->fits_open++;
    q->ports.fit(q->ports.ctx, run, sweep, last);
}

void queue_fitted(struct queue *q, int id, const char *fit, const struct gon_error *err)
{
    struct run *run = find(q, id);
    if (!run || run != q->active)
        return;
    assert(run->fits_open > 0);
    run->fits_open--;
    run->fit_failed = !fit && !(err && err->code == GON_E_CANCELED);
    if (fit) {
        free(run->fit);
        run->fit = strdup(fit);
    }
    close_if_ready(q);
}

void queue_ended(struct queue *q, int id, enum run_state state, const struct gon_error *err)
{
    assert(q->phase == MEASURING && q->active->id == id);
    q->phase = FITTING;
    q->ended_as = state;
    if (state != RUN_DONE && err && !q->stopping)
        snprintf(q->active->text, sizeof q->active->text, "%s", err->text);
    close_if_ready(q);
}

void queue_closed(struct queue *q, int id, const struct gon_error *err)
{
    assert(q->phase == CLOSING && q->active->id == id);
    if (err)
        finish(q, RUN_FAILED, err->text);
    else
        finish(q, q->ended_as, q->active->text);
}

void queue_reopened(struct queue *q, int id)
{
    assert(q->phase == CLOSING && q->active->id == id);
    struct run *run = q->active;
    if (q->stopping || q->ending) {
        finish(q, RUN_STOPPED, run->text);
        return;
    }
    q->active = NULL;
    q->phase = IDLE;
    put_in(q, 0, id);
    run->held = false;
    change(q, run, RUN_QUEUED, run->text);
    next(q);
    keep(q);
}

const struct run *queue_active(const struct queue *q)
{
    return q->active;
}

const struct run *queue_run(const struct queue *q, int id)
{
    return find(q, id);
}

const struct run *queue_at(const struct queue *q, size_t index)
{
    return index < q->count ? q->runs[index] : NULL;
}

bool queue_idle(const struct queue *q)
{
    return !q->active;
}
