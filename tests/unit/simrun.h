// SPDX-License-Identifier: MIT
// The engine's surroundings for tests: simbench's world in virtual time, rows kept in memory, a
// script of what happens meanwhile, and a watch over what must never happen. Include after
// cmocka.h.
#pragma once
#include "daemon/engine.h"

#include "base/units.h"
#include "campaign/config.h"
#include "campaign/plan.h"
#include "campaign/store.h"
#include "tests/unit/simbench.h"
#include "tests/unit/simconfig.h"
#include "tests/unit/simdevices.h"

enum { ROWS_MOST = 4000, TEXTS_MOST = 400 };

struct run {
    struct simbench b;
    struct simdevices devices; // those that the bench names
    struct bench_config bench;
    struct instrument *in;
    struct campaign_config config;
    struct plan plan;
    struct plan_point points[1000];
    struct cancel *cancel;
    struct engine_ports ports;

    struct store_reading row[ROWS_MOST];
    int rows;
    char pauses[TEXTS_MOST][300];
    int pauses_count, states_count;
    enum run_state state;
    int fits, last_fits, sweeps_told;
    double f_per_sr[1000]; // provisional, by plan index

    // the script
    bool auto_resume, want_resume, want_pause;
    struct engine_asked asked; // of the next pause
    int store_fails; // so many times in a row, from row store_fail_at on
    int store_fail_at;
    bool store_carries_out;        // and the row is there nevertheless
    void (*on_row)(struct run *r); // after each row
    void (*on_pause)(struct run *r);
    int64_t cancel_at_ns;
    void (*on_time)(struct run *r);
    bool strayed; // what on_time had to do once is done

    // what must never happen
    int violations;
    char violation[200];
};

static inline void violate(struct run *r, const char *what)
{
    if (r->violations++ == 0)
        snprintf(r->violation, sizeof r->violation, "%s at t = %.3f s, call %ld", what,
                 (double)r->b.clk.t_ns * 1e-9, r->b.calls);
}

static inline bool emits(struct run *r)
{
    world_see(&r->b.world, r->b.clk.t_ns);
    return sim_laser_emits(&r->b.world.laser);
}

// Light that a shutter lets out.
static inline bool is_lit(struct run *r)
{
    return emits(r) && r->b.world.lets_out > 0;
}

// A laser that was unplugged can be told again once it is back and its reopening, 2 s apart, was
// due.
static inline bool laser_reachable(const struct run *r)
{
    const int64_t gone_ns = r->b.gone_until_ns[SIMBENCH_LASER];
    return !(gone_ns && r->b.clk.t_ns < gone_ns + CLK_S(2.3)) && !r->b.world.laser.ignores_off;
}

static inline bool at_rest(enum run_state s)
{
    return s == RUN_PAUSED || s == RUN_STOPPED || s == RUN_DONE || s == RUN_FAILED ||
           s == RUN_QUEUED;
}

static inline const struct plan_point *point_of(const struct run *r, int sweep, int point)
{
    for (int i = 0; i < r->plan.count; i++)
        if (r->points[i].sweep == sweep && r->points[i].point == point)
            return &r->points[i];
    return NULL;
}

static inline bool is_accepted(const struct store_reading *row)
{
    return !(row->flags & STORE_REJECTING);
}

// --- ports ------------------------------------------------------------------------------------

static inline bool same_row(const struct store_reading *a, const struct store_reading *b)
{
    return a->sweep == b->sweep && a->point == b->point && a->attempt == b->attempt;
}

static inline void keep(struct run *r, const struct store_reading *row)
{
    const struct plan_point *p = point_of(r, row->sweep, row->point);
    for (int i = 0; i < r->rows; i++)
        if (same_row(&r->row[i], row)) {
            if (memcmp(&r->row[i], row, sizeof *row) != 0)
                violate(r, "a row came twice and differs");
            return;
        }
    if (r->rows > 0 && is_accepted(&r->row[r->rows - 1]) && p->kind == PLAN_SAMPLE &&
        p == point_of(r, r->row[r->rows - 1].sweep, r->row[r->rows - 1].point))
        violate(r, "a point was measured again after it was accepted");
    if (p->kind == PLAN_DARK && is_accepted(row) && is_lit(r))
        violate(r, "a dark with light");
    if (p->kind != PLAN_DARK && is_accepted(row) && r->state != RUN_PAUSED && !is_lit(r))
        violate(r, "light was expected");
    if (!isfinite(row->signal_v))
        violate(r, "not a number was stored");
    r->row[r->rows++] = *row;
}

