// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "daemon/instrument_devices.h"
#include "daemon/instrument_suspend.h"
#include "daemon/travel.h"

#include <stdio.h>
#include <string.h>

#define RETURNS_MOST 5 // pauses that ended by themselves, without a reading between them

int engine_canceled(struct engine *e)
{
    return gon_fail(&e->why, GON_E_CANCELED, "stopped");
}

int engine_nap(struct engine *e, int64_t ns)
{
    return instrument_wait(e->in, clk_now_ns(e->ports->clk) + ns, e->ports->cancel) < 0
               ? engine_canceled(e)
               : 0;
}

const char *engine_light_text(const struct engine *e)
{
    return safety_light_text(instrument_light_left(e->in));
}

void engine_make_safe(struct engine *e)
{
    struct gon_error err;
    const bool was_on = instrument_light_left(e->in) == SAFETY_LIGHT_MAYBE;
    e->ready = e->lit = e->dark = e->heeding = false;
    engine_begin_gap(e);
    instrument_steady(e->in, false);
    instrument_permit(e->in, false);
    if (instrument_emission_off(e->in, &err) < 0 && was_on)
        engine_say(e, ENGINE_LOG, "err", "%s", err.text);
    travel_stop(e->in, NULL);
    if (instrument_devices_safe(e->in, &err) < 0)
        engine_say(e, ENGINE_LOG, "err", "%s", err.text);
}

static bool resume_asked(struct engine *e)
{
    return e->ports->take_resume(e->ports->ctx);
}

bool engine_pause_asked(struct engine *e)
{
    if (!e->asking && e->ports->take_pause)
        e->asking = e->ports->take_pause(e->ports->ctx, &e->asked);
    const bool was = e->asking;
    e->asking = false;
    return was;
}

int engine_operator_paused(struct engine *e)
{
    e->wanted = true;
    return gon_fail(&e->why, GON_E_REFUSED, "by the operator%s; go on with: gonio resume",
                    e->asked.by);
}

int engine_take_over(struct engine *e)
{
    (void)engine_operator_paused(e);
    engine_enter_pause(e, e->why.text);
    return engine_wait_for_operator(e);
}

static int next_lost(const struct instrument_snapshot *s, int part)
{
    while (part < PART_COUNT && s->part[part].link != PART_LOST)
        part++;
    return part;
}

// "axis theta_i, axis theta_r (rtu://...), laser (serial://...)", an address once for those that
// share it. Returns how many are lost.
static int name_lost(const struct engine *e, char *text, size_t size)
{
    struct instrument_snapshot s;
    size_t length = 0;
    int lost = 0;
    instrument_snapshot(e->in, &s);
    *text = 0;
    for (int i = next_lost(&s, 0), next; i < PART_COUNT && length < size; i = next) {
        const struct part_state *p = &s.part[i];
        next = next_lost(&s, i + 1);
        const bool shared = next < PART_COUNT && !strcmp(p->address, s.part[next].address);
        const bool told = *p->address && !shared;
        length += (size_t)snprintf(text + length, size - length, "%s%s%s%s%s%s", lost++ ? ", " : "",
                                   i < INSTRUMENT_AXES ? "axis " : "", p->name, told ? " (" : "",
                                   told ? p->address : "", told ? ")" : "");
    }
    return lost;
}

static void describe_loss(const struct engine *e, char *text, size_t size)
{
    char names[360];
    const int lost = name_lost(e, names, sizeof names);
    if (e->why.code == GON_E_GONE && lost > 0)
        snprintf(text, size, "%s: unplugged; waiting for %s to come back", names,
                 lost == 1 ? "it" : "them");
    else
        snprintf(text, size, "%.400s; trying again", e->why.text);
}

// The warning comes first: whoever reads half of the line has read it.
void engine_enter_pause(struct engine *e, const char *text)
{
    char whole[640];
    (void)resume_asked(e); // only one that comes after this pause ends it
    const bool off = instrument_light_left(e->in) == SAFETY_LIGHT_OFF;
    snprintf(whole, sizeof whole, "%s%s%s", off ? "" : engine_light_text(e), off ? "" : "; ", text);
    engine_enter(e, RUN_PAUSED, whole);
}

int engine_wait_for_operator(struct engine *e)
{
    int64_t tend_ns = 0;
    arm_end(instrument_arm(e->in), "the run was paused"); // whoever goes on answers for the light
    while (!resume_asked(e)) {
        (void)engine_pause_asked(e); // it is paused already
        if (engine_nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
        if (clk_now_ns(e->ports->clk) >= tend_ns) {
            instrument_tend(e->in);
            tend_ns = clk_now_ns(e->ports->clk) + CLK_S(1);
        }
    }
    return 0;
}

// Another device answers in a lost one's place: waiting alone does not help, so that is said.
static void tell_refused(struct engine *e, char told[sizeof((struct part_state *)0)->problem])
{
    struct instrument_snapshot s;
    instrument_snapshot(e->in, &s);
    for (int i = next_lost(&s, 0); i < PART_COUNT; i = next_lost(&s, i + 1))
        if (s.part[i].refused && strcmp(told, s.part[i].problem) != 0) {
            strcpy(told, s.part[i].problem);
            engine_enter_pause(e, told);
            return;
        }
}

// Until every device is back, or an operator took the pause over.
static int wait_for_devices(struct engine *e)
{
    char told[sizeof((struct part_state *)0)->problem] = "";
    do {
        tell_refused(e, told);
        if (engine_pause_asked(e))
            return engine_take_over(e);
        instrument_look_around(e->in); // a door that opens meanwhile is not forgotten
        (void)resume_asked(e);         // it goes on by itself anyway
        if (engine_nap(e, CLK_MS(100)) < 0)
            return GON_E_CANCELED;
    } while (instrument_reconnect(e->in) > 0);
    return 0;
}

// Emission off, axes stopped, and what is to be done depends on what happened (e->why). 0: go on.
int engine_pause_run(struct engine *e)
{
    const enum run_state before = e->state;
    char text[600];
    int rc;
    instrument_breathe(e->in);
    // What the guard did is the reason, whatever followed from it: somebody has to look.
    const bool suspended = engine_heed_guard(e) == 0 && e->suspended;
    const bool by_itself = e->why.code == GON_E_LINK || e->why.code == GON_E_GONE;
    engine_make_safe(e);
    if (cancel_requested(e->ports->cancel))
        return engine_canceled(e);
    if (suspended) {
        rc = engine_sit_out(e);
    } else if (by_itself && e->returns < RETURNS_MOST) {
        e->returns++;
        describe_loss(e, text, sizeof text);
        engine_enter_pause(e, text);
        rc = wait_for_devices(e);
    } else {
        snprintf(text, sizeof text, "%.440s%s", e->why.text,
                 by_itself ? "; it keeps failing: look at it, then: gonio resume" : "");
        engine_enter_pause(e, text);
        rc = engine_wait_for_operator(e);
        e->returns = 0;
    }
    instrument_permit(e->in, false);               // what the guard did meanwhile is past
    const bool returned = by_itself && !e->wanted; // and nobody took the pause over
    if (rc >= 0 && !returned && (!suspended || e->wanted))
        instrument_release(e->in); // somebody resumed it
    e->wanted = false;
    if (rc >= 0)
        engine_enter(e, before,
                     suspended  ? "nothing suspends it any more; going on"
                     : returned ? "everything is there again; going on"
                                : "resumed");
    return rc;
}
