// SPDX-License-Identifier: MIT
#include "bench/peers/method.h"

#include <stddef.h>
#include <string.h>

// The Makefile says which packages it found.
#ifdef PEERS_NLOPT
#include <nlopt.h>
#else
#define peer_nlopt NULL
enum { NLOPT_G_MLSL, NLOPT_G_MLSL_LDS, NLOPT_GN_CRS2_LM, NLOPT_LD_SLSQP, NLOPT_LD_LBFGS };
#endif
#ifndef PEERS_CMAES
#define peer_cmaes NULL
#endif
#ifndef PEERS_CMINPACK
#define peer_cminpack NULL
#endif

#define COUNT(a) (sizeof(a) / sizeof *(a))

// Tried and dropped, as they were slower: MMA, CCSA, VAR2, TNEWTON and BOBYQA under MLSL; a fixed
// number of evaluations for it; no polish of CRS2 and CMA-ES; k or k^2 for the gene; log Delta for
// gradient methods (CMA-ES needs it: its tolerance is absolute). settings_grid is the last round.
static const struct setting gonio = {.name = "gonio", .run = peer_gonio};
static const struct setting mlsl = {.name = "NLopt MLSL_LDS + SLSQP",
                                    .run = peer_nlopt,
                                    .k_power = 4,
                                    .algorithm = NLOPT_G_MLSL_LDS,
                                    .local = NLOPT_LD_SLSQP,
                                    .ftol = 1e-8};
static const struct setting mlsl_random = {.name = "NLopt MLSL + SLSQP",
                                           .run = peer_nlopt,
                                           .k_power = 4,
                                           .algorithm = NLOPT_G_MLSL,
                                           .local = NLOPT_LD_SLSQP,
                                           .ftol = 1e-8};
static const struct setting crs2 = {.name = "NLopt CRS2_LM + SLSQP",
                                    .run = peer_nlopt,
                                    .k_power = 4,
                                    .algorithm = NLOPT_GN_CRS2_LM,
                                    .local = NLOPT_LD_SLSQP,
                                    .ftol = 1e-8,
                                    .polish = true};
static const struct setting cmaes = {.name = "pagmo CMA-ES + SLSQP",
                                     .run = peer_cmaes,
                                     .k_power = 4,
                                     .log = true,
                                     .local = NLOPT_LD_SLSQP,
                                     .ftol = 1e-9,
                                     .first_step = 0.5,
                                     .polish = true};
static const struct setting lmder = {.name = "cminpack lmder, multistart",
                                     .run = peer_cminpack,
                                     .ours = true,
                                     .k_power = 4,
                                     .ftol = 1e-6,
                                     .first_step = 1};

static struct setting tuned(struct setting s, int population, int effort, double method_ftol,
                            int restarts)
{
    s.population = population;
    s.effort = effort;
    s.method_ftol = method_ftol;
    s.restarts = restarts;
    return s;
}

int settings_to_optimum(struct setting ret_setting[SETTINGS_MAX])
{
    struct setting lbfgs = mlsl;
    lbfgs.name = "NLopt MLSL_LDS + LBFGS";
    lbfgs.local = NLOPT_LD_LBFGS;
    const struct setting all[] = {gonio,
                                  tuned(mlsl, 4, 300, 0, 0),
                                  tuned(mlsl_random, 4, 300, 0, 0),
                                  tuned(lbfgs, 2, 600, 0, 0),
                                  tuned(crs2, 90, 100, 0, 0),
                                  tuned(cmaes, 16, 0, 0.1, 0),
                                  tuned(lmder, 1, 1, 0, 0)};
    memcpy(ret_setting, all, sizeof all);
    return COUNT(all);
}

// A ladder each, the cheapest rungs first: which of them suffices is seen in the run.
int settings_to_stop(struct setting ret_setting[SETTINGS_MAX])
{
    const struct setting all[] = {gonio,
                                  tuned(mlsl, 32, 200, 0, 0),
                                  tuned(mlsl, 32, 300, 0, 0),
                                  tuned(mlsl, 32, 400, 0, 0),
                                  tuned(mlsl_random, 64, 200, 0, 0),
                                  tuned(mlsl_random, 64, 250, 0, 0),
                                  tuned(mlsl_random, 64, 300, 0, 0),
                                  tuned(mlsl_random, 64, 400, 0, 0),
                                  tuned(mlsl_random, 64, 600, 0, 0),
                                  tuned(crs2, 30, 50, 0, 6),
                                  tuned(crs2, 30, 50, 0, 8),
                                  tuned(crs2, 30, 50, 0, 12),
                                  tuned(cmaes, 8, 0, 1, 6),
                                  tuned(cmaes, 8, 0, 1, 8),
                                  tuned(cmaes, 8, 0, 1, 12),
                                  tuned(lmder, 2, 1, 0, 3),
                                  tuned(lmder, 2, 1, 0, 4),
                                  tuned(lmder, 2, 1, 0, 6)};
    memcpy(ret_setting, all, sizeof all);
    return COUNT(all);
}

// What tuning tries: every combination of a row's non-zero numbers.
struct grid {
    peer_run *run;
    int algorithm;
    int population[8], effort[8], restarts[8];
    double method_ftol[4];
};

static const struct grid grids[] = {
    {peer_cminpack, 0, {1, 2, 4, 6}, {1, 2}, {2, 3, 4, 5, 6, 8}, {0}},
    {peer_nlopt, NLOPT_G_MLSL_LDS, {16, 32, 64}, {150, 175, 200, 225, 250, 300}, {0}, {0}},
    {peer_nlopt, NLOPT_G_MLSL, {8, 16, 32, 64}, {100, 125, 150, 175, 200, 250, 300}, {0}, {0}},
    {peer_cmaes, 0, {8, 12, 16}, {0}, {3, 4, 5, 6, 8}, {3, 1, 0.1}},
    {peer_nlopt, NLOPT_GN_CRS2_LM, {20, 30, 40, 60}, {50, 100}, {3, 4, 5, 6, 8}, {0}},
};

// A list ends at its first zero; an empty one counts as one zero.
static int length(const int list[8])
{
    int n = 0;
    while (n < 8 && list[n] != 0)
        n++;
    return n > 1 ? n : 1;
}

bool settings_grid(const struct setting *method, int i, struct setting *ret_setting)
{
    for (size_t g = 0; g < COUNT(grids); g++) {
        const struct grid *grid = &grids[g];
        if (!method->run || grid->run != method->run || grid->algorithm != method->algorithm)
            continue;
        int p = length(grid->population), e = length(grid->effort), r = length(grid->restarts);
        int f = grid->method_ftol[1] > 0 ? 3 : 1;
        *ret_setting = tuned(*method, grid->population[i % p], grid->effort[i / p % e],
                             grid->method_ftol[i / p / e / r % f], grid->restarts[i / p / e % r]);
        return i < p * e * r * f;
    }
    return false;
}
