// SPDX-License-Identifier: MIT
#include "fit/bootstrap.h"

#include "fit/kernel.h"
#include "fit/rng.h"
#include "fit/select.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 3, ROUNDS = 8, QUANTITIES = FIT_PARAMS + 2 };
#define Z95 1.959963984540054
#define SETTLED 1e-3 // of the noise's variance: z of an estimate within 3 %

struct work {
    const struct fit_set *set;
    const struct fit_options *options;
    const struct fit_optimum *best;
    struct fit_control *control;
    struct fit_space space;
    struct fit_set replica; // the set with readings of its own
    double *model, *noise;  // sqrt(g) times both
    double settled;         // of q
    double *values[QUANTITIES];
};

// --- one replica ---------------------------------------------------------------------------------

static bool draw(struct work *w, struct rng *rng)
{
    const bool parametric = w->set->u != NULL;
    uint64_t bits = 0;
    for (size_t i = 0; i < w->set->count; i++) {
        if (i % (CONTROL_SLICE / 4) == 0 && control_ask(w->control))
            return false;
        bits = i % 64 == 0 ? rng_next(rng) : bits >> 1;
        double e = parametric ? rng_normal(rng) : bits & 1 ? 1 : -1;
        w->replica.all.f[i] = w->model[i] + w->noise[i] * e;
    }
    return set_revalue(&w->replica, w->control) == 0;
}

static bool refit(struct work *w, struct fit_optimum *at)
{
    *at = *w->best;
    if (!polish(&w->replica, &w->space, STEPS, w->control, at))
        return false;
    for (int round = 1; round < ROUNDS; round++) {
        double before = at->q;
        if (!polish(&w->replica, &w->space, STEPS, w->control, at))
            return false;
        if (before - at->q <= w->settled)
            break;
    }
    return true;
}

// A scale common to all readings is the same for all that is proportional to them.
static void quantities(const struct fit_optimum *at, double scale, double ret[QUANTITIES])
{
    struct brdf_params p = space_params(at->x);
    double ks = p.ks * scale;
    const double all[QUANTITIES] = {p.n,
                                    p.k,
                                    p.sigma,
                                    ks,
                                    p.kd * scale,
                                    ks * brdf_fresnel_mean(p.n, p.k, 0, 1),
                                    ks * brdf_fresnel_mean(p.n, p.k, 0.5, 0.5)};
    memcpy(ret, all, sizeof all);
}

static void keep(struct work *w, int i, const struct fit_optimum *at, double scale)
{
    double of_replica[QUANTITIES];
    quantities(at, scale, of_replica);
    for (int j = 0; j < QUANTITIES; j++)
        w->values[j][i] = of_replica[j];
}

static bool run(struct work *w)
{
    for (int i = 0; i < w->options->bootstrap; i++) {
        struct rng rng;
        struct fit_optimum at;
        rng_seed(&rng, w->options->seed ^ 0x626f6f7473747261u);
        rng_seed(&rng, rng_next(&rng) + (uint64_t)i);
        if (!draw(w, &rng) || !refit(w, &at))
            return false;
        double u = w->options->u_scale;
        keep(w, i, &at, u > 0 ? 1 + u * rng_normal(&rng) : 1);
    }
    return true;
}

// --- what they say -------------------------------------------------------------------------------

static double normal_below(double z)
{
    return 0.5 * erfc(-z * 0.70710678118654752);
}

static double normal_quantile(double p)
{
    double low = -9, high = 9;
    for (int i = 0; i < 60; i++) {
        double middle = (low + high) / 2;
        *(normal_below(middle) < p ? &low : &high) = middle;
    }
    return (low + high) / 2;
}

// Quantiles moved by twice the bias: by how often a replica falls below what it was made from.
static struct fit_spread spread(double *values, int count, double estimate)
{
    double mean = 0, square = 0, below = 0.5;
    for (int i = 0; i < count; i++) {
        mean += values[i] / count;
        below += values[i] < estimate ? 1 : values[i] > estimate ? 0 : 0.5;
    }
    for (int i = 0; i < count; i++)
        square += (values[i] - mean) * (values[i] - mean) / (count - 1);
    double shift = 2 * normal_quantile(below / (count + 1));
    return (struct fit_spread){
        sqrt(square), select_quantile(values, (size_t)count, normal_below(shift - Z95)),
        select_quantile(values, (size_t)count, normal_below(shift + Z95))};
}

static void summarise(struct work *w, struct fit_bootstrap *ret)
{
    struct fit_spread all[QUANTITIES];
    double estimate[QUANTITIES];
    quantities(w->best, 1, estimate);
    for (int j = 0; j < QUANTITIES && !control_ask(w->control); j++)
        all[j] = spread(w->values[j], w->options->bootstrap, estimate[j]);
    if (w->control->stop)
        return;
    memcpy(ret->param, all, sizeof ret->param);
    ret->ks_r0 = all[FIT_PARAMS];
    ret->ks_r45 = all[FIT_PARAMS + 1];
    ret->replicas = w->options->bootstrap;
}

static void say_nothing(struct fit_bootstrap *ret)
{
    const struct fit_spread nothing = {(double)NAN, (double)NAN, (double)NAN};
    *ret = (struct fit_bootstrap){.replicas = 0, .ks_r0 = nothing, .ks_r45 = nothing};
    for (int i = 0; i < FIT_PARAMS; i++)
        ret->param[i] = nothing;
}

static bool prepare(struct work *w, const struct covariance *cov)
{
    const double *x = w->best->x;
    struct kernel_block b;
    for (size_t at = 0; at < w->set->padded; at += KERNEL_BLOCK) {
        if (control_spend(w->control, 2 * KERNEL_BLOCK))
            return false;
        size_t count = kernel_jacobian(w->set, x, at, &b);
        for (size_t i = 0; i < count; i++)
            w->model[at + i] = w->set->all.f[at + i] - b.r[i];
        covariance_noise(w->set, cov, &b, at, count, w->noise + at);
    }
    w->settled = SETTLED * w->best->q / fmax(1, cov->dof);
    return true;
}

int bootstrap_run(const struct fit_set *set, const struct fit_options *options,
                  const struct fit_optimum *best, const struct covariance *cov,
                  struct fit_control *control, struct fit_bootstrap *ret_bootstrap)
{
    size_t padded = set->padded, replicas = (size_t)options->bootstrap;
    struct fit_bootstrap result;
    say_nothing(&result);
    result.parametric = set->u != NULL;
    struct work w = {.set = set, .options = options, .best = best, .control = control};
    double *memory = NULL;
    int stop = 0;
    if (replicas < 2 || isnan(covariance_u(cov, (const double[FIT_PARAMS]){1, 1, 1, 1, 1})))
        goto out;
    stop = set_replica(set, &w.replica);
    memory = calloc(2 * padded + QUANTITIES * replicas, sizeof *memory);
    if (stop || !memory) {
        stop = FIT_E_MEMORY;
        goto out;
    }
    w.space = space_of_options(options);
    w.model = memory;
    w.noise = memory + padded;
    for (int j = 0; j < QUANTITIES; j++)
        w.values[j] = memory + 2 * padded + (size_t)j * replicas;
    if (prepare(&w, cov) && run(&w))
        summarise(&w, &result);
    stop = control->stop ? FIT_E_CANCELED : 0;
out:
    set_free(&w.replica);
    free(memory);
    if (!stop)
        *ret_bootstrap = result;
    return stop;
}
