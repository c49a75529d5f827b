// SPDX-License-Identifier: MIT
// What the guard process needs of a laser's profile to switch it off and to see that: commands as
// bytes, and for each question of off_asks the answers that mean off, as a regular expression.
// Pure. Thread: any.
//
// Of is_off it can express terms that each speak of one value of one answer: of a word or a whole
// number anything (whole numbers: at most 256 of them), of a hexadecimal one that it lacks bits
// ("lacks 0x12", "not status.emission"). Real numbers, texts and comparisons between values are
// refused with GON_E_INPUT; so are a laser without a command that switches on, which could not be
// watched, and what does not fit into struct guard_record. Checksums of answers are not checked.
#pragma once
#include "base/err.h"
#include "guard/talk.h"

struct profile;

int safing_of(const struct profile *p, const char *link, struct guard_record *ret_record,
              struct gon_error *err);
