// SPDX-License-Identifier: MIT
// The instrument of a text profile, simulated by that profile, at the end of a line that can be
// noisy, in virtual time. One a program.
#pragma once
#include "drivers/by_profile.h"
#include "sim/actor_message.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <math.h>

struct profiled {
    const struct profile *profile;
    struct actor actor;
    struct actor_message device;
    struct noisy line;
    struct clk *clk;
};

static struct profiled profiled;

// The link is vline.link, the clock profiled.clk.
static inline void profiled_begin(const struct profile *p)
{
    struct gon_error err;
    profiled.profile = p;
    if (actor_init(&profiled.actor, p, CLK_S(1), &err) < 0)
        abort();
    actor_message_init(&profiled.device, &profiled.actor);
    noisy_init(&profiled.line, &profiled.device.port, 20240917, 0);
    profiled.clk = vline_begin(&profiled.line.port);
}

// What somebody else does to it: "interlock = 1".
static inline void profiled_do(const char *assignments)
{
    struct gon_error err;
    if (actor_set(&profiled.actor, assignments, vline.clk.t_ns, &err) < 0)
        abort();
}

static inline double profiled_number(const char *name)
{
    actor_step(&profiled.actor, vline.clk.t_ns);
    const int i = actor_values_find(&profiled.actor.now, name, strlen(name));
    return i < 0 ? (double)NAN : profiled.actor.now.number[i];
}

static inline void profiled_run(double s)
{
    clk_sleep(&vline.clk.clk, CLK_S(s), NULL);
}
