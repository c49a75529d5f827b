// SPDX-License-Identifier: MIT
#include "model/batch.h"

#include "model/batch_level.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
enum { ARRAYS = 4, ALIGNMENT = 64 };

// --- levels --------------------------------------------------------------------------------------
enum batch_level batch_best_level(void)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        return BATCH_AVX512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return BATCH_AVX2;
#endif
    return BATCH_PLAIN;
}

const char *batch_level_name(enum batch_level level)
{
#ifdef __SSE2__
    static const char *const name[BATCH_LEVELS] = {"sse2", "avx2", "avx512"};
#else
    static const char *const name[BATCH_LEVELS] = {"plain", "avx2", "avx512"};
#endif
    return name[level];
}

static const struct batch_passes *passes(enum batch_level level)
{
#ifdef __x86_64__
    if (level == BATCH_AVX512)
        return &batch_passes_avx512;
    if (level == BATCH_AVX2)
        return &batch_passes_avx2;
#endif
    (void)level;
    return &batch_passes_plain;
}

// --- geometry ------------------------------------------------------------------------------------
bool batch_new(size_t count, const double *theta_i_rad, const double *theta_r_rad,
               const double *dphi_rad, enum brdf_diffuse diffuse, struct batch *ret_batch)
{
    size_t padded = (count + BATCH_PAD - 1) / BATCH_PAD * BATCH_PAD;
    double *memory = aligned_alloc(ALIGNMENT, padded * ARRAYS * sizeof *memory);
    if (!memory)
        return false;
    struct batch b = {
        count, padded, memory, memory + padded, memory + 2 * padded, memory + 3 * padded};
    for (size_t i = 0; i < padded; i++) {
        size_t j = i < count ? i : count - 1; // padding is the last direction again
        struct brdf_geometry g = brdf_geometry(theta_i_rad[j], theta_r_rad[j], dphi_rad[j]);
        b.tan2_theta[i] = g.tan2_theta;
        b.cos_beta[i] = sqrt(g.cos2_beta);
        b.spec[i] = g.spec_per_sr;
        b.diffuse[i] = diffuse == BRDF_DIFFUSE_PAPER ? g.inv_cos_i : 1 / PI;
    }
    *ret_batch = b;
    return true;
}

void batch_free(struct batch *b)
{
    free(b->tan2_theta);
    *b = (struct batch){.count = 0};
}

// --- parameters ----------------------------------------------------------------------------------
struct batch_point batch_point(double n, double kappa, double sigma)
{
    double k = sqrt(kappa), above = (n - 1) * (n + 1) - kappa, im2 = 4 * n * n * kappa;
    double v = 0.5 / (sigma * sigma);
    return (struct batch_point){
        .n = n,
        .k = k,
        .kappa = kappa,
        .inv_k = 1 / fmax(k, BATCH_K_LEAST),
        .above = above,
        .im = 2 * n * k,
        .im2 = im2,
        .w = above * above + im2,
        .wn = 4 * n * (n * n + kappa - 1),
        .wk = 2 * (n * n + kappa + 1),
        .v = v,
        .exp2_scale = -v * 1.4426950408889634074,
        .exp2_least = BATCH_EXP2_LEAST,
    };
}

static bool within(double x, double least, double most)
{
    return x >= least && x <= most; // NAN is not
}

static bool in_domain(const struct brdf_params *p)
{
    return p->n > 0 && within(p->n, 0, BRDF_INDEX_MAX) && within(p->k, 0, BRDF_INDEX_MAX) &&
           within(p->sigma, BRDF_SIGMA_MIN, BRDF_SIGMA_MAX) &&
           within(p->ks, 0, BRDF_STRENGTH_MAX) && within(p->kd, 0, BRDF_STRENGTH_MAX);
}

void batch_f00(const struct batch *b, enum batch_level level, const struct brdf_params *p,
               double *ret_f)
{
    struct batch_point point = batch_point(p->n, p->k * p->k, p->sigma);
    if (in_domain(p))
        passes(level)->f00(b, &point, p->ks, p->kd, ret_f);
    else
        for (size_t i = 0; i < b->padded; i++)
            ret_f[i] = (double)NAN;
}

void batch_jacobian(const struct batch *b, enum batch_level level, const struct brdf_params *p,
                    double *const ret_column[BATCH_COLUMNS])
{
    struct batch_point point = batch_point(p->n, p->k * p->k, p->sigma);
    if (in_domain(p)) {
        passes(level)->jacobian(b, &point, p->ks, p->kd, ret_column);
        return;
    }
    for (int c = 0; c < BATCH_COLUMNS; c++)
        for (size_t i = 0; i < b->padded; i++)
            ret_column[c][i] = (double)NAN;
}
