// SPDX-License-Identifier: MIT
// The pace at which something lost is tried again: after each failure twice as long, from 0.1 s to
// 5 s. Pure; a zeroed struct is due at once. Thread: its owner's.
#pragma once
#include "base/clk.h"

#include <stdbool.h>
#include <stdint.h>

#define BACKOFF_LEAST_NS CLK_MS(100)
#define BACKOFF_MOST_NS CLK_S(5)

struct backoff {
    int64_t wait_ns; // after the last failure; 0: there was none
    int64_t next_ns; // not before
};

bool backoff_due(const struct backoff *b, int64_t now_ns);
void backoff_failed(struct backoff *b, int64_t now_ns); // a try ended now
void backoff_reset(struct backoff *b);                  // it is there again
