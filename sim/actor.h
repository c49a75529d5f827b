// SPDX-License-Identifier: MIT
// An instrument made from its profile: it keeps its values, answers what the profile says it can be
// asked, and lets values go where "simulate" says they go, by the time that is passed in. What it
// is fed through: sim/actor_message (lines of text) and sim/actor_registers (a Modbus unit). The
// simulator reads profiles with its own code, so that it is wrong in its own ways. Thread: one.
//
// A value goes somewhere (drift) while its row's condition holds, the first such row of a value
// counts; arrivals are exact in time, other conditions are looked at every 10 ms, or a thousandth
// of the time passed if that is longer. What "follows" says is carried out as often.
#pragma once
#include "base/err.h"
#include "sim/actor_values.h"

#include <stdint.h>

struct actor;

// What the actor has to do with a world around it (sim/actor_world.h): meet brings the world up to
// that time and puts into the actor's values what it sees of it.
struct actor_link {
    void (*meet)(struct actor_link *l, int64_t t_ns);
    bool tells[PROFILE_VALUES]; // values that come from the world: no drift moves them
};

struct actor {
    struct actor_values now; // first to look at after actor_step
    struct actor_link *link; // NULL: it stands alone
    int64_t t_ns;
    bool there[PROFILE_STEPS]; // a drift has arrived and its "then" was done
    int64_t last_ns;           // of the last command; INT64_MIN
    uint64_t commands, too_early, refused;
};

// The profile is borrowed for the actor's life. GON_E_INPUT: something in "then" or "deny" cannot
// be read.
int actor_init(struct actor *a, const struct profile *p, int64_t t_ns, struct gon_error *err);
void actor_power_cycle(struct actor *a, int64_t t_ns);
void actor_step(struct actor *a, int64_t t_ns); // to that time; never back
// The same, the world around it included: before and after whatever is asked of it or done to it.
void actor_meet(struct actor *a, int64_t t_ns);
// Carries out assignments from outside ("interlock = 1", "status.fault = 1"), whatever a value's
// range. GON_E_INPUT.
int actor_set(struct actor *a, const char *assignments, int64_t t_ns, struct gon_error *err);
// The same for a command of the instrument, whose profile was looked through by actor_init.
void actor_do(struct actor *a, const char *assignments);
// The row that denies an exchange or write ("": unknown commands) in the state v; NULL: none.
const struct profile_deny *actor_denies(const struct actor_values *v, const char *does);
