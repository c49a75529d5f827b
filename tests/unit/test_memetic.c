// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/memetic.h"
#include "fit/pool.h"
#include "fit/rng.h"
#include "tests/unit/samples.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static double search(const struct readings *r, struct fit_options *o, uint64_t seed,
                     struct fit_optimum *ret_optimum)
{
    struct fit_data data = readings_data(r, o->weighting == FIT_VARIANCE);
    struct fit_control control = {.stop = false};
    struct fit_set set;
    o->seed = seed;
    assert_int_equal(set_compile(&data, o, &control, &set), 0);
    struct fit_space space = space_of_options(o);
    assert_int_equal(memetic_search(&set, &space, o, &control, ret_optimum), 0);
    double delta = ret_optimum->q / set.ff;
    for (int i = 0; i < FIT_PARAMS; i++)
        assert_true(ret_optimum->x[i] >= space.lower[i] && ret_optimum->x[i] <= space.upper[i]);
    set_free(&set);
    return delta;
}

static void golden_optima_are_reached_from_every_seed(void **state)
{
    (void)state;
    struct golden t;
    if (!golden_open(&t, "tests/golden/golden_fit_optima.csv"))
        fail_msg("no golden_fit_optima.csv: run the tests from the root of the repository");
    for (int i = 0; i < t.rows; i++) {
        char path[64];
        struct readings r = {.count = 0};
        snprintf(path, sizeof path, "tests/golden/golden_fit_%c.csv", 'a' + i / 2);
        assert_true(readings_load(&r, path, "f_r", 90));
        assert_int_equal(r.count, 841);
        struct fit_options o = fit_options_default();
        o.weighting = i % 2 ? FIT_DENSE : FIT_UNIFORM;
        double want = golden_at(&t, i, "delta_best");
        for (uint64_t seed = 1; seed <= 10; seed++) {
            struct fit_optimum best;
            double delta = search(&r, &o, seed, &best);
            // 1e-4 is what is asked; what is found is the optimum to the digits of the table.
            if (fabs(delta / want - 1) > 1e-6)
                fail_msg("%s g%d seed %d: Delta %.10g, best known %.10g", path, i % 2 ? 3 : 1,
                         (int)seed, delta, want);
        }
        readings_free(&r);
    }
    golden_close(&t);
}

static void same_seed_gives_the_same_bits(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    readings_measure(&r, &(struct brdf_params){1.5, 0.3, 0.2, 0.8, 0.1}, 0.02, 1e-5, 4);
    struct fit_options o = fit_options_default();
    struct fit_optimum a, b;
    search(&r, &o, 9, &a);
    search(&r, &o, 9, &b);
    assert_memory_equal(&a, &b, sizeof a);
    readings_free(&r);
}

// 60 random samples (seed 2026): no search may end above Delta at the truth, which is a feasible
// point, and seeds must agree on the optimum. False alarms: none, both hold for every data set when
// the optimum is found.
static void random_samples_agree_between_seeds(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct rng rng;
    rng_seed(&rng, 2026);
    for (int i = 0; i < 60; i++) {
        double k = 3 * rng_uniform(&rng);
        struct brdf_params p = {1.1 + 4 * rng_uniform(&rng), i % 2 ? 0.1 * k : k * k,
                                0.05 * exp(1.8 * rng_uniform(&rng)), 0.3 + rng_uniform(&rng),
                                0.15 * rng_uniform(&rng)};
        readings_measure(&r, &p, 0.02, 1e-5, rng_next(&rng));
        struct fit_options o = fit_options_default();
        o.weighting = i % 3 ? FIT_UNIFORM : FIT_VARIANCE;
        struct fit_data data = readings_data(&r, true);
        struct fit_optimum best;
        double truth, delta[2];
        assert_int_equal(fit_delta(&data, &o, &p, &truth), 0);
        for (int seed = 0; seed < 2; seed++)
            delta[seed] = search(&r, &o, (uint64_t)seed + 1, &best);
        if (delta[0] > truth || fabs(delta[0] / delta[1] - 1) > 1e-6)
            fail_msg("sample %d (n %.3f k %.3f sigma %.3f): Delta %.9g and %.9g, truth %.9g", i,
                     p.n, p.k, p.sigma, delta[0], delta[1], truth);
    }
    readings_free(&r);
}

