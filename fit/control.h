// SPDX-License-Identifier: MIT
// What every long computation of fit/ carries: has somebody asked to stop, how much was computed,
// and who helps. One thread's own. After control_spend has returned true, results are worthless and
// callers only unwind.
#pragma once
#include <stdbool.h>
#include <stddef.h>

struct pool; // fit/pool.h

struct fit_control {
    bool (*canceled)(void *ctx); // NULL: never
    void *ctx;
    bool stop;
    size_t unchecked;  // points since canceled was last asked
    double points;     // evaluated in all
    struct pool *pool; // NULL: this thread works alone
};

// About 0.3 ms of work at 10 ns a point and 1 ms with derivatives.
#define CONTROL_SLICE ((size_t)32768)

// For work that is not counted in points.
static inline bool control_ask(struct fit_control *c)
{
    c->unchecked = 0;
    c->stop = c->stop || (c->canceled && c->canceled(c->ctx));
    return c->stop;
}

static inline bool control_spend(struct fit_control *c, size_t points)
{
    c->points += (double)points;
    c->unchecked += points;
    return c->unchecked >= CONTROL_SLICE ? control_ask(c) : c->stop;
}
