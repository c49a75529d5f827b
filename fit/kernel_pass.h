// SPDX-License-Identifier: MIT
// The passes of fit/kernel.c, for the level whose file includes this and names it with KERNEL:
// block by block, first the columns, which stay in the first-level cache, then their inner
// products. Made in one loop, the sums would take the registers that the columns need: that was
// measured to be no faster with AVX-512 and up to a fifth slower with SSE2.
//
// Columns are filled in two ways: for sets that are unpolarised throughout, where F is simpler than
// its two halves, and for those with channels.
#pragma once
#include "fit/kernel_level.h"
#include "model/batch_vec.h"

static size_t block_length(size_t at, size_t to)
{
    return to - at < KERNEL_BLOCK ? to - at : KERNEL_BLOCK;
}

BATCH_INLINE vec residual_at(const struct set_rows *s, size_t i, vec a, vec b, vec ks, vec kd)
{
    return vec_load(s->f + i) - ks * a - kd * b;
}

BATCH_INLINE void load_channel(const struct set_rows *s, size_t i, vec w[SET_CHANNELS])
{
    for (int c = 0; c < SET_CHANNELS; c++)
        w[c] = vec_load(s->channel[c] + i);
}

// --- values --------------------------------------------------------------------------------------
// a short of a factor, the same for all rows.
static double lead(const struct set_rows *s, const struct batch_point *p)
{
    return s->channel[0] ? p->v : 4 * p->v * p->w;
}

BATCH_INLINE void fill_means(const struct set_rows *s, size_t at, size_t count,
                             const struct batch_point *p, bool folds, double *restrict a)
{
    for (size_t j = 0, i = at; j < count; j += VEC_LANES, i += VEC_LANES) {
        vec height = vec_load(s->spec + i) * lobe_at(p, s->tan2_theta + i);
        vec_store(a + j, mean_value(p, facet_at(s->cos_beta + i), height, folds));
    }
}

static void fill_channels(const struct set_rows *s, size_t at, size_t count,
                          const struct batch_point *p, double *restrict a)
{
    for (size_t j = 0, i = at; j < count; j += VEC_LANES, i += VEC_LANES) {
        vec w[SET_CHANNELS];
        load_channel(s, i, w);
        struct slope f = channel_slope(p, facet_at(s->cos_beta + i), w);
        vec_store(a + j, f.f * lobe_at(p, s->tan2_theta + i));
    }
}

static void fill_values(const struct set_rows *s, size_t at, size_t count,
                        const struct batch_point *p, double *restrict a)
{
    if (s->channel[0])
        fill_channels(s, at, count, p, a);
    else if (batch_folds(p))
        fill_means(s, at, count, p, true, a);
    else
        fill_means(s, at, count, p, false, a);
}

static void moments(const struct set_rows *s, size_t from, size_t to,
                    const struct batch_point *point, double ks, double kd,
                    struct kernel_products *ret)
{
    const struct batch_point p = *point;
    const double unit = lead(s, &p);
    const vec own_ks = vec_all(ks * unit), own_kd = vec_all(kd);
    vec aa = {0}, ab = {0}, ar = {0}, bb = {0}, br = {0}, rr = {0};
    double column[KERNEL_BLOCK];
    for (size_t at = from; at < to; at += KERNEL_BLOCK) {
        size_t count = block_length(at, to);
        fill_values(s, at, count, &p, column);
        for (size_t j = 0; j < count; j += VEC_LANES) {
            vec a = vec_load(column + j), b = vec_load(s->diffuse + at + j);
            vec r = residual_at(s, at + j, a, b, own_ks, own_kd);
            aa = vec_fma(a, a, aa);
            ab = vec_fma(a, b, ab);
            ar = vec_fma(a, r, ar);
            bb = vec_fma(b, b, bb);
            br = vec_fma(b, r, br);
            rr = vec_fma(r, r, rr);
        }
    }
    *ret = (struct kernel_products){.aa = unit * unit * vec_sum(aa),
                                    .ab = unit * vec_sum(ab),
                                    .ar = unit * vec_sum(ar),
                                    .bb = vec_sum(bb),
                                    .br = vec_sum(br),
                                    .rr = vec_sum(rr)};
}

