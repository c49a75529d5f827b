// SPDX-License-Identifier: MIT
// A laser by its profile (struct profile_laser): what is asked, said and concluded stands there; in
// which order, how often and what is never done stands here.
#include "drivers/by_profile.h"

#include "drivers/laser.h"
#include "drivers/message.h"
#include "drivers/session.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OFF_TRIES 5

struct profiled_laser {
    struct laser laser; // first
    struct session *s;
    const struct profile_laser *is;
    bool once;        // what changes only when it is set is known
    int64_t alive_ns; // when the lease of the laser's own was renewed
};

static struct profiled_laser *laser_of(struct laser *l)
{
    return (struct profiled_laser *)l;
}

static struct transport *transport_of(const struct profiled_laser *z)
{
    return message_transport(session_message(z->s));
}

static int identify(struct laser *l, char *ret_text, size_t size, struct gon_error *err)
{
    return session_identify(laser_of(l)->s, ret_text, size, err);
}

// --- status --------------------------------------------------------------------------------------

static int emission(struct laser *l, bool *ret_emission, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    int rc = session_ask(z->s, &z->is->light, err);
    if (rc == 0)
        *ret_emission = session_holds(z->s, z->is->emitting);
    return rc;
}

// The last rule of a profile has no condition; without one nothing good is assumed.
static enum laser_state state_of(const struct profiled_laser *z)
{
    for (int i = 0; i < z->is->states.count; i++)
        if (session_holds(z->s, z->is->states.rule[i].when))
            return (enum laser_state)z->is->states.rule[i].is;
    return LASER_FAULT;
}

static int fault_of(const struct profiled_laser *z)
{
    const double code = session_number(z->s, z->is->fault);
    return isfinite(code) && fabs(code) < 2e9 ? (int)code : 0;
}

static int status(struct laser *l, struct laser_status *ret_status, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    int rc = session_ask(z->s, &z->is->status, err);
    if (rc == 0 && !z->once)
        rc = session_ask(z->s, &z->is->once, err);
    if (rc < 0)
        return rc;
    z->once = true;
    *ret_status = (struct laser_status){
        .state = state_of(z),
        .emission = session_holds(z->s, z->is->emitting),
        .interlock_closed = session_holds(z->s, z->is->interlock_closed),
        .power_w = session_number(z->s, z->is->power),
        .setpoint_w = session_number(z->s, z->is->setpoint),
        .fault_code = fault_of(z),
    };
    return 0;
}

static const char *fault_text(struct laser *l, int code)
{
    const struct profile_laser *is = laser_of(l)->is;
    for (int i = 0; i < is->faults_count; i++)
        if (is->faults[i].code == code)
            return is->faults[i].text;
    return code ? "not in the list of faults" : "none";
}

// --- commands ------------------------------------------------------------------------------------

static int set_power(struct laser *l, double power_w, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    if (!(power_w >= 0 && power_w <= z->is->power_most_w))
        return gon_fail(err, GON_E_INPUT, "laser power %g W; allowed: 0..%g W", power_w,
                        z->is->power_most_w);
    z->once = false;
    session_put(z->s, z->is->setpoint, power_w);
    int rc = session_send(z->s, z->is->set_power, NULL, err);
    z->once = rc == 0 && !isnan(session_number(z->s, z->is->setpoint));
    return rc;
}

static int stays_off(enum profile_meaning means, const char *why, struct gon_error *err)
{
    switch (means) {
    case PROFILE_OPEN_INTERLOCK:
        return gon_fail(err, GON_E_REFUSED, "laser stays off: the interlock is open%s", why);
    case PROFILE_KEY:
        return gon_fail(err, GON_E_REFUSED, "laser stays off: turn its key switch off and on%s",
                        why);
    case PROFILE_BUSY: return gon_fail(err, GON_E_REFUSED, "laser stays off: it is busy%s", why);
    case PROFILE_REFUSED:
    case PROFILE_FAULTY:
    case PROFILE_FINE:
    default: return gon_fail(err, GON_E_DEVICE, "laser stays off%s", why);
    }
}

