// SPDX-License-Identifier: MIT
// What the measurements of check_links share: the bad line, what is counted, and a quantity that
// is another one each millisecond, so that an old value is a wrong value.
#pragma once
#include "drivers/transport.h"
#include "tests/unit/noisy.h"
#include "tests/unit/vline.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

enum { LINKS_ONE_IN = 200 };
#define LINKS_LATE_NS CLK_S(3)
#define LINKS_QUIET_MS 3100 // the largest latency, as a profile would say
#define LINKS_TIMEOUT_MS 100
#define LINKS_REPLY_NS CLK_MS(2)

struct links_tally {
    int reads, answered, refused; // refused: an error was reported
    int wrong;                    // accepted, though the quantity did not hold it meanwhile
    int beyond;                   // of these outside what the profile allows
    uint64_t faults;
    double line_s; // time on the line
};

static struct noisy links_line;

// faults: bits of noisy_fault; one in 200 answers has one of them.
static inline struct clk *links_begin(struct port *device, bool tcp, unsigned faults, int seed)
{
    noisy_init(&links_line, device, (uint64_t)seed, LINKS_ONE_IN);
    links_line.all = true;
    links_line.only = faults;
    links_line.one_in = LINKS_ONE_IN * (unsigned)__builtin_popcount(faults) / NOISY_ALL;
    links_line.soon_ns = 4 * LINKS_REPLY_NS; // between the next question and its answer
    links_line.late_most_ns = links_line.double_most_ns = LINKS_LATE_NS;
    return tcp ? vline_begin_tcp(&links_line.port) : vline_begin(&links_line.port);
}

static inline void links_finish(struct links_tally *t, int reads)
{
    t->reads = reads;
    t->faults = links_line.faults;
    t->line_s = (double)vline.clk.t_ns * 1e-9;
}

// --- a quantity ----------------------------------------------------------------------------------

enum { LINKS_TICKS = 3000000, LINKS_TURN = 1000000 }; // the values begin again after 50 min

static inline int64_t links_tick(int64_t t_ns)
{
    return t_ns / CLK_MS(1);
}

static inline double links_x(int64_t tick)
{
    return (double)(tick % LINKS_TICKS - LINKS_TICKS / 2) * 1e-6;
}

static inline double links_y(int64_t tick)
{
    return links_x(tick + LINKS_TURN);
}

static inline double links_frequency(int64_t tick)
{
    return (double)(1000 + tick % 100000);
}

// The tick not before begun at which x was this; -1: never.
static inline int64_t links_when(double x, int64_t begun)
{
    const double k = x * 1e6 + LINKS_TICKS / 2;
    const int64_t whole = llround(k);
    if (!(fabs(k - (double)whole) < 1e-3) || whole < 0 || whole >= LINKS_TICKS)
        return -1;
    return begun + (whole - begun % LINKS_TICKS + LINKS_TICKS) % LINKS_TICKS;
}

static inline bool links_is(double a, double b)
{
    return fabs(a - b) < 1e-8 + 1e-8 * fabs(b);
}
