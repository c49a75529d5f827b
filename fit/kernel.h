// SPDX-License-Identifier: MIT
// The passes over a compiled data set, which is where a fit spends its time: the specular column
// a_i = sqrt(g) v A exp(-v tan^2 theta) F(beta) at (n, k^2, log sigma), its derivatives, and inner
// products of these with the diffuse column b and the residuals r = f - ks a - kd b.
//
// Plain C over blocks that stay in the first-level cache, written so that the compiler vectorises
// it; sums run in SET_LANES fixed lanes, so that the vector's width does not change a bit of the
// result. The exponential is a polynomial of its own (relative error below 1e-13, arguments below
// -150 taken for -150): reported values come from model/brdf.h, not from here. Nothing allocates.
// Any thread.
#pragma once
#include "fit/control.h"
#include "fit/set.h"

// Columns of a Gram matrix: the derivatives of a by n, k^2, log sigma, then a, b and r.
enum kernel_column { KERNEL_DN, KERNEL_DKAPPA, KERNEL_DSIGMA, KERNEL_A, KERNEL_B, KERNEL_R,
                     KERNEL_COLUMNS };

struct kernel_gram {
    double m[KERNEL_COLUMNS][KERNEL_COLUMNS]; // symmetric, both halves filled
};

// x: FIT_PARAMS coordinates of fit/space.h; ks and kd are those that r is taken at.
// kernel_moments leaves the rows and columns of the derivatives untouched and costs about a third.
// Both return false when canceled.
bool kernel_moments(const struct fit_set *set, const double x[FIT_PARAMS],
                    struct fit_control *control, struct kernel_gram *ret_gram);
bool kernel_gram(const struct fit_set *set, const double x[FIT_PARAMS], struct fit_control *control,
                 struct kernel_gram *ret_gram);

#define KERNEL_BLOCK 128

// One block from reading `at` (a multiple of SET_LANES) on, for sums of other kinds: the
// derivatives of the model by x (ks multiplied in where it belongs) and the residuals. Returns the
// block's length.
struct kernel_block {
    double j[FIT_PARAMS][KERNEL_BLOCK];
    double r[KERNEL_BLOCK];
};
size_t kernel_jacobian(const struct fit_set *set, const double x[FIT_PARAMS], size_t at,
                       struct kernel_block *ret_block);

// F, dF/dn and dF/d(k^2) at one angle, as the kernel computes them.
void kernel_fresnel(double n, double kappa, double sin2_beta, double cos2_beta, double ret_f[3]);
