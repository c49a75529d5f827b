// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/fit.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define GENERATIONS 150 // of the paper's 1000: enough for what is asserted

struct log {
    int calls;
    double best[GENERATIONS + 1], mean[GENERATIONS + 1];
};

static void keep(void *ctx, int generation, double best, double mean)
{
    struct log *log = ctx;
    assert_int_equal(generation, log->calls);
    assert_true(best <= mean * (1 + 1e-12));
    log->best[log->calls] = best;
    log->mean[log->calls++] = mean;
}

static struct fit_result run(const struct readings *r, struct fit_options *o, struct log *log)
{
    struct fit_data data = readings_data(r, false);
    struct fit_result result;
    *log = (struct log){0};
    o->method = FIT_PAPER;
    o->paper.generations = GENERATIONS;
    o->trace = keep;
    o->trace_ctx = log;
    assert_int_equal(fit_run(&data, o, &result), 0);
    assert_int_equal(log->calls, GENERATIONS + 1);
    return result;
}

static struct readings dielectric(void)
{
    struct readings r = {.count = 0};
    if (!readings_load(&r, "tests/golden/golden_fit_a.csv", "f_r", 90))
        fail_msg("no golden_fit_a.csv: run the tests from the root of the repository");
    return r;
}

static void same_seed_gives_the_same_trace(void **state)
{
    (void)state;
    struct readings r = dielectric();
    struct fit_options o = fit_options_default();
    struct log a, b, c;
    struct fit_result x = run(&r, &o, &a), y = run(&r, &o, &b);
    assert_memory_equal(&a, &b, sizeof a);
    assert_memory_equal(&x.params, &y.params, sizeof x.params);
    o.seed = 2;
    run(&r, &o, &c);
    assert_memory_not_equal(a.best, c.best, sizeof a.best);
    readings_free(&r);
}

// What the paper's algorithm does: it improves on chance, and stays far above the optimum.
static void delta_is_worse_than_the_memetic_search_finds(void **state)
{
    (void)state;
    struct readings r = dielectric();
    struct fit_data data = readings_data(&r, false);
    struct fit_options o = fit_options_default();
    struct fit_result memetic;
    assert_int_equal(fit_run(&data, &o, &memetic), 0);
    for (int scaling = 0; scaling <= 1; scaling++)
        for (uint64_t seed = 1; seed <= 3; seed++) {
            struct log log;
            o.seed = seed;
            o.paper.scaling = (enum fit_scaling)scaling;
            struct fit_result paper = run(&r, &o, &log);
            double least = log.best[0];
            for (int i = 1; i <= GENERATIONS; i++)
                least = fmin(least, log.best[i]);
            assert_near(paper.delta / least, 1, 1e-9); // the best ever seen is what is reported
            assert_true(paper.delta < log.best[0]);
            assert_true(paper.delta > 1.1 * memetic.delta); // 1.3 to 50 times, measured
            assert_true(paper.params.k >= 0 && paper.params.k <= 10 && paper.params.n >= 0.2);
        }
    readings_free(&r);
}

static void best_falls_steadily_only_with_elitism(void **state)
{
    (void)state;
    struct readings r = dielectric();
    struct fit_options o = fit_options_default();
    for (int elitism = 0; elitism <= 1; elitism++) {
        struct log log;
        int rises = 0;
        o.paper.elitism = elitism;
        run(&r, &o, &log);
        for (int i = 1; i <= GENERATIONS; i++)
            rises += log.best[i] > log.best[i - 1];
        assert_true(elitism ? rises == 0 : rises > 0);
    }
    readings_free(&r);
}

static void crossover_and_mutation_rates_matter(void **state)
{
    (void)state;
    struct readings r = dielectric();
    struct fit_options o = fit_options_default();
    struct log log;
    // Without mutation and crossover only copies are left: the best of the first generation for
    // ever.
    o.paper.pc = o.paper.pm = 0;
    o.paper.elitism = true;
    run(&r, &o, &log);
    assert_near(log.best[GENERATIONS], log.best[0], 0);
    assert_near(log.mean[GENERATIONS], log.best[0], 1e-9 * log.best[0]); // and they take over
    // With crossover alone genes of different parents meet.
    o.paper.pc = 1;
    run(&r, &o, &log);
    assert_true(log.best[GENERATIONS] < log.best[0]);
    // With every bit flipped two generations are complements: mean Delta returns, nothing is
    // learnt.
    o.paper.pc = 0;
    o.paper.pm = 1;
    o.paper.elitism = false;
    run(&r, &o, &log);
    assert_true(log.best[0] == log.best[2] || log.best[2] >= log.best[0]);
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_seed_gives_the_same_trace),
        cmocka_unit_test(delta_is_worse_than_the_memetic_search_finds),
        cmocka_unit_test(best_falls_steadily_only_with_elitism),
        cmocka_unit_test(crossover_and_mutation_rates_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
