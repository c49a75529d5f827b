// SPDX-License-Identifier: MIT
// A data set compiled for evaluation: the geometry of every reading computed once, weights
// multiplied in, as structure of arrays. Made once a fit; owns its memory; read-only afterwards, so
// any thread.
#pragma once
#include "fit/control.h"
#include "fit/fit.h"

#define SET_LANES 8 // arrays are padded to a multiple of this with readings of weight zero

// sqrt(g) is multiplied into spec, diffuse, f and u: sums of squares of these are the sums of
// eq. 17. g is scaled so that its largest value is 1, which changes no Delta and cannot overflow.
struct fit_set {
    size_t count;  // readings
    size_t padded; // length of the arrays
    double *tan2_theta, *sin2_beta, *cos2_beta;
    double *spec;    // sqrt(g) A
    double *diffuse; // sqrt(g) / cos theta_i, or sqrt(g) / pi
    double *f;       // sqrt(g) f
    double *u;       // sqrt(g) u; NULL when the uncertainties are not known
    double g_scale;  // what g was divided by
    double bb, ff;   // sums of diffuse^2 and f^2
    void *memory;
};

// Checks and compiles: 0 or a negative fit_stop. ret_set is released with set_free.
int set_compile(const struct fit_data *data, const struct fit_options *options,
                struct fit_control *control, struct fit_set *ret_set);

// `count` readings drawn without replacement in their order, reproducibly for the seed: a smaller
// set to search on. 0 or a negative fit_stop.
int set_sample(const struct fit_set *set, size_t count, uint64_t seed, struct fit_control *control,
               struct fit_set *ret_set);
void set_free(struct fit_set *set); // an all-zero set is fine
