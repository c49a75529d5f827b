// SPDX-License-Identifier: MIT
// The sandwich covariance of a weighted least squares fit (Huber 1967, White 1980), in the
// coordinates of fit/space.h: H^-1 M H^-1 with H = sum g J J^T and M = sum g^2 s^2 J J^T. It
// holds for any weights, where the plain H^-1 holds only for g = 1/s^2. s is the readings' u where
// known, else the residuals with leverages taken out, r/(1 - h) (HC3, MacKinnon and White 1985),
// which needs no noise model.
//
// What f_00 does not identify (n, k and ks together) leaves H nearly singular. The estimate with
// its sandwich is therefore combined, as one measurement with another, with what is known
// beforehand: that each parameter lies within its bounds, C = (H M^-1 H + P^-1)^-1 with P =
// diag(width/2)^2, the largest variance there is between two bounds (Popoviciu 1935). This keeps C
// finite for a parameter that the data say nothing of, or that sits on its bound, hardly changes
// what is identified, and needs no case for bounds. (Half the width covers best: with the variance
// of a uniform distribution, or with bounds as ridge terms in H, u of identified quantities was 10
// % too small or 35 % too large under uniform weights.) A parameter with equal bounds is known: its
// u is 0. Eigenvalues of the scaled matrices, not inverses, are what is used.
#pragma once
#include "fit/control.h"
#include "fit/kernel.h"
#include "fit/polish.h"

struct covariance {
    double c[FIT_PARAMS][FIT_PARAMS];
    double inverse[FIT_PARAMS][FIT_PARAMS];     // H^-1
    double information[FIT_PARAMS][FIT_PARAMS]; // H M^-1 H: of the readings alone, without bounds
    // Of a parameter held at a distance d from the optimum, q rises by about d^2 / inverse[i][i];
    // that times rise[i] is (d/u)^2 with the sandwich's u, without bounds.
    double rise[FIT_PARAMS];
    bool known[FIT_PARAMS]; // equal bounds
    double dof;             // readings minus parameters
};

// False when canceled. All NAN where nothing can be said: no uncertainties and no degree of
// freedom.
bool covariance_at(const struct fit_set *set, const struct fit_space *space,
                   const double x[FIT_PARAMS], struct fit_control *control,
                   struct covariance *ret_cov);

// The noise s of a block of readings, times sqrt(g): u, or the residual r/(1 - h) with its sign. b
// is what kernel_jacobian says of the `count` readings from `at` on, at the optimum that cov
// belongs to.
void covariance_noise(const struct fit_set *set, const struct covariance *cov,
                      const struct kernel_block *b, size_t at, size_t count, double *ret_s);

// (information + P^-1)^-1: what estimates have that the readings and the bounds know together.
void covariance_combine(const double information[FIT_PARAMS][FIT_PARAMS],
                        const struct fit_space *space, double ret_c[FIT_PARAMS][FIT_PARAMS]);

// Standard uncertainty of a quantity whose gradient by x is `gradient`.
double covariance_u(const struct covariance *cov, const double gradient[FIT_PARAMS]);

// c = sum of axis[i] axis[i]^T: independent directions one standard deviation long.
void covariance_axes(const struct covariance *cov, double ret_axis[FIT_PARAMS][FIT_PARAMS]);
