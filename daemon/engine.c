// SPDX-License-Identifier: MIT
#include "daemon/engine.h"

#include "base/units.h"
#include "campaign/bench.h"
#include "campaign/config.h"
#include "campaign/plan.h"
#include "campaign/plan_states.h"
#include "campaign/reduce_elements.h"
#include "campaign/store.h"
#include "daemon/acquire.h"
#include "daemon/engine_inside.h"
#include "daemon/instrument.h"
#include "daemon/instrument_devices.h"
#include "daemon/instrument_suspend.h"
#include "daemon/travel.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define ATTEMPTS_MORE 3  // attempts at a point: the ranges and these
#define MONITOR_LOST 0.5 // of the monitor after warm-up: below it the light is lost
#define STORE_RETRY_NS CLK_S(1)

const char *run_state_name(enum run_state s)
{
    switch (s) {
    case RUN_QUEUED: return "queued";
    case RUN_PREPARING: return "preparing";
    case RUN_RUNNING: return "running";
    case RUN_PAUSED: return "paused";
    case RUN_STOPPING: return "stopping";
    case RUN_STOPPED: return "stopped";
    case RUN_DONE: return "done";
    case RUN_FAILED: return "failed";
    }
    return "unknown";
}

// --- what is said -----------------------------------------------------------------------------

static double seconds_left(const struct engine *e)
{
    const int here = e->done - e->pace_done;
    if (!e->pace_ns || here < 3)
        return (double)NAN;
    const double s = (double)(clk_now_ns(e->ports->clk) - e->pace_ns) * 1e-9;
    return s / here * (e->plan->count - e->done);
}

static struct engine_event event_of(const struct engine *e, enum engine_event_kind kind,
                                    const char *text)
{
    const struct plan_point *p = e->point;
    struct engine_event event = {
        .kind = kind,
        .state = e->state,
        .sweep = p ? p->sweep : 0,
        .sweeps = e->plan->sweeps,
        .point = e->done,
        .points = e->plan->count,
        .theta_i_deg = p ? p->theta_i_deg : (double)NAN,
        .theta_r_deg = p ? p->theta_r_deg : (double)NAN,
        .f_per_sr = (double)NAN,
        .u_per_sr = (double)NAN,
        .left_s = seconds_left(e),
        .light = instrument_light_left(e->in),
        .wanted = e->wanted,
        .text = text,
    };
    memcpy(event.asks, e->asks, sizeof event.asks);
    return event;
}

void engine_say(struct engine *e, enum engine_event_kind kind, const char *level, const char *fmt,
                ...)
{
    char text[640];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    e->ports->store_event(e->ports->ctx, level, "engine", text, NULL);
    struct engine_event event = event_of(e, kind, text);
    e->ports->publish(e->ports->ctx, &event);
}

void engine_enter(struct engine *e, enum run_state state, const char *text)
{
    const bool bad = state == RUN_PAUSED || state == RUN_FAILED;
    char row[640];
    if (state == e->state && !text)
        return;
    e->state = state;
    snprintf(row, sizeof row, "%s%s%s", run_state_name(state), text ? ": " : "", text ? text : "");
    e->ports->store_event(e->ports->ctx, bad ? "warn" : "notice", "engine", row, NULL);
    const struct engine_event event = event_of(e, ENGINE_STATE, text);
    e->ports->publish(e->ports->ctx, &event);
}

// --- storing ----------------------------------------------------------------------------------

// The light is looked after meanwhile: an off that was not confirmed is repeated.
static void wait_to_store(struct engine *e)
{
    const int64_t until_ns = clk_now_ns(e->ports->clk) + STORE_RETRY_NS;
    while (clk_now_ns(e->ports->clk) < until_ns && engine_nap(e, CLK_MS(100)) == 0)
        instrument_reconnect(e->in);
    instrument_tend(e->in);
}

