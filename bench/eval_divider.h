// SPDX-License-Identifier: MIT
// The divider's roofline: what a point costs when nothing is done but F's two square roots and one
// division, a vector at a time, in more independent chains than the divider can hold. Compiled for
// each level by the file that includes this and names it with DIVIDER.
#pragma once
#include "model/vec.h"

enum { DIVIDER_CHAINS = 8 };

// `rounds` times DIVIDER_CHAINS vectors of points; returns how many points that were. The values
// converge to a number with a full mantissa.
size_t divider_plain(size_t rounds, double *ret_sink);
#ifdef __x86_64__
size_t divider_avx2(size_t rounds, double *ret_sink);
size_t divider_avx512(size_t rounds, double *ret_sink);
#endif

#ifdef DIVIDER
size_t DIVIDER(size_t rounds, double *ret_sink)
{
    vec v[DIVIDER_CHAINS];
    for (int c = 0; c < DIVIDER_CHAINS; c++)
        v[c] = vec_all(1.5 + c);
    for (size_t i = 0; i < rounds; i++)
        for (int c = 0; c < DIVIDER_CHAINS; c++)
            v[c] = vec_sqrt(vec_sqrt(7.3 / v[c]));
    for (int c = 0; c < DIVIDER_CHAINS; c++)
        *ret_sink += vec_sum(v[c]);
    return rounds * DIVIDER_CHAINS * VEC_LANES;
}
#endif
