// SPDX-License-Identifier: MIT
// 95 % intervals by profile likelihood: one parameter is held at a value, the other four are fitted again,
// and the interval ends where q has risen by what the 95 % quantile allows. With weights that are not 1/u^2
// q is no likelihood; its rise is scaled so that near the optimum it agrees with the sandwich covariance
// (Chandler and Bate 2007). An end that lies beyond a bound is the bound.
#pragma once
#include "fit/covariance.h"

struct profile {
    double lo95, hi95; // of the parameter itself (k, sigma: not k^2, log sigma)
};

// *best must be a converged optimum with cov taken there. When a profile comes across a lower q than best's,
// *best becomes that (polished) and *ret_better true: covariance and profiles must be made again.
// False when canceled.
bool profile_interval(const struct fit_set *set, const struct fit_space *space,
                      const struct covariance *cov, enum fit_param which,
                      struct fit_control *control, struct fit_optimum *best,
                      struct profile *ret_profile, bool *ret_better);