// The row is offered until it is accepted: nothing that was measured is lost, and nothing goes on
// before.
static int store(struct engine *e, const struct store_reading *row)
{
    const enum run_state before = e->state;
    int rc = e->ports->store_reading(e->ports->ctx, row, &e->why);
    if (rc != GON_E_STORE)
        return rc;
    char text[600];
    snprintf(text, sizeof text, "store: %.400s; the reading is kept and offered again each second",
             e->why.text);
    engine_make_safe(e);
    engine_enter_pause(e, text);
    while (rc == GON_E_STORE) {
        wait_to_store(e);
        rc = e->ports->store_reading(e->ports->ctx, row, &e->why);
        if (rc == GON_E_STORE && cancel_requested(e->ports->cancel))
            return engine_canceled(e);
    }
    if (rc >= 0)
        engine_enter(e, before, "the store takes readings again");
    return rc;
}

static double u_of_mean(double sd, int count)
{
    return count > 1 ? sd / sqrt(count) : 0.0;
}

static double analyser(const struct engine *e)
{
    double u_rel;
    const struct bench_config *bench = instrument_bench(e->in);
    const int in = e->point->pol_in;
    return reduce_analyser(&bench->polarisation, in, plan_beam_out(e->config, bench, in),
                           e->point->pol_out, &u_rel);
}

// Underfilled or overfilled f_r (formulas: campaign/reduce.h) with the opening references; the last
// word is reduce's.
static void provisional(const struct engine *e, const struct acquire_reading *r, double theta_i_deg,
                        double theta_r_deg, double *ret_f, double *ret_u)
{
    const struct engine_opening *o = &e->opening;
    const bool monitored = isfinite(r->monitor_v);
    const double signal_v = r->signal_v - o->dark_signal_v;
    const int in = e->point->pol_in;
    double u_rel;
    const double passes = bench_beam_passes(instrument_bench(e->in), &u_rel);
    const double beam = (o->beam_signal_v[in] - o->dark_signal_v) /
                        (monitored ? o->beam_monitor_v[in] - o->dark_monitor_v : 1.0);
    const double ratio =
        passes * signal_v / (monitored ? r->monitor_v - o->dark_monitor_v : 1.0) / beam;
    const double cosine = cos(
        units_rad(instrument_bench(e->in)->regime == BENCH_OVERFILLED ? theta_i_deg : theta_r_deg));
    const double u_signal_v = u_of_mean(r->signal_sd_v, r->count);
    const double u_monitor =
        monitored ? u_of_mean(r->monitor_sd_v, r->count) / (r->monitor_v - o->dark_monitor_v) : 0.0;
    *ret_f = ratio / (e->omega_sr * cosine * analyser(e));
    *ret_u = fabs(*ret_f) * hypot(u_signal_v / signal_v, u_monitor);
}

static void publish_reading(struct engine *e, const struct acquire_reading *r,
                            const struct travel_pose *at)
{
    struct engine_event event = event_of(e, ENGINE_READING, NULL);
    const struct kinematics_pose pose = kinematics_forward(instrument_kinematics(e->in), at->at);
    event.theta_i_deg = pose.theta_i;
    event.theta_r_deg = pose.theta_r;
    event.flags = r->flags;
    if (e->point->kind == PLAN_SAMPLE)
        provisional(e, r, event.theta_i_deg, event.theta_r_deg, &event.f_per_sr, &event.u_per_sr);
    e->ports->publish(e->ports->ctx, &event);
}

static void remember(struct engine *e, const struct acquire_reading *r)
{
    e->last_utc_ms = r->utc_ns / 1000000;
    if (e->point->kind == PLAN_DARK) {
        e->monitor_dark_v = r->monitor_v;
        e->opening.dark_signal_v = r->signal_v;
        e->opening.dark_monitor_v = r->monitor_v;
    } else if (e->point->kind == PLAN_BEAM) {
        e->opening.beam_signal_v[e->point->pol_in] = r->signal_v;
        e->opening.beam_monitor_v[e->point->pol_in] = r->monitor_v;
    }
}

// Homing, warm-up and beam say nothing about how long a point takes.
static void begin_pace(struct engine *e)
{
    if (e->pace_ns || e->point->kind != PLAN_SAMPLE)
        return;
    e->pace_ns = clk_now_ns(e->ports->clk);
    e->pace_done = e->done;
}

