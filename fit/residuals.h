// SPDX-License-Identifier: MIT
// What the residuals say of the model: noise is not smooth.
//
// Under weights that are not 1/u^2 the largest residuals drown the others, and an estimate that
// wastes readings leaves smooth residuals of its own where it is off by its own uncertainty. So
// neighbours are compared at the fit that 1/noise^2 would give (u, or the noise law of
// fit/noise.h), polished from the optimum, each residual divided by its noise. Neighbours are
// readings of one theta_i, one azimuth plane and one polarisation channel next to each other in
// angle; above RESIDUALS_SORT_MAX readings they are compared under the weights given, in the order
// given (a sort could not be interrupted).
#pragma once
#include "fit/control.h"
#include "fit/polish.h"
#include "fit/set.h"

#define RESIDUALS_SORT_MAX ((size_t)20000)

struct residuals {
    double lag1;       // autocorrelation of neighbouring residuals; NAN without neighbours
    double z;          // lag1's significance: standard normal when the residuals are independent
    double signs_z;    // the same of how many neighbours share a sign, which no outlier can sway
    double chi2;       // sum (r/u)^2 at p; NAN without u
    double least_chi2; // the same at the fit with weights 1/u^2: there noise alone makes it 1 a
                       // reading
    int sweeps;        // different theta_i, counted up to 3
};

// p: what is reported. optimum: next to it, where the polish starts. 0 or a negative fit_stop.
int residuals_study(const struct fit_data *data, const struct fit_set *set,
                    const struct fit_options *options, const struct brdf_params *p,
                    const struct fit_optimum *optimum, struct fit_control *control,
                    struct residuals *ret_residuals);
