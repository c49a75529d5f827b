// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "daemon/instrument_suspend.h"

#include <stdio.h>

#define TRIES_MOST 5 // in a row, to see with light what only light shows

// --- between points and in their waits ---------------------------------------------------------

static int suspended_by(struct engine *e, const struct suspender_state *s)
{
    e->suspended = true;
    return gon_fail(&e->why, GON_E_REFUSED, "suspended by \"%s\": %s", s->name, s->text);
}

int engine_suspended(struct engine *e)
{
    struct suspender_state s;
    instrument_look_around(e->in);
    return instrument_suspended(e->in, &s) ? suspended_by(e, &s) : 0;
}

bool engine_heed(void *ctx)
{
    struct engine *e = ctx;
    struct suspender_state s;
    if (!e->heeding)
        return false;
    if (!e->asking)
        e->asking = e->ports->take_pause && e->ports->take_pause(e->ports->ctx, &e->asked);
    instrument_look_around(e->in);
    if (instrument_suspended(e->in, &s))
        suspended_by(e, &s);
    else if (e->asking && e->asked.now)
        (void)engine_operator_paused(e);
    else
        return false;
    e->interrupt = e->why;
    return true;
}

int engine_interrupted(struct engine *e, int rc)
{
    if (rc != GON_E_CANCELED || e->interrupt.code == GON_OK || cancel_requested(e->ports->cancel))
        return rc;
    e->why = e->interrupt;
    e->asking = e->asking && e->suspended; // what was asked for is done
    return e->why.code;
}

// --- the pause -----------------------------------------------------------------------------------

static void say_why(struct engine *e, const struct suspender_state *s)
{
    char text[500], quiet[80] = "";
    if (s->left_s > 0)
        snprintf(quiet, sizeof quiet, " once that has been quiet for %.3g s", s->settle_s);
    snprintf(text, sizeof text, "suspended by \"%s\": %s%s; %s%s%s", s->name, s->text,
             s->holds || s->needs_light ? "" : " until a moment ago",
             s->manual && s->holds ? "mend it, then: gonio resume; it goes on"
             : s->manual           ? "go on with: gonio resume"
                                   : "it goes on by itself",
             quiet, s->manual && s->holds && !*quiet ? " at once" : "");
    engine_enter_pause(e, text);
}

// Nothing keeps the run any more; else *s is what does.
static bool is_over(struct engine *e, struct suspender_state *s)
{
    struct suspender_state now;
    instrument_look_around(e->in);
    if (!instrument_suspended(e->in, &now))
        return true;
    const bool news = now.name != s->name;
    *s = now;
    if (news)
        say_why(e, s);
    return false;
}

// One that comes while it holds is not kept: who gives it does not see the bench then.
static void take_resume(struct engine *e, const struct suspender_state *s)
{
    if (!e->ports->take_resume(e->ports->ctx))
        return;
    instrument_release(e->in);
    if (s->holds && s->manual)
        say_why(e, s);
}

// What only light shows is quiet without it: not for ever.
static int try_light(struct engine *e, const char *name)
{
    char text[300];
    if (++e->tries < TRIES_MOST)
        return 0;
    e->tries = 0;
    snprintf(text, sizeof text,
             "suspended by \"%s\": it held again each time when the light was back, %d times; look "
             "at it, then: gonio resume",
             name, TRIES_MOST);
    engine_enter_pause(e, text);
    return engine_wait_for_operator(e);
}

int engine_sit_out(struct engine *e)
{
    struct suspender_state s = {.name = NULL};
    int64_t tend_ns = 0;
    if (instrument_suspended(e->in, &s) && s.manual) // whoever goes on answers for the light
        arm_end(instrument_arm(e->in), "the run was paused");
    s.name = NULL;
    while (!is_over(e, &s)) {
        if (engine_pause_asked(e))
            return engine_take_over(e);
        take_resume(e, &s);
        if (engine_nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
        if (clk_now_ns(e->ports->clk) >= tend_ns) {
            instrument_tend(e->in);
            tend_ns = clk_now_ns(e->ports->clk) + CLK_S(1);
        }
    }
    return s.needs_light && !s.manual ? try_light(e, s.name) : 0;
}