static struct store_reading row_of(const struct engine *e, const struct acquire_reading *r,
                                   const struct travel_pose *at)
{
    const struct kinematics_pose pose = kinematics_forward(instrument_kinematics(e->in), at->at);
    return (struct store_reading){
        .sweep = e->point->sweep,
        .point = e->point->point,
        .attempt = e->attempt,
        .t_utc_ms = r->utc_ns / 1000000,
        .theta_i_udeg = (int32_t)units_udeg(pose.theta_i),
        .theta_r_udeg = (int32_t)units_udeg(pose.theta_r),
        .signal_v = r->signal_v,
        .signal_sd_v = r->signal_sd_v,
        .monitor_v = r->monitor_v,
        .monitor_sd_v = r->monitor_sd_v,
        .count = r->count,
        .range = r->range,
        .flags = r->flags,
    };
}

// --- points -----------------------------------------------------------------------------------

static int prepare(struct engine *e)
{
    if (e->ready)
        return 0;
    const enum instrument_part lost = instrument_lost(e->in);
    int rc = lost < PART_COUNT ? instrument_connect(e->in, lost, &e->why) : 0;
    while (rc >= 0 && instrument_lost(e->in) < PART_COUNT)
        rc = instrument_connect(e->in, instrument_lost(e->in), &e->why);
    if (rc >= 0)
        rc = travel_home(e->in, e->ports->cancel, &e->why);
    e->devices_sweep = -1;
    e->ready = rc >= 0;
    e->pace_ns = 0;
    instrument_permit(e->in, e->ready);
    e->acquire =
        (struct acquire){.range = -1, .set_up = true}; // whoever was there may have turned it
    return rc;
}

// A dark needs no place: it is measured where the axes are, unless the plan says where. A filter
// that a station asks for is in before the axes go there, and out after they have left.
static int go_to(struct engine *e, struct travel_pose *ret_at)
{
    const struct plan_point *p = e->point;
    struct travel_pose pose = travel_stay();
    int rc = engine_station_places(e) ? engine_place_devices(e) : 0;
    if (rc >= 0)
        rc = engine_turn_elements(e);
    if (rc >= 0 && p->kind == PLAN_SAMPLE)
        rc = travel_to_sample(e->in, p->theta_i_deg, p->theta_r_deg, &pose, &e->why);
    else if (rc >= 0 && (p->kind != PLAN_DARK || p->station[0]))
        rc = travel_station(e->in, p->station, &pose, &e->why);
    if (rc >= 0)
        rc = travel_move(e->in, &pose, e->ports->cancel, ret_at, &e->why);
    return rc < 0 ? rc : engine_place_devices(e);
}

static int readings_of(const struct engine *e)
{
    switch (e->point->kind) {
    case PLAN_DARK: return e->config->dark_readings;
    case PLAN_BEAM: return e->config->beam_readings;
    default: return e->config->readings;
    }
}

// Why no further attempt is made at a reading that is not good.
static int no_more_attempts(struct engine *e, const struct acquire_reading *r)
{
    const char *unit = instrument_monitor_unit(e->in);
    if (r->flags & STORE_MONITOR_LOW) {
        int rc = engine_check_laser(e);
        return rc < 0 ? rc
                      : gon_fail(&e->why, GON_E_DEVICE,
                                 "laser: says it emits, but the monitor fell to %.4g %s from %.4g "
                                 "%s; look at shutter and monitor, then: gonio resume",
                                 r->monitor_v, unit, e->monitor_lit_v, unit);
    }
    if (r->monitor_failed)
        return gon_fail(&e->why, GON_E_DEVICE,
                        "monitor: beyond its range or unsettled in %d attempts; look at it and at "
                        "its full_scale in the bench file, then: gonio resume",
                        e->attempt);
    const char *what = r->flags & STORE_SATURATED  ? "saturated on its least sensitive range"
                       : r->flags & STORE_UNLOCKED ? "has no reference (chopper stopped?)"
                                                   : "gives no usable reading";
    return gon_fail(
        &e->why, GON_E_DEVICE,
        "detector: %s at theta_i %.2f deg, theta_r %.2f deg after %d attempts; mend it, "
        "then: gonio resume",
        what, e->point->theta_i_deg, e->point->theta_r_deg, e->attempt);
}

