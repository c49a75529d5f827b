// SPDX-License-Identifier: MIT
#include "daemon/safety.h"

#include "daemon/arm.h"
#include "drivers/guard_link.h"

#include <stdlib.h>
#include <string.h>

struct safety {
    struct laser *laser;
    struct clk *clk;
    bool running;  // a run has permission
    bool emission; // on was sent, off was not read back since
    bool pending;  // off was sent and not read back
    bool busy;     // in a call of the laser's: its waits tick too
    bool obeyed;   // the stop was told once
    bool warned;   // the alarm was
    const struct cancel *stop;
    const struct arm *arm;    // NULL: nobody armed it
    struct guard_link *guard; // NULL: none
    struct gon_error alarm;   // of the guard's or the arm's; code 0: none
    int64_t tick_ns, worst_gap_ns;
};

struct safety *safety_new(struct laser *laser, struct clk *clk)
{
    struct safety *s = calloc(1, sizeof *s);
    if (!s) {
        laser->ops->free(laser);
        return NULL;
    }
    *s = (struct safety){.laser = laser, .clk = clk, .tick_ns = clk_now_ns(clk)};
    return s;
}

void safety_guard(struct safety *s, struct guard_link *guard)
{
    s->guard = guard;
}

void safety_arm(struct safety *s, const struct arm *arm)
{
    s->arm = arm;
}

bool safety_free(struct safety *s)
{
    if (!s)
        return true;
    const bool dark = safety_off(s, NULL) >= 0;
    s->laser->ops->free(s->laser);
    free(s);
    return dark;
}

// Around each call of the laser's: s->busy = true; return talked(s, call).
static int talked(struct safety *s, int rc)
{
    s->busy = false;
    return rc;
}

int safety_begin(struct safety *s, char *ret_text, size_t size, struct gon_error *err)
{
    char text[96];
    int rc = safety_off(s, err);
    if (rc < 0)
        return rc;
    s->busy = true;
    return talked(s, s->laser->ops->identify(s->laser, ret_text ? ret_text : text,
                                             ret_text ? size : sizeof text, err));
}

int safety_reopen(struct safety *s, char *ret_text, size_t size, struct gon_error *err)
{
    s->busy = true;
    int rc = talked(s, s->laser->ops->reopen(s->laser, err));
    return rc < 0 ? rc : safety_begin(s, ret_text, size, err);
}

void safety_permit(struct safety *s, bool running)
{
    s->running = running;
    if (!running)
        s->alarm = (struct gon_error){0};
}

int safety_set_power(struct safety *s, double power_w, struct gon_error *err)
{
    s->busy = true;
    return talked(s, s->laser->ops->set_power(s->laser, power_w, err));
}

static int check_may_emit(struct safety *s, struct gon_error *err)
{
    struct laser_status now;
    if (!s->running)
        return gon_fail(err, GON_E_REFUSED, "stays off: no campaign is running");
    if (s->alarm.code)
        return safety_alarm(s, err);
    int rc = arm_check(s->arm, clk_now_ns(s->clk), err);
    if (rc < 0) {
        gon_prefix(err, "stays off");
        return rc;
    }
    if (s->pending)
        return gon_fail(err, GON_E_REFUSED, "stays off: an earlier OFF was not confirmed");
    rc = safety_status(s, &now, err);
    if (rc < 0)
        return rc;
    if (!now.interlock_closed || now.state == LASER_INTERLOCK)
        return gon_fail(err, GON_E_REFUSED, "the interlock is open; close it, then: gonio resume");
    if (now.state == LASER_NEEDS_KEY)
        return gon_fail(err, GON_E_REFUSED,
                        "wants its key switch turned off and on, then: gonio resume");
    if (now.state == LASER_FAULT)
        return gon_fail(err, GON_E_DEVICE, "fault %d (%s); clear it, then: gonio resume",
                        now.fault_code, safety_fault_text(s, now.fault_code));
    return 0;
}

int safety_on(struct safety *s, struct gon_error *err)
{
    int rc = check_may_emit(s, err);
    if (rc < 0)
        return rc;

    // From here until an off is read back the laser counts as emitting, whatever the answer is.
    s->emission = true;
    s->warned = false;
    s->tick_ns = clk_now_ns(s->clk);
    s->busy = true;
    rc = talked(s, s->laser->ops->on(s->laser, err));
    if (rc < 0)
        safety_off(s, NULL);
    return rc;
}

// One try; of a guard, which tries by itself, all of the time.
static int off_once(struct safety *s, int64_t until_ns, struct gon_error *err)
{
    return s->guard ? guard_link_off(s->guard, until_ns, err) : s->laser->ops->off(s->laser, err);
}

