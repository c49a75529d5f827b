// SPDX-License-Identifier: MIT
#include "daemon/runner.h"

#include "base/cancel.h"
#include "base/clk.h"
#include "base/log.h"
#include "campaign/store.h"
#include "daemon/align.h"
#include "daemon/arm.h"
#include "daemon/engine.h"
#include "daemon/instrument.h"
#include "daemon/instrument_suspend.h"
#include "daemon/material.h"
#include "daemon/note.h"
#include "daemon/travel.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>

enum { SLICE_MS = 50, IDLE_MS = 1000 };
#define SNAPSHOT_NS CLK_S(0.5)
#define STORE_PATIENCE_NS CLK_S(10)
#define STOPPED_PATIENCE_NS CLK_S(1) // once a stop is asked for: the light goes off first

struct runner {
    struct runner_links links;
    pthread_t thread;
    struct instrument *in;
    int run;                 // in progress; 0: none
    uint64_t sequence;       // of the last note that the store must acknowledge
    uint64_t acknowledged;   // the newest acknowledged
    struct gon_error answer; // to that one
    bool reading_open;       // the last reading was posted and not yet acknowledged
    struct store_reading reading;
    bool pause, resume, ack, halt, quit;
    char acked_by[300];
    struct engine_asked asked; // of that pause
    uint64_t arm_changes;      // of the arm, as told
    struct align align;
    uint64_t align_changes;   // of it, as told
    struct note *align_asked; // held until the thread is idle
    struct note *start;       // the next run, held until the thread is idle
    int64_t next_snapshot_ns; // not before every part was asked once
    bool may_be_on;           // of the laser, at the thread's end
};

// --- the arm -------------------------------------------------------------------------------------

static void tell_arm(struct runner *r, uint64_t ticket, const struct gon_error *err)
{
    struct note *n = note_new(NOTE_ARMED);
    struct arm *copy = malloc(sizeof *copy);
    if (copy)
        *copy = *instrument_arm(r->in);
    n->ticket = ticket;
    n->thing = copy;
    if (err)
        n->err = *err;
    note_post(r->links.to_main, n);
}

static void change_arm(struct runner *r, const struct note *n)
{
    struct arm *arm = instrument_arm(r->in);
    const int64_t now_ns = instrument_now_ns(r->in), utc_ms = instrument_utc_ns(r->in) / 1000000;
    struct gon_error err = {0};
    if (n->letter.kind == NOTE_ARM)
        arm_set(arm, n->name, n->text, n->for_s, now_ns, utc_ms, &err);
    else if (n->letter.kind == NOTE_EXTEND)
        arm_extend(arm, n->name, n->text, n->for_s, now_ns, utc_ms, &err);
    else
        arm_end(arm, n->text);
    if (n->ticket)
        tell_arm(r, n->ticket, &err);
}

static void tell_align(struct runner *r, uint64_t ticket, const struct gon_error *err)
{
    struct note *n = note_new(NOTE_ALIGNED);
    struct align *copy = malloc(sizeof *copy);
    if (copy)
        *copy = r->align;
    n->ticket = ticket;
    n->thing = copy;
    if (err)
        n->err = *err;
    note_post(r->links.to_main, n);
}

// Only an idle thread may talk to the laser for it.
static void ask_align(struct runner *r, struct note *n)
{
    struct gon_error err;
    if (!r->run && !r->start && !r->align_asked) {
        r->align_asked = n;
        return;
    }
    gon_fail(&err, GON_E_REFUSED, "a run has the bench; see: gonio status");
    tell_align(r, n->ticket, &err);
    note_free(n);
}

// --- what the others say -------------------------------------------------------------------------

