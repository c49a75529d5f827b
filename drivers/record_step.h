// SPDX-License-Identifier: MIT
// What a line of a recording means (the forms are in drivers/recorder.h), and whether it may be
// done. Pure. Thread: any.
#pragma once
#include "drivers/profile_golden.h"

struct record_step {
    struct profile_asks asks; // count 0: does
    char does[PROFILE_NAME];
    char with[PROFILE_LONG]; // assignments, "" for none
};

// GON_E_INPUT: no such thing.
int record_step_parse(const struct profile *p, const char *line, struct record_step *ret_step,
                      struct gon_error *err);
// GON_E_INPUT: a value that cannot be; GON_E_REFUSED: it would switch light on or keep it on.
int record_step_may(const struct profile *p, const struct record_step *step, struct gon_error *err);
// What it is told: values into data, $NAMEs into params. GON_E_INPUT.
int record_step_with(const struct profile *p, const struct record_step *step,
                     struct profile_data *d, struct golden_params *ret_params,
                     struct gon_error *err);
