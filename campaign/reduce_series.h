// SPDX-License-Identifier: MIT
// A reference that was measured now and then: what it was meanwhile, and how well that is known.
// Thread: any; freed by its maker.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

struct reduce_value {
    int64_t t_utc_ms;
    double value;
};

struct reduce_series {          // zeroed: empty
    struct reduce_value *value; // by time
    int count;
    bool interpolated; // else one mean for all of the time
};

int reduce_series_add(struct reduce_series *s, int64_t t_utc_ms, double value,
                      struct gon_error *err); // GON_E_SYSTEM
void reduce_series_clear(struct reduce_series *s);

double reduce_series_mean(const struct reduce_series *s);  // NAN when empty
double reduce_series_least(const struct reduce_series *s); // NAN when empty
// Linear in time between neighbours, before the first and after the last as that one.
double reduce_series_at(const struct reduce_series *s, int64_t t_utc_ms);
// Of all samples those that such a value rests on: all of a mean, one group's when interpolated.
double reduce_series_samples(const struct reduce_series *s, int samples);
// Standard uncertainty of that as its values tell it: of the mean, from their scatter (half the
// difference of two); interpolated, half of the largest difference of neighbours, as what happened
// between them may have happened at once. 0 for a single one.
double reduce_series_u(const struct reduce_series *s);
