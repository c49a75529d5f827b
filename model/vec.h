// SPDX-License-Identifier: MIT
// A vector of doubles as wide as the file that includes this is compiled for: 8 with AVX-512, 4
// with AVX2 and FMA, else 2. Only what the batch kernels need. Written out, not left to the
// compiler's vectoriser, so that every compiler and every optimisation level makes the same thing
// of it; plain arithmetic is the compilers' own vector extension. No state: any thread.
//
// Which operation where was measured (Zen 4): the divider works beside the multipliers, so one
// square root and one division a vector come nearly free while there is enough to multiply. A
// second root would make it the bottleneck and so takes AVX-512's estimate of the reciprocal root
// (14 bits) and one step of third order. f_00 took 14 % longer with two roots of either kind. AVX2
// has that estimate in float only: 18 % longer.
#pragma once
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#if defined __AVX512F__ && defined __AVX512DQ__
#define VEC_LANES 8
#elif defined __AVX2__ && defined __FMA__
#define VEC_LANES 4
#else
#define VEC_LANES 2
#endif

typedef double vec __attribute__((vector_size(8 * VEC_LANES)));
typedef uint64_t vec_bits __attribute__((vector_size(8 * VEC_LANES)));

static inline vec vec_load(const double *from)
{
    vec v;
    memcpy(&v, from, sizeof v);
    return v;
}

static inline void vec_store(double *to, vec v)
{
    memcpy(to, &v, sizeof v);
}

static inline vec vec_abs(vec v)
{
    return (vec)((vec_bits)v & ~((vec_bits){0} + ((uint64_t)1 << 63)));
}

// The lanes added by halves.
static inline double vec_sum(vec v)
{
    double s[VEC_LANES];
    vec_store(s, v);
    for (int half = VEC_LANES / 2; half > 0; half /= 2)
        for (int i = 0; i < half; i++)
            s[i] += s[i + half];
    return s[0];
}

// --- what differs --------------------------------------------------------------------------------
// vec_all     a number in every lane
// vec_fma     a b + c, rounded once where the machine can
// vec_max
// vec_choose  of each lane: negative where sign's lane is below 0 (or is -0), else positive
// vec_sqrt    correctly rounded
// vec_scaled  scale sqrt(x), to 2 units in the last place; x in [1e-300, 1e300]
// vec_folded  likewise, and scale im/sqrt(x) where sign is negative
// vec_root    sqrt(x) and its reciprocal, likewise
// vec_exp2    2^y to 5e-15; y in [-1020, 1020]

// clang-format off
#if VEC_LANES == 8
static inline vec vec_all(double x) { return _mm512_set1_pd(x); }
static inline vec vec_fma(vec a, vec b, vec c) { return _mm512_fmadd_pd(a, b, c); }
static inline vec vec_max(vec a, vec b) { return _mm512_max_pd(a, b); }
static inline vec vec_sqrt(vec x) { return _mm512_sqrt_pd(x); }

static inline vec vec_choose(vec sign, vec negative, vec positive)
{
    return _mm512_mask_blend_pd(_mm512_movepi64_mask(_mm512_castpd_si512(sign)), positive,
                                negative);
}

// value (1 + c), where 1 + c is what is missing to the estimate r of 1/sqrt(x): from the series of
// (1 - e)^(-1/2) with e = 1 - x r^2, |e| < 2^-13.
static inline vec vec_refined(vec value, vec x_r, vec r)
{
    vec e = _mm512_fnmadd_pd(x_r, r, vec_all(1));
    vec series = vec_fma(e, vec_fma(e, vec_all(0.3125), vec_all(0.375)), vec_all(0.5));
    return vec_fma(value * e, series, value);
}

static inline vec vec_scaled(vec x, vec scale)
{
    vec r = _mm512_rsqrt14_pd(x), x_r = x * r;
    return vec_refined(x_r * scale, x_r, r);
}

static inline vec vec_folded(vec sign, vec x, vec im, vec scale)
{
    vec r = _mm512_rsqrt14_pd(x), x_r = x * r;
    return vec_refined(vec_choose(sign, im * r, x_r) * scale, x_r, r);
}

static inline void vec_root(vec x, vec *ret_root, vec *ret_inverse)
{
    vec r = _mm512_rsqrt14_pd(x), x_r = x * r;
    *ret_root = vec_refined(x_r, x_r, r);
    *ret_inverse = vec_refined(r, x_r, r);
}

