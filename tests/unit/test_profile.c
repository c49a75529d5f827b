// SPDX-License-Identifier: MIT
// uses: fit model
// What the ends of the intervals are worth: with the parameter held 2 % beyond an end, no fit from
// anywhere may come closer to the optimum than the 95 % quantile allows. Surfaces of which the
// valley of n, k and ks has several branches, rises above the quantile and falls below it again,
// and ends at a cliff.
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define Z95 1.96
#define BEYOND 0.02
#define FIRST_SEED 2002

static const struct brdf_params surface[] = {{3.6, 1.5, 0.2, 0.8, 0.02}, // n up to 8, or high k
                                             {4.3, 0.05, 0.1, 0.6, 0.03},
                                             {4, 0.5, 0.15, 0.9, 0.05},
                                             {1.3, 7.5, 0.12, 1, 0.01}, // k about 3, or 9
                                             {1.5, 0.02, 0.15, 0.9, 0.05}};
enum { SURFACES = sizeof surface / sizeof *surface, NOISES = 2, SEARCHES = 2 };

static double *bound_of(struct brdf_params *p, enum fit_param which)
{
    double *member[FIT_PARAMS] = {&p->n, &p->k, &p->sigma, &p->ks, &p->kd};
    return member[which];
}

// The least Delta with the parameter held: the search itself, from several seeds.
static double least_delta(const struct fit_data *data, const struct fit_options *options,
                          enum fit_param which, double value)
{
    struct fit_options held = *options;
    double least = (double)INFINITY;
    *bound_of(&held.lower, which) = *bound_of(&held.upper, which) = value;
    for (int seed = 1; seed <= SEARCHES; seed++) {
        struct fit_result r;
        held.seed = (uint64_t)seed;
        assert_int_equal(fit_run(data, &held, &r), 0);
        least = fmin(least, r.delta);
    }
    return least;
}

static double sum_of_squares(const struct readings *r)
{
    double sum = 0;
    for (size_t i = 0; i < r->count; i++)
        sum += r->f[i] * r->f[i] / (r->u[i] * r->u[i]);
    return sum;
}

// An end may lie further out than the quantile (what the other profiles admit), never nearer.
static int short_ends(const struct readings *r, int *ret_ends)
{
    const struct fit_data data = readings_data(r, true);
    struct fit_options o = fit_options_default();
    struct fit_result fit;
    int count = 0;
    o.weighting = FIT_VARIANCE;
    assert_int_equal(fit_run(&data, &o, &fit), 0);
    for (enum fit_param p = 0; p < FIT_PARAMS; p++) {
        const double end[2] = {fit.estimate[p].lo95, fit.estimate[p].hi95};
        const double bound[2] = {*bound_of(&o.lower, p), *bound_of(&o.upper, p)};
        for (int i = 0; i < 2; i++) {
            const double at = end[i] + (i ? BEYOND : -BEYOND) * fabs(end[i]);
            if (i ? at >= bound[i] : at <= bound[i])
                continue;
            const double rise = least_delta(&data, &o, p, at) - fit.delta;
            const double z = sqrt(fmax(0, rise * sum_of_squares(r)));
            ++*ret_ends;
            if (z < 0.95 * Z95) {
                count++;
                print_error("%s = %g: end at %g, but z is %.2f at %g\n", fit_param_name(p),
                            fit.estimate[p].value, end[i], z, at);
            }
        }
    }
    return count;
}

static void no_lower_valley_is_overlooked(void **state)
{
    (void)state;
    int ends = 0, too_short = 0;
    for (int s = 0; s < SURFACES; s++)
        for (int noise = 0; noise < NOISES; noise++) {
            struct readings r = readings_paper();
            readings_measure(&r, &surface[s], 0.02, 1e-5, (uint64_t)(FIRST_SEED + noise));
            too_short += short_ends(&r, &ends);
            readings_free(&r);
        }
    print_message("seeds %d..%d: %d of %d ends are too short\n", FIRST_SEED,
                  FIRST_SEED + NOISES - 1, too_short, ends);
    assert_true(ends > 6 * SURFACES * NOISES);
    assert_int_equal(too_short, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(no_lower_valley_is_overlooked)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