// A reason in brackets behind what it means; " (...)", or ": ..." where it stands for itself.
static int stays_off_because(enum profile_meaning means, const char *text, struct gon_error *err)
{
    char why[300] = "";
    if (*text && (means == PROFILE_REFUSED || means == PROFILE_FAULTY))
        snprintf(why, sizeof why, ": %s", text);
    else if (*text)
        snprintf(why, sizeof why, " (%s)", text);
    return stays_off(means, why, err);
}

static int check_state(struct profiled_laser *z, const struct laser_status *s,
                       struct gon_error *err)
{
    char why[200];
    switch (s->state) {
    case LASER_INTERLOCK: return stays_off(PROFILE_OPEN_INTERLOCK, "", err);
    case LASER_NEEDS_KEY: return stays_off(PROFILE_KEY, "", err);
    case LASER_FAULT:
        snprintf(why, sizeof why, ": fault %d (%s)", s->fault_code,
                 fault_text(&z->laser, s->fault_code));
        return stays_off(PROFILE_FAULTY, why, err);
    case LASER_OFF:
    case LASER_WARMING:
    case LASER_EMITTING: break;
    }
    return s->interlock_closed ? 0 : stays_off(PROFILE_OPEN_INTERLOCK, "", err);
}

static int check_may_start(struct profiled_laser *z, struct gon_error *err)
{
    struct laser_status now;
    int rc = status(&z->laser, &now, err);
    if (rc == 0)
        rc = check_state(z, &now, err);
    if (rc == 0)
        rc = session_ask(z->s, &z->is->before_on, err);
    for (int i = 0; rc == 0 && i < z->is->may_not.count; i++) {
        const struct profile_rule *r = &z->is->may_not.rule[i];
        if (session_holds(z->s, r->when))
            return stays_off_because((enum profile_meaning)r->is, r->text, err);
    }
    return rc;
}

// What has to be done first, as far as it is needed now.
static int prepare(struct profiled_laser *z, struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; rc == 0 && i < z->is->prepare.count; i++)
        if (session_holds(z->s, z->is->prepare.rule[i].when))
            rc = session_send(z->s, z->is->prepare.rule[i].send, NULL, err);
    return rc;
}

// Why the laser did not want to: some say so, others have to be asked.
static int explain_refusal(struct profiled_laser *z, int rc, struct gon_error *err)
{
    const struct gon_error why = *err;
    enum profile_meaning means = session_meaning(z->s);
    if (means != PROFILE_REFUSED)
        return stays_off_because(means, why.text, err);
    if (session_ask(z->s, &z->is->after_refusal, NULL) < 0)
        return rc;
    for (int i = 0; i < z->is->refusals.count; i++) {
        const struct profile_rule *r = &z->is->refusals.rule[i];
        if (session_holds(z->s, r->when))
            return stays_off_because((enum profile_meaning)r->is, why.text, err);
    }
    return rc;
}

static int on(struct laser *l, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    struct gon_error own;
    err = err ? err : &own;
    int rc = check_may_start(z, err);
    if (rc == 0)
        rc = prepare(z, err);
    for (int i = 0; rc == 0 && i < z->is->on.count; i++) {
        const struct profile_rule *r = &z->is->on.rule[i];
        if (!session_holds(z->s, r->when))
            continue;
        rc = session_send(z->s, r->send, NULL, err);
        return rc == GON_E_DEVICE || rc == GON_E_REFUSED ? explain_refusal(z, rc, err) : rc;
    }
    return rc < 0 ? rc
                  : gon_fail(err, GON_E_DEVICE, "%s: in this state nothing switches it on",
                             session_link(z->s));
}

// --- off -----------------------------------------------------------------------------------------

// One round: told after the gap, and what it says then. One question each, no repetition: telling
// again is worth more than asking again.
static int switch_off(struct profiled_laser *z, const char *command, bool *ret_off,
                      struct gon_error *err)
{
    int rc = session_send_blind(z->s, command, false, err);
    if (rc == 0)
        rc = session_ask_once(z->s, &z->is->off_asks, err);
    if (rc == 0)
        *ret_off = session_holds(z->s, z->is->is_off);
    return rc;
}

