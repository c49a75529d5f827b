// SPDX-License-Identifier: MIT
// How noisy the readings are, as a law that also tells the noise of readings not made yet: a part
// in proportion to the reading and a floor. Pure: any thread.
#pragma once
#include "fit/fit.h"

struct noise { // u^2 = (relative f)^2 + floor^2
    double relative, floor_per_sr;
};

// Fitted to the data's u, or without u to the residuals at x (fit/space.h); by some thousand
// readings, evenly taken. Zeros where there is no noise.
struct noise noise_of(const struct fit_data *data, enum brdf_diffuse diffuse,
                      const double x[FIT_PARAMS]);

// Standard uncertainty of a reading f.
double noise_u(const struct noise *n, double f_per_sr);
