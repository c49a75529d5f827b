// SPDX-License-Identifier: MIT
// A selector by its profile (struct profile_selector).
#include "drivers/selector.h"

#include "drivers/by_profile.h"
#include "drivers/message.h"
#include "drivers/session.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define LOOK_NS CLK_MS(50)

struct profiled_selector {
    struct selector selector; // first
    struct session *s;
    const struct profile_selector *is;
};

static struct profiled_selector *selector_of(struct selector *z)
{
    return (struct profiled_selector *)z;
}

static struct transport *transport_of(const struct profiled_selector *z)
{
    return message_transport(session_message(z->s));
}

// --- where it is ---------------------------------------------------------------------------------

static int positions(struct selector *z)
{
    return selector_of(z)->is->positions_count;
}

static const char *name(struct selector *z, int position)
{
    assert(position >= 0 && position < positions(z));
    return selector_of(z)->is->positions[position].name;
}

int selector_find(struct selector *z, const char *wanted)
{
    for (int i = 0; i < z->ops->positions(z); i++)
        if (strcmp(z->ops->name(z, i), wanted) == 0)
            return i;
    return SELECTOR_ELSEWHERE;
}

static int safe(struct selector *z)
{
    return selector_find(z, selector_of(z)->is->safe);
}

static int where(struct selector *selector, int *ret_position, bool *ret_moving,
                 struct gon_error *err)
{
    struct profiled_selector *z = selector_of(selector);
    int rc = session_ask(z->s, &z->is->status, err);
    if (rc < 0)
        return rc;
    *ret_position = SELECTOR_ELSEWHERE;
    for (int i = z->is->positions_count - 1; i >= 0; i--)
        if (session_holds(z->s, z->is->positions[i].when))
            *ret_position = i;
    if (ret_moving)
        *ret_moving = *z->is->moving && session_holds(z->s, z->is->moving);
    return 0;
}

// --- going ---------------------------------------------------------------------------------------

static int64_t now_ns(const struct profiled_selector *z)
{
    return clk_now_ns(transport_clk(transport_of(z)));
}

// Looks until it stands at that position, or at any with SELECTOR_ELSEWHERE. ret_there: where it
// was seen last.
static int wait_there(struct profiled_selector *z, int position, int *ret_there,
                      struct gon_error *err)
{
    const int64_t until_ns = now_ns(z) + CLK_S(z->is->timeout_s);
    struct transport *t = transport_of(z);
    for (;;) {
        bool moving = false;
        int rc = where(&z->selector, ret_there, &moving, err);
        if (rc < 0)
            return rc;
        const bool any = position == SELECTOR_ELSEWHERE && *ret_there != SELECTOR_ELSEWHERE;
        if (!moving && (any || *ret_there == position))
            return 0;
        if (now_ns(z) >= until_ns)
            return 0;
        if (clk_sleep(transport_clk(t), LOOK_NS, transport_cancel(t)) < 0)
            return gon_fail(err, GON_E_CANCELED, "%s: stopped on its way", session_link(z->s));
    }
}

static int elsewhere(struct profiled_selector *z, int wanted, int there, struct gon_error *err)
{
    const bool nowhere = there == SELECTOR_ELSEWHERE;
    return gon_fail(err, GON_E_DEVICE,
                    "%s: does not go to '%s' in %g s, it is %s%s%s; is it stuck?",
                    session_link(z->s), z->is->positions[wanted].name, z->is->timeout_s,
                    nowhere ? "at none of its positions" : "at '",
                    nowhere ? "" : z->is->positions[there].name, nowhere ? "" : "'");
}

// Told once and looked at. ret_lost: the answer was lost, so that it may not have been told.
static int tell(struct profiled_selector *z, int position, int *ret_there, bool *ret_lost,
                struct gon_error *err)
{
    const struct profile_position *p = &z->is->positions[position];
    struct gon_error why = {0};
    int rc = session_send(z->s, p->send, NULL, &why);
    *ret_lost = rc == GON_E_LINK;
    if (rc < 0 && !*ret_lost)
        return gon_fail(err, rc, "%s", why.text);
    return wait_there(z, position, ret_there, err);
}

// One that only changes over is told only from a position that is known; any other also from
// nowhere.
static int go(struct selector *selector, int position, struct gon_error *err)
{
    struct profiled_selector *z = selector_of(selector);
    int there = SELECTOR_ELSEWHERE;
    bool moving = false, lost = true;
    assert(position >= 0 && position < z->is->positions_count);
    int rc = where(selector, &there, &moving, err);
    if (rc == 0 && (moving || (there < 0 && z->is->positions[position].toggles)))
        rc = wait_there(z, SELECTOR_ELSEWHERE, &there, err);
    for (int i = 0; i < 2 && rc == 0 && there != position && lost; i++) {
        if (there == SELECTOR_ELSEWHERE && z->is->positions[position].toggles)
            break;
        rc = tell(z, position, &there, &lost, err);
    }
    if (rc < 0 || there == position)
        return rc;
    return elsewhere(z, position, there, err);
}

// --- life ----------------------------------------------------------------------------------------

static int identify(struct selector *selector, char *ret_text, size_t size, struct gon_error *err)
{
    struct profiled_selector *z = selector_of(selector);
    int rc = session_identify(z->s, ret_text, size, err);
    for (int i = 0; rc == 0 && i < z->is->setup.count; i++)
        if (session_holds(z->s, z->is->setup.rule[i].when))
            rc = session_send(z->s, z->is->setup.rule[i].send, NULL, err);
    return rc;
}

static int reopen(struct selector *z, struct gon_error *err)
{
    return session_reopen(selector_of(z)->s, err);
}

static const struct link_stats *stats(const struct selector *z)
{
    return message_stats(session_message(((const struct profiled_selector *)z)->s));
}

static void selector_free(struct selector *z)
{
    if (!z)
        return;
    session_free(selector_of(z)->s);
    free(z);
}

static int check_profile(const struct profile *p, struct gon_error *err)
{
    if (p->role != PROFILE_SELECTOR)
        return gon_fail(err, GON_E_INPUT, "profile %s is not of a selector", p->name);
    if (p->selector.positions_count == 0 || p->selector.status.count == 0)
        return gon_fail(err, GON_E_INPUT,
                        "profile %s does not say where it can be, and how that "
                        "is seen",
                        p->name);
    return 0;
}

int selector_by_profile(const struct profile *p, const char *link, struct clk *clk,
                        const struct cancel *cancel, struct selector **ret_selector,
                        struct gon_error *err)
{
    static const struct selector_ops ops = {
        identify, positions, name, safe, where, go, reopen, stats, selector_free,
    };
    struct session *s;
    int rc = check_profile(p, err);
    if (rc == 0)
        rc = session_open(p, link, clk, cancel, &s, err);
    if (rc < 0)
        return rc;
    struct profiled_selector *z = calloc(1, sizeof *z);
    if (!z) {
        session_free(s);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    *z = (struct profiled_selector){.selector = {&ops}, .s = s, .is = &p->selector};
    *ret_selector = &z->selector;
    return 0;
}
