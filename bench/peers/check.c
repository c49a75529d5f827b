// SPDX-License-Identifier: MIT
#include "bench/peers/check.h"

#include "bench/peers/attempt.h"
#include "fit/rng.h"

#include <string.h>

enum { GENES = ATTEMPT_GENES, POINTS = 20 };
#define STEP 1e-5

static double norm(const double v[GENES])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double at_genes(struct attempt *a, const double gene[GENES])
{
    double slope[GENES], off[GENES], off_rows[GENES], r[ATTEMPT_ROWS], j[ATTEMPT_ROWS][GENES];
    double value = attempt_slope(a, gene, slope), sum = 0;
    attempt_rows(a, gene, r, j);
    for (int i = 0; i < GENES; i++) {
        double low[GENES], high[GENES];
        memcpy(low, gene, sizeof low);
        memcpy(high, gene, sizeof high);
        low[i] -= STEP;
        high[i] += STEP;
        off[i] = (attempt_value(a, high) - attempt_value(a, low)) / (2 * STEP) - slope[i];
        off_rows[i] = -slope[i] * a->task->set.ff / 2;
        for (int row = 0; row < ATTEMPT_ROWS; row++)
            off_rows[i] += j[row][i] * r[row];
    }
    for (int row = 0; row < ATTEMPT_ROWS; row++)
        sum += r[row] * r[row];
    double worst = norm(off) / norm(slope);
    worst = fmax(worst, norm(off_rows) / (norm(slope) * a->task->set.ff));
    return fmax(worst, fabs(sum / (value * a->task->set.ff) - 1));
}

double check_slopes(const struct task *t)
{
    struct rng rng;
    double worst = 0;
    rng_seed(&rng, t->seed);
    for (int i = 0; i < POINTS; i++) {
        struct attempt a = {.task = t, .k_power = 4, .limit_ms = 1000};
        double gene[GENES];
        for (int g = 0; g < GENES; g++)
            gene[g] = 0.05 + 0.9 * rng_uniform(&rng);
        attempt_begin(&a);
        attempt_run(&a, 0);
        worst = fmax(worst, at_genes(&a, gene));
    }
    return worst;
}
