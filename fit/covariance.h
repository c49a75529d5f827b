// SPDX-License-Identifier: MIT
// The sandwich covariance of a weighted least squares fit (Huber 1967, White 1980), in the
// coordinates of fit/space.h: C = H^-1 M H^-1 with H = sum g J J^T and M = sum g^2 s^2 J J^T. It
// holds for any weights, where the plain H^-1 holds only for g = 1/s^2. s is the readings' u where
// known, else the residuals with leverages taken out, r/(1 - h) (HC3, MacKinnon and White 1985),
// which needs no noise model.
//
// What f_00 does not identify (n, k and ks together) leaves H nearly singular. Every parameter is
// therefore given what is known of it beforehand: that it lies within its bounds, as one
// pseudo-observation with the variance of a uniform distribution, width^2/12. This keeps C finite
// for a parameter that the data say nothing of, or that sits on its bound, changes well-identified
// parameters and products by far less than 1 %, and needs no case for bounds. A parameter with
// equal bounds is known: its u is 0. Eigenvalues of the scaled H, not an inverse, are what is used.
#pragma once
#include "fit/control.h"
#include "fit/polish.h"

struct covariance {
    double c[FIT_PARAMS][FIT_PARAMS];
    // H^-1 with the pseudo-observations: its diagonal against c's scales likelihood ratios
    // (fit/profile.h).
    double inverse[FIT_PARAMS][FIT_PARAMS];
    bool known[FIT_PARAMS]; // equal bounds
    double dof;             // readings minus parameters
};

// False when canceled. All NAN where nothing can be said: no uncertainties and no degree of
// freedom.
bool covariance_at(const struct fit_set *set, const struct fit_space *space,
                   const double x[FIT_PARAMS], struct fit_control *control,
                   struct covariance *ret_cov);

// Standard uncertainty of a quantity whose gradient by x is `gradient`.
double covariance_u(const struct covariance *cov, const double gradient[FIT_PARAMS]);

// c = sum of axis[i] axis[i]^T: independent directions one standard deviation long.
void covariance_axes(const struct covariance *cov, double ret_axis[FIT_PARAMS][FIT_PARAMS]);
