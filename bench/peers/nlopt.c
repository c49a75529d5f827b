// SPDX-License-Identifier: MIT
// NLopt: MLSL with a local optimiser of its own, and CRS2 with local mutation.
#include "bench/peers/method.h"

#include "fit/rng.h"

#include <nlopt.h>
#include <string.h>

struct context {
    struct attempt *attempt;
    nlopt_opt opt;
};

static double objective(unsigned n, const double *gene, double *slope, void *ctx)
{
    struct context *c = ctx;
    (void)n;
    double delta = slope ? attempt_slope(c->attempt, gene, slope) : attempt_value(c->attempt, gene);
    if (c->attempt->over)
        nlopt_force_stop(c->opt);
    return delta;
}

static nlopt_opt create(int algorithm)
{
    nlopt_opt opt = nlopt_create((nlopt_algorithm)algorithm, ATTEMPT_GENES);
    nlopt_set_lower_bounds1(opt, 0);
    nlopt_set_upper_bounds1(opt, 1);
    return opt;
}

static void optimise(nlopt_opt opt, struct attempt *a, double gene[])
{
    struct context c = {a, opt};
    double delta;
    nlopt_set_min_objective(opt, objective, &c);
    nlopt_optimize(opt, gene, &delta);
}

void peer_nlopt(struct attempt *a, const struct setting *s, uint64_t seed)
{
    double gene[ATTEMPT_GENES];
    struct rng rng;
    rng_seed(&rng, seed);
    nlopt_srand((unsigned long)seed);
    for (int i = 0; i < ATTEMPT_GENES; i++)
        gene[i] = rng_uniform(&rng);
    nlopt_opt opt = create(s->algorithm), local = create(s->local);
    nlopt_set_ftol_rel(local, s->ftol);
    nlopt_set_population(opt, (unsigned)s->population);
    if (s->algorithm != NLOPT_GN_CRS2_LM)
        nlopt_set_local_optimizer(opt, local);
    attempt_run(a, s->effort);
    optimise(opt, a, gene);
    nlopt_destroy(local);
    nlopt_destroy(opt);
    peer_polish(a, s);
}

void peer_polish(struct attempt *a, const struct setting *s)
{
    if (!s->polish || a->done)
        return;
    nlopt_opt local = create(s->local);
    double gene[ATTEMPT_GENES];
    memcpy(gene, a->run_gene, sizeof gene);
    nlopt_set_ftol_rel(local, s->ftol);
    attempt_run(a, 0);
    optimise(local, a, gene);
    nlopt_destroy(local);
}
