// SPDX-License-Identifier: MIT
// The Modbus side of an instrument made from a profile (sim/actor.h): its values as registers and
// bits of one unit. Thread: one.
//
// What has no register gives exception 2, but for gaps that the profile allows to be read along,
// which read 0; so does writing what can only be read. Half of a 32-bit value can be read, not
// written (3); a value beyond its range is refused (3). A write of the profile is recognised when
// everything it sets was written in one request, as it would (its trigger); its edge when that bit
// was 0 before. Then its "then" follows. "deny" gives the exception's number, 4 if it says none.
#pragma once
#include "sim/actor.h"
#include "sim/modbus.h"

struct sim_modbus_unit actor_registers_unit(struct actor *actor, int id);