// 2^y = 2^(j/16) 2^f, |f| <= 1/32; minimax polynomial of f, relative error 4.5e-15. Adding
// 1.5 * 2^48 leaves y in sixteenths in the low bits. E takes j out of the place in the table's
// entry where j, shifted along with the exponent, comes to lie.
static inline vec vec_exp2(vec y)
{
#define E(j, bits) (int64_t)(bits##ull - ((uint64_t)(j) << 48))
    const int64_t table[16] = {
        E(0, 0x3ff0000000000000), E(1, 0x3ff0b5586cf9890f), E(2, 0x3ff172b83c7d517b),
        E(3, 0x3ff2387a6e756238), E(4, 0x3ff306fe0a31b715), E(5, 0x3ff3dea64c123422),
        E(6, 0x3ff4bfdad5362a27), E(7, 0x3ff5ab07dd485429), E(8, 0x3ff6a09e667f3bcd),
        E(9, 0x3ff7a11473eb0187), E(10, 0x3ff8ace5422aa0db), E(11, 0x3ff9c49182a3f090),
        E(12, 0x3ffae89f995ad3ad), E(13, 0x3ffc199bdd85529c), E(14, 0x3ffd5818dcfba487),
        E(15, 0x3ffea4afa2a490da)
    };
#undef E
    const vec magic = vec_all(0x1.8p48);
    vec shifted = y + magic;
    vec f = y - (shifted - magic);
    vec p = vec_fma(f, vec_all(0x1.5d867e9c0d6e4p-10), vec_all(0x1.3b2c9b8648e62p-7));
    p = vec_fma(f, p, vec_all(0x1.c6b08d76a9691p-5));
    p = vec_fma(f, p, vec_all(0x1.ebfbdff55592dp-3));
    p = vec_fma(f, p, vec_all(0x1.62e42fefa397bp-1));
    p = vec_fma(f, p, vec_all(0x1.0000000000014p+0));
    vec_bits root = (vec_bits)_mm512_permutex2var_epi64(_mm512_loadu_si512(table),
                                                        _mm512_castpd_si512(shifted),
                                                        _mm512_loadu_si512(table + 8));
    return p * (vec)(root + ((vec_bits)shifted << 48));
}

#else // --- AVX2, SSE2 and other machines
#if VEC_LANES == 4
static inline vec vec_all(double x) { return _mm256_set1_pd(x); }
static inline vec vec_fma(vec a, vec b, vec c) { return _mm256_fmadd_pd(a, b, c); }
static inline vec vec_max(vec a, vec b) { return _mm256_max_pd(a, b); }
static inline vec vec_sqrt(vec x) { return _mm256_sqrt_pd(x); }
static inline int vec_signs(vec x) { return _mm256_movemask_pd(x); }

static inline vec vec_choose(vec sign, vec negative, vec positive)
{
    return _mm256_blendv_pd(positive, negative, sign);
}
#else
static inline vec vec_all(double x) { return (vec){x, x}; }
static inline vec vec_fma(vec a, vec b, vec c) { return a * b + c; }

static inline vec vec_choose(vec sign, vec negative, vec positive)
{
    vec_bits mask = -((vec_bits)sign >> 63);
    return (vec)((mask & (vec_bits)negative) | (~mask & (vec_bits)positive));
}
#ifdef __SSE2__
static inline vec vec_max(vec a, vec b) { return _mm_max_pd(a, b); }
static inline vec vec_sqrt(vec x) { return _mm_sqrt_pd(x); }
static inline int vec_signs(vec x) { return _mm_movemask_pd(x); }
#else
static inline vec vec_max(vec a, vec b) { return vec_choose(a - b, b, a); }
static inline vec vec_sqrt(vec x) { return (vec){sqrt(x[0]), sqrt(x[1])}; }
static inline int vec_signs(vec x) { return signbit(x[0]) || signbit(x[1]); }
#endif
#endif

static inline vec vec_scaled(vec x, vec scale)
{
    return vec_sqrt(x) * scale;
}

// Most sets are all of one sign, which the branch predictor learns.
static inline vec vec_folded(vec sign, vec x, vec im, vec scale)
{
    vec root = vec_sqrt(x);
    return (vec_signs(sign) ? vec_choose(sign, im / root, root) : root) * scale;
}

static inline void vec_root(vec x, vec *ret_root, vec *ret_inverse)
{
    *ret_root = vec_sqrt(x);
    *ret_inverse = 1 / *ret_root;
}

// Minimax polynomial on |f| <= 1/2, relative error 3e-16. Adding 1.5 * 2^52 leaves the exponent in
// the low bits.
static inline vec vec_exp2(vec y)
{
    const vec magic = vec_all(0x1.8p52);
    vec shifted = y + magic;
    vec f = y - (shifted - magic);
    vec p = vec_fma(f, vec_all(0x1.e8b761c675c38p-28), vec_all(0x1.b689b4ad4f65fp-24));
    p = vec_fma(f, p, vec_all(0x1.62be68640a005p-20));
    p = vec_fma(f, p, vec_all(0x1.ffcb3f1b1dfa2p-17));
    p = vec_fma(f, p, vec_all(0x1.43091387c719ep-13));
    p = vec_fma(f, p, vec_all(0x1.5d87fea4a755ap-10));
    p = vec_fma(f, p, vec_all(0x1.3b2ab6fb8208ep-7));
    p = vec_fma(f, p, vec_all(0x1.c6b08d7039559p-5));
    p = vec_fma(f, p, vec_all(0x1.ebfbdff82c61fp-3));
    p = vec_fma(f, p, vec_all(0x1.62e42fefa3a28p-1));
    p = vec_fma(f, p, vec_all(1));
    return p * (vec)(((vec_bits)shifted << 52) + ((uint64_t)1023 << 52));
}
#endif
