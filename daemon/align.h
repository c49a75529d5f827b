// SPDX-License-Identifier: MIT
// An alignment session: light at a low power for a short time while no run has the bench, so that
// somebody can align the beam. It ends with its time, with its arm, when the guard switches off, when
// the interlock opens or the laser fails, and when a run or a stop comes. Thread: instrument.
#pragma once
#include "base/err.h"
#include "daemon/arm.h"

#include <stdbool.h>
#include <stdint.h>

struct bench_laser;
struct instrument;

#define ALIGN_MOST_S 1800.0

struct align { // zeroed: none
    bool running;
    char name[ARM_NAME];
    double power_w;
    int64_t until_utc_ms; // for people
    int64_t until_ns, look_ns;
    char end[ARM_END]; // why the last one ended; ""
    uint64_t changes;  // rises with each
};

// GON_E_INPUT: above laser.align_power_w, or longer than ALIGN_MOST_S; GON_E_REFUSED: the bench
// allows none, or one is running.
int align_may(const struct align *a, const struct bench_laser *l, double power_w, double for_s,
              struct gon_error *err);
// The same, then power set and on. GON_E_REFUSED: also not armed, interlock; GON_E_DEVICE and the
// link's. Then the laser is off.
int align_begin(struct align *a, struct instrument *in, const char *name, double power_w,
                double for_s, struct gon_error *err);
// At least every 100 ms, between breaths.
void align_step(struct align *a, struct instrument *in);
void align_end(struct align *a, struct instrument *in, const char *why); // laser off; none: nothing