// A link that is gone is tried again by whoever reopens it: waiting here would only delay that.
int safety_off(struct safety *s, struct gon_error *err)
{
    const int64_t until_ns = clk_now_ns(s->clk) + CLK_S(SAFETY_OFF_S);
    struct gon_error why = {0};
    int rc;
    s->pending = s->busy = true;
    for (;;) {
        rc = off_once(s, until_ns, &why);
        if (rc >= 0) {
            s->emission = s->pending = false;
            return talked(s, 0);
        }
        if (rc == GON_E_GONE || clk_now_ns(s->clk) >= until_ns)
            break;
        clk_sleep(s->clk, CLK_MS(100), NULL);
    }
    talked(s, rc);
    // Before the first ON there is only a link that fails; afterwards light may come out.
    if ((s->emission || rc == GON_E_DEVICE) && !strstr(why.text, "LASER MAY BE ON"))
        return gon_fail(err, rc, "%s (%s)", safety_light_text(SAFETY_LIGHT_MAYBE), why.text);
    return gon_fail(err, rc, "%s", why.text);
}

void safety_obey(struct safety *s, const struct cancel *stop)
{
    s->stop = stop;
    s->obeyed = false;
}

// The lease that the laser itself gives. When renewing fails it runs out: that is what it is for.
static void keep_alive(struct safety *s)
{
    if (!s->emission || s->pending || s->busy || s->alarm.code || cancel_requested(s->stop) ||
        !s->laser->ops->keep_alive)
        return;
    s->busy = true;
    talked(s, s->laser->ops->keep_alive(s->laser, NULL));
}

// The guard's lease goes on also while the laser is being talked to. An alarm is kept here: whoever
// switches off after it makes the guard forget. While nothing runs that is due at the next look.
static void mind_guard(struct safety *s)
{
    struct gon_error why;
    if (!s->guard)
        return;
    if (s->emission && !s->pending && !s->alarm.code)
        guard_link_renew(s->guard);
    if (guard_link_watch(s->guard, &why) == 0)
        return;
    if (!s->alarm.code)
        s->alarm = why;
    if (!s->running)
        s->pending = true;
}

// Light that nobody answers for goes off, and the run learns of it as of the guard's doing.
static void mind_arm(struct safety *s)
{
    if (!s->emission || s->alarm.code || arm_is_live(s->arm, clk_now_ns(s->clk)))
        return;
    gon_fail(&s->alarm, GON_E_REFUSED, "switched off, as the arm of %s ended: %s",
             s->arm ? s->arm->name : "nobody", s->arm && *s->arm->end ? s->arm->end : "it ran out");
}

int safety_alarm(const struct safety *s, struct gon_error *err)
{
    return s->alarm.code ? gon_fail(err, s->alarm.code, "%s", s->alarm.text) : 0;
}

bool safety_tick(struct safety *s)
{
    mind_arm(s);
    mind_guard(s);
    keep_alive(s);
    const int64_t now_ns = clk_now_ns(s->clk);
    if (s->emission && now_ns - s->tick_ns > s->worst_gap_ns)
        s->worst_gap_ns = now_ns - s->tick_ns;
    s->tick_ns = now_ns;
    if (!s->emission || s->busy)
        return false;
    if (s->alarm.code && !s->warned)
        return s->warned = true;
    if (s->obeyed || !cancel_requested(s->stop))
        return false;
    return s->obeyed = true;
}

int safety_status(struct safety *s, struct laser_status *ret_status, struct gon_error *err)
{
    s->busy = true;
    return talked(s, s->laser->ops->status(s->laser, ret_status, err));
}

int safety_look(struct safety *s, bool *ret_emission, struct gon_error *err)
{
    s->busy = true;
    return talked(s, s->laser->ops->emission(s->laser, ret_emission, err));
}

const char *safety_fault_text(const struct safety *s, int code)
{
    const char *text = s->laser->ops->fault_text ? s->laser->ops->fault_text(s->laser, code) : NULL;
    return text ? text : "no text for it";
}

const struct link_stats *safety_stats(const struct safety *s)
{
    return s->laser->ops->stats ? s->laser->ops->stats(s->laser) : NULL;
}

enum safety_light safety_light(const struct safety *s)
{
    return s->emission  ? SAFETY_LIGHT_MAYBE
           : s->pending ? SAFETY_LIGHT_UNCONFIRMED
                        : SAFETY_LIGHT_OFF;
}

const char *safety_light_text(enum safety_light light)
{
    switch (light) {
    case SAFETY_LIGHT_OFF: return "laser off";
    case SAFETY_LIGHT_UNCONFIRMED: return "the laser does not confirm that it is off: look at it";
    case SAFETY_LIGHT_MAYBE: break;
    }
    return "LASER MAY BE ON: use its key or the interlock";
}

bool safety_emission(const struct safety *s)
{
    return s->emission;
}

bool safety_pending(const struct safety *s)
{
    return s->pending;
}

int64_t safety_worst_gap_ns(const struct safety *s)
{
    return s->worst_gap_ns;
}
