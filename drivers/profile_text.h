// SPDX-License-Identifier: MIT
// The patterns of a message profile: a command written from values, an answer read into them.
//
//   {name}         the value as its type says (a whole number, %.10g, hexadecimal, word, text)
//   {name:05.2f}   written as printf would: [0][width][.precision] and d, x, X, f, e, g or s;
//                  read by type whatever is said here, but x and X read hexadecimal
//   {}             reading only: any text, not kept
//   [ ... ]        reading only: may be missing, as a whole; its values then become unknown
//   blank          reading: any number of blanks, also none; writing: one blank
//   {{ }} [[ ]]    the characters { } [ ]
//
// A value ends where the pattern's next character stands; a text takes as little as possible. The
// answer has to fit as a whole, from its first to its last character. Numbers are read by
// message_decimal (a decimal point, never a comma; no nan, no inf). Thread: any.
#pragma once
#include "drivers/profile_data.h"

// GON_E_INPUT: a value is not known, does not fit (profile_wire) or there is no room.
int profile_text_write(const struct profile *p, const char *pattern, const struct profile_data *d,
                       char *ret_text, size_t size, struct gon_error *err);
// GON_E_LINK: does not fit the pattern, or a value cannot be (profile_number); d is then untouched.
// Otherwise the pattern's values in d are known, or unknown where they said that they are none
// (invalid).
int profile_text_read(const struct profile *p, const char *pattern, const char *answer,
                      struct profile_data *d, struct gon_error *err);
// 0, or GON_E_INPUT: what is wrong in the pattern. reading: whether it is an answer.
int profile_text_check(const struct profile *p, const char *pattern, bool reading,
                       struct gon_error *err);
// ret_uses[value] is set to true for each value in it.
void profile_text_uses(const struct profile *p, const char *pattern, bool ret_uses[PROFILE_VALUES]);
