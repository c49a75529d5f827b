// SPDX-License-Identifier: MIT
// The engine's ports, as daemon/runner.c has them, over the shop instead of a thread.
#include "tests/dst/trial.h"

#include <stdlib.h>
#include <string.h>

enum { SLICE_MS = 50 };
#define PATIENCE_NS OS_S(10)
#define STOPPED_PATIENCE_NS OS_S(1)

static void take_all(struct trial *t, int timeout_ms)
{
    for (struct note *n; (n = note_wait(t->box, timeout_ms)); timeout_ms = 0) {
        if (n->letter.kind == NOTE_STORED) {
            t->acknowledged = n->sequence;
            t->answer = n->err;
        }
        note_free(n);
    }
}

static int wait_stored(struct trial *t, struct gon_error *err)
{
    int64_t end_ns = os_monotonic_ns() + PATIENCE_NS;
    while (t->acknowledged != t->sequence) {
        take_all(t, SLICE_MS);
        instrument_breathe(t->in);
        if (cancel_requested(t->cancel) && end_ns > os_monotonic_ns() + STOPPED_PATIENCE_NS)
            end_ns = os_monotonic_ns() + STOPPED_PATIENCE_NS;
        if (t->acknowledged != t->sequence && os_monotonic_ns() > end_ns)
            return gon_fail(err, GON_E_STORE,
                            "store: no acknowledgement for 10 s; is the disk full, slow or gone?");
    }
    if (t->answer.code && err)
        *err = t->answer;
    return t->answer.code;
}

static bool same(const struct store_reading *a, const struct store_reading *b)
{
    return a->sweep == b->sweep && a->point == b->point && a->attempt == b->attempt;
}

static int store_reading(void *ctx, const struct store_reading *reading, struct gon_error *err)
{
    struct trial *t = ctx;
    if (!t->reading_open || !same(reading, &t->reading)) {
        struct note *n = note_new(NOTE_READING);
        struct store_reading *row = malloc(sizeof *row);
        if (!row)
            abort();
        if (!same(reading, &t->reading))
            watch_offered(&t->watch, reading);
        *row = t->reading = *reading;
        n->run = t->id;
        n->thing = row;
        n->sequence = ++t->sequence;
        t->reading_open = true;
        shop_post(&t->shop, n);
    }
    const int rc = wait_stored(t, err);
    if (t->acknowledged == t->sequence)
        t->reading_open = false;
    if (rc == 0)
        watch_acknowledged(&t->watch, reading);
    return rc;
}

static int store_event(void *ctx, const char *level, const char *source, const char *text,
                       struct gon_error *err)
{
    struct trial *t = ctx;
    struct note *n = note_new(NOTE_EVENT);
    (void)err;
    n->run = t->id;
    n->level = level;
    n->source = source;
    n->text = note_text(text);
    shop_post(&t->shop, n);
    return GON_OK;
}

// What the hub does with it, and what an operator does who reads it.
static void publish(void *ctx, const struct engine_event *event)
{
    struct trial *t = ctx;
    watch_event(&t->watch, event);
    if (event->kind != ENGINE_STATE)
        return;
    const char *text = event->text ? event->text : "";
    os_trace("engine", '=', run_state_name(event->state), strlen(run_state_name(event->state)));
    os_trace("engine", '"', text, strlen(text));
    struct note *n = note_new(NOTE_STATE);
    n->run = t->id;
    n->state = event->state;
    n->text = note_text(text);
    shop_post(&t->shop, n);
    t->paused = event->state == RUN_PAUSED;
    if (t->paused) {
        t->pauses++;
        snprintf(t->pause_text, sizeof t->pause_text, "%s", text);
    }
}

static void request_fit(void *ctx, int sweep, bool last)
{
    (void)ctx;
    os_trace("engine", 'f', &sweep, sizeof sweep);
    (void)last;
}

static bool take_resume(void *ctx)
{
    struct trial *t = ctx;
    if (!t->resume_ns || os.now_ns < t->resume_ns)
        return false;
    t->resume_ns = 0;
    return true;
}

static bool take_pause(void *ctx)
{
    struct trial *t = ctx;
    const bool was = t->wants_pause;
    t->wants_pause = false;
    return was;
}

void trial_ports(struct trial *t, struct engine_ports *ret_ports)
{
    *ret_ports = (struct engine_ports){.ctx = t,
                                       .clk = clk_system(),
                                       .cancel = t->cancel,
                                       .opening =
                                           t->material->has_opening ? &t->material->opening : NULL,
                                       .store_reading = store_reading,
                                       .store_event = store_event,
                                       .publish = publish,
                                       .request_fit = request_fit,
                                       .take_resume = take_resume,
                                       .take_pause = take_pause};
}