static void take(struct runner *r, struct note *n)
{
    switch ((enum note_kind)n->letter.kind) {
    case NOTE_QUIT: r->quit = true; break;
    case NOTE_PAUSE:
        r->asked.now = (r->pause && r->asked.now) || n->last;
        snprintf(r->asked.by, sizeof r->asked.by, "%s", n->text ? n->text : "");
        r->pause = true;
        break;
    case NOTE_ACK:
        r->ack = true;
        snprintf(r->acked_by, sizeof r->acked_by, "%s", n->text ? n->text : "");
        break;
    case NOTE_RESUME: r->resume = true; break;
    case NOTE_HALT: r->halt = true; break;
    case NOTE_STORED:
        r->acknowledged = n->sequence;
        r->answer = n->err;
        break;
    case NOTE_ARM:
    case NOTE_EXTEND:
    case NOTE_DISARM: change_arm(r, n); break;
    case NOTE_ALIGN: ask_align(r, n); return;
    case NOTE_START: r->start = n; return;
    default: break;
    }
    note_free(n);
}

static void take_all(struct runner *r)
{
    for (struct note *n; (n = note_take(r->links.box));)
        take(r, n);
}

static void send_snapshot(struct runner *r)
{
    struct note *n = note_new(NOTE_SNAPSHOT);
    struct instrument_snapshot *s = calloc(1, sizeof *s);
    if (s)
        instrument_snapshot(r->in, s);
    n->thing = s;
    note_post(r->links.to_main, n);
}

// Events are committed in order with the readings; nobody waits for them.
static int store_event_port(void *ctx, const char *level, const char *source, const char *text,
                            struct gon_error *err)
{
    struct runner *r = ctx;
    struct note *n = note_new(NOTE_EVENT);
    (void)err;
    n->run = r->run;
    n->level = level;
    n->source = source;
    n->text = note_text(text);
    note_post(r->links.to_store, n);
    return GON_OK;
}

// In the file too, while a run has the bench.
static void watch_arm(struct runner *r)
{
    const struct arm *arm = instrument_arm(r->in);
    char text[ARM_NAME + ARM_END + ARM_REASON + 40];
    if (arm->changes == r->arm_changes)
        return;
    r->arm_changes = arm->changes;
    tell_arm(r, 0, NULL);
    arm_describe(arm, text, sizeof text);
    if (r->run)
        store_event_port(r, "notice", "laser", text, NULL);
}

// Between the slices of every wait.
static void watch(void *ctx)
{
    struct runner *r = ctx;
    int64_t now_ns = clk_now_ns(clk_system());
    take_all(r);
    watch_arm(r);
    if (now_ns < r->next_snapshot_ns)
        return;
    r->next_snapshot_ns = now_ns + SNAPSHOT_NS;
    send_snapshot(r);
}

// --- the engine's ports --------------------------------------------------------------------------

static bool same_reading(const struct store_reading *a, const struct store_reading *b)
{
    return a->sweep == b->sweep && a->point == b->point && a->attempt == b->attempt;
}

static int wait_stored(struct runner *r, struct gon_error *err)
{
    int64_t end_ns = clk_now_ns(clk_system()) + STORE_PATIENCE_NS;
    while (r->acknowledged != r->sequence) {
        struct note *n = note_wait(r->links.box, SLICE_MS);
        if (n)
            take(r, n);
        const bool interrupted = instrument_interrupted(r->in);
        if ((interrupted || cancel_requested(r->links.cancel)) &&
            end_ns > clk_now_ns(clk_system()) + STOPPED_PATIENCE_NS)
            end_ns = clk_now_ns(clk_system()) + STOPPED_PATIENCE_NS;
        if (clk_now_ns(clk_system()) > end_ns)
            return gon_fail(err, GON_E_STORE,
                            "store: no acknowledgement for 10 s; is the disk full, slow or gone?");
    }
    if (r->answer.code && err)
        *err = r->answer;
    return r->answer.code;
}

