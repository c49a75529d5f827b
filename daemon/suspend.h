// SPDX-License-Identifier: MIT
// The bench's suspenders (campaign/bench_suspend.h) against what is seen of it. A core without
// devices: it is told when it is looked and asks for values, so that tests step it.
//
// One keeps a run from going on while it holds; then until it has not held for its settle time; and
// a manual one until somebody releases it. What cannot be judged at the moment (the monitor without
// light) does not hold. Thread: instrument.
#pragma once
#include "campaign/bench_suspend.h"

#include <stdbool.h>
#include <stdint.h>

struct bench_config;

// For whoever shows them.
struct suspender_state {
    const char *name; // NULL: none
    bool manual;      // waits for a release
    bool holds;       // now
    bool keeps;       // the run from going on
    bool waits;       // quiet, but not released yet
    bool needs_light; // nobody sees without light whether it holds
    double settle_s;  // for so long it has to be quiet
    double left_s;    // of that; 0: quiet for long enough. While it holds all of it
    char text[160];   // what it said when it held last; "" never
};

struct suspend_source {
    void *ctx;
    // NAN: not known. False: cannot be judged now.
    bool (*value)(void *ctx, const struct bench_term *t, double *ret_value);
};

struct suspend {
    const struct bench_config *bench;
    struct {
        struct bench_condition condition;
        bool holds, latched, needs_light;
        int64_t quiet_ns; // since when it has not held; INT64_MIN: it never has
        char text[160];
    } one[BENCH_SUSPENDERS];
};

// The bench is borrowed, and was checked (bench_suspend_check).
void suspend_init(struct suspend *s, const struct bench_config *bench);
void suspend_look(struct suspend *s, int64_t now_ns, const struct suspend_source *source);
// Somebody says that the run may go on: forgets what does not hold now.
void suspend_release(struct suspend *s);
struct suspender_state suspend_state(const struct suspend *s, int index, int64_t now_ns);
// The one that keeps the run from going on, one that holds first; -1: none.
int suspend_first(const struct suspend *s, int64_t now_ns);
bool suspend_uses(const struct suspend *s, bool (*is)(const struct bench_term *t));