// --- derivatives ---------------------------------------------------------------------------------
BATCH_INLINE void fill_columns(const struct set_rows *s, size_t at, size_t count,
                               const struct batch_point *p, double ks, double kd, bool polarised,
                               double (*column)[KERNEL_BLOCK])
{
    const vec v = vec_all(p->v), own_ks = vec_all(ks), own_kd = vec_all(kd);
    for (size_t j = 0, i = at; j < count; j += VEC_LANES, i += VEC_LANES) {
        vec height = v * lobe_at(p, s->tan2_theta + i), b = vec_load(s->diffuse + i);
        struct facet g = facet_at(s->cos_beta + i);
        struct slope f;
        if (polarised) {
            vec w[SET_CHANNELS];
            load_channel(s, i, w);
            f = channel_slope(p, g, w);
        } else {
            f = mean_slope(p, g);
            height *= vec_load(s->spec + i);
        }
        vec a = height * f.f;
        vec_store(column[KERNEL_DN] + j, height * f.n);
        vec_store(column[KERNEL_DKAPPA] + j, height * f.k);
        vec_store(column[KERNEL_DSIGMA] + j, a * (2 * v * vec_load(s->tan2_theta + i) - 2));
        vec_store(column[KERNEL_A] + j, a);
        vec_store(column[KERNEL_B] + j, b);
        vec_store(column[KERNEL_R] + j, residual_at(s, i, a, b, own_ks, own_kd));
    }
}

static void columns(const struct set_rows *s, size_t at, size_t count,
                    const struct batch_point *point, double ks, double kd,
                    double (*column)[KERNEL_BLOCK])
{
    const struct batch_point p = *point;
    if (s->channel[0])
        fill_columns(s, at, count, &p, ks, kd, true, column);
    else
        fill_columns(s, at, count, &p, ks, kd, false, column);
}

// --- inner products ------------------------------------------------------------------------------
// One row of the matrix: column `row` with those from it on. `row` is known where this is inlined.
BATCH_INLINE void add_row(const double (*column)[KERNEL_BLOCK], size_t count, int row,
                          vec total[KERNEL_COLUMNS])
{
    vec sum[KERNEL_COLUMNS];
    for (int c = row; c < KERNEL_COLUMNS; c++)
        sum[c] = total[c];
    for (size_t i = 0; i < count; i += VEC_LANES) {
        vec left = vec_load(column[row] + i);
        for (int c = row; c < KERNEL_COLUMNS; c++)
            sum[c] = vec_fma(left, vec_load(column[c] + i), sum[c]);
    }
    for (int c = row; c < KERNEL_COLUMNS; c++)
        total[c] = sum[c];
}

static void gram(const struct set_rows *s, size_t from, size_t to, const struct batch_point *point,
                 double ks, double kd, double ret_m[KERNEL_COLUMNS][KERNEL_COLUMNS])
{
    vec sum[KERNEL_COLUMNS][KERNEL_COLUMNS] = {{{0}}};
    double column[KERNEL_COLUMNS][KERNEL_BLOCK];
    for (size_t at = from; at < to; at += KERNEL_BLOCK) {
        size_t count = block_length(at, to);
        columns(s, at, count, point, ks, kd, column);
        add_row(column, count, KERNEL_DN, sum[KERNEL_DN]);
        add_row(column, count, KERNEL_DKAPPA, sum[KERNEL_DKAPPA]);
        add_row(column, count, KERNEL_DSIGMA, sum[KERNEL_DSIGMA]);
        add_row(column, count, KERNEL_A, sum[KERNEL_A]);
        add_row(column, count, KERNEL_B, sum[KERNEL_B]);
        add_row(column, count, KERNEL_R, sum[KERNEL_R]);
    }
    for (int i = 0; i < KERNEL_COLUMNS; i++)
        for (int j = i; j < KERNEL_COLUMNS; j++)
            ret_m[i][j] = ret_m[j][i] = vec_sum(sum[i][j]);
}

const struct kernel_passes KERNEL = {moments, gram, columns};
