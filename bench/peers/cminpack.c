// SPDX-License-Identifier: MIT
// cminpack: MINPACK's lmder from the best of a few random points. It knows no bounds, so that each
// gene is (1 - cos u)/2 of a free u. It sees four rows instead of 850 (attempt_rows): the same
// steps for less.
#include "bench/peers/method.h"

#include "fit/rng.h"

#include <cminpack.h>
#include <stdlib.h>
#include <string.h>

enum { STARTS_MAX = 64, CALLS = 200, GENES = ATTEMPT_GENES, ROWS = ATTEMPT_ROWS };

struct start {
    double gene[GENES], delta;
};

static int by_delta(const void *a, const void *b)
{
    double p = ((const struct start *)a)->delta, q = ((const struct start *)b)->delta;
    return (p > q) - (p < q);
}

struct last {
    struct attempt *attempt;
    double u[GENES], j[ROWS][GENES]; // lmder asks for the derivatives where it has just been
};

static int rows(void *ctx, int m, int n, const double *u, double *r, double *j, int stride,
                int what)
{
    struct last *last = ctx;
    double gene[GENES];
    (void)m;
    (void)n;
    if (what == 1) {
        for (int i = 0; i < GENES; i++)
            gene[i] = (1 - cos(u[i])) / 2;
        attempt_rows(last->attempt, gene, r, last->j);
        memcpy(last->u, u, sizeof last->u);
    } else {
        double other[ROWS];
        if (memcmp(last->u, u, sizeof last->u) != 0)
            rows(ctx, m, n, u, other, NULL, 0, 1);
        for (int i = 0; i < GENES; i++)
            for (int row = 0; row < ROWS; row++)
                j[row + stride * i] = last->j[row][i] * sin(u[i]) / 2;
    }
    return last->attempt->over ? -1 : 0;
}

static void polish_start(struct attempt *a, const struct setting *s, const struct start *start)
{
    double u[GENES], r[ROWS], j[ROWS * GENES], diag[GENES], qtf[GENES];
    double w1[GENES], w2[GENES], w3[GENES], w4[ROWS];
    int values, slopes, pivot[GENES];
    struct last last = {.attempt = a};
    for (int i = 0; i < GENES; i++)
        u[i] = acos(1 - 2 * start->gene[i]);
    lmder(rows, &last, ROWS, GENES, u, r, j, ROWS, s->ftol, s->ftol, 0, CALLS, diag, 1,
          s->first_step, 0, &values, &slopes, pivot, qtf, w1, w2, w3, w4);
}

void peer_cminpack(struct attempt *a, const struct setting *s, uint64_t seed)
{
    struct start start[STARTS_MAX];
    struct rng rng;
    bool choose = s->population > s->effort;
    rng_seed(&rng, seed);
    for (int i = 0; i < s->population && !a->over; i++) {
        for (int g = 0; g < GENES; g++)
            start[i].gene[g] = rng_uniform(&rng);
        start[i].delta = choose ? attempt_value(a, start[i].gene) : 0;
    }
    if (choose)
        qsort(start, (size_t)s->population, sizeof *start, by_delta);
    for (int i = 0; i < s->effort && i < s->population && !a->over; i++)
        polish_start(a, s, &start[i]);
}
