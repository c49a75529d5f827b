// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "campaign/bench.h"
#include "campaign/plan.h"
#include "daemon/instrument_devices.h"
#include "daemon/travel.h"

#include <math.h>

#define LASER_LOOK_NS CLK_S(1) // how often the laser itself is asked while it is on
#define EMITTING_LEAST_S 600.0 // how long a laser may take to reach its set-point, at least
#define OFF_AT_FIRST_S 5.0     // and to leave "off" after it accepted ON
#define STEADY_REL 0.005       // change of the monitor in a second, to call it steady
#define STEADY_LEAST_S 60.0    // how long it may take to become so, at least

static int laser_trouble(struct engine *e, const struct laser_status *s)
{
    const char *then = "then: gonio resume";
    if (!s->interlock_closed || s->state == LASER_INTERLOCK)
        return gon_fail(&e->why, GON_E_REFUSED, "laser: the interlock opened; close it, %s", then);
    if (s->state == LASER_NEEDS_KEY)
        return gon_fail(&e->why, GON_E_REFUSED, "laser: wants its key switch turned off and on, %s",
                        then);
    if (s->state == LASER_FAULT)
        return gon_fail(&e->why, GON_E_DEVICE, "laser: fault %d (%s); clear it, %s", s->fault_code,
                        safety_fault_text(instrument_safety(e->in), s->fault_code), then);
    return 0;
}

int engine_heed_guard(struct engine *e)
{
    struct gon_error why;
    if (instrument_alarm(e->in, &why) == 0)
        return 0;
    return gon_fail(&e->why, why.code, "%.400s; look at it, then: gonio resume", why.text);
}

int engine_check_laser(struct engine *e)
{
    struct laser_status s;
    int rc = engine_heed_guard(e);
    if (rc >= 0)
        rc = instrument_laser(e->in, &s, &e->why);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    if (rc >= 0)
        rc = laser_trouble(e, &s);
    if (rc >= 0 && !s.emission)
        rc = gon_fail(&e->why, GON_E_DEVICE,
                      "laser: went off by itself (state %s); look at it, then: gonio resume",
                      laser_state_name(s.state));
    return rc;
}

int engine_watch_laser(struct engine *e)
{
    bool on;
    if (e->lit && engine_heed_guard(e) < 0)
        return e->why.code;
    if (!e->lit || clk_now_ns(e->ports->clk) < e->laser_look_ns)
        return 0;
    int rc = instrument_light(e->in, &on, &e->why);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    return rc < 0 || on ? rc : engine_check_laser(e);
}

// Nothing moves while it warms up, but an axis in alarm must not stay in the light until then.
static int check_axes(struct engine *e)
{
    const struct travel_pose anywhere = travel_stay();
    return travel_still(e->in, &anywhere, &e->why);
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
        rc = check_axes(e);
        if (rc < 0)
            return rc;
        const double s_since = (double)(clk_now_ns(e->ports->clk) - start_ns) * 1e-9;
        if ((s.state == LASER_OFF && s_since > OFF_AT_FIRST_S) || s_since > most_s)
            return gon_fail(
                &e->why, GON_E_DEVICE,
                "laser: still %s %.0f s after it accepted ON; look at it, then: gonio resume",
                laser_state_name(s.state), s_since);
        if (engine_pause_asked(e))
            return engine_operator_paused(e);
        if (engine_nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
    }
}

static int watch_monitor(struct engine *e, double *ret_mean_v)
{
    double sum_v = 0;
    for (int i = 0; i < 10; i++) {
        struct detector_sample s;
        if (engine_nap(e, CLK_MS(50)) < 0)
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
    const char *unit = instrument_monitor_unit(e->in);
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
        if (clk_now_ns(e->ports->clk) > until_ns && now_v == dark_v)
            return gon_fail(&e->why, GON_E_DEVICE,
                            "laser: says it emits, but the monitor reads %.4g %s as in the dark; "
                            "look at laser, shutter and monitor, then: gonio resume",
                            now_v, unit);
        if (clk_now_ns(e->ports->clk) > until_ns)
            return gon_fail(
                &e->why, GON_E_DEVICE,
                "laser: says it emits, but the monitor (%.4g %s, dark %.4g %s) still changes by "
                "%.2g %% in half a second after %.0f s; look at laser, shutter and monitor, "
                "then: gonio resume",
                now_v, unit, dark_v, unit, 100.0 * change, most_s);
        if (engine_pause_asked(e))
            return engine_operator_paused(e);
    }
    return rc;
}

// While the light is on and nothing is measured, a lost device is still a lost device, and an alarm
// an alarm.
static int look_around(struct engine *e)
{
    int rc = engine_check_laser(e);
    rc = rc < 0 ? rc : check_axes(e);
    return rc < 0 ? rc : engine_look_at_devices(e);
}

static int warm_up(struct engine *e)
{
    int rc = wait_until_emitting(e);
    const int64_t until_ns =
        clk_now_ns(e->ports->clk) + CLK_S(instrument_bench(e->in)->laser.warmup_s);
    while (rc >= 0 && clk_now_ns(e->ports->clk) < until_ns) {
        const int64_t left_ns = until_ns - clk_now_ns(e->ports->clk);
        if (engine_pause_asked(e))
            return engine_operator_paused(e);
        rc = engine_nap(e, left_ns < CLK_MS(100) ? left_ns : CLK_MS(100));
        if (rc >= 0 && clk_now_ns(e->ports->clk) >= e->laser_look_ns)
            rc = look_around(e);
    }
    if (rc >= 0)
        rc = instrument_fit_monitor(e->in, &e->why);
    return rc < 0 ? rc : wait_until_steady(e);
}

static int light_up(struct engine *e)
{
    engine_say(e, ENGINE_LOG, "notice", "laser on at %.4g W, warming up",
               instrument_bench(e->in)->laser.power_w);
    int rc = instrument_power(e->in, instrument_bench(e->in)->laser.power_w, &e->why);
    if (rc >= 0)
        rc = instrument_emission_on(e->in, &e->why);
    if (rc >= 0)
        rc = warm_up(e);
    if (rc < 0)
        return rc;
    e->lit = true;
    e->light_ns = e->source_ns = clk_now_ns(e->ports->clk);
    e->laser_look_ns = clk_now_ns(e->ports->clk) + LASER_LOOK_NS;
    e->acquire.range = -1;
    if (isfinite(e->monitor_lit_v))
        engine_say(e, ENGINE_LOG, "notice", "laser warm, monitor %.4g %s", e->monitor_lit_v,
                   instrument_monitor_unit(e->in));
    else
        engine_say(e, ENGINE_LOG, "notice", "laser warm");
    return 0;
}

// With a shutter for it the laser stays as it is, warm.
static int lights_out(struct engine *e)
{
    int rc = engine_shut(e);
    const bool stays = rc >= 0 && e->lit && engine_shutter_darkens(e);
    if (rc >= 0 && !stays)
        rc = engine_heed_guard(e); // whose reason our own OFF would take back
    if (rc >= 0 && !stays)
        rc = instrument_emission_off(e->in, &e->why);
    if (rc < 0)
        return rc;
    e->lit = stays;
    e->dark = true;
    e->light_ns = e->source_ns = clk_now_ns(e->ports->clk);
    e->acquire.range = -1;
    return 0;
}

int engine_light_for(struct engine *e)
{
    if (e->point->kind == PLAN_DARK)
        return e->dark ? 0 : lights_out(e);
    e->dark = false; // a shutter that made the dark opens when the devices are placed
    return e->lit ? 0 : light_up(e);
}
