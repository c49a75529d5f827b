// SPDX-License-Identifier: MIT
#include "fit/fit.h"

#include "fit/bootstrap.h"
#include "fit/memetic.h"
#include "fit/objective.h"
#include "fit/paper_ga.h"
#include "fit/pool.h"
#include "fit/set.h"
#include "fit/space.h"
#include "fit/uncertainty.h"

#include <math.h>
#include <time.h>

#define PI 3.14159265358979323846

struct fit_options fit_options_default(void)
{
    return (struct fit_options){
        .method = FIT_MEMETIC,
        .weighting = FIT_UNIFORM,
        .dense_g = 3,
        .dense_half_width_rad = 5 * PI / 180,
        .diffuse = BRDF_DIFFUSE_PAPER,
        .lower = {.n = 0.2, .k = 0, .sigma = 0.01, .ks = 0, .kd = 0},
        .upper = {.n = 8, .k = 10, .sigma = 0.6, .ks = 1.5, .kd = 0.5},
        .seed = 1,
        .threads = 1,
        .paper = {.population = 100, .bits = 20, .generations = 1000, .pc = 0.5, .pm = 0.05},
    };
}

static bool in_range(double low, double high, double least, double most)
{
    return low >= least && low <= high && high <= most; // false for NAN
}

void fit_param_range(enum fit_param p, double *ret_least, double *ret_most)
{
    static const double least[FIT_PARAMS] = {1e-6, 0, 1e-6, 0, 0},
                        most[FIT_PARAMS] = {1e6, 1e6, 1e3, BRDF_STRENGTH_MAX, BRDF_STRENGTH_MAX};
    *ret_least = least[p];
    *ret_most = most[p];
}

static bool bounds_ok(const struct brdf_params *l, const struct brdf_params *u)
{
    const double low[FIT_PARAMS] = {l->n, l->k, l->sigma, l->ks, l->kd},
                 high[FIT_PARAMS] = {u->n, u->k, u->sigma, u->ks, u->kd};
    bool ok = true;
    for (int i = 0; i < FIT_PARAMS; i++) {
        double least, most;
        fit_param_range((enum fit_param)i, &least, &most);
        ok = ok && in_range(low[i], high[i], least, most);
    }
    return ok;
}

static bool paper_ok(const struct fit_paper_options *p)
{
    bool sizes = p->population >= 4 && p->population <= 10000 && p->population % 2 == 0 &&
                 p->bits >= 4 && p->bits <= 30 && p->generations >= 0 &&
                 p->generations <= FIT_GENERATIONS_MOST;
    bool rates = p->pc >= 0 && p->pc <= 1 && p->pm >= 0 && p->pm <= 1;
    return sizes && rates &&
           (p->mutation == FIT_MUTATE_BIT || p->mutation == FIT_MUTATE_INDIVIDUAL) &&
           (p->scaling == FIT_SCALING_NONE || p->scaling == FIT_SCALING_LINEAR);
}

static bool weighting_ok(const struct fit_options *o, bool with_u)
{
    switch (o->weighting) {
    case FIT_UNIFORM:
    case FIT_RELATIVE: return true;
    case FIT_DENSE:
        return o->dense_g > 0 && o->dense_g <= FIT_DENSE_MOST && o->dense_half_width_rad >= 0 &&
               o->dense_half_width_rad <= PI;
    case FIT_VARIANCE: return with_u;
    }
    return false;
}

static int check_options(const struct fit_options *o, bool with_u)
{
    bool ok = weighting_ok(o, with_u) && bounds_ok(&o->lower, &o->upper) && o->threads >= 1 &&
              o->threads <= 64 && o->u_scale >= 0 && o->u_scale <= 1e6 &&
              o->bootstrap >= 0 && o->bootstrap <= BOOTSTRAP_MOST &&
              (o->diffuse == BRDF_DIFFUSE_PAPER || o->diffuse == BRDF_DIFFUSE_LAMBERT) &&
              (o->method == FIT_MEMETIC || (o->method == FIT_PAPER && paper_ok(&o->paper)));
    return ok ? 0 : FIT_E_OPTIONS;
}

static double elapsed_ms(const struct timespec *since)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)(now.tv_sec - since->tv_sec) * 1e3 +
           (double)(now.tv_nsec - since->tv_nsec) * 1e-6;
}

static int search(const struct fit_set *set, const struct fit_options *o,
                  struct fit_control *control, struct fit_optimum *ret_optimum)
{
    struct fit_space space = space_of_options(o);
    if (o->method == FIT_PAPER)
        return paper_ga_search(set, &space, o, control, ret_optimum);
    return memetic_search(set, &space, o, control, ret_optimum);
}

int fit_run(const struct fit_data *data, const struct fit_options *options,
            struct fit_result *ret_result)
{
    struct timespec start;
    clock_gettime(CLOCK_MONOTONIC, &start);
    struct fit_control control = {.canceled = options->canceled, .ctx = options->cancel_ctx};
    struct fit_set set = {.count = 0};
    struct fit_result r = {.evaluations = 0};
    struct fit_optimum optimum;
    int stop = check_options(options, data->u_per_sr != NULL);
    if (!stop) {
        control.pool = pool_new(options->threads);
        stop = set_compile(data, options, &control, &set);
    }
    if (!stop)
        stop = search(&set, options, &control, &optimum);
    if (stop)
        goto out;
    r.elapsed_ms = elapsed_ms(&start);
    stop = uncertainty_estimate(data, &set, options, &control, &optimum, &r);
    if (stop)
        goto out;
    r.evaluations = lrint(control.points / (double)set.distinct.padded);
    r.elapsed_total_ms = elapsed_ms(&start);
    *ret_result = r;
out:
    set_free(&set);
    pool_free(control.pool);
    return stop;
}

int fit_delta(const struct fit_data *data, const struct fit_options *options,
              const struct brdf_params *p, double *ret_delta)
{
    struct fit_control control = {.canceled = options->canceled, .ctx = options->cancel_ctx};
    struct fit_set set = {.count = 0};
    double delta;
    int stop = check_options(options, data->u_per_sr != NULL);
    if (!stop)
        stop = set_compile(data, options, &control, &set);
    if (!stop)
        stop = objective_delta(&set, p, &control, &delta);
    if (!stop)
        *ret_delta = delta;
    set_free(&set);
    return stop;
}