static inline int port_store(void *ctx, const struct store_reading *row, struct gon_error *err)
{
    struct run *r = ctx;
    if (r->store_fails > 0 && r->rows >= r->store_fail_at) {
        r->store_fails--;
        if (r->store_carries_out)
            keep(r, row);
        return gon_fail(err, GON_E_STORE, "disk full");
    }
    keep(r, row);
    if (r->on_row)
        r->on_row(r);
    return 0;
}

static inline int port_event(void *ctx, const char *level, const char *source, const char *text,
                             struct gon_error *err)
{
    (void)ctx, (void)level, (void)source, (void)err;
    assert_true(strlen(text) > 0);
    return 0;
}

// What is said of the light: off only when that was read back, and a warning when it is on.
static inline void check_words(struct run *r, const struct engine_event *event)
{
    struct instrument_snapshot s;
    const bool warned = strstr(event->text, "LASER MAY BE ON"),
               denied = strstr(event->text, "laser off");
    instrument_snapshot(r->in, &s);
    if (denied && (emits(r) || s.off_unconfirmed))
        violate(r, "called off without knowing");
    if (emits(r) && !warned)
        violate(r, "light without a warning");
    if (warned && !s.emission)
        violate(r, "a warning without a reason");
}

static inline void port_publish(void *ctx, const struct engine_event *event)
{
    struct run *r = ctx;
    if (event->kind == ENGINE_SWEEP)
        r->sweeps_told++;
    if (event->kind == ENGINE_READING && isfinite(event->f_per_sr) &&
        !(event->flags & STORE_REJECTING))
        r->f_per_sr[event->point - 1] = event->f_per_sr;
    if (event->kind != ENGINE_STATE)
        return;
    r->state = event->state;
    r->states_count++;
    if (at_rest(event->state) && event->state != RUN_QUEUED)
        check_words(r, event);
    if (at_rest(event->state) && laser_reachable(r) && emits(r))
        violate(r, "laser on at rest");
    if (event->state == RUN_PAUSED) {
        assert_true(r->pauses_count < TEXTS_MOST);
        snprintf(r->pauses[r->pauses_count++], sizeof r->pauses[0], "%s", event->text);
        if (r->on_pause)
            r->on_pause(r);
    }
}

static inline void port_fit(void *ctx, int sweep, bool last)
{
    struct run *r = ctx;
    (void)sweep;
    r->fits++;
    r->last_fits += last;
}

static inline bool port_resume(void *ctx)
{
    struct run *r = ctx;
    bool now = r->auto_resume || r->want_resume;
    r->want_resume = false;
    if (now)
        simbench_arm(r->in);
    return now;
}

static inline bool port_pause(void *ctx, struct engine_asked *ret_asked)
{
    struct run *r = ctx;
    bool now = r->want_pause;
    r->want_pause = false;
    if (now)
        *ret_asked = r->asked;
    return now;
}

static inline void advanced(void *ctx, int64_t t_ns)
{
    struct run *r = ctx;
    if (r->cancel_at_ns && t_ns >= r->cancel_at_ns)
        cancel_request(r->cancel);
    if (at_rest(r->state) && laser_reachable(r) && emits(r))
        violate(r, "laser on at rest");
    if (r->on_time)
        r->on_time(r);
}

// --- a run ------------------------------------------------------------------------------------

static inline void add_point(struct run *r, int sweep, int point, enum plan_kind kind,
                             double theta_i, double theta_r)
{
    struct plan_point *p = &r->points[r->plan.count++];
    *p = (struct plan_point){.sweep = sweep,
                             .point = point,
                             .kind = kind,
                             .theta_i_deg = theta_i,
                             .theta_r_deg = theta_r};
    snprintf(p->station, sizeof p->station, "%s",
             kind == PLAN_DARK   ? "park"
             : kind == PLAN_BEAM ? "beam"
                                 : "");
}

// Two sweeps of five points between the reference readings.
static inline void small_plan(struct run *r)
{
    static const double theta_i[2] = {10, 45}, theta_r[5] = {-40, 0, 10, 45, 80};
    r->plan = (struct plan){.points = r->points, .sweeps = 2};
    add_point(r, 0, 1, PLAN_DARK, 0, 0);
    add_point(r, 0, 2, PLAN_BEAM, 0, 180);
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 5; k++)
            add_point(r, i + 1, k + 1, PLAN_SAMPLE, theta_i[i], theta_r[k]);
    add_point(r, 3, 1, PLAN_BEAM, 0, 180);
    add_point(r, 3, 2, PLAN_DARK, 0, 0);
}

