// SPDX-License-Identifier: MIT
// A profile's conditions and assignments over what a simulated instrument knows, read by the
// simulator's own code. The grammar of conditions is in drivers/profile_when.h, that of assignments
// in drivers/profile.h ("then"). Thread: any.
#pragma once
#include "base/err.h"
#include "sim/actor_values.h"

// "" holds; what cannot be read does not.
bool actor_when(const struct actor_values *v, const char *condition);
// Carries all of them out, or none: GON_E_INPUT says which cannot be read.
int actor_then(struct actor_values *v, const char *assignments, struct gon_error *err);
// What a text stands for beside a value (-1: none): a number, one of its words, over, or what
// another value is. NAN: none of these.
double actor_number(const struct actor_values *v, const char *text, int beside);
// "speed = $speed", "type = 1" or "speed" of a Modbus write: the value that it sets, and whether
// what is in v is what it would set ($ and a name alone: anything is). False: it cannot be read.
bool actor_item(const struct actor_values *v, const char *item, int *ret_value, bool *ret_fits);
