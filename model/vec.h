// SPDX-License-Identifier: MIT
// A vector of doubles as wide as the file that includes this is compiled for: 8 with AVX-512, 4 with
// AVX2 and FMA, else 2. Only what the batch kernels need. Written out, not left to the compiler's
// vectoriser, so that every compiler and every optimisation level makes the same thing of it; plain
// arithmetic is the compilers' own vector extension. No state: any thread.
//
// Which operation where was measured on Zen 4: its divider works beside the multipliers, so one
// square root and one division a vector cost nothing while there is enough to multiply. What would
// make the divider the bottleneck takes AVX-512's reciprocal square root estimate (14 bits) and one
// step of third order. AVX2 has that estimate in float only; with its conversions it gains nothing.
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
// vec_root    sqrt(x) and its reciprocal, to 2 units in the last place; x in [1e-300, 1e300]
// vec_fold    sqrt(x) where sign >= 0, im/sqrt(x) where sign < 0, likewise
// vec_exp2    2^y to 1e-15; y in [-1020, 1020]

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

// What is missing to the estimate r of 1/sqrt(x): the factor 1 + c, from the series of
// (1 - e)^(-1/2) with e = 1 - x r^2, |e| < 2^-13.
static inline vec vec_root_correction(vec x_r, vec r)
{
    vec e = _mm512_fnmadd_pd(x_r, r, vec_all(1));
    vec series = vec_fma(e, vec_fma(e, vec_all(0.3125), vec_all(0.375)), vec_all(0.5));
    return e * series;
}

static inline void vec_root(vec x, vec *ret_root, vec *ret_inverse)
{
    vec r = _mm512_rsqrt14_pd(x), x_r = x * r, c = vec_root_correction(x_r, r);
    *ret_root = vec_fma(x_r, c, x_r);
    *ret_inverse = vec_fma(r, c, r);
}

static inline vec vec_fold(vec sign, vec x, vec im)
{
    vec r = _mm512_rsqrt14_pd(x), x_r = x * r, c = vec_root_correction(x_r, r);
    vec root = vec_choose(sign, im * r, x_r);
    return vec_fma(root, c, root);
}

// 2^y = 2^(j/8) 2^f, |f| <= 1/16; minimax polynomial of f, relative error 9e-16. Adding 1.5 * 2^49
// leaves y in eighths in the low bits; the table's entries have j taken out of the place where j,
// shifted along with the exponent, comes to lie.
static inline vec vec_exp2(vec y)
{
#define EIGHTH(j, bits) (bits##ull - ((uint64_t)(j) << 49))
    const vec_bits table = {
        EIGHTH(0, 0x3ff0000000000000), EIGHTH(1, 0x3ff172b83c7d517b), EIGHTH(2, 0x3ff306fe0a31b715),
        EIGHTH(3, 0x3ff4bfdad5362a27), EIGHTH(4, 0x3ff6a09e667f3bcd), EIGHTH(5, 0x3ff8ace5422aa0db),
        EIGHTH(6, 0x3ffae89f995ad3ad), EIGHTH(7, 0x3ffd5818dcfba487)};
#undef EIGHTH
    const vec magic = vec_all(0x1.8p49);
    vec shifted = y + magic;
    vec f = y - (shifted - magic);
    vec p = vec_fma(f, vec_all(0x1.4317c8f2fc5dfp-13), vec_all(0x1.5d8f116167897p-10));
    p = vec_fma(f, p, vec_all(0x1.3b2ab6ca122e9p-7));
    p = vec_fma(f, p, vec_all(0x1.c6b08d53aecd2p-5));
    p = vec_fma(f, p, vec_all(0x1.ebfbdff82ce54p-3));
    p = vec_fma(f, p, vec_all(0x1.62e42fefa3d8dp-1));
    p = vec_fma(f, p, vec_all(1));
    vec_bits root =
        (vec_bits)_mm512_permutexvar_epi64(_mm512_castpd_si512(shifted), (__m512i)table);
    return p * (vec)(root + ((vec_bits)shifted << 49));
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

static inline void vec_root(vec x, vec *ret_root, vec *ret_inverse)
{
    *ret_root = vec_sqrt(x);
    *ret_inverse = 1 / *ret_root;
}

// Most sets are all of one sign, which the branch predictor learns.
static inline vec vec_fold(vec sign, vec x, vec im)
{
    vec root = vec_sqrt(x);
    return vec_signs(sign) ? vec_choose(sign, im / root, root) : root;
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
