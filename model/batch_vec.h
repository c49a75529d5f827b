// SPDX-License-Identifier: MIT
// The model for one vector of geometries; for the files that are compiled for each level only
// (model/batch_pass.h, fit/kernel_pass.h). With c = cos beta and s = sin beta of the facet:
//
//   q = a + ib = sqrt(N^2 - s^2)   m = |q|^2   S = |c + q|^2 = m + y + c^2,  y = 2 c a
//   Z = m c^2 + s^4                T = |s^2 + q c|^2 = Z + y s^2
//   |rs|^2 = W/S,   rp = rs (s^2 - q c)/(s^2 + q c),   W = |N^2 - 1|^2 whatever beta
//
// so that all four Fresnel terms are W/(S^2 T) times a polynomial Q (model/fresnel.h, where the
// same is done for one facet):
//
//   |rs|^2: T      |rp|^2: |s^2 - q c|^2      Re(rs rp*): s^4 - m c^2      Im(rs rp*): 2 s^2 c b
//   F = (|rs|^2 + |rp|^2)/2: Z
//
// Nothing cancels: Re(N^2 - s^2) = Re(N^2 - 1) + c^2 =: Re, and of a and b the larger one is the
// square root of (m + |Re|)/2, the other n k over it. A doubled letter is twice the quantity: the
// square roots come out without factors then, and doubling is an addition, which the machine has to
// spare.
#pragma once
#include "model/batch.h"
#include "model/vec.h"

// Keeps m from 0, so that there is no 0/0 and no other special case; changes nothing else.
#define BATCH_TINY 1e-100

#define BATCH_INLINE static inline __attribute__((always_inline))

struct facet {
    vec c, cc, c2, cc2, s2, ss4; // cc2: twice c^2; ss4: twice s^4
};

BATCH_INLINE struct facet facet_at(const double *cos_beta)
{
    vec c = vec_load(cos_beta), c2 = c * c, cc2 = c2 + c2, s2 = 1 - c2;
    return (struct facet){c, c + c, c2, cc2, s2, s2 * (2 - cc2)};
}

// exp(-v tan^2 theta)
BATCH_INLINE vec lobe_at(const struct batch_point *p, const double *tan2_theta)
{
    return vec_exp2(vec_max(vec_load(tan2_theta) * vec_all(p->exp2_scale), vec_all(p->exp2_least)));
}

// Re is negative somewhere.
static inline bool batch_folds(const struct batch_point *p)
{
    return p->above < 0;
}

// height F/(4 W): where the kernels spend their time.
BATCH_INLINE vec mean_value(const struct batch_point *p, struct facet g, vec height, bool folds)
{
    vec re = vec_all(2 * p->above) + g.cc2;
    vec mm = vec_sqrt(vec_fma(re, re, vec_all(4 * p->im2 + BATCH_TINY)));
    vec larger = mm + vec_abs(re);
    vec yy = folds ? vec_folded(re, larger, vec_all(2 * p->im), g.cc) : vec_scaled(larger, g.cc);
    vec zz = vec_fma(mm, g.c2, g.ss4);
    vec ss = mm + g.cc2 + yy, tt = vec_fma(yy, g.s2, zz);
    return height * zz / (ss * ss * tt);
}

// --- derivatives ---------------------------------------------------------------------------------
// A quantity and its derivatives by n and kappa = k^2.
struct slope {
    vec f, n, k;
};

// Twice m, y and b. From dq/dn = N/q and dq/dk = iN/q:
//
//   m_n = 2 n (Re + 2 kappa)/m      a_n = (n a + k b)/m          b_n = (k a - n b)/m
//   m_kappa = (2 n^2 - Re)/m        a_kappa = (n b/k - a)/(2 m)  b_kappa = (n a/k + b)/(2 m)
//
// One of a/k and b/k is n over a root, whatever k; the other is a root over k. So b, and beyond the
// critical angle of n < 1 a, goes as the root of kappa near k = 0, with an infinite slope at 0 that
// BATCH_K_LEAST makes finite: a step downhill from there is short but leaves, and the next ones see
// the true slope.
struct root {
    struct slope mm, yy, bb;
};