// 32 samples of samples.h, hard ones among them, from seed 20082, with both weightings: a search
// ends within 1e-6 of the best of 60 polishes from random places, one from the truth and itself in
// 63 of the 64 fits at least. bench/fit_success measures 1200 such fits; where 99.9 % of them
// succeed, two in 64 fail in one of 500 seeds: that is the rate of false alarms when the seed is
// changed.
static double best_of_many(const struct fit_set *set, const struct fit_space *space,
                           const struct brdf_params *truth, struct rng *rng)
{
    struct fit_control control = {.stop = false};
    double best = (double)INFINITY;
    for (int i = 0; i <= 60; i++) {
        struct fit_optimum at = {.q = 0};
        for (int p = 0; p <= FIT_SIGMA; p++)
            at.x[p] = samples_lin(rng, space->lower[p], space->upper[p]);
        at.x[FIT_K] = pow(samples_lin(rng, 0, pow(space->upper[FIT_K], 0.25)), 4);
        if (i == 60)
            space_of_params(truth, at.x);
        assert_true(polish(set, space, 200, &control, &at));
        best = fmin(best, at.q);
    }
    return best;
}

static void hard_samples_end_at_the_best_known_optimum(void **state)
{
    (void)state;
    const uint64_t seed = 20082;
    struct readings r = samples_plan();
    struct fit_data data = readings_data(&r, true);
    struct rng rng;
    int missed = 0;
    assert_int_equal(r.count, 850);
    rng_seed(&rng, seed);
    for (int i = 0; i < 64; i++) {
        static struct brdf_params truth;
        if (i % 2 == 0)
            truth = samples_truth(&rng, i / 2);
        readings_measure(&r, &truth, 0.02, 1e-5, rng_next(&rng));
        struct fit_options o = fit_options_default();
        struct fit_control control = {.stop = false};
        struct fit_space space = space_of_options(&o);
        struct fit_optimum found;
        struct fit_set set;
        o.weighting = i % 2 ? FIT_VARIANCE : FIT_UNIFORM;
        o.seed = (uint64_t)i;
        assert_int_equal(set_compile(&data, &o, &control, &set), 0);
        assert_int_equal(memetic_search(&set, &space, &o, &control, &found), 0);
        double best = best_of_many(&set, &space, &truth, &rng);
        if (found.q > best * (1 + 1e-6)) {
            printf("seed %llu, fit %d, %s: Delta %.9g, best known %.9g\n",
                   (unsigned long long)seed, i, samples_kind(i / 2), found.q / set.ff,
                   best / set.ff);
            missed++;
        }
        set_free(&set);
    }
    assert_true(missed <= 1);
    readings_free(&r);
}

// 850 readings, and so many that a sample of them is searched first.
static void any_number_of_threads_finds_the_same_bits(void **state)
{
    (void)state;
    for (size_t count = 850; count < 20000; count *= 20) {
        struct readings r = count == 850 ? samples_plan() : readings_new(count);
        struct rng rng;
        rng_seed(&rng, 4);
        while (r.count < count)
            readings_add(&r, 6.0 * (double)(r.count % 10), samples_lin(&rng, -85, 85), 0);
        readings_measure(&r, &(struct brdf_params){1.5, 0.3, 0.2, 0.8, 0.1}, 0.02, 1e-5, 4);
        struct fit_data data = readings_data(&r, true);
        struct fit_options o = fit_options_default();
        struct fit_space space = space_of_options(&o);
        struct fit_optimum first = {.q = 0};
        o.weighting = FIT_VARIANCE;
        for (int threads = 1; threads <= 5; threads++) {
            struct fit_control control = {.pool = pool_new(threads)};
            struct fit_optimum found;
            struct fit_set set;
            assert_int_equal(set_compile(&data, &o, &control, &set), 0);
            assert_int_equal(memetic_search(&set, &space, &o, &control, &found), 0);
            if (threads == 1)
                first = found;
            assert_memory_equal(&found, &first, sizeof first);
            set_free(&set);
            pool_free(control.pool);
        }
        readings_free(&r);
    }
}

struct log {
    int calls;
    double best[64];
};

static void keep(void *ctx, int generation, double best, double mean)
{
    struct log *log = ctx;
    assert_int_equal(generation, log->calls);
    assert_true(best <= mean * (1 + 1e-12));
    log->best[log->calls++] = best;
}

static void trace_falls_steadily_to_the_result(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    readings_measure(&r, &(struct brdf_params){1.5, 0.3, 0.2, 0.8, 0.1}, 0.02, 1e-5, 4);
    struct fit_options o = fit_options_default();
    struct log log = {0};
    struct fit_optimum best;
    o.trace = keep;
    o.trace_ctx = &log;
    double delta = search(&r, &o, 1, &best);
    assert_true(log.calls > 2);
    for (int i = 1; i < log.calls; i++)
        assert_true(log.best[i] <= log.best[i - 1]);
    assert_near(log.best[log.calls - 1], delta, 1e-12 * delta);
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(golden_optima_are_reached_from_every_seed),
        cmocka_unit_test(same_seed_gives_the_same_bits),
        cmocka_unit_test(random_samples_agree_between_seeds),
        cmocka_unit_test(hard_samples_end_at_the_best_known_optimum),
        cmocka_unit_test(any_number_of_threads_finds_the_same_bits),
        cmocka_unit_test(trace_falls_steadily_to_the_result),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
