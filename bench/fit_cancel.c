// SPDX-License-Identifier: MIT
// uses: fit model
// fit_cancel [TIMES SEED]: how long a fit goes on after it was told to stop, at random moments, for
// 1e3 to 1e6 readings, both methods and 1, 2 and 4 threads. Latency from the flag's change to
// fit_run's return, memory given back: by the wall clock, which on a busy machine holds what the
// scheduler gave to others, and of the processor, all threads of the fit together. One JSON object
// a line.
#include "bench/report.h"
#include "fit/fit.h"
#include "tests/unit/samples.h"
#include "tests/unit/stopper.h"

#include <stdio.h>
#include <stdlib.h>

static int by_value(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

enum { TIMES_MOST = 1000 };

// False when the fit ended before it was told to stop.
static bool stop_once(const struct fit_data *data, struct fit_options *o, double after_ms,
                      double *ret_wall_ms, double *ret_cpu_ms)
{
    struct stopper stop = {.after_ms = after_ms, .processor = CLOCK_PROCESS_CPUTIME_ID};
    struct fit_result result;
    const int rc = stopper_fit(&stop, data, o, &result, ret_wall_ms, ret_cpu_ms);
    if (rc == FIT_E_MEMORY)
        exit(1);
    return rc == FIT_E_CANCELED;
}

static void study(const struct readings *r, enum fit_method method, int threads, int times,
                  struct rng *rng)
{
    static double wall[TIMES_MOST], cpu[TIMES_MOST];
    struct fit_data data = readings_data(r, true);
    struct fit_options o = fit_options_default();
    struct fit_result result;
    o.method = method;
    o.weighting = FIT_VARIANCE;
    o.threads = threads;
    o.paper.generations = r->count > 10000 ? 5 : 100;
    double from = stopper_clock_ms(CLOCK_MONOTONIC);
    if (fit_run(&data, &o, &result))
        exit(1);
    double whole = stopper_clock_ms(CLOCK_MONOTONIC) - from;
    int count = 0;
    for (int i = 0; i < times; i++)
        count += stop_once(&data, &o, whole * rng_uniform(rng), &wall[count], &cpu[count]);
    if (count == 0)
        return;
    qsort(wall, (size_t)count, sizeof *wall, by_value);
    qsort(cpu, (size_t)count, sizeof *cpu, by_value);
    const struct {
        const char *what;
        double ms;
    } rows[] = {{"median", wall[count / 2]}, {"longest", wall[count - 1]},
                {"longest of the processor", cpu[count - 1]}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[80];
        snprintf(text, sizeof text, "%zu points, %s, %d threads, %s", r->count,
                 method == FIT_PAPER ? "paper" : "memetic", threads, rows[i].what);
        report_row("fit_cancel", text, rows[i].ms, "ms", 0, NULL);
    }
}

int main(int argc, char **argv)
{
    int times = argc > 1 ? atoi(argv[1]) : 10;
    struct rng rng;
    struct brdf_params truth = {1.6, 0.4, 0.17, 0.8, 0.06};
    rng_seed(&rng, argc > 2 ? strtoull(argv[2], NULL, 10) : 1);
    if (times < 1 || times > TIMES_MOST)
        return 2;
    for (size_t count = 1000; count <= 1000000; count *= 10) {
        struct readings r = readings_new(count);
        for (size_t i = 0; i < count; i++)
            readings_add(&r, 6.0 * (double)(i % 10), samples_lin(&rng, -85, 85), 0);
        readings_measure(&r, &truth, 0.02, 1e-5, 5);
        for (int method = 0; method < 2; method++)
            for (int threads = 1; threads <= 4; threads *= 2)
                study(&r, method ? FIT_PAPER : FIT_MEMETIC, threads, times, &rng);
        readings_free(&r);
    }
    return 0;
}