// The shortest that has everything.
static inline void tiny_plan(struct run *r)
{
    r->plan = (struct plan){.points = r->points, .sweeps = 1};
    add_point(r, 0, 1, PLAN_DARK, 0, 0);
    add_point(r, 0, 2, PLAN_BEAM, 0, 180);
    add_point(r, 1, 1, PLAN_SAMPLE, 30, -20);
    add_point(r, 1, 2, PLAN_SAMPLE, 30, 30);
    add_point(r, 2, 1, PLAN_BEAM, 0, 180);
    add_point(r, 2, 2, PLAN_DARK, 0, 0);
}

static inline void quick_laser(struct world_spec *spec)
{
    spec->laser.temperatures_s = 0.5;
    spec->laser.warmup_s = 5;
}

static inline struct run *begin_on(const struct world_spec *spec, const struct bench_config *bench)
{
    struct run *r = calloc(1, sizeof *r);
    simbench_init_world(&r->b, spec);
    r->b.clk.on_advance = advanced;
    r->b.clk.ctx = r;
    r->bench = *bench;
    r->config.readings = 4;
    r->config.dark_readings = 8;
    r->config.beam_readings = 8;
    r->cancel = cancel_new();
    r->auto_resume = true;
    r->ports = (struct engine_ports){.ctx = r,
                                     .clk = &r->b.clk.clk,
                                     .cancel = r->cancel,
                                     .store_reading = port_store,
                                     .store_event = port_event,
                                     .publish = port_publish,
                                     .request_fit = port_fit,
                                     .take_resume = port_resume,
                                     .take_pause = port_pause};
    struct instrument_parts parts = simbench_parts(&r->b);
    if (*bench->monitor.driver || bench->devices_count) {
        simdevices_init(&r->devices, &r->b);
        simdevices_parts(&r->devices, &r->bench, &parts);
    }
    assert_int_equal(instrument_new(&r->bench, &parts, &r->b.clk.clk, &r->in, NULL), 0);
    simbench_arm(r->in);
    return r;
}

static inline struct run *begin(void (*tune)(struct world_spec *spec))
{
    struct world_spec spec;
    struct bench_config bench;
    world_defaults(&spec);
    (tune ? tune : quick_laser)(&spec);
    simconfig_bench(&bench);
    bench.laser.warmup_s = 5;
    struct run *r = begin_on(&spec, &bench);
    small_plan(r);
    return r;
}

static inline enum run_state go(struct run *r)
{
    struct gon_error err = {0};
    enum run_state s = engine_run(&r->ports, r->in, &r->config, &r->plan, &err);
    if (s == RUN_FAILED)
        print_error("failed: %s\n", err.text);
    if (emits(r) && laser_reachable(r))
        violate(r, "laser on after the end");
    for (int i = 0; i < WORLD_AXES; i++)
        if (motion_at(&r->b.world.axis[i], r->b.clk.t_ns + CLK_S(1)).moving)
            violate(r, "an axis moves after the end");
    return s;
}

static inline void end(struct run *r)
{
    const int violations = r->violations;
    if (violations)
        print_error("%s\n", r->violation);
    const int64_t gap_ns = safety_worst_gap_ns(instrument_safety(r->in));
    instrument_free(r->in);
    cancel_free(r->cancel);
    free(r);
    assert_int_equal(violations, 0);
    assert_true(gap_ns <= CLK_MS(SAFETY_TICK_MOST_MS));
}

static inline int accepted_of(const struct run *r, const struct plan_point *p)
{
    int n = 0;
    for (int i = 0; i < r->rows; i++)
        n += r->row[i].sweep == p->sweep && r->row[i].point == p->point && is_accepted(&r->row[i]);
    return n;
}

// References may be measured again after a gap.
static inline void assert_complete(struct run *r)
{
    for (int i = 0; i < r->plan.count; i++)
        if (accepted_of(r, &r->points[i]) < 1 ||
            (r->points[i].kind == PLAN_SAMPLE && accepted_of(r, &r->points[i]) > 1)) {
            print_error("sweep %d point %d has %d accepted readings\n", r->points[i].sweep,
                        r->points[i].point, accepted_of(r, &r->points[i]));
            fail();
        }
    for (int i = 0; i < r->rows; i++) { // attempts count up from 1 without a gap
        int last = 0;
        for (int k = 0; k < i; k++)
            if (r->row[k].sweep == r->row[i].sweep && r->row[k].point == r->row[i].point)
                last = r->row[k].attempt;
        assert_int_equal(r->row[i].attempt, last + 1);
    }
}

static inline double f_of(const struct run *r, const struct plan_point *p)
{
    const struct world_spec *w = &r->b.world.spec;
    return optics_f_per_sr(&w->optics, p->theta_i_deg, p->theta_r_deg);
}
