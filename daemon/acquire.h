// SPDX-License-Identifier: MIT
// One attempt at one reading: wait until the filter has settled, take samples that are nearly
// independent, say what was wrong with them. Thread: instrument.
//
// Settling: until the residual of a step through n RC poles (detector_settle_s) is ACQUIRE_RESIDUAL
// of the signal before; and when the first sample shows that the signal fell, until it is that much
// of the new signal. It counts from the arrival (or the light's change) and from the change of
// range. Spacing (plan_spacing_s): white noise through n equal poles is correlated over x = t /
// time constant by
//   1: e^-x   2: (1 + x) e^-x   3: (1 + x + x^2/3) e^-x   4: (1 + x + 2x^2/5 + x^3/15) e^-x,
// and the samples are spaced to a correlation of 0.05, where the sd of the mean of four taken as
// independent is low by 5 %.
#pragma once
#include "base/cancel.h"
#include "base/err.h"
#include "daemon/instrument.h"

#define ACQUIRE_RESIDUAL 1e-4
#define ACQUIRE_UNDER                                                                              \
    0.2 // of the next smaller range's full scale: below it the next reading goes down
#define ACQUIRE_POOR                                                                               \
    0.05 // of its own full scale: below it the reading is made again, further down:
         // there a step of 1/65536 full scale is 3e-4 of the signal

// Where the ranging stands. Start with {.range = -1}; acquire_begin before each point.
struct acquire {
    int range;            // of the next attempt; -1: the least sensitive
    int least_range;      // at this point anything more sensitive saturated
    int ups;              // ranges gone up at this point: the steps double
    bool set_up;          // its settings are to be written again first
    int64_t range_ns;     // when the range was last changed
    double last_signal_v; // of the reading before, for the settling; 0: none
};

struct acquire_wish {
    int count;         // samples, 1..1000
    int64_t since_ns;  // when the light last changed: arrival, laser on or off
    int64_t source_ns; // when that of the source did: what a monitor of its own has to settle from
    double monitor_least_v; // below it the light was lost; NAN: not checked
};

struct acquire_reading {
    int64_t utc_ns; // of the first sample
    int count, range;
    double signal_v, signal_sd_v;   // mean, sample sd (0 for one sample)
    double monitor_v, monitor_sd_v; // NAN: no monitor
    unsigned flags;                 // of store.h
    bool monitor_failed;            // a monitor of its own was beyond its range, or unsettled
    bool accepted;
    bool again; // not accepted, and another attempt may mend it (the range was changed in acquire)
};

void acquire_begin(struct acquire *a);
// GON_E_LINK and GON_E_GONE: the detector went away and nothing was measured.
int acquire_attempt(struct instrument *in, struct acquire *a, const struct acquire_wish *wish,
                    const struct cancel *cancel, struct acquire_reading *ret_reading,
                    struct gon_error *err);
