// SPDX-License-Identifier: MIT
// Uncertainties by repetition: the fit is done again on data sets that might have been measured,
// and what the parameters do there is their spread (Efron 1979).
//
// A replica is the fitted model plus noise. Where u is known the noise is normal with that u
// (parametric). Where it is not, each residual, divided by 1 - h for its leverage h, is kept in its
// place and given a random sign (wild bootstrap: Wu 1986, Davidson and Flachaire 2008): unlike
// drawing residuals from one urn this is right when the noise differs from reading to reading, as
// 2 % noise does between the peak and the wings. Both hold noise only, nothing of what the model
// cannot follow.
//
// Intervals are bias-corrected percentiles (Efron 1981): where half of the replicas fall elsewhere
// than below the estimate, the 2.5 and 97.5 % quantiles are moved by twice that. Plain percentiles
// count a bias twice and held the truth in 87 to 90 % of cases near k = 0.
//
// On a bound no bootstrap is right (Andrews 2000): half of the replicas sit there too, and what
// correlates with the bounded parameter spreads some 10 % less than it should. fit_estimate.u does
// not.
//
// A replica's fit starts from the optimum. Its first step is the linearised one; it goes on while
// three more steps still lower q by more than a thousandth of the noise's variance. Another valley
// is not looked for. Replica i has its own generator, made from seed and i.
#pragma once
#include "fit/covariance.h"

#define BOOTSTRAP_MOST 100000

// options: bootstrap (replicas, 0..BOOTSTRAP_MOST), seed, u_scale and the bounds. Takes 7 numbers
// of memory a replica. Spreads are NAN where nothing tells noise (cov is NAN) and for fewer than 2
// replicas. 0 or a negative fit_stop.
int bootstrap_run(const struct fit_set *set, const struct fit_options *options,
                  const struct fit_optimum *best, const struct covariance *cov,
                  struct fit_control *control, struct fit_bootstrap *ret_bootstrap);
