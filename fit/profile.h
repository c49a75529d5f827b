// SPDX-License-Identifier: MIT
// 95 % intervals by profile likelihood: one parameter is held at a value, the other four are fitted
// again, and the interval ends where q has risen by what the 95 % quantile allows. With weights
// that are not 1/u^2 q is no likelihood; its rise is scaled so that near the optimum it agrees with
// the sandwich covariance (Chandler and Bate 2007). An end that lies beyond a bound is the bound.
//
// In the long curved valley of n, k and ks that scale differs from parameter to parameter, and k
// alone would stop short (80 % coverage was measured). So the intervals of these three also take in
// what they are at the admitted points of the other profiles; where the valley is straight that
// adds nothing. Fits of the others start in every valley (fit/hold.h).
#pragma once
#include "fit/covariance.h"

struct profile {
    double lo95, hi95; // of the parameter itself (k, sigma: not k^2, log sigma)
};

// *best must be a converged optimum with cov taken there. When a profile comes across a lower q
// than best's, *best becomes that (polished) and *ret_better true: covariance and profiles must be
// made again. False when canceled.
bool profile_intervals(const struct fit_set *set, const struct fit_space *space,
                       const struct covariance *cov, struct fit_control *control,
                       struct fit_optimum *best, struct profile ret_profile[FIT_PARAMS],
                       bool *ret_better);
