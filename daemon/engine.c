// SPDX-License-Identifier: MIT
#include "daemon/engine.h"

#include "base/units.h"
#include "campaign/bench.h"
#include "campaign/config.h"
#include "campaign/plan.h"
#include "campaign/store.h"
#include "daemon/acquire.h"
#include "daemon/instrument.h"
#include "daemon/travel.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define ATTEMPTS_MORE 3           // attempts at a point: the ranges and these
#define RETURNS_MOST 5            // pauses that ended by themselves, without a reading between them
#define LASER_LOOK_NS CLK_S(1)    // how often the laser itself is asked while it is on
#define EMITTING_LEAST_S 600.0    // how long a laser may take to reach its set-point, at least
#define OFF_AT_FIRST_S 5.0        // and to leave "off" after it accepted ON
#define STEADY_REL 0.005          // change of the monitor in a second, to call it steady
#define STEADY_LEAST_S 60.0       // how long it may take to become so, at least
#define MONITOR_LOST 0.5          // of the monitor after warm-up: below it the light is lost
#define AGAIN 1                   // not done, but nothing is wrong
#define STORE_RETRY_NS CLK_S(1)

struct engine {
    const struct engine_ports *ports;
    struct instrument *in;
    const struct campaign_config *config;
    const struct plan *plan;

    enum run_state state;
    const struct plan_point *point; // in progress; NULL: none
    int done, attempt;
    bool ready;  // connected, homed
    bool lit;    // laser on, warmed up, monitor steady
    bool dark;   // laser off, read back at this campaign's own request
    int returns; // pauses that ended by themselves since the last accepted reading
    int64_t light_ns, laser_look_ns;
    struct acquire acquire;

    double omega_sr, monitor_dark_v, monitor_lit_v;
    struct engine_opening opening;
    int64_t first_ns;
    int first_done;
    struct gon_error why; // of the last failure
};

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

// --- what is said ------------------------------------------------------------------------------------

static double seconds_left(const struct engine *e)
{
    const int here = e->done - e->first_done;
    if (here < 3)
        return NAN;
    const double s = (double)(clk_now_ns(e->ports->clk) - e->first_ns) * 1e-9;
    return s / here * (e->plan->count - e->done);
}

static struct engine_event event_of(const struct engine *e, enum engine_event_kind kind, const char *text)
{
    const struct plan_point *p = e->point;
    return (struct engine_event){
        .kind = kind,
        .state = e->state,
        .sweep = p ? p->sweep : 0,
        .sweeps = e->plan->sweeps,
        .point = e->done,
        .points = e->plan->count,
        .theta_i_deg = p ? p->theta_i_deg : (double)NAN,
        .theta_r_deg = p ? p->theta_r_deg : (double)NAN,
        .f_per_sr = NAN,
        .u_per_sr = NAN,
        .left_s = seconds_left(e),
        .emission = instrument_emission(e->in),
        .text = text,
    };
}

