// SPDX-License-Identifier: MIT
// f_00 (eq. 16) and its Jacobian at many directions at once: what does not depend on the parameters
// is computed once, as structure of arrays, and the rest in real arithmetic, a vector at a time
// (physics: F of model/brdf.h, arranged for one division and two square roots).
//
// The same source is compiled for several instruction sets (levels). All give the same values to
// 1e-13, and to 1e-12 those of model/brdf.h, relative, for n >= 0.2 and any k: also at k = 0, for n
// next to 1, at total reflection (n < 1) and at grazing angles (seen: 7e-15 and 4e-13). For smaller
// n, and within 1e-8 of the critical angle, it is 1e-16/|N^2 - sin^2 beta|: what the angles' own
// rounding makes of F. Floors:
// - exp(-tan^2 theta/(2 sigma^2)) stays at 2^BATCH_EXP2_LEAST, 1e-301, however far from the peak:
//   nothing underflows, and nobody pays for denormal numbers;
// - on the critical angle of n < 1 with k = 0 the slope of F by n and k^2 is infinite. The Jacobian
//   takes that of |N^2 - sin^2 beta| >= BATCH_M_LEAST, and 1/k of k >= BATCH_K_LEAST.
//
// A struct batch owns its memory and is read-only once made: any thread. Pure functions; nothing is
// allocated but by batch_new.
#pragma once
#include "model/brdf.h"

#include <stdbool.h>
#include <stddef.h>

#define BATCH_PAD 8             // arrays are as long as a multiple of this
#define BATCH_EXP2_LEAST -1000.0
#define BATCH_M_LEAST 1e-9
#define BATCH_K_LEAST 1e-6

enum batch_level { BATCH_PLAIN, BATCH_AVX2, BATCH_AVX512, BATCH_LEVELS };

// The highest level that this build has and this processor runs.
enum batch_level batch_best_level(void);
const char *batch_level_name(enum batch_level level); // "plain" ("sse2" on x86), "avx2", "avx512"

// The parameters, in what the evaluation makes of them.
struct batch_point {
    double n, k, kappa, inv_k; // kappa = k^2; inv_k = 1/max(k, BATCH_K_LEAST)
    double above, im, im2;     // Re N^2 - 1; Im N^2 = 2 n k and its square
    double w, wn, wk;          // |N^2 - 1|^2 and its derivatives by n and kappa
    double v;                  // 1/(2 sigma^2)
    double exp2_scale;         // tan^2 theta to the power of 2: -v / ln 2
    double exp2_least;         // BATCH_EXP2_LEAST, or higher
};
struct batch_point batch_point(double n, double kappa, double sigma);

struct batch {
    size_t count, padded;
    double *tan2_theta, *cos_beta; // of the facet
    double *spec;                  // A of model/brdf.h
    double *diffuse;               // 1/cos theta_i or 1/pi
};

// False when memory is short. Directions outside the domain of brdf_geometry become NAN.
bool batch_new(size_t count, const double *theta_i_rad, const double *theta_r_rad,
               const double *dphi_rad, enum brdf_diffuse diffuse, struct batch *ret_batch);
void batch_free(struct batch *b); // an all-zero batch is fine

// ret_f: `padded` numbers. All NAN when p is outside the domain of model/brdf.h.
void batch_f00(const struct batch *b, enum batch_level level, const struct brdf_params *p,
               double *ret_f);

// F, dF/dn and dF/d(k^2) at one angle, with the same arithmetic.
void batch_fresnel(const struct batch_point *p, double cos2_beta, double ret_f[3]);

// The derivatives of f_00 by n, k^2, log sigma, ks and kd, and f_00 itself: F is even in k, so that
// k = 0 is stationary in k but not in k^2, and sigma is a scale.
enum batch_column { BATCH_DN, BATCH_DKAPPA, BATCH_DSIGMA, BATCH_DKS, BATCH_DKD, BATCH_F,
                    BATCH_COLUMNS };
void batch_jacobian(const struct batch *b, enum batch_level level, const struct brdf_params *p,
                    double *const ret_column[BATCH_COLUMNS]);
