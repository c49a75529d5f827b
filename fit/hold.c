// SPDX-License-Identifier: MIT
#include "fit/hold.h"

#include "fit/passes.h"
#include "fit/varpro.h"

#include <math.h>
#include <stdlib.h>

enum { STEPS = 40, FIRST_STEPS = 8, STARTS = 2 };
enum { CELLS = 16, CELLS_EACH = 8 }; // of one that is free, and of each of two
#define MAY_PASS 1.002 // times the lowest q after the first steps: worth the others
#define GRID_ROWS ((size_t)20000) // above, noise is so small that valleys are short and straight

struct grid {
    struct fit_space held;
    int n_cells, k_cells; // 1: that one is held
    double q[CELLS][CELLS];
};

// n in equal ratios, k in equal steps of its root, both from bound to bound.
static void place(const struct grid *g, int i, int j, double x[FIT_PARAMS])
{
    const double *low = g->held.lower, *high = g->held.upper;
    const double a = g->n_cells > 1 ? i / (g->n_cells - 1.0) : 0;
    const double b = g->k_cells > 1 ? j / (g->k_cells - 1.0) : 0;
    const double root = sqrt(sqrt(low[FIT_K])) * (1 - b) + sqrt(sqrt(high[FIT_K])) * b;
    x[FIT_N] = low[FIT_N] * pow(high[FIT_N] / low[FIT_N], a);
    x[FIT_K] = g->k_cells > 1 ? pow(root, 4) : low[FIT_K];
}

static int cell_of(double value, double low, double high, int cells)
{
    return cells > 1 ? (int)lrint((value - low) / (high - low) * (cells - 1)) : 0;
}

static bool fill(const struct hold *h, struct grid *g, double log_sigma)
{
    for (int i = 0; i < g->n_cells; i++)
        for (int j = 0; j < g->k_cells; j++) {
            double x[FIT_PARAMS] = {[FIT_SIGMA] = log_sigma};
            struct kernel_gram gram;
            place(g, i, j, x);
            if (!passes_moments(h->set, x, h->control, &gram))
                return false;
            g->q[i][j] = varpro_solve(&gram, x, &g->held).q;
        }
    return true;
}

static bool is_valley(const struct grid *g, int i, int j)
{
    for (int a = i - 1; a <= i + 1; a++)
        for (int b = j - 1; b <= j + 1; b++)
            if (a >= 0 && a < g->n_cells && b >= 0 && b < g->k_cells && g->q[a][b] < g->q[i][j])
                return false;
    return true;
}

// The lowest valleys that *at does not lie in, each polished; *at becomes the lowest of all.
static bool try_valleys(const struct hold *h, const struct grid *g, struct fit_optimum *at)
{
    const double *low = g->held.lower, *high = g->held.upper;
    const int own_i = cell_of(log(at->x[FIT_N]), log(low[FIT_N]), log(high[FIT_N]), g->n_cells);
    const int own_j = cell_of(sqrt(sqrt(at->x[FIT_K])), sqrt(sqrt(low[FIT_K])),
                              sqrt(sqrt(high[FIT_K])), g->k_cells);
    const double log_sigma = at->x[FIT_SIGMA];
    double above = -1; // valleys are taken by rising q
    for (int start = 0; start < STARTS; start++) {
        int n_cell = -1, k_cell = -1;
        for (int i = 0; i < g->n_cells; i++)
            for (int j = 0; j < g->k_cells; j++)
                if (g->q[i][j] > above && is_valley(g, i, j) &&
                    (abs(i - own_i) > 1 || abs(j - own_j) > 1) &&
                    (n_cell < 0 || g->q[i][j] < g->q[n_cell][k_cell])) {
                    n_cell = i;
                    k_cell = j;
                }
        if (n_cell < 0)
            return true;
        struct fit_optimum other = {.x = {[FIT_SIGMA] = log_sigma}};
        place(g, n_cell, k_cell, other.x);
        above = g->q[n_cell][k_cell];
        if (!polish(h->set, &g->held, FIRST_STEPS, h->control, &other))
            return false;
        if (other.q < MAY_PASS * at->q && !polish(h->set, &g->held, STEPS, h->control, &other))
            return false;
        if (other.q < at->q)
            *at = other;
    }
    return true;
}

bool hold_at(const struct hold *h, enum fit_param which, double x, const struct fit_optimum *from,
             struct fit_optimum *ret_at)
{
    const double own = h->cov->inverse[which][which], step = x - from->x[which];
    struct grid g = {.held = *h->space};
    struct fit_optimum at = *from;
    for (int i = 0; i < FIT_PARAMS && own > 0; i++)
        at.x[i] += step * h->cov->inverse[i][which] / own;
    g.held.lower[which] = g.held.upper[which] = x;
    if (!polish(h->set, &g.held, STEPS, h->control, &at))
        return false;
    const bool n_free = g.held.lower[FIT_N] < g.held.upper[FIT_N];
    const bool k_free = g.held.lower[FIT_K] < g.held.upper[FIT_K];
    g.n_cells = !n_free ? 1 : k_free ? CELLS_EACH : CELLS;
    g.k_cells = !k_free ? 1 : n_free ? CELLS_EACH : CELLS;
    const bool valleys = which == FIT_N || which == FIT_K || which == FIT_KS;
    if (valleys && h->set->distinct.count <= GRID_ROWS &&
        (!fill(h, &g, at.x[FIT_SIGMA]) || !try_valleys(h, &g, &at)))
        return false;
    *ret_at = at;
    return true;
}
