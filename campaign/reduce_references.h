// SPDX-License-Identifier: MIT
// Private to campaign/reduce*.c: what dark and beam readings say.
#pragma once
#include "campaign/reduce.h"

// Mean of a few values and its standard uncertainty, 0 for a single one: half the difference of
// two, which is also what their scatter gives, and of more half the largest difference.
struct reduce_mean {
    double sum, least, most;
    int n;
};
double reduce_mean_of(const struct reduce_mean *m); // NAN of none
double reduce_mean_u(const struct reduce_mean *m);

struct reduce_beam {
    struct reduce_mean signal, monitor, ratio;
    int samples, out; // out: what stood before the detector
    int excluded;     // readings
};

struct reduce_references {
    struct reduce_mean dark_signal, dark_monitor;
    int dark_samples, dark_excluded;
    struct reduce_beam beam[POL_COUNT]; // by the light's state
};

// Every reading that counts of a dark or a beam up to a sweep: one that was measured again stands
// beside the earlier ones.
struct reduce_references reduce_references_of(const struct plan *plan,
                                              const struct store_reading *rows, int count,
                                              int last_sweep);
struct reduce_reference reduce_reference_means(const struct reduce_references *f);
