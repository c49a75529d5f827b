// SPDX-License-Identifier: MIT
// Whether a campaign file is whole: its structure, every check value, no attempt and no point
// missing between others, nothing that refers to what is not there. All in one reading transaction,
// so that a file that is being written is looked at as it was in one moment, and the writer never
// waits. Thread: the store's.
#pragma once
#include "campaign/store.h"

struct store_finding {
    const char *what; // "structure", "meta", "config", "bench", "plan", "profile", "exclusion",
                      // "reading", "hole", "reference", "state"
    int sweep, point, attempt; // -1: not of one
    const char *text;          // names it; borrowed for the call
};

struct store_verified {
    int version;
    int64_t points, readings, profiles, exclusions, reductions, fits; // that were looked at
    int64_t findings;
};

// 0, whatever was found; GON_E_STORE: it cannot even be read. found is told each time.
int store_verify(struct store *s, void (*found)(void *ctx, const struct store_finding *f),
                 void *ctx, struct store_verified *ret_verified, struct gon_error *err);