// An event row, and the same for whoever watches.
static void say(struct engine *e, enum engine_event_kind kind, const char *level, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
static void say(struct engine *e, enum engine_event_kind kind, const char *level, const char *fmt, ...)
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

static void enter(struct engine *e, enum run_state state, const char *text)
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

// --- the safe state, and waiting in it ---------------------------------------------------------------

static int canceled(struct engine *e)
{
    return gon_fail(&e->why, GON_E_CANCELED, "stopped");
}

static int nap(struct engine *e, int64_t ns)
{
    return instrument_wait(e->in, clk_now_ns(e->ports->clk) + ns, e->ports->cancel) < 0 ? canceled(e) : 0;
}

static void make_safe(struct engine *e)
{
    struct gon_error err;
    const bool was_on = instrument_emission(e->in);
    e->ready = e->lit = e->dark = false;
    instrument_permit(e->in, false);
    if (instrument_emission_off(e->in, &err) < 0 && was_on)
        say(e, ENGINE_LOG, "err", "%s", err.text);
    travel_stop(e->in, NULL);
}

static bool resume_asked(struct engine *e)
{
    return e->ports->take_resume(e->ports->ctx);
}

static bool pause_asked(struct engine *e)
{
    return e->ports->take_pause && e->ports->take_pause(e->ports->ctx);
}

static int wait_for_operator(struct engine *e)
{
    int64_t tend_ns = 0;
    while (!resume_asked(e)) {
        if (nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
        if (clk_now_ns(e->ports->clk) >= tend_ns) {
            instrument_tend(e->in);
            tend_ns = clk_now_ns(e->ports->clk) + CLK_S(1);
        }
    }
    return 0;
}

// Until every device is back, or an operator took the pause over.
static int wait_for_devices(struct engine *e)
{
    do {
        if (pause_asked(e)) {
            enter(e, RUN_PAUSED, "paused by the operator; go on with: gonio resume");
            return wait_for_operator(e);
        }
        (void)resume_asked(e); // it goes on by itself anyway
        if (nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
    } while (instrument_reconnect(e->in) > 0);
    return 0;
}

static void describe_loss(const struct engine *e, char *text, size_t size)
{
    struct instrument_snapshot s;
    const enum instrument_part part = instrument_lost(e->in);
    instrument_snapshot(e->in, &s);
    if (e->why.code == GON_E_GONE && part < PART_COUNT)
        snprintf(text, size, "%s%s: unplugged%s%s%s; waiting for it to come back",
                 part < INSTRUMENT_AXES ? "axis " : "", s.part[part].name,
                 s.part[part].address[0] ? " (" : "", s.part[part].address,
                 s.part[part].address[0] ? ")" : "");
    else
        snprintf(text, size, "%.400s; trying again", e->why.text);
}

// Emission off, axes stopped, and what is to be done depends on what happened (e->why). 0: go on.
static int pause_run(struct engine *e)
{
    const enum run_state before = e->state;
    const bool by_itself = e->why.code == GON_E_LINK || e->why.code == GON_E_GONE;
    char text[600];
    int rc;
    make_safe(e);
    if (cancel_requested(e->ports->cancel))
        return canceled(e);
    if (by_itself && e->returns < RETURNS_MOST) {
        e->returns++;
        describe_loss(e, text, sizeof text);
        enter(e, RUN_PAUSED, text);
        rc = wait_for_devices(e);
    } else {
        snprintf(text, sizeof text, "%.440s%s", e->why.text,
                 by_itself ? "; it keeps failing: look at it, then: gonio resume" : "");
        enter(e, RUN_PAUSED, text);
        rc = wait_for_operator(e);
        e->returns = 0;
    }
    if (rc >= 0)
        enter(e, before, by_itself ? "everything is there again; going on" : "resumed");
    return rc;
}

// --- storing -----------------------------------------------------------------------------------------

// The row is offered until it is accepted: nothing that was measured is lost, and nothing goes on before.
static int store(struct engine *e, const struct store_reading *row)
{
    const enum run_state before = e->state;
    int rc = e->ports->store_reading(e->ports->ctx, row, &e->why);
    if (rc != GON_E_STORE)
        return rc;
    char text[600];
    snprintf(text, sizeof text, "store: %.400s; the reading is kept and offered again each second",
             e->why.text);
    make_safe(e);
    enter(e, RUN_PAUSED, text);
    while (rc == GON_E_STORE) {
        instrument_wait(e->in, clk_now_ns(e->ports->clk) + STORE_RETRY_NS, e->ports->cancel);
        rc = e->ports->store_reading(e->ports->ctx, row, &e->why);
        if (rc == GON_E_STORE && cancel_requested(e->ports->cancel))
            return canceled(e);
    }
    if (rc >= 0)
        enter(e, before, "the store takes readings again");
    return rc;
}

static double u_of_mean(double sd, int count)
{
    return count > 1 ? sd / sqrt(count) : 0.0;
}

// Underfilled or overfilled f_r with the opening references (metrology.md 1); the last word is reduce's.
static void provisional(const struct engine *e, const struct acquire_reading *r, double theta_i_deg,
                        double theta_r_deg, double *ret_f, double *ret_u)
{
    const struct engine_opening *o = &e->opening;
    const bool monitored = isfinite(r->monitor_v);
    const double signal_v = r->signal_v - o->dark_signal_v;
    const double beam = (o->beam_signal_v - o->dark_signal_v) /
                        (monitored ? o->beam_monitor_v - o->dark_monitor_v : 1.0);
    const double ratio = signal_v / (monitored ? r->monitor_v - o->dark_monitor_v : 1.0) / beam;
    const double cosine =
        cos(units_rad(instrument_bench(e->in)->regime == BENCH_OVERFILLED ? theta_i_deg
                                                                                    : theta_r_deg));
    const double u_signal_v = u_of_mean(r->signal_sd_v, r->count);
    const double u_monitor =
        monitored ? u_of_mean(r->monitor_sd_v, r->count) / (r->monitor_v - o->dark_monitor_v) : 0.0;
    *ret_f = ratio / (e->omega_sr * cosine);
    *ret_u = fabs(*ret_f) * hypot(u_signal_v / signal_v, u_monitor);
}

static void publish_reading(struct engine *e, const struct acquire_reading *r, const struct travel_pose *at)
{
    struct engine_event event = event_of(e, ENGINE_READING, NULL);
    event.theta_i_deg = at->at[PART_THETA_I];
    event.theta_r_deg = at->at[PART_THETA_R];
    event.flags = r->flags;
    if (e->point->kind == PLAN_SAMPLE)
        provisional(e, r, event.theta_i_deg, event.theta_r_deg, &event.f_per_sr, &event.u_per_sr);
    e->ports->publish(e->ports->ctx, &event);
}

// Means of the opening references, as far as they go.
static void remember(struct engine *e, const struct acquire_reading *r)
{
    if (e->point->kind == PLAN_DARK) {
        e->monitor_dark_v = r->monitor_v;
        if (isnan(e->opening.dark_signal_v)) {
            e->opening.dark_signal_v = r->signal_v;
            e->opening.dark_monitor_v = r->monitor_v;
        }
    } else if (e->point->kind == PLAN_BEAM && isnan(e->opening.beam_signal_v)) {
        e->opening.beam_signal_v = r->signal_v;
        e->opening.beam_monitor_v = r->monitor_v;
    }
}

static struct store_reading row_of(const struct engine *e, const struct acquire_reading *r,
                                   const struct travel_pose *at)
{
    return (struct store_reading){
        .sweep = e->point->sweep,
        .point = e->point->point,
        .attempt = e->attempt,
        .t_utc_ms = r->utc_ns / 1000000,
        .theta_i_udeg = (int32_t)units_udeg(at->at[PART_THETA_I]),
        .theta_r_udeg = (int32_t)units_udeg(at->at[PART_THETA_R]),
        .signal_v = r->signal_v,
        .signal_sd_v = r->signal_sd_v,
        .monitor_v = r->monitor_v,
        .monitor_sd_v = r->monitor_sd_v,
        .count = r->count,
        .range = r->range,
        .flags = r->flags,
    };
}

// --- laser -------------------------------------------------------------------------------------------

static int laser_trouble(struct engine *e, const struct laser_status *s)
{
    const char *then = "then: gonio resume";
    if (!s->interlock_closed || s->state == LASER_INTERLOCK)
        return gon_fail(&e->why, GON_E_REFUSED, "laser: the interlock opened; close it, %s", then);
    if (s->state == LASER_NEEDS_KEY)
        return gon_fail(&e->why, GON_E_REFUSED, "laser: wants its key switch turned off and on, %s", then);
    if (s->state == LASER_FAULT)
        return gon_fail(&e->why, GON_E_DEVICE, "laser: fault %d (%s); clear it, %s", s->fault_code,
                        safety_fault_text(instrument_safety(e->in), s->fault_code), then);
    return 0;
}

// The laser was on and should be.
static int check_laser(struct engine *e)
{
    struct laser_status s;
    int rc = instrument_laser(e->in, &s, &e->why);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    if (rc >= 0)
        rc = laser_trouble(e, &s);
    if (rc >= 0 && !s.emission)
        rc = gon_fail(&e->why, GON_E_DEVICE,
                      "laser: went off by itself (state %s); look at it, then: gonio resume",
                      laser_state_name(s.state));
    return rc;
}

// The same with one short question, and only when it is due.
static int watch_laser(struct engine *e)
{
    bool on;
    if (!e->lit || clk_now_ns(e->ports->clk) < e->laser_look_ns)
        return 0;
    int rc = instrument_light(e->in, &on, &e->why);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    return rc < 0 || on ? rc : check_laser(e);
}

static int operator_paused(struct engine *e)
{
    return gon_fail(&e->why, GON_E_REFUSED, "paused by the operator; go on with: gonio resume");
}

static int wait_until_emitting(struct engine *e)
{
    const double most_s = fmax(EMITTING_LEAST_S, 2.0 * instrument_bench(e->in)->laser.warmup_s);
    const int64_t start_ns = clk_now_ns(e->ports->clk);
    for (;;) {
        struct laser_status s;
        int rc = instrument_laser(e->in, &s, &e->why);
        if (rc >= 0)
            rc = laser_trouble(e, &s);
        if (rc < 0)
            return rc;
        if (s.state == LASER_EMITTING && s.emission)
            return 0;
        const double s_since = (double)(clk_now_ns(e->ports->clk) - start_ns) * 1e-9;
        if ((s.state == LASER_OFF && s_since > OFF_AT_FIRST_S) || s_since > most_s)
            return gon_fail(&e->why, GON_E_DEVICE,
                            "laser: still %s %.0f s after it accepted ON; look at it, then: gonio resume",
                            laser_state_name(s.state), s_since);
        if (pause_asked(e))
            return operator_paused(e);
        if (nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
    }
}

static int watch_monitor(struct engine *e, double *ret_mean_v)
{
    double sum_v = 0;
    for (int i = 0; i < 10; i++) {
        struct detector_sample s;
        if (nap(e, CLK_MS(50)) < 0)
            return GON_E_CANCELED;
        int rc = instrument_sample(e->in, &s, &e->why);
        if (rc < 0)
            return rc;
        sum_v += s.monitor_v;
    }
    *ret_mean_v = sum_v / 10;
    return 0;
}

// Two means half a second apart differ by less than half of what a second is allowed.
static int wait_until_steady(struct engine *e)
{
    const double most_s = fmax(STEADY_LEAST_S, 2.0 * instrument_bench(e->in)->laser.warmup_s);
    const int64_t until_ns = clk_now_ns(e->ports->clk) + CLK_S(most_s);
    const double dark_v = isfinite(e->monitor_dark_v) ? e->monitor_dark_v : 0.0;
    double before_v, now_v;
    int rc = watch_monitor(e, &before_v);
    for (; rc >= 0; before_v = now_v) {
        rc = watch_monitor(e, &now_v);
        if (rc < 0 || isnan(now_v)) // without a monitor there is nothing to see
            break;
        const double change = fabs(now_v - before_v) / fabs(now_v - dark_v);
        e->monitor_lit_v = now_v;
        if (change < 0.5 * STEADY_REL)
            break;
        if (clk_now_ns(e->ports->clk) > until_ns)
            return gon_fail(&e->why, GON_E_DEVICE,
                            "laser: says it emits, but the monitor (%.4g V, dark %.4g V) still changes by "
                            "%.2g %% in half a second after %.0f s; look at laser, shutter and monitor, "
                            "then: gonio resume",
                            now_v, dark_v, 100.0 * change, most_s);
        if (pause_asked(e))
            return operator_paused(e);
    }
    return rc;
}

static int warm_up(struct engine *e)
{
    int rc = wait_until_emitting(e);
    const int64_t until_ns = clk_now_ns(e->ports->clk) + CLK_S(instrument_bench(e->in)->laser.warmup_s);
    while (rc >= 0 && clk_now_ns(e->ports->clk) < until_ns) {
        const int64_t left_ns = until_ns - clk_now_ns(e->ports->clk);
        if (pause_asked(e))
            return operator_paused(e);
        rc = nap(e, left_ns < CLK_MS(100) ? left_ns : CLK_MS(100));
        if (rc >= 0 && clk_now_ns(e->ports->clk) >= e->laser_look_ns)
            rc = check_laser(e);
    }
    return rc < 0 ? rc : wait_until_steady(e);
}

static int light_up(struct engine *e)
{
    say(e, ENGINE_LOG, "notice", "laser on at %.4g W, warming up", instrument_bench(e->in)->laser.power_w);
    int rc = instrument_power(e->in, instrument_bench(e->in)->laser.power_w, &e->why);
    if (rc >= 0)
        rc = instrument_emission_on(e->in, &e->why);
    if (rc >= 0)
        rc = warm_up(e);
    if (rc < 0)
        return rc;
    e->lit = true;
    e->dark = false;
    e->light_ns = clk_now_ns(e->ports->clk);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    e->acquire.range = -1;
    say(e, ENGINE_LOG, "notice", "laser warm, monitor %.4g V", e->monitor_lit_v);
    return 0;
}

static int lights_out(struct engine *e)
{
    int rc = instrument_emission_off(e->in, &e->why);
    if (rc < 0)
        return rc;
    e->lit = false;
    e->dark = true;
    e->light_ns = clk_now_ns(e->ports->clk);
    e->acquire.range = -1;
    return 0;
}

// Darks without light, everything else with it.
static int light_for(struct engine *e)
{
    if (e->point->kind == PLAN_DARK)
        return e->dark ? 0 : lights_out(e);
    return e->lit ? 0 : light_up(e);
}

// --- points ------------------------------------------------------------------------------------------

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
    e->ready = rc >= 0;
    instrument_permit(e->in, e->ready);
    e->acquire = (struct acquire){.range = -1};
    return rc;
}

// A dark needs no place: it is measured where the axes are, unless the plan says where.
static int go_to(struct engine *e, struct travel_pose *ret_at)
{
    const struct plan_point *p = e->point;
    struct travel_pose pose = {.at = {p->theta_i_deg, p->theta_r_deg, 0.0}};
    int rc = 0;
    if (p->kind == PLAN_DARK && !p->station[0])
        pose = (struct travel_pose){.at = {NAN, NAN, NAN}};
    else if (p->kind != PLAN_SAMPLE)
        rc = travel_station(e->in, p->station, &pose, &e->why);
    return rc < 0 ? rc : travel_move(e->in, &pose, e->ports->cancel, ret_at, &e->why);
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
    if (r->flags & STORE_MONITOR_LOW) {
        int rc = check_laser(e);
        return rc < 0 ? rc
                      : gon_fail(&e->why, GON_E_DEVICE,
                                 "laser: says it emits, but the monitor fell to %.4g V from %.4g V; look at "
                                 "shutter and monitor, then: gonio resume",
                                 r->monitor_v, e->monitor_lit_v);
    }
    const char *what = r->flags & STORE_SATURATED ? "saturated on its least sensitive range"
                       : r->flags & STORE_UNLOCKED ? "has no reference (chopper stopped?)"
                                                   : "gives no usable reading";
    return gon_fail(&e->why, GON_E_DEVICE,
                    "detector: %s at theta_i %.2f deg, theta_r %.2f deg after %d attempts; mend it, "
                    "then: gonio resume",
                    what, e->point->theta_i_deg, e->point->theta_r_deg, e->attempt);
}

static double least_monitor_v(const struct engine *e)
{
    const double dark_v = isfinite(e->monitor_dark_v) ? e->monitor_dark_v : 0.0;
    return e->point->kind == PLAN_DARK ? (double)NAN : dark_v + MONITOR_LOST * (e->monitor_lit_v - dark_v);
}

static int measure(struct engine *e, const struct travel_pose *at)
{
    const struct acquire_wish wish = {readings_of(e), e->light_ns, least_monitor_v(e)};
    const int most = instrument_ranges(e->in) + ATTEMPTS_MORE;
    struct acquire_reading r = {0};
    acquire_begin(&e->acquire);
    for (int k = 0; k < most; k++) {
        int rc = acquire_attempt(e->in, &e->acquire, &wish, e->ports->cancel, &r, &e->why);
        if (rc < 0)
            return rc;
        e->attempt++;
        const struct store_reading row = row_of(e, &r, at);
        rc = store(e, &row);
        if (rc < 0)
            return rc;
        if (r.accepted) {
            remember(e, &r);
            e->done++;
        }
        publish_reading(e, &r, at);
        if (r.accepted || !r.again)
            break;
        if (!e->ready) // the store paused the run: light and axes first
            return AGAIN;
    }
    return r.accepted ? 0 : no_more_attempts(e, &r);
}

static int do_point(struct engine *e)
{
    struct travel_pose at;
    if (cancel_requested(e->ports->cancel))
        return canceled(e);
    if (pause_asked(e))
        return operator_paused(e);
    int rc = prepare(e);
    if (rc >= 0)
        rc = light_for(e);
    if (rc >= 0)
        rc = watch_laser(e);
    if (rc >= 0)
        rc = go_to(e, &at);
    if (rc < 0)
        return rc;
    if (e->point->kind == PLAN_SAMPLE)
        enter(e, RUN_RUNNING, NULL);
    if (e->point->kind == PLAN_BEAM) // the brightest there is
        e->acquire.range = -1;
    if (at.still_ns > e->light_ns)
        e->light_ns = at.still_ns;
    return measure(e, &at);
}

static void sweep_done(struct engine *e, const struct plan_point *next)
{
    const struct plan_point *p = e->point;
    if (p->kind != PLAN_SAMPLE || (next && next->sweep == p->sweep))
        return;
    say(e, ENGINE_SWEEP, "notice", "sweep %d of %d is measured (theta_i %.2f deg)", p->sweep,
        e->plan->sweeps, p->theta_i_deg);
    e->ports->request_fit(e->ports->ctx, p->sweep, false);
}

// --- the run -----------------------------------------------------------------------------------------

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
        int rc = do_point(e);
        if (rc == AGAIN)
            continue;
        if (rc >= 0) {
            e->returns = 0;
            return 0;
        }
        if (rc == GON_E_CANCELED || rc == GON_E_INPUT || rc == GON_E_SYSTEM)
            return rc;
        rc = pause_run(e);
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
        next = next_point(e->plan, e->point);
        sweep_done(e, next);
    }
    return 0;
}

static enum run_state finish(struct engine *e, int rc, struct gon_error *err)
{
    if (rc < 0)
        enter(e, RUN_STOPPING, NULL);
    make_safe(e);
    if (rc == GON_E_CANCELED) {
        enter(e, RUN_STOPPED, "laser off, axes stopped; go on with: gonio resume");
    } else if (rc < 0) {
        enter(e, RUN_FAILED, e->why.text);
        if (err)
            *err = e->why;
    } else {
        e->ports->request_fit(e->ports->ctx, e->plan->sweeps, true);
        enter(e, RUN_DONE, "every point is measured; laser off");
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
        .acquire = {.range = -1},
        .omega_sr = bench_omega_sr(bench),
        .monitor_dark_v = NAN,
        .monitor_lit_v = NAN,
        .opening = {NAN, NAN, NAN, NAN},
        .first_ns = clk_now_ns(ports->clk),
    };
    if (ports->opening) {
        e.opening = *ports->opening;
        e.monitor_dark_v = e.opening.dark_monitor_v;
    }
    for (int i = 0; i < plan->count; i++)
        e.done += plan->points[i].done;
    e.first_done = e.done;
    enter(&e, RUN_PREPARING, NULL);
    return finish(&e, run_points(&e), err);
}