static double least_monitor_v(const struct engine *e)
{
    const double dark_v = isfinite(e->monitor_dark_v) ? e->monitor_dark_v : 0.0;
    return e->point->kind == PLAN_DARK ? (double)NAN
                                       : dark_v + MONITOR_LOST * (e->monitor_lit_v - dark_v);
}

static int measure(struct engine *e, const struct travel_pose *at)
{
    struct acquire_wish wish = {.count = readings_of(e), .monitor_least_v = least_monitor_v(e)};
    const int most = instrument_ranges(e->in) + ATTEMPTS_MORE;
    struct acquire_reading r = {0};
    acquire_begin(&e->acquire);
    e->sought = 0;
    for (int k = 0; k < most; k++) {
        wish.since_ns = e->light_ns;
        wish.source_ns = e->source_ns;
        int rc = acquire_attempt(e->in, &e->acquire, &wish, e->ports->cancel, &r, &e->why);
        if (rc >= 0)
            rc = engine_confirm_devices(e, &r);
        if (rc < 0)
            return rc;
        if (e->lit && (rc = engine_heed_guard(e)) < 0)
            return rc; // it went dark meanwhile: no reading
        e->attempt++;
        const int sure = engine_verify(e, at, &r);
        const struct gon_error why = e->why;
        const struct store_reading row = row_of(e, &r, at);
        if (r.accepted)
            engine_freshen(e); // before a pause of the store, which is a gap
        rc = store(e, &row);
        if (rc < 0)
            return rc;
        if (r.accepted) {
            remember(e, &r);
            e->done += !e->referring;
            begin_pace(e);
        }
        publish_reading(e, &r, at);
        if (r.monitor_failed)
            engine_say(e, ENGINE_LOG, "notice",
                       "monitor: beyond its range or unsettled; the reading is discarded");
        if (sure < 0) {
            e->why = why;
            return sure;
        }
        rc = e->ready ? engine_seek_device(e) : 0;
        if (rc < 0)
            return rc;
        if (r.accepted || !r.again)
            break;
        if (!e->ready) // the store paused the run: light and axes first
            return ENGINE_AGAIN;
    }
    return r.accepted ? 0 : no_more_attempts(e, &r);
}

int engine_do_point(struct engine *e)
{
    struct travel_pose at;
    e->interrupt = (struct gon_error){.code = GON_OK};
    e->suspended = false;
    if (cancel_requested(e->ports->cancel))
        return engine_canceled(e);
    if (engine_pause_asked(e))
        return engine_operator_paused(e);
    e->heeding = true;
    int rc = engine_suspended(e);
    instrument_steady(e->in, false);
    if (rc >= 0)
        rc = engine_operator_steps(e);
    if (rc == ENGINE_AGAIN)
        return rc;
    e->heeding = true; // again, after a wait for somebody
    if (rc >= 0)
        rc = prepare(e);
    if (rc >= 0)
        rc = instrument_watch_inputs(e->in, &e->why);
    if (rc >= 0 && !e->lit && e->point->kind != PLAN_DARK && instrument_bench(e->in)->devices_count)
        rc = go_to(e, &at); // out of the beam, or with its filter, before there is light
    if (rc >= 0)
        rc = engine_light_for(e);
    if (rc >= 0)
        rc = engine_watch_laser(e);
    if (rc >= 0)
        rc = go_to(e, &at);
    if (rc < 0)
        return rc;
    if (e->point->kind == PLAN_SAMPLE)
        engine_enter(e, RUN_RUNNING, NULL);
    if (e->point->kind == PLAN_BEAM) // the brightest there is
        e->acquire.range = -1;
    if (at.still_ns > e->light_ns)
        e->light_ns = at.still_ns;
    instrument_steady(e->in, e->lit && !e->dark);
    return measure(e, &at);
}

static void sweep_done(struct engine *e, const struct plan_point *next)
{
    const struct plan_point *p = e->point;
    if (p->kind != PLAN_SAMPLE || (next && next->sweep == p->sweep))
        return;
    engine_say(e, ENGINE_SWEEP, "notice", "sweep %d of %d is measured (theta_i %.2f deg)", p->sweep,
               e->plan->sweeps, p->theta_i_deg);
    e->ports->request_fit(e->ports->ctx, p->sweep, false);
}

