// SPDX-License-Identifier: MIT
// Readings as a person names them: SWEEP, SWEEP/POINT, SWEEP/FIRST-LAST, SWEEP/POINT/ATTEMPT,
// several with commas: "1/3,1/5-9,2". The numbers are those of the plan. Thread: any.
#pragma once
#include "base/err.h"

enum { READING_PICKS = 1000, READING_PICK_ALL = 0x7fffffff };

struct reading_pick {
    int sweep;
    int first, last; // points; 0..READING_PICK_ALL: the whole sweep
    int attempt;     // 0: not said
};

// Returns how many; GON_E_INPUT names the part that is wrong.
int reading_picks_take(const char *text, struct reading_pick ret_picks[READING_PICKS],
                       struct gon_error *err);
