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

static void happen(void *ctx, int arg)
{
    fault_begin(ctx, arg >> 16, arg & 0xffff);
}

static bool same(const struct store_reading *a, const struct store_reading *b)
{
    return a->sweep == b->sweep && a->point == b->point && a->attempt == b->attempt;
}

// At random, after about so many readings.
static void roll_for_fault(struct trial *t)
{
    if (dice_unit(&t->dice) >= t->spec.faults_per_1000 * 1e-3)
        return;
    int index;
    do
        index = (int)dice_below(&t->dice, (unsigned)faults_count());
    while (!fault_fits(&faults[index], t) || faults[index].matrix_only);
    os_at(os.now_ns + OS_S(dice_between(&t->dice, 0, 1.5)), happen, t,
          index << 16 | (int)dice_below(&t->dice, 1 << 15));
}

static void acknowledged(struct trial *t, const struct store_reading *reading)
{
    watch_acknowledged(&t->watch, reading);
    t->row_ns = os.now_ns;
    t->seen.flagged += t->seen.begun && reading->flags & STORE_REJECTING & ~STORE_UNDER_RANGE;
    roll_for_fault(t);
}

static void post(struct trial *t, const struct store_reading *stored)
{
    struct note *n = note_new(NOTE_READING);
    struct store_reading *row = malloc(sizeof *row);
    if (!row)
        abort();
    *row = *stored;
    n->run = t->id;
    n->thing = row;
    n->sequence = ++t->sequence;
    t->reading_open = true;
    shop_post(&t->shop, n);
}

static int store_reading(void *ctx, const struct store_reading *reading, struct gon_error *err)
{
    struct trial *t = ctx;
    struct store_reading stored = *reading, told = *reading;
    int rc = 0;
    if (mutation_of_reading(t, &stored, &told)) {
        watch_offered(&t->watch, &told);
    } else {
        if (!same(reading, &t->reading)) {
            watch_offered(&t->watch, &told);
            trial_aim(t, MOMENT_STORING, os.now_ns + OS_MS(0.05));
        }
        if (!t->reading_open || !same(reading, &t->reading))
            post(t, &stored);
        t->reading = *reading;
        rc = wait_stored(t, err);
        if (t->acknowledged == t->sequence)
            t->reading_open = false;
    }
    if (rc == 0) {
        acknowledged(t, &told);
        mutation_after_row(t);
    }
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

// Looks at it after a while, mends what can be mended, and says resume; again while it is paused.
static void operate(void *ctx, int arg)
{
    struct trial *t = ctx;
    (void)arg;
    if (!t->paused || t->no_operator)
        return;
    faults_mend(t, false);
    t->resume = true;
    os_at(os.now_ns + OS_S(dice_between(&t->dice, 5, 20)), operate, t, 0);
}

static void state_changed(struct trial *t, enum run_state state, const char *text)
{
    const bool was = t->paused;
    const char *words = t->injected ? faults[t->last_fault].words : NULL;
    t->paused = state == RUN_PAUSED;
    if (t->paused) {
        t->paused_ns = os.now_ns;
        t->pauses += !was;
        if (!was)
            os_at(os.now_ns + OS_S(dice_between(&t->dice, 3, 20)), operate, t, 0);
        trial_aim(t, MOMENT_PAUSED, os.now_ns + OS_S(1.05));
        if (!t->seen.begun)
            return;
        if (!*t->seen.reason)
            snprintf(t->seen.reason, sizeof t->seen.reason, "%s", text);
        t->seen.warned |= strstr(text, "LASER MAY BE ON") != NULL;
        t->seen.told |= words && strstr(text, words);
    } else if (was && t->seen.begun) {
        t->seen.operators += t->resumed;
        t->seen.returns += !t->resumed;
    }
    t->resumed = false;
    if (state == RUN_PREPARING)
        trial_aim(t, MOMENT_PREPARING, os.now_ns + OS_S(0.3));
    if (state == RUN_STOPPING)
        trial_aim(t, MOMENT_STOPPING, os.now_ns);
}

// What the hub does with it, and what an operator does who reads it.
static void publish(void *ctx, const struct engine_event *told)
{
    struct trial *t = ctx;
    struct engine_event own = *told;
    const struct engine_event *event = &own;
    mutation_of_event(t, &own);
    watch_event(&t->watch, event);
    if (event->kind == ENGINE_LOG && event->text && strstr(event->text, "warming up"))
        trial_aim(t, MOMENT_WARMING, os.now_ns + OS_S(1.5));
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
    state_changed(t, event->state, text);
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
    const bool was = t->resume;
    t->resume = false;
    t->resumed |= was;
    if (was)
        trial_arm(t);
    return was;
}

static bool take_pause(void *ctx, struct engine_asked *ret_asked)
{
    struct trial *t = ctx;
    const bool was = t->wants_pause;
    t->wants_pause = false;
    if (was)
        *ret_asked = (struct engine_asked){.by = ""};
    return was;
}

void trial_ports(struct trial *t, struct engine_ports *ret_ports)
{
    *ret_ports =
        (struct engine_ports){.ctx = t,
                              .clk = clk_system(),
                              .cancel = t->cancel,
                              .opening = t->material->has_opening ? &t->material->opening : NULL,
                              .store_reading = store_reading,
                              .store_event = store_event,
                              .publish = publish,
                              .request_fit = request_fit,
                              .take_resume = take_resume,
                              .take_pause = take_pause};
}
