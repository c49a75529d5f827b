// SPDX-License-Identifier: MIT
// Whether the laser may be switched on: armed by a person, by name, until an expiry. An arm covers
// all runs until it ends: by its expiry, by who disarms, by an operator's pause or a fault's, by a
// stop. What ended does not come back by itself, and nothing of it outlives the daemon.
//
// Rules without I/O, stepped with the time of the monotonic clock. Thread: whoever owns it; others
// get copies.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { ARM_NAME = 65, ARM_REASON = 161, ARM_END = 240 }; // sizes with the final NUL

#define ARM_LEAST_S 1.0
#define ARM_MOST_S (7 * 86400.0)

struct arm { // zeroed: not armed
    bool live;
    char name[ARM_NAME], reason[ARM_REASON];
    int64_t since_utc_ms, until_utc_ms; // for people
    int64_t expiry_ns;                  // what counts, monotonic
    char end[ARM_END];                  // why the last one ended; "": live, or there was none
    uint64_t changes;                   // rises with each
};

// GON_E_INPUT: no name, or texts longer than the sizes above, or for_s outside
// ARM_LEAST_S..ARM_MOST_S; then the arm stays as it was. An arm that is live is replaced.
int arm_set(struct arm *a, const char *name, const char *reason, double for_s, int64_t now_ns,
            int64_t utc_ms, struct gon_error *err);
// The same, but a live one that lasts longer stays as it is.
int arm_extend(struct arm *a, const char *name, const char *reason, double for_s, int64_t now_ns,
               int64_t utc_ms, struct gon_error *err);
// The first reason of an end is kept; nothing when it is not live.
void arm_end(struct arm *a, const char *why);
// Ends one that ran out.
void arm_tick(struct arm *a, int64_t now_ns);
bool arm_is_live(const struct arm *a, int64_t now_ns); // NULL: no
// "armed by anna until 2027-01-15 20:00 (night run)", or why it is not; one clause, no full stop.
void arm_describe(const struct arm *a, char *text, size_t size);
// GON_E_REFUSED, with what to do: not live. Begins with "not armed".
int arm_check(const struct arm *a, int64_t now_ns, struct gon_error *err);
