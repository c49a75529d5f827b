// SPDX-License-Identifier: MIT
// The model for one vector of geometries; for the files that are compiled for each level only
// (model/batch_pass.h, fit/kernel_pass.h). With c = cos beta and s = sin beta of the facet:
//
//   q = a + ib = sqrt(N^2 - s^2)   m = |q|^2   S = |c + q|^2 = m + y + c^2,  y = 2 c a
//   Z = m c^2 + s^4                T = |s^2 + q c|^2 = Z + y s^2
//   |rs|^2 = W/S,   rp = rs (s^2 - q c)/(s^2 + q c),   W = |N^2 - 1|^2 whatever beta
//
// so that all four Fresnel terms are W/(S^2 T) times a polynomial Q (model/fresnel.h, where the same
// is done for one facet):
//
//   |rs|^2: T      |rp|^2: |s^2 - q c|^2      Re(rs rp*): s^4 - m c^2      Im(rs rp*): 2 s^2 c b
//   F = (|rs|^2 + |rp|^2)/2: Z
//
// Nothing cancels: Re(N^2 - s^2) = Re(N^2 - 1) + c^2, and of a and b the larger one is the square
// root of (m + |Re|)/2, the other n k over it.
#pragma once
#include "model/batch.h"
#include "model/vec.h"

#define BATCH_TINY 1e-300 // keeps 0/0 out, changes nothing else

struct facet {
    vec c, c2, s2;
};

static inline struct facet facet_at(const double *cos_beta)
{
    vec c = vec_load(cos_beta), c2 = c * c;
    return (struct facet){c, c2, 1 - c2};
}

// exp(-v tan^2 theta)
static inline vec lobe_at(const struct batch_point *p, const double *tan2_theta)
{
    return vec_exp2(vec_max(vec_load(tan2_theta) * vec_all(p->exp2_scale), vec_all(p->exp2_least)));
}

// F/W. One division, one square root and one folded one: where the kernels spend their time.
static inline vec fresnel_mean(const struct batch_point *p, struct facet g)
{
    vec re = vec_all(p->above) + g.c2;
    vec m = vec_sqrt(vec_fma(re, re, vec_all(p->im2)));
    vec y = vec_fold(re, m + vec_abs(re) + BATCH_TINY, vec_all(p->im)) * (g.c * sqrt(2.0));
    vec z = vec_fma(m, g.c2, g.s2 * g.s2);
    vec s = m + g.c2 + y, t = vec_fma(y, g.s2, z);
    return z / (s * s * t + BATCH_TINY);
}

// --- derivatives ----------------------------------------------------------------------------------
// A quantity and its derivatives by n and kappa = k^2.
struct slope {
    vec f, n, k;
};

// From dq/dn = N/q and dq/dk = iN/q:
//
//   m_n = 2 n (Re + 2 kappa)/m      a_n = (n a + k b)/m          b_n = (k a - n b)/m
//   m_kappa = (2 n^2 - Re)/m        a_kappa = (n b/k - a)/(2 m)  b_kappa = (n a/k + b)/(2 m)
//
// One of a/k and b/k is n over a root, whatever k; the other is a root over k. So b, and beyond the
// critical angle of n < 1 a, goes as the root of kappa near k = 0, with an infinite slope at 0 that
// BATCH_K_LEAST makes finite: a step downhill from there is short but leaves, and the next ones see
// the true slope.
struct root {
    struct slope m, y, b;
};

static inline struct root root_at(const struct batch_point *p, struct facet g)
{
    vec n = vec_all(p->n), k = vec_all(p->k), kappa = vec_all(p->kappa);
    vec re = vec_all(p->above) + g.c2, least = vec_all(BATCH_M_LEAST * BATCH_M_LEAST);
    vec m, inv_m, large, inv_large;
    vec_root(vec_max(vec_fma(re, re, vec_all(p->im2)), least), &m, &inv_m);
    vec_root((m + vec_abs(re)) * 0.5, &large, &inv_large);
    vec small_k = n * inv_large, small = k * small_k, large_k = vec_all(p->inv_k) * large;
    vec a = vec_choose(re, small, large), a_k = vec_choose(re, small_k, large_k);
    vec b = vec_choose(re, large, small), b_k = vec_choose(re, large_k, small_k);
    return (struct root){
        .m = {m, 2 * n * (re + 2 * kappa) * inv_m, (2 * n * n - re) * inv_m},
        .y = {2 * g.c * a, 2 * g.c * (n * a + k * b) * inv_m, g.c * (n * b_k - a) * inv_m},
        .b = {b, (k * a - n * b) * inv_m, (n * a_k + b) * inv_m * 0.5},
    };
}

// Q of the mean.
static inline struct slope mean_at(const struct root *r, struct facet g)
{
    return (struct slope){vec_fma(r->m.f, g.c2, g.s2 * g.s2), r->m.n * g.c2, r->m.k * g.c2};
}

// Q of a channel with the weights w (model/channel.h): ss, pp, re, im.
static inline struct slope channel_at(const struct root *r, struct facet g, const vec w[4])
{
    struct slope z = mean_at(r, g);
    vec part = g.s2 - r->y.f * 0.5, cb = g.c * r->b.f, s4 = g.s2 * g.s2;
    vec by_z = w[0] + w[1] - w[2], by_y = (w[0] - w[1]) * g.s2, by_b = w[3] * (2 * g.s2 * g.c);
    return (struct slope){
        .f = w[0] * vec_fma(r->y.f, g.s2, z.f) + w[1] * vec_fma(part, part, cb * cb) +
             w[2] * (s4 - r->m.f * g.c2) + by_b * r->b.f,
        .n = by_z * z.n + by_y * r->y.n + by_b * r->b.n,
        .k = by_z * z.k + by_y * r->y.k + by_b * r->b.k,
    };
}

// W Q/(S^2 T).
static inline struct slope reflectance(const struct batch_point *p, const struct root *r,
                                       struct facet g, struct slope q)
{
    struct slope z = mean_at(r, g);
    vec s = r->m.f + g.c2 + r->y.f, t = vec_fma(r->y.f, g.s2, z.f), w = vec_all(p->w);
    vec s_s = s * s, s_t2 = 2 * s * t, norm = 1 / (s_s * t + BATCH_TINY), f = w * q.f * norm;
    vec down_n = vec_fma(s_t2, r->m.n + r->y.n, s_s * vec_fma(r->y.n, g.s2, z.n));
    vec down_k = vec_fma(s_t2, r->m.k + r->y.k, s_s * vec_fma(r->y.k, g.s2, z.k));
    return (struct slope){
        .f = f,
        .n = (vec_all(p->wn) * q.f + w * q.n - f * down_n) * norm,
        .k = (vec_all(p->wk) * q.f + w * q.k - f * down_k) * norm,
    };
}

static inline struct slope fresnel_slope(const struct batch_point *p, struct facet g)
{
    struct root r = root_at(p, g);
    return reflectance(p, &r, g, mean_at(&r, g));
}

static inline struct slope channel_slope(const struct batch_point *p, struct facet g,
                                         const vec w[4])
{
    struct root r = root_at(p, g);
    return reflectance(p, &r, g, channel_at(&r, g, w));
}
