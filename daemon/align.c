// SPDX-License-Identifier: MIT
#include "daemon/align.h"

#include "base/clk.h"
#include "daemon/instrument.h"

#include <math.h>
#include <stdio.h>

#define LOOK_NS CLK_S(0.5) // how often the laser itself is asked

int align_may(const struct align *a, const struct bench_laser *l, double power_w, double for_s,
              struct gon_error *err)
{
    if (a->running)
        return gon_fail(err, GON_E_REFUSED, "%s aligns already; end it: gonio laser off", a->name);
    if (!(l->align_power_w > 0))
        return gon_fail(err, GON_E_REFUSED,
                        "this bench allows no alignment; to allow it, set laser.align_power_w in its "
                        "bench file");
    if (!(power_w > 0 && power_w <= l->align_power_w))
        return gon_fail(err, GON_E_INPUT,
                        "alignment at %g W: this bench allows up to %g W (laser.align_power_w)",
                        power_w, l->align_power_w);
    if (!(for_s >= ARM_LEAST_S && for_s <= ALIGN_MOST_S))
        return gon_fail(err, GON_E_INPUT, "alignment for %g s: allowed are %g to %g s", for_s,
                        ARM_LEAST_S, ALIGN_MOST_S);
    return 0;
}

int align_begin(struct align *a, struct instrument *in, const char *name, double power_w,
                double for_s, struct gon_error *err)
{
    int rc = align_may(a, &instrument_bench(in)->laser, power_w, for_s, err);
    if (rc < 0)
        return rc;
    instrument_permit(in, false); // what the guard did before is past
    instrument_permit(in, true);
    rc = instrument_power(in, power_w, err);
    rc = rc < 0 ? rc : instrument_emission_on(in, err);
    if (rc < 0) {
        instrument_permit(in, false);
        instrument_emission_off(in, NULL);
        return rc;
    }
    *a = (struct align){.running = true,
                        .power_w = power_w,
                        .until_ns = instrument_now_ns(in) + CLK_S(for_s),
                        .until_utc_ms = instrument_utc_ns(in) / 1000000 + llrint(for_s * 1e3),
                        .look_ns = instrument_now_ns(in) + LOOK_NS,
                        .changes = a->changes + 1};
    snprintf(a->name, sizeof a->name, "%s", name);
    return 0;
}

void align_end(struct align *a, struct instrument *in, const char *why)
{
    if (!a->running)
        return;
    a->running = false;
    a->changes++;
    snprintf(a->end, sizeof a->end, "%.*s", (int)sizeof a->end - 1, why);
    instrument_permit(in, false);
    instrument_emission_off(in, NULL); // what is not confirmed is repeated by whoever tends
}

// An interlock or a fault ends the arm too: the next light is a person's decision.
static void look(struct align *a, struct instrument *in)
{
    struct laser_status s;
    struct gon_error err;
    const char *why = NULL;
    a->look_ns = instrument_now_ns(in) + LOOK_NS;
    if (instrument_laser(in, &s, &err) < 0)
        why = err.text;
    else if (!s.interlock_closed || s.state == LASER_INTERLOCK)
        why = "the interlock opened";
    else if (s.state == LASER_FAULT || s.state == LASER_NEEDS_KEY)
        why = laser_state_name(s.state);
    if (!why)
        return;
    arm_end(instrument_arm(in), why);
    align_end(a, in, why);
}

void align_step(struct align *a, struct instrument *in)
{
    struct gon_error why;
    const int64_t now_ns = instrument_now_ns(in);
    if (!a->running)
        return;
    if (instrument_alarm(in, &why) < 0)
        align_end(a, in, why.text);
    else if (now_ns >= a->until_ns)
        align_end(a, in, "its time is over");
    else if (now_ns >= a->look_ns)
        look(a, in);
}
