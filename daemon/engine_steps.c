// SPDX-License-Identifier: MIT
// What a person does on the way: the run is paused, the laser off, until somebody acknowledges it.
// It is no gap: the references stay what they are, and the laser only has to be warm again.
#include "daemon/engine_inside.h"

#include "campaign/plan.h"
#include "campaign/plan_steps.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void make_safe(struct engine *e)
{
    const bool gap = e->gap;
    const unsigned fresh = e->fresh;
    engine_make_safe(e);
    e->gap = gap;
    e->fresh = fresh;
}

static void say(struct engine *e, double late_s)
{
    char text[400], late[80] = "";
    if (late_s > 0)
        snprintf(late, sizeof late, " (not acknowledged for %.0f s)", late_s);
    snprintf(text, sizeof text, "operator: %s, then: gonio ack%s", e->asks, late);
    engine_enter_pause(e, text);
}

// Acknowledged: 0. A pause that somebody asks for meanwhile is one of its own, and the step is
// still to be done: ENGINE_AGAIN.
static int wait_for_it(struct engine *e, char *ret_by, size_t size)
{
    const int64_t start_ns = clk_now_ns(e->ports->clk);
    const double limit_s = instrument_bench(e->in)->step_limit_s;
    int64_t tend_ns = 0;
    bool late = false;
    while (!e->ports->take_ack || !e->ports->take_ack(e->ports->ctx, ret_by, size)) {
        const int64_t now_ns = clk_now_ns(e->ports->clk);
        const double waited_s = (double)(now_ns - start_ns) * 1e-9;
        if (engine_pause_asked(e)) {
            *e->asks = 0;
            const int rc = engine_take_over(e);
            instrument_permit(e->in, false); // what the guard did meanwhile is past
            return rc < 0 ? rc : ENGINE_AGAIN;
        }
        if (!late && limit_s > 0 && waited_s >= limit_s) {
            late = true;
            say(e, waited_s);
        }
        if (engine_nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
        if (now_ns >= tend_ns) {
            instrument_tend(e->in);
            tend_ns = now_ns + CLK_S(1);
        }
    }
    return 0;
}

static int ask(struct engine *e, const char *what)
{
    const enum run_state before = e->state;
    char by[300] = "", text[600];
    make_safe(e);
    snprintf(e->asks, sizeof e->asks, "%s", what);
    if (e->ports->take_ack)
        (void)e->ports->take_ack(e->ports->ctx, by, sizeof by); // only one that comes after it
    e->wanted = true;
    say(e, 0);
    int rc = wait_for_it(e, by, sizeof by);
    e->wanted = false;
    *e->asks = 0;
    if (rc < 0)
        return rc;
    snprintf(text, sizeof text, "acknowledged by the operator%s (%s)", by, what);
    engine_enter(e, before, rc == ENGINE_AGAIN ? "resumed" : text);
    return rc;
}

// They stand before anything moves for this point.
int engine_operator_steps(struct engine *e)
{
    const int index = (int)(e->point - e->plan->points);
    const char *text;
    for (;;) {
        const bool begun = e->referring || e->stepped == index;
        const enum plan_step_kind kind = plan_next_step(e->config, instrument_bench(e->in), e->plan,
                                                        index, e->station, begun, &text);
        if (kind == PLAN_STEP_NONE)
            break;
        int rc = ask(e, text);
        if (rc < 0 || rc == ENGINE_AGAIN)
            return rc;
        if (kind == PLAN_STEP_SWEEP)
            e->stepped = index;
        else
            snprintf(e->station, sizeof e->station, "%s",
                     kind == PLAN_STEP_ARRIVE ? e->point->station : "");
    }
    snprintf(e->station, sizeof e->station, "%s", e->point->station);
    return 0;
}
