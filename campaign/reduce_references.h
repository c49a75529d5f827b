// SPDX-License-Identifier: MIT
// Private to campaign/reduce*.c: what dark and beam readings say, and when. Thread: any.
#pragma once
#include "campaign/reduce.h"
#include "campaign/reduce_series.h"

struct reduce_beam {
    struct reduce_series signal, monitor, ratio; // ratio: over its dark
    int samples, out;                            // out: what stood before the detector
    int excluded;                                // readings
};

struct reduce_references {
    struct reduce_series dark_signal, dark_monitor;
    int dark_samples, dark_excluded;
    struct reduce_beam beam[POL_COUNT]; // by the light's state
    bool again;                         // one was measured again: after a gap, or with a sweep
};

// Every reading that counts of a dark or a beam: one that was measured again stands beside the
// earlier ones. GON_E_SYSTEM; to be cleared also then.
int reduce_references_of(const struct plan *plan, const struct store_reading *rows, int count,
                         struct reduce_references *ret_references, struct gon_error *err);
void reduce_references_clear(struct reduce_references *f);
struct reduce_reference reduce_reference_means(const struct reduce_references *f);
