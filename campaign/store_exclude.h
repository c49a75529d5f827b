// SPDX-License-Identifier: MIT
// Readings that a person takes out and puts back, and sweeps that are measured again. Nothing is
// removed: each decision is a row of its own for each reading that it is about, with its reason,
// and the newest row of a reading says what holds:
//
//   excluded   does not count; its point stays measured
//   restored   counts again
//   replaced   does not count, and its point is to be measured again
//   repeated   counts, and its point is to be measured again: a reference
//
// Rejected readings never count and have no rows. Errors are the store's; GON_E_INPUT also for a
// reason that is empty or no text, and for what is not there to be excluded or restored: then
// nothing was changed. Thread: the store's.
#pragma once
#include "campaign/store.h"

enum { STORE_REASON = 400 }; // bytes at most

struct store_exclusion {
    int64_t id, t_utc_ms;
    int sweep, point, attempt;
    const char *what, *reason, *who; // borrowed for the call
};

struct store_decision {
    int64_t t_utc_ms;
    const char *reason, *who;
};

// which: as reading_pick.h. Without an attempt all readings of a point that count are excluded, and
// the last of those that do not is restored. One commit, with an event. Return how many readings.
int store_exclude(struct store *s, const char *which, const struct store_decision *d,
                  struct gon_error *err);
int store_restore(struct store *s, const char *which, const struct store_decision *d,
                  struct gon_error *err);

// All that was measured of a sweep on the sample, 1..sweeps, is replaced. A later reading needs
// references of its own time, while the sweeps of before need theirs: beam and dark are measured
// again and all of them count (campaign/reduce.h). A campaign that was done is stopped then. One
// commit. Returns how many readings of the sweep are replaced.
int store_remeasure(struct store *s, int sweep, const struct store_decision *d,
                    struct gon_error *err);

// For who goes on with it: the closing references come after everything on the sample. Where a
// sweep is open and they were measured before, they are repeated. Returns how many.
int store_reopen_closing(struct store *s, int64_t t_utc_ms, struct gon_error *err);

// The rows, oldest first, until each returns false; files before version 4 have none. Returns how
// many were shown; GON_E_STORE for one whose check value is wrong.
int store_each_exclusion(struct store *s, bool (*each)(void *ctx, const struct store_exclusion *e),
                         void *ctx, struct gon_error *err);
