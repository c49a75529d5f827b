// SPDX-License-Identifier: MIT
#include "bench/peers/task.h"

#include "fit/polish.h"
#include "fit/rng.h"

#include <stdio.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
enum { ROOM = 1000, POLISH_STEPS = 300 };

static double between(struct rng *r, double low, double high)
{
    return low + (high - low) * rng_uniform(r);
}

static double between_log(struct rng *r, double low, double high)
{
    return exp(between(r, log(low), log(high)));
}

static struct brdf_params random_surface(struct rng *r, uint64_t kind)
{
    struct brdf_params p = {.sigma = between_log(r, 0.04, 0.4),
                            .ks = between(r, 0.3, 1),
                            .kd = between_log(r, 0.005, 0.2)};
    switch (kind % 3) {
    case 0: // dielectric
        p.n = between(r, 1.3, 2.2);
        p.k = between_log(r, 1e-3, 0.1);
        break;
    case 1: // metal
        p.n = between(r, 0.4, 4);
        p.k = between(r, 2, 8);
        break;
    default: p.n = between(r, 1, 4); p.k = between_log(r, 0.1, 3);
    }
    return p;
}

static void measure(struct task *t, struct rng *rng)
{
    static const double sweep_deg[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    double *ti = t->columns, *tr = ti + ROOM, *dphi = tr + ROOM, *f = dphi + ROOM;
    size_t count = 0;
    for (size_t s = 0; s < sizeof sweep_deg / sizeof *sweep_deg; s++)
        for (int i = -170; i <= 170; i++) {
            double tr_deg = i * 0.5;
            if (i % 5 != 0 && fabs(tr_deg - sweep_deg[s]) > 5)
                continue;
            ti[count] = sweep_deg[s] * PI / 180;
            tr[count] = fabs(tr_deg) * PI / 180;
            dphi[count] = i >= 0 ? PI : 0;
            struct brdf_geometry g = brdf_geometry(ti[count], tr[count], dphi[count]);
            double exact = brdf_f00(&t->truth, BRDF_DIFFUSE_PAPER, &g);
            f[count++] = exact * (1 + 0.02 * rng_normal(rng)) + 1e-5 * rng_normal(rng);
        }
    t->data = (struct fit_data){
        .count = count, .theta_i_rad = ti, .theta_r_rad = tr, .dphi_rad = dphi, .f_per_sr = f};
}

static double best_of_starts(const struct task *t, struct rng *rng, int starts)
{
    struct fit_control control = {.stop = false};
    double best = (double)INFINITY;
    const double *low = t->space.lower, *high = t->space.upper;
    for (int i = 0; i < starts; i++) {
        double root_k = between(rng, sqrt(sqrt(low[FIT_K])), sqrt(sqrt(high[FIT_K])));
        struct fit_optimum o = {.x = {[FIT_N] = between(rng, low[FIT_N], high[FIT_N]),
                                      [FIT_K] = pow(root_k, 4),
                                      [FIT_SIGMA] = between(rng, low[FIT_SIGMA], high[FIT_SIGMA])}};
        polish(&t->set, &t->space, POLISH_STEPS, &control, &o);
        best = fmin(best, o.q / t->set.ff);
    }
    return best;
}

bool task_new(struct task *ret_task, uint64_t seed, int starts)
{
    struct task t = {.seed = seed, .options = fit_options_default()};
    struct fit_control control = {.stop = false};
    struct rng rng;
    rng_seed(&rng, seed);
    t.columns = malloc(4 * ROOM * sizeof *t.columns);
    if (!t.columns)
        return false;
    t.truth = random_surface(&rng, seed);
    measure(&t, &rng);
    if (set_compile(&t.data, &t.options, &control, &t.set)) {
        free(t.columns);
        return false;
    }
    t.space = space_of_options(&t.options);
    t.best = best_of_starts(&t, &rng, starts);
    *ret_task = t;
    return true;
}

void task_free(struct task *t)
{
    set_free(&t->set);
    free(t->columns);
}

bool task_write(const struct task *t, const char *path)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return false;
    const struct fit_data *d = &t->data;
    for (size_t i = 0; i < d->count; i++)
        fprintf(file, "%.17g %.17g %.17g %.17g\n", d->theta_i_rad[i], d->theta_r_rad[i],
                d->dphi_rad[i], d->f_per_sr[i]);
    return fclose(file) == 0;
}