// At once, even into a gap in which the laser ignores commands; then, with the gap kept, until it
// is seen.
static int off_unminding(struct profiled_laser *z, struct gon_error *err)
{
    const struct profile_laser *is = z->is;
    bool is_off = false;
    int rc = session_send_blind(z->s, is->off[0], true, err);
    for (int i = 0; i < OFF_TRIES && !is_off && rc != GON_E_GONE; i++)
        rc = switch_off(z, is->off[i % is->off_count], &is_off, err);
    if (rc < 0 || is_off)
        return rc;
    return gon_fail(
        err, GON_E_DEVICE,
        "%s: LASER MAY BE ON: told %d times to switch off, it still says that it emits or "
        "starts; use its key or the interlock",
        session_link(z->s), OFF_TRIES + 1);
}

static int off(struct laser *l, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    const struct cancel *cancel = transport_mind(transport_of(z), NULL);
    int rc = off_unminding(z, err);
    transport_mind(transport_of(z), cancel);
    return rc;
}

// --- its own lease -------------------------------------------------------------------------------

// In good time: whoever calls may come back only after a while.
static int keep_alive(struct laser *l, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    const struct profile_keepalive *k = &z->is->keepalive;
    const int64_t now_ns = clk_now_ns(transport_clk(transport_of(z)));
    if (!*k->send || now_ns - z->alive_ns < CLK_S(k->period_ms * 0.5e-3))
        return 0;
    z->alive_ns = now_ns;
    return session_send(z->s, k->send, NULL, err);
}

// --- life ----------------------------------------------------------------------------------------

static int reopen(struct laser *l, struct gon_error *err)
{
    struct profiled_laser *z = laser_of(l);
    z->once = false;
    return session_reopen(z->s, err);
}

static const struct link_stats *stats(const struct laser *l)
{
    return message_stats(session_message(((const struct profiled_laser *)l)->s));
}

static void laser_free(struct laser *l)
{
    if (!l)
        return;
    session_free(laser_of(l)->s);
    free(l);
}

static int check_profile(const struct profile *p, struct gon_error *err)
{
    if (p->role != PROFILE_LASER)
        return gon_fail(err, GON_E_INPUT, "profile %s is not of a laser", p->name);
    if (p->laser.off_count == 0 || p->laser.off_asks.count == 0 || !*p->laser.is_off)
        return gon_fail(err, GON_E_INPUT, "profile %s does not say how to switch off and to see it",
                        p->name);
    return 0;
}

// Takes the session over.
static int make(const struct profile *p, struct session *s, struct laser **ret_laser,
                struct gon_error *err)
{
    static const struct laser_ops ops = {
        .identify = identify,
        .status = status,
        .emission = emission,
        .set_power = set_power,
        .on = on,
        .off = off,
        .keep_alive = keep_alive,
        .reopen = reopen,
        .fault_text = fault_text,
        .stats = stats,
        .free = laser_free,
    };
    struct profiled_laser *z = calloc(1, sizeof *z);
    if (!z) {
        session_free(s);
        return gon_fail(err, GON_E_SYSTEM, "laser: out of memory");
    }
    *z = (struct profiled_laser){
        .laser = {&ops}, .s = s, .is = &p->laser, .alive_ns = INT64_MIN / 2};
    *ret_laser = &z->laser;
    return 0;
}

int laser_over(const struct profile *p, struct transport *transport, struct laser **ret_laser,
               struct gon_error *err)
{
    struct session *s;
    int rc = session_over(p, transport, &s, err);
    return rc < 0 ? rc : make(p, s, ret_laser, err);
}

int laser_by_profile(const struct profile *p, const char *link, struct clk *clk,
                     const struct cancel *cancel, struct laser **ret_laser, struct gon_error *err)
{
    struct session *s;
    int rc = check_profile(p, err);
    if (rc == 0)
        rc = session_open(p, link, clk, cancel, &s, err);
    return rc < 0 ? rc : make(p, s, ret_laser, err);
}
