// SPDX-License-Identifier: MIT
// The passes over a compiled data set, which is where a fit spends its time: the specular column
// a_i = sqrt(g) v A exp(-v tan^2 theta) F(beta) at (n, k^2, log sigma), its derivatives, and inner
// products of these with the diffuse column b and the residuals r = f - ks a - kd b. With polarised
// readings F is the channel's mixture of Fresnel terms (model/channel.h) and b half where there is
// an analyser.
//
// The arithmetic is that of the batch kernels (model/batch.h; what is computed: model/batch_vec.h),
// compiled for the same levels; set->level says which one runs, and levels agree to 1e-13 of the
// columns' lengths. The exponent stays at KERNEL_EXP2_LEAST, so that its square does not underflow.
// Reported values come from model/brdf.h, not from here. Nothing allocates. Any thread.
#pragma once
#include "fit/set.h"

#define KERNEL_EXP2_LEAST -430.0

// Columns of a Gram matrix: the derivatives of a by n, k^2, log sigma, then a, b and r.
enum kernel_column { KERNEL_DN, KERNEL_DKAPPA, KERNEL_DSIGMA, KERNEL_A, KERNEL_B, KERNEL_R,
                     KERNEL_COLUMNS };

struct kernel_gram {
    double m[KERNEL_COLUMNS][KERNEL_COLUMNS]; // symmetric, both halves filled
};

#define KERNEL_BLOCK 128

// x: FIT_PARAMS coordinates of fit/space.h; ks and kd are those that r is taken at.
// The sums over rows [from, to) of set->distinct, `from` a multiple of KERNEL_BLOCK, `to` another
// or the padded length. kernel_moments_of leaves the derivatives' rows and columns undefined and
// costs about a third. What repeated readings scatter about their means is in the sums from row 0.
typedef void kernel_sums(const struct fit_set *set, const double x[FIT_PARAMS], size_t from,
                         size_t to, struct kernel_gram *ret_gram);
kernel_sums kernel_moments_of, kernel_gram_of;
void kernel_add(struct kernel_gram *sum, const struct kernel_gram *part);

// A set is summed in at most KERNEL_PARTS parts of this many rows, which depends on the set's size
// alone, and the parts are added in their order: that makes the sum independent of who computes
// which part.
#define KERNEL_PARTS 64
#define KERNEL_PART_BLOCKS 8 // at least
size_t kernel_part(const struct fit_set *set);

// One block from reading `at` (a multiple of SET_LANES) on, for sums of other kinds: the
// derivatives of the model by x (ks multiplied in where it belongs) and the residuals, of single
// readings. Returns the block's length.
struct kernel_block {
    double j[FIT_PARAMS][KERNEL_BLOCK];
    double r[KERNEL_BLOCK];
};
size_t kernel_jacobian(const struct fit_set *set, const double x[FIT_PARAMS], size_t at,
                       struct kernel_block *ret_block);

// F, dF/dn and dF/d(k^2) at one angle, as the kernel computes them.
void kernel_fresnel(double n, double kappa, double sin2_beta, double cos2_beta, double ret_f[3]);