BATCH_INLINE struct root root_at(const struct batch_point *p, struct facet g)
{
    vec n = vec_all(p->n), k = vec_all(p->k);
    vec re = vec_all(2 * p->above) + g.cc2;
    vec least = vec_all(4 * BATCH_M_LEAST * BATCH_M_LEAST), mm, inv, large, inv_large;
    vec_root(vec_max(vec_fma(re, re, vec_all(4 * p->im2)), least), &mm, &inv);
    vec_root(mm + vec_abs(re), &large, &inv_large);
    vec small_k = vec_all(4 * p->n) * inv_large, small = k * small_k;
    vec large_k = vec_all(p->inv_k) * large;
    vec aa = vec_choose(re, small, large), aa_k = vec_choose(re, small_k, large_k);
    vec bb = vec_choose(re, large, small), bb_k = vec_choose(re, large_k, small_k);
    vec c_inv = g.cc * inv;
    return (struct root){
        .mm = {mm, vec_all(4 * p->n) * (re + 4 * p->kappa) * inv,
               (vec_all(8 * p->n * p->n) - (re + re)) * inv},
        .yy = {g.cc * aa, (c_inv + c_inv) * vec_fma(n, aa, k * bb), c_inv * (n * bb_k - aa)},
        .bb = {bb, (inv + inv) * (k * aa - n * bb), inv * vec_fma(n, aa_k, bb)},
    };
}

// QQ of the mean.
BATCH_INLINE struct slope mean_at(const struct root *r, struct facet g)
{
    return (struct slope){vec_fma(r->mm.f, g.c2, g.ss4), r->mm.n * g.c2, r->mm.k * g.c2};
}

// QQ of a channel with the weights w (model/channel.h): ss, pp, re, im.
BATCH_INLINE struct slope channel_at(const struct root *r, struct facet g, const vec w[4])
{
    struct slope zz = mean_at(r, g);
    vec sc = g.s2 * g.cc, cb = g.c * r->bb.f, part = 2 * g.s2 - 0.5 * r->yy.f;
    vec by_z = w[0] + w[1] - w[2], by_y = (w[0] - w[1]) * g.s2, by_b = w[3] * sc;
    vec pp = 0.5 * vec_fma(part, part, cb * cb);
    return (struct slope){
        .f = w[0] * vec_fma(r->yy.f, g.s2, zz.f) + w[1] * pp + w[2] * (g.ss4 - r->mm.f * g.c2) +
             by_b * r->bb.f,
        .n = by_z * zz.n + by_y * r->yy.n + by_b * r->bb.n,
        .k = by_z * zz.k + by_y * r->yy.k + by_b * r->bb.k,
    };
}

// W Q/(S^2 T), given QQ.
BATCH_INLINE struct slope reflectance(const struct batch_point *p, const struct root *r,
                                      struct facet g, struct slope qq)
{
    struct slope zz = mean_at(r, g);
    vec ss = r->mm.f + g.cc2 + r->yy.f, tt = vec_fma(r->yy.f, g.s2, zz.f);
    vec s_s = ss * ss, s_t = ss * tt, norm = 4 / (s_s * tt), w = vec_all(p->w);
    vec f = w * qq.f * norm, part = 0.25 * f;
    s_t = s_t + s_t;
    vec down_n = vec_fma(s_t, r->mm.n + r->yy.n, s_s * vec_fma(r->yy.n, g.s2, zz.n));
    vec down_k = vec_fma(s_t, r->mm.k + r->yy.k, s_s * vec_fma(r->yy.k, g.s2, zz.k));
    return (struct slope){
        .f = f,
        .n = (vec_all(p->wn) * qq.f + w * qq.n - part * down_n) * norm,
        .k = (vec_all(p->wk) * qq.f + w * qq.k - part * down_k) * norm,
    };
}

BATCH_INLINE struct slope mean_slope(const struct batch_point *p, struct facet g)
{
    struct root r = root_at(p, g);
    return reflectance(p, &r, g, mean_at(&r, g));
}

BATCH_INLINE struct slope channel_slope(const struct batch_point *p, struct facet g, const vec w[4])
{
    struct root r = root_at(p, g);
    return reflectance(p, &r, g, channel_at(&r, g, w));
}
