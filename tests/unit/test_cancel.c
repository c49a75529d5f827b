// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/fit.h"
#include "fit/rng.h"
#include "tests/unit/readings.h"
#include "tests/unit/stopper.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

#ifdef __SANITIZE_ADDRESS__
#define LATENCY_MS 40.0 // the sanitizers slow everything down
#else
#define LATENCY_MS 10.0
#endif

static uint64_t seed = 20081;

// Returns whether it was stopped before its end. What counts is the processor's time of the fitting
// thread, which a busy machine does not lengthen; the clock's is printed.
static bool stop_after(const struct readings *r, struct fit_options *o, double after_ms,
                       double *longest_cpu_ms, double *longest_wall_ms)
{
    struct fit_data data = readings_data(r, true);
    struct stopper stop = {.after_ms = after_ms};
    struct fit_result result = {.delta = 42};
    double wall_ms, cpu_ms;
    assert_int_equal(pthread_getcpuclockid(pthread_self(), &stop.processor), 0);
    const int rc = stopper_fit(&stop, &data, o, &result, &wall_ms, &cpu_ms);
    if (rc == FIT_OK)
        return false;
    assert_int_equal(rc, FIT_E_CANCELED);
    assert_near(result.delta, 42, 0);
    *longest_cpu_ms = fmax(*longest_cpu_ms, cpu_ms);
    *longest_wall_ms = fmax(*longest_wall_ms, wall_ms);
    return true;
}

static void stops_in_time(size_t count, enum fit_method method, int times, double most_ms)
{
    struct rng rng;
    rng_seed(&rng, seed);
    struct readings r = readings_new(count);
    for (size_t i = 0; i < count; i++)
        readings_add(&r, 6.0 * (double)(i % 10), 170 * rng_uniform(&rng) - 85, 0);
    readings_measure(&r, &(struct brdf_params){1.6, 0.4, 0.17, 0.8, 0.06}, 0.02, 1e-5, seed);
    for (int threads = 1; threads <= 3; threads += 2) {
        struct fit_options o = fit_options_default();
        double cpu = 0, wall = 0;
        int stopped = 0;
        o.method = method;
        o.weighting = FIT_VARIANCE;
        o.threads = threads;
        for (int i = 0; i < times; i++)
            stopped += stop_after(&r, &o, most_ms * rng_uniform(&rng), &cpu, &wall);
        printf("%zu readings, %d threads, seed %llu: stopped %d of %d, longest %.2f ms of the "
               "thread, %.2f by the clock\n", count, threads, (unsigned long long)seed, stopped,
               times, cpu, wall);
        assert_true(stopped > 0);
        assert_true(cpu < LATENCY_MS);
    }
    readings_free(&r);
}

// Moments spread over compilation, sampling, search, polish and uncertainties. False alarms: none
// expected; 4 ms of the 10 is giving a million readings' memory back.
static void a_million_readings_stop_in_time(void **state)
{
    (void)state;
    stops_in_time(1000000, FIT_MEMETIC, 4, 400);
}

static void ten_thousand_readings_stop_in_time(void **state)
{
    (void)state;
    stops_in_time(10000, FIT_MEMETIC, 30, 12);
}

static void the_papers_algorithm_stops_in_time(void **state)
{
    (void)state;
    stops_in_time(200000, FIT_PAPER, 4, 100);
}

int main(int argc, char **argv)
{
    if (argc == 3 && argv[1][0] == '-' && argv[1][1] == 's')
        seed = strtoull(argv[2], NULL, 10);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_million_readings_stop_in_time),
        cmocka_unit_test(ten_thousand_readings_stop_in_time),
        cmocka_unit_test(the_papers_algorithm_stops_in_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
