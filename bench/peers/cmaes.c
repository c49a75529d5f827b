// SPDX-License-Identifier: MIT
// pagmo's CMA-ES, kept within the bounds by pagmo (letting it out and clamping was slower), then a
// local search: alone, it spends most of its time on the last digits.
#include "bench/peers/method.h"
#include "bench/peers/pagmo.h"

enum { GENERATIONS = 500 }; // a bound, not an expectation

static double value(void *ctx, const double gene[3], int *ret_over)
{
    struct attempt *a = ctx;
    double delta = attempt_value(a, gene);
    *ret_over = a->over;
    return delta;
}

void peer_cmaes(struct attempt *a, const struct setting *s, uint64_t seed)
{
    struct peers_pagmo_options o = {s->population, GENERATIONS, s->first_step, s->method_ftol,
                                    (unsigned)seed};
    peers_pagmo_cmaes(value, a, &o);
    peer_polish(a, s);
}
