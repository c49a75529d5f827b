// SPDX-License-Identifier: MIT
// The profiles that a bench names, as texts for the campaign files: read once, when the daemon
// starts, as the devices read theirs when they are first opened.
#pragma once
#include "base/err.h"
#include "campaign/bench.h"
#include "campaign/store.h"

enum { PROFILE_TEXTS = BENCH_AXES + BENCH_DEVICES + 3 };

struct profile_texts {
    struct store_profile profile[PROFILE_TEXTS]; // each name once; the names are the bench's
    int count;
};

// GON_E_INPUT: one that is not there, or has a mistake; nothing is to be freed then.
int profile_texts_read(const struct bench_config *bench, struct profile_texts *ret_texts,
                       struct gon_error *err);
void profile_texts_free(struct profile_texts *texts); // what is all zero is fine
