// SPDX-License-Identifier: MIT
// Conditions over an instrument's values, as profiles write them. Terms joined by "and":
//
//   status.fault           the bit fault of status is set        not status.fault     is not
//   emission = 1           also != < <= > >=; beside a word of the value, a name of another value,
//   mode != warming        a number times a name ("|x| <= 1.5 * full_scale"), or over (beyond its
//   x = over               range); | | is the absolute value
//   lias has 0x07          any of these bits                     lias lacks 0x07      none of them
//   model ~ '*-06-*'       a glob over the text, letter case does not matter; !~ is its contrary
//   flag known             flag unknown
//
// A term about a value that is not known is false (but for the last form), whatever it says: what
// must be true to go on was then not seen. "" is true. Thread: any.
#pragma once
#include "drivers/profile_data.h"

bool profile_when(const struct profile *p, const char *condition, const struct profile_data *d);
// 0, or GON_E_INPUT with what is wrong in it.
int profile_when_check(const struct profile *p, const char *condition, struct gon_error *err);
// Which values it speaks of: ret_uses[value] is set to true; others stay.
void profile_when_uses(const struct profile *p, const char *condition,
                       bool ret_uses[PROFILE_VALUES]);