// A row that was not acknowledged in time is offered again by the engine: then its answer is waited
// for once more, and only a refused one is sent again.
static int store_reading_port(void *ctx, const struct store_reading *reading, struct gon_error *err)
{
    struct runner *r = ctx;
    if (!r->reading_open || !same_reading(reading, &r->reading)) {
        struct note *n = note_new(NOTE_READING);
        struct store_reading *row = malloc(sizeof *row);
        if (!row) {
            note_free(n);
            return gon_fail(err, GON_E_STORE, "store: out of memory");
        }
        *row = r->reading = *reading;
        n->run = r->run;
        n->thing = row;
        n->sequence = ++r->sequence;
        r->reading_open = true;
        note_post(r->links.to_store, n);
    }
    int rc = wait_stored(r, err);
    if (r->acknowledged == r->sequence)
        r->reading_open = false;
    return rc;
}

static void publish_port(void *ctx, const struct engine_event *event)
{
    struct runner *r = ctx;
    struct note *n = note_new(NOTE_HAPPENED);
    if (event->kind == ENGINE_STATE) // what is said of the devices is as new as the state
        send_snapshot(r);
    n->run = r->run;
    n->event = *event;
    n->text = note_text(event->text);
    n->event.text = n->text;
    n->sweep = r->reading.sweep;
    n->point = r->reading.point;
    note_post(r->links.to_main, n);
}

static void request_fit_port(void *ctx, int sweep, bool last)
{
    struct runner *r = ctx;
    struct note *n = note_new(NOTE_FIT_ASKED);
    n->run = r->run;
    n->sweep = sweep;
    n->last = last;
    note_post(r->links.to_main, n);
}

static bool take_flag(struct runner *r, bool *flag)
{
    take_all(r);
    bool was = *flag;
    *flag = false;
    return was;
}

static bool take_resume_port(void *ctx)
{
    struct runner *r = ctx;
    return take_flag(r, &r->resume);
}

static bool take_pause_port(void *ctx, struct engine_asked *ret_asked)
{
    struct runner *r = ctx;
    if (!take_flag(r, &r->pause))
        return false;
    *ret_asked = r->asked;
    return true;
}

static bool take_ack_port(void *ctx, char *ret_by, size_t size)
{
    struct runner *r = ctx;
    if (!take_flag(r, &r->ack))
        return false;
    snprintf(ret_by, size, "%s", r->acked_by);
    return true;
}

// --- the disk ------------------------------------------------------------------------------------

static double free_mb(void *ctx)
{
    const struct runner *r = ctx;
    struct statvfs s;
    return statvfs(r->links.directory, &s) < 0 ? (double)NAN
                                               : (double)s.f_bavail * (double)s.f_frsize * 1e-6;
}

// --- the thread ----------------------------------------------------------------------------------

static void run(struct runner *r)
{
    struct note *start = r->start, *n = note_new(NOTE_ENDED);
    struct run_material *m = start->thing;
    r->start = NULL;
    r->run = start->run;
    r->pause = r->resume = r->ack = r->reading_open = false;
    struct engine_ports ports = {
        .ctx = r,
        .clk = clk_system(),
        .cancel = r->links.cancel,
        .opening = m->has_opening ? &m->opening : NULL,
        .store_reading = store_reading_port,
        .store_event = store_event_port,
        .publish = publish_port,
        .request_fit = request_fit_port,
        .take_resume = take_resume_port,
        .take_pause = take_pause_port,
        .take_ack = take_ack_port,
    };
    r->arm_changes = 0; // who armed it before belongs into this file as well
    watch_arm(r);
    n->run = r->run;
    n->state = engine_run(&ports, r->in, &m->config, &m->plan, &n->err);
    r->run = 0;
    send_snapshot(r);
    note_post(r->links.to_main, n);
    note_free(start);
}

static void halt(struct runner *r)
{
    struct note *n = note_new(NOTE_HALTED);
    struct gon_error axes = {0};
    int rc = instrument_emission_off(r->in, &n->err);
    if (travel_stop(r->in, &axes) < 0 && rc == 0)
        n->err = axes;
    r->halt = false;
    send_snapshot(r);
    note_post(r->links.to_main, n);
}

