// SPDX-License-Identifier: MIT
// pagmo's CMA-ES for C: three genes in [0, 1]; value says in *ret_over that nothing more is wanted.
// Everything is borrowed for the call. Nothing is thrown.
#pragma once
#ifdef __cplusplus
extern "C" {
#endif

struct peers_pagmo_options {
    int population, generations;
    double sigma0, ftol; // first step; relative tolerance of values and genes
    unsigned seed;
};

typedef double peers_pagmo_value(void *ctx, const double gene[3], int *ret_over);

void peers_pagmo_cmaes(peers_pagmo_value *value, void *ctx, const struct peers_pagmo_options *o);

#ifdef __cplusplus
}
#endif
