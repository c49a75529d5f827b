// SPDX-License-Identifier: MIT
// After a gap (a pause, a stop) the light has been off: the opening references are measured again,
// as further accepted readings of the same points, before the sample goes on. Those that are open
// anyway (a sweep is measured again) are measured once. The reduction
// (campaign/reduce.h) then takes those before and behind each reading.
#include "daemon/engine_inside.h"

#include "campaign/plan.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// Without a beam measured there is nothing that a gap could spoil.
bool engine_has_beam(const struct engine *e)
{
    for (int i = 0; i < POL_COUNT; i++)
        if (isfinite(e->opening.beam_signal_v[i]))
            return true;
    return false;
}

static int opening_points(const struct plan *plan)
{
    int n = 0;
    while (n < plan->count && n < ENGINE_REFERENCES && plan->points[n].sweep == 0)
        n++;
    return n;
}

// As the plan has them, and what this run has added.
void engine_count_attempts(struct engine *e)
{
    for (int i = 0; i < opening_points(e->plan); i++)
        e->attempts[i] = e->plan->points[i].attempts;
}

void engine_keep_attempt(struct engine *e)
{
    const int i = (int)(e->point - e->plan->points);
    if (i < opening_points(e->plan))
        e->attempts[i] = e->attempt;
}

// --- gap and references --------------------------------------------------------------------------

void engine_begin_gap(struct engine *e)
{
    e->fresh = 0;
    if (e->gap || !engine_has_beam(e))
        return;
    e->gap = true;
    e->gap_utc_ms = e->last_utc_ms;
}

void engine_freshen(struct engine *e)
{
    const int i = (int)(e->point - e->plan->points);
    if (i < opening_points(e->plan))
        e->fresh |= 1u << i;
}

static bool all_fresh(const struct engine *e)
{
    return e->fresh == (1u << opening_points(e->plan)) - 1;
}

// What the references were before those that are measured again; NAN: not of these.
static struct engine_opening former(const struct engine *e)
{
    struct engine_opening before = e->opening;
    for (int i = 0; i < opening_points(e->plan); i++)
        if (e->fresh & 1u << i && e->plan->points[i].kind == PLAN_BEAM)
            before.beam_signal_v[e->plan->points[i].pol_in] = (double)NAN;
    return before;
}

// --- what has changed ----------------------------------------------------------------------------

static double beam_ratio(const struct engine_opening *o, int state)
{
    const bool monitored = isfinite(o->beam_monitor_v[state]);
    return (o->beam_signal_v[state] - o->dark_signal_v) /
           (monitored ? o->beam_monitor_v[state] - o->dark_monitor_v : 1.0);
}

static void say_change(struct engine *e, const struct engine_opening *before)
{
    char text[400];
    const struct engine_opening *now = &e->opening;
    size_t used = (size_t)snprintf(text, sizeof text,
                                   "references measured again after a gap of %.0f s: dark %+.3g V",
                                   e->gap_s, now->dark_signal_v - before->dark_signal_v);
    for (int i = 0; i < POL_COUNT && used < sizeof text; i++) {
        const double change = beam_ratio(now, i) / beam_ratio(before, i) - 1;
        if (isfinite(change))
            used += (size_t)snprintf(text + used, sizeof text - used, ", beam (%s) %+.3g %%",
                                     polarisation_name((enum polarisation)i), 100 * change);
    }
    engine_say(e, ENGINE_LOG, "notice", "%s", text);
}

// --- measuring them again ------------------------------------------------------------------------

static int measure_one(struct engine *e, int index)
{
    int rc;
    e->point = &e->plan->points[index];
    e->attempt = e->attempts[index];
    do
        rc = engine_do_point(e);
    while (rc == ENGINE_AGAIN);
    e->attempts[index] = e->attempt;
    return rc;
}

static double gap_s(const struct engine *e)
{
    const int64_t now_ms = clk_utc_ns(e->ports->clk) / 1000000;
    return fmax(0, (double)(now_ms - e->gap_utc_ms) * 1e-3);
}

// A pause of the store meanwhile is a gap, too: then once more.
static int measure_stale(struct engine *e)
{
    int rc = 0;
    while (rc >= 0 && !all_fresh(e))
        for (int i = 0; i < opening_points(e->plan) && rc >= 0; i++)
            if (!(e->fresh & 1u << i))
                rc = measure_one(e, i);
    return rc;
}

int engine_refer(struct engine *e)
{
    const struct plan_point *asked = e->point;
    const int attempt = e->attempt;
    if (!e->gap || asked->kind != PLAN_SAMPLE)
        return 0;
    if (all_fresh(e)) {
        e->gap = e->referring = false;
        return 0;
    }
    if (!e->referring) { // not of an earlier try
        e->before = former(e);
        e->gap_s = gap_s(e);
    }
    e->referring = true;
    engine_enter(e, RUN_PREPARING, "dark and beam again, after a gap");
    int rc = measure_stale(e);
    e->point = asked;
    e->attempt = attempt;
    if (rc < 0)
        return rc;
    e->gap = e->referring = false;
    say_change(e, &e->before);
    return 0;
}