static void begin_align(struct runner *r)
{
    struct note *n = r->align_asked;
    struct gon_error err = {0};
    const struct bench_laser *l = &r->links.bench->laser;
    int rc = align_may(&r->align, l, n->power_w, n->for_s, &err);
    if (rc >= 0 && l->arm == BENCH_ARM_RUN) // a person's own command
        rc = arm_extend(instrument_arm(r->in), n->name, "alignment", n->for_s,
                        instrument_now_ns(r->in), instrument_utc_ns(r->in) / 1000000, &err);
    if (rc >= 0)
        align_begin(&r->align, r->in, n->name, n->power_w, n->for_s, &err);
    r->align_asked = NULL;
    tell_align(r, n->ticket, &err);
    note_free(n);
}

// A run and a stop end a session; other devices are not tended meanwhile: bringing one back may take
// longer than the laser's lease.
static void mind_align(struct runner *r)
{
    if (r->start || r->halt)
        align_end(&r->align, r->in, r->start ? "a run begins" : "stopped");
    align_step(&r->align, r->in);
    if (r->align.changes == r->align_changes)
        return;
    r->align_changes = r->align.changes;
    tell_align(r, 0, NULL);
}

static void idle(struct runner *r)
{
    int64_t tend_ns = 0;
    const int most_ms = r->links.bench->devices_count ? SLICE_MS : IDLE_MS; // relays to be kept
    while (!r->quit) {
        int64_t now_ns = clk_now_ns(clk_system());
        mind_align(r);
        if (r->start) {
            run(r);
            tend_ns = clk_now_ns(clk_system()) + CLK_MS(IDLE_MS); // an end that waits goes first
        } else if (r->halt) {
            halt(r);
        } else if (r->align_asked) {
            begin_align(r);
        } else if (now_ns >= tend_ns && !r->align.running) {
            instrument_tend(r->in);
            send_snapshot(r);
            r->next_snapshot_ns = now_ns + SNAPSHOT_NS;
            tend_ns = now_ns + CLK_MS(IDLE_MS);
        } else {
            const int left_ms =
                r->align.running ? SLICE_MS : (int)((tend_ns - now_ns) / 1000000) + 1;
            struct note *n = note_wait(r->links.box, left_ms < most_ms ? left_ms : most_ms);
            if (n)
                take(r, n);
            instrument_breathe(r->in);
        }
    }
}

static void *thread_main(void *ctx)
{
    struct runner *r = ctx;
    struct note *failed = note_new(NOTE_ENDED);
    pthread_setname_np(pthread_self(), "instrument");
    int rc = instrument_open(r->links.bench, r->links.guard, clk_system(), &r->in, &failed->err);
    if (rc < 0) {
        note_post(r->links.to_main, failed); // run 0: the bench itself
        return NULL;
    }
    note_free(failed);
    r->next_snapshot_ns = INT64_MAX;
    instrument_watch(r->in, watch, r);
    instrument_disk(r->in, free_mb, r);
    idle(r);
    note_free(r->start);
    note_free(r->align_asked);
    r->may_be_on = !instrument_free(r->in); // laser off, axes stopped
    return NULL;
}

int runner_start(const struct runner_links *links, struct runner **ret_runner,
                 struct gon_error *err)
{
    struct runner *r = calloc(1, sizeof *r);
    if (!r)
        return gon_fail(err, GON_E_SYSTEM, "instrument thread: out of memory");
    r->links = *links;
    int failed = pthread_create(&r->thread, NULL, thread_main, r);
    if (failed) {
        free(r);
        return gon_fail(err, GON_E_SYSTEM, "instrument thread: %s", strerror(failed));
    }
    (void)pthread_setname_np(r->thread, "instrument"); // for top -H and debuggers
    *ret_runner = r;
    return GON_OK;
}

bool runner_join(struct runner *r)
{
    if (!r)
        return false;
    pthread_join(r->thread, NULL);
    bool may_be_on = r->may_be_on;
    free(r);
    return may_be_on;
}