// --- the run ----------------------------------------------------------------------------------

static const struct plan_point *next_point(const struct plan *plan, const struct plan_point *after)
{
    const struct plan_point *end = plan->points + plan->count;
    const struct plan_point *p = after ? after + 1 : plan->points;
    while (p < end && p->done)
        p++;
    return p < end ? p : NULL;
}

// Until the point is done: 0; or GON_E_CANCELED, or what cannot be waited out.
static int see_through(struct engine *e)
{
    for (;;) {
        int rc = engine_refer(e);
        if (rc >= 0)
            rc = engine_do_point(e);
        rc = engine_interrupted(e, rc);
        e->heeding = false;
        if (rc == ENGINE_AGAIN)
            continue;
        if (rc >= 0) {
            e->returns = e->tries = 0;
            return 0;
        }
        if (rc == GON_E_CANCELED || rc == GON_E_INPUT || rc == GON_E_SYSTEM)
            return rc;
        rc = engine_pause_run(e);
        if (rc < 0)
            return rc;
    }
}

static int run_points(struct engine *e)
{
    const struct plan_point *next = next_point(e->plan, NULL);
    while (next) {
        e->point = next;
        e->attempt = next->attempts;
        int rc = see_through(e);
        if (rc < 0)
            return rc;
        engine_keep_attempt(e);
        next = next_point(e->plan, e->point);
        sweep_done(e, next);
    }
    return 0;
}

static enum run_state finish(struct engine *e, int rc, struct gon_error *err)
{
    char text[700];
    if (rc < 0)
        engine_enter(e, RUN_STOPPING, NULL);
    engine_make_safe(e);
    if (rc == GON_E_CANCELED) {
        snprintf(text, sizeof text, "%s; go on with: gonio resume", engine_light_text(e));
        engine_enter(e, RUN_STOPPED, text);
    } else if (rc < 0) {
        snprintf(text, sizeof text, "%s; %s", e->why.text, engine_light_text(e));
        engine_enter(e, RUN_FAILED, text);
        if (err)
            *err = e->why;
    } else {
        e->ports->request_fit(e->ports->ctx, e->plan->sweeps, true);
        snprintf(text, sizeof text, "every point is measured; %s", engine_light_text(e));
        engine_enter(e, RUN_DONE, text);
    }
    return e->state;
}

enum run_state engine_run(const struct engine_ports *ports, struct instrument *instrument,
                          const struct campaign_config *config, const struct plan *plan,
                          struct gon_error *err)
{
    const struct bench_config *bench = instrument_bench(instrument);
    struct engine e = {
        .ports = ports,
        .in = instrument,
        .config = config,
        .plan = plan,
        .state = RUN_QUEUED,
        .stepped = -1,
        .acquire = {.range = -1},
        .omega_sr = bench_omega_sr(bench),
        .monitor_dark_v = (double)NAN,
        .monitor_lit_v = (double)NAN,
        .opening = {.dark_signal_v = (double)NAN, .dark_monitor_v = (double)NAN},
    };
    for (int i = 0; i < POL_COUNT; i++)
        e.opening.beam_signal_v[i] = e.opening.beam_monitor_v[i] = (double)NAN;
    if (ports->opening) {
        e.opening = *ports->opening;
        e.monitor_dark_v = e.opening.dark_monitor_v;
        e.last_utc_ms = e.opening.last_utc_ms;
    }
    engine_begin_gap(&e);
    engine_count_attempts(&e);
    for (int i = 0; i < plan->count; i++)
        e.done += plan->points[i].done;
    instrument_obey(instrument, ports->cancel);
    instrument_permit(instrument, false); // what the guard did before is past
    instrument_heed(instrument, engine_heed, &e);
    instrument_release(instrument); // whoever starts it has seen to the bench
    engine_enter(&e, RUN_PREPARING, NULL);
    const enum run_state ended = finish(&e, run_points(&e), err);
    instrument_heed(instrument, NULL, NULL);
    instrument_obey(instrument, NULL);
    return ended;
}
