// SPDX-License-Identifier: MIT
// Everything of a fit_result but the search: values, uncertainties, intervals, what they are
// derived into, and warnings. u of a parameter is the square root of the sandwich covariance
// (fit/covariance.h); for k, whose coordinate is k^2, u(k) = sqrt(k^2 + u(k^2)) - k, which is
// u(k^2)/(2 k) for a k well above 0 and stays finite at k = 0. Derived quantities use the whole
// covariance, so that what the data do identify keeps its small u although n, k and ks do not.
#pragma once
#include "fit/polish.h"

// *optimum of a memetic search is replaced when a profile comes across a better one. 0 or a
// negative fit_stop.
int uncertainty_estimate(const struct fit_data *data, const struct fit_set *set,
                         const struct fit_options *options, struct fit_control *control,
                         struct fit_optimum *optimum, struct fit_result *ret_result);
