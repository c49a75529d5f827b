// SPDX-License-Identifier: MIT
#include "fit/kernel.h"

#include "fit/kernel_level.h"

#include <math.h>
#include <string.h>

static const struct kernel_passes *passes(const struct fit_set *set)
{
#ifdef __x86_64__
    if (set->level == BATCH_AVX512)
        return &kernel_passes_avx512;
    if (set->level == BATCH_AVX2)
        return &kernel_passes_avx2;
#endif
    (void)set;
    return &kernel_passes_plain;
}

static struct batch_point point_at(const double x[FIT_PARAMS])
{
    struct batch_point p = batch_point(x[FIT_N], x[FIT_K], exp(x[FIT_SIGMA]));
    p.exp2_least = KERNEL_EXP2_LEAST;
    return p;
}

// --- sums ----------------------------------------------------------------------------------------
size_t kernel_part(const struct fit_set *set)
{
    size_t blocks = (set->distinct.padded + KERNEL_BLOCK - 1) / KERNEL_BLOCK;
    size_t each = (blocks + KERNEL_PARTS - 1) / KERNEL_PARTS;
    return KERNEL_BLOCK * (each > KERNEL_PART_BLOCKS ? each : KERNEL_PART_BLOCKS);
}

void kernel_moments_of(const struct fit_set *set, const double x[FIT_PARAMS], size_t from,
                       size_t to, struct kernel_gram *ret_gram)
{
    const struct batch_point p = point_at(x);
    struct kernel_products s;
    passes(set)->moments(&set->distinct, from, to, &p, x[FIT_KS], x[FIT_KD], &s);
    double (*m)[KERNEL_COLUMNS] = ret_gram->m;
    m[KERNEL_A][KERNEL_A] = s.aa;
    m[KERNEL_A][KERNEL_B] = m[KERNEL_B][KERNEL_A] = s.ab;
    m[KERNEL_A][KERNEL_R] = m[KERNEL_R][KERNEL_A] = s.ar;
    m[KERNEL_B][KERNEL_R] = m[KERNEL_R][KERNEL_B] = s.br;
    m[KERNEL_B][KERNEL_B] = s.bb;
    m[KERNEL_R][KERNEL_R] = s.rr + (from == 0 ? set->scatter : 0);
}

void kernel_gram_of(const struct fit_set *set, const double x[FIT_PARAMS], size_t from, size_t to,
                    struct kernel_gram *ret_gram)
{
    const struct batch_point p = point_at(x);
    passes(set)->gram(&set->distinct, from, to, &p, x[FIT_KS], x[FIT_KD], ret_gram->m);
    ret_gram->m[KERNEL_R][KERNEL_R] += from == 0 ? set->scatter : 0;
}

void kernel_add(struct kernel_gram *sum, const struct kernel_gram *part)
{
    for (int i = 0; i < KERNEL_COLUMNS; i++)
        for (int j = 0; j < KERNEL_COLUMNS; j++)
            sum->m[i][j] += part->m[i][j];
}

// --- single readings -----------------------------------------------------------------------------
size_t kernel_jacobian(const struct fit_set *set, const double x[FIT_PARAMS], size_t at,
                       struct kernel_block *ret_block)
{
    const struct batch_point p = point_at(x);
    size_t left = set->all.padded - at, count = left < KERNEL_BLOCK ? left : KERNEL_BLOCK;
    double column[KERNEL_COLUMNS][KERNEL_BLOCK];
    passes(set)->columns(&set->all, at, count, &p, x[FIT_KS], x[FIT_KD], column);
    for (size_t i = 0; i < count; i++) {
        ret_block->j[FIT_N][i] = x[FIT_KS] * column[KERNEL_DN][i];
        ret_block->j[FIT_K][i] = x[FIT_KS] * column[KERNEL_DKAPPA][i];
        ret_block->j[FIT_SIGMA][i] = x[FIT_KS] * column[KERNEL_DSIGMA][i];
    }
    memcpy(ret_block->j[FIT_KS], column[KERNEL_A], count * sizeof(double));
    memcpy(ret_block->j[FIT_KD], column[KERNEL_B], count * sizeof(double));
    memcpy(ret_block->r, column[KERNEL_R], count * sizeof(double));
    return count;
}

void kernel_fresnel(double n, double kappa, double sin2_beta, double cos2_beta, double ret_f[3])
{
    (void)sin2_beta;
    struct batch_point p = batch_point(n, kappa, 1);
    batch_fresnel(&p, cos2_beta, ret_f);
}
