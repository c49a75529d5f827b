// SPDX-License-Identifier: MIT
// What the residuals say of the model: noise is not smooth. Neighbours are readings of one theta_i
// and one azimuth plane next to each other in angle; above RESIDUALS_SORT_MAX readings, next to
// each other in the order given (a sort could not be interrupted).
#pragma once
#include "fit/control.h"
#include "fit/set.h"

#define RESIDUALS_SORT_MAX ((size_t)20000)

struct residuals {
    double lag1;    // autocorrelation of neighbouring weighted residuals; NAN without neighbours
    double z;       // lag1's significance: standard normal when the residuals are independent
    double chi2;    // sum (r/u)^2; NAN without u
    int sweeps;     // different theta_i, counted up to 3
};

// 0 or a negative fit_stop.
int residuals_study(const struct fit_data *data, const struct fit_set *set,
                    const struct brdf_params *p, struct fit_control *control,
                    struct residuals *ret_residuals);
