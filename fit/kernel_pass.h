// SPDX-License-Identifier: MIT
// The passes of fit/kernel.c, for the level whose file includes this and names it with KERNEL. Each
// exists twice: for sets that are unpolarised throughout, where F is simpler than its two halves,
// and for those with channels; `polarised` is known where these are inlined.
#pragma once
#include "fit/kernel_level.h"
#include "model/batch_vec.h"

#include <string.h>

struct levels { // ks, kd in every lane
    vec ks, kd;
};

BATCH_INLINE vec residual_at(const struct set_rows *s, size_t i, vec a, vec b, struct levels x)
{
    return vec_load(s->f + i) - x.ks * a - x.kd * b;
}

BATCH_INLINE void load_channel(const struct set_rows *s, size_t i, vec w[SET_CHANNELS])
{
    for (int c = 0; c < SET_CHANNELS; c++)
        w[c] = vec_load(s->channel[c] + i);
}

// --- inner products ------------------------------------------------------------------------------
// Everything stays in registers: with the sums as a pass of its own over a stored a, this took a
// quarter longer. a is short of the factor `lead`, the same for all rows.
enum kind { BRIGHT, FOLDING, POLARISED }; // F; F where Re is negative somewhere; a channel

BATCH_INLINE void sum_moments(const struct set_rows *s, size_t from, size_t to,
                              const struct batch_point *p, double ks, double kd, enum kind kind,
                              struct kernel_products *ret)
{
    const double lead = kind == POLARISED ? p->v : 4 * p->v * p->w;
    const struct levels x = {vec_all(ks * lead), vec_all(kd)};
    vec aa = {0}, ab = {0}, ar = {0}, bb = {0}, br = {0}, rr = {0};
    for (size_t i = from; i < to; i += VEC_LANES) {
        vec a = lobe_at(p, s->tan2_theta + i), b = vec_load(s->diffuse + i);
        struct facet g = facet_at(s->cos_beta + i);
        if (kind == POLARISED) {
            vec w[SET_CHANNELS];
            load_channel(s, i, w);
            a *= channel_slope(p, g, w).f;
        } else {
            a = mean_value(p, g, a * vec_load(s->spec + i), kind == FOLDING);
        }
        vec r = residual_at(s, i, a, b, x);
        aa = vec_fma(a, a, aa);
        ab = vec_fma(a, b, ab);
        ar = vec_fma(a, r, ar);
        bb = vec_fma(b, b, bb);
        br = vec_fma(b, r, br);
        rr = vec_fma(r, r, rr);
    }
    *ret = (struct kernel_products){lead * lead * vec_sum(aa),
                                    lead * vec_sum(ab),
                                    lead * vec_sum(ar),
                                    vec_sum(bb),
                                    vec_sum(br),
                                    vec_sum(rr)};
}

static void moments(const struct set_rows *s, size_t from, size_t to,
                    const struct batch_point *point, double ks, double kd,
                    struct kernel_products *ret)
{
    const struct batch_point p = *point;
    if (s->channel[0])
        sum_moments(s, from, to, &p, ks, kd, POLARISED, ret);
    else if (batch_folds(&p))
        sum_moments(s, from, to, &p, ks, kd, FOLDING, ret);
    else
        sum_moments(s, from, to, &p, ks, kd, BRIGHT, ret);
}

// --- columns -------------------------------------------------------------------------------------
BATCH_INLINE void fill_columns(const struct set_rows *s, size_t at, size_t count,
                               const struct batch_point *p, double ks, double kd, bool polarised,
                               double (*column)[KERNEL_BLOCK])
{
    const struct levels x = {vec_all(ks), vec_all(kd)};
    const vec v = vec_all(p->v);
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
        vec_store(column[KERNEL_R] + j, residual_at(s, i, a, b, x));
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

// --- all inner products --------------------------------------------------------------------------
BATCH_INLINE void add_row(const double (*column)[KERNEL_BLOCK], size_t count, int row,
                          vec total[KERNEL_COLUMNS])
{
    vec sum[KERNEL_COLUMNS];
    memcpy(sum, total, sizeof sum);
    for (size_t i = 0; i < count; i += VEC_LANES) {
        vec left = vec_load(column[row] + i);
        for (int c = row; c < KERNEL_COLUMNS; c++)
            sum[c] = vec_fma(left, vec_load(column[c] + i), sum[c]);
    }
    memcpy(total, sum, sizeof sum);
}

// 21 sums and what the columns need do not fit the registers together: columns of a block first,
// which stay in the first-level cache, then a row of the matrix at a time.
static void gram(const struct set_rows *s, size_t from, size_t to, const struct batch_point *point,
                 double ks, double kd, double ret_m[KERNEL_COLUMNS][KERNEL_COLUMNS])
{
    vec sum[KERNEL_COLUMNS][KERNEL_COLUMNS] = {{{0}}};
    double column[KERNEL_COLUMNS][KERNEL_BLOCK];
    for (size_t at = from; at < to; at += KERNEL_BLOCK) {
        size_t count = to - at < KERNEL_BLOCK ? to - at : KERNEL_BLOCK;
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
