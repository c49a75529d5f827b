// SPDX-License-Identifier: MIT
// uses: fit model
// fit_scaling [ROUNDS]: search with polish at 1e3, 1e4, 1e5 and 1e6 readings (a dense plan, every
// geometry different, noise 2 %), on one thread and on two, which must find the same to the bit.
// The threads' rounds alternate and the least time of each counts, because other programs share the
// machine. cpu_ms is the processor's time of all threads together: how much work sharing adds. One
// JSON object a line.
#include "bench/report.h"
#include "fit/fit.h"
#include "tests/unit/samples.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double clock_ms(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

// Ten sweeps; theta_r at random, half of it within 5 deg of specular.
static struct readings dense_plan(size_t count)
{
    static const double sweep[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct readings r = readings_new(count);
    struct rng rng;
    rng_seed(&rng, 7);
    for (size_t i = 0; i < count; i++) {
        double theta_i_deg = sweep[i % 10];
        readings_add(&r, theta_i_deg, i % 20 < 10 ? samples_lin(&rng, -85, 85)
                                                  : samples_lin(&rng, theta_i_deg - 5,
                                                                theta_i_deg + 5), 0);
    }
    return r;
}

struct timing {
    double elapsed_ms, total_ms, cpu_ms;
    struct fit_result result;
};

static void run(const struct readings *r, int threads, struct timing *least)
{
    struct fit_options o = fit_options_default();
    struct fit_data data = readings_data(r, true);
    struct fit_result f;
    o.weighting = FIT_VARIANCE;
    o.threads = threads;
    double cpu = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
    if (fit_run(&data, &o, &f)) {
        fputs("fit_scaling: a fit failed\n", stderr);
        exit(1);
    }
    least->cpu_ms = fmin(least->cpu_ms, clock_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu);
    least->elapsed_ms = fmin(least->elapsed_ms, f.elapsed_ms);
    least->total_ms = fmin(least->total_ms, f.elapsed_total_ms);
    least->result = f;
}

static void report(size_t count, const struct timing t[2], double per_point, double growth,
                   bool same)
{
    char text[80];
    snprintf(text, sizeof text, "%zu points, search and polish", count);
    report_row("fit_scaling", text, t[0].elapsed_ms, "ms", 0, NULL);
    snprintf(text, sizeof text, "%zu points, a point", count);
    report_row("fit_scaling", text, per_point, "ns", growth, "1000 points");
    snprintf(text, sizeof text, "%zu points, two threads%s", count,
             same ? "" : ": ANOTHER RESULT");
    report_row("fit_scaling", text, t[1].elapsed_ms, "ms", t[0].elapsed_ms / t[1].elapsed_ms,
               "one thread");
}

int main(int argc, char **argv)
{
    int rounds = argc > 1 ? atoi(argv[1]) : 7;
    double per_point_first = 0;
    struct brdf_params truth = {1.6, 0.4, 0.17, 0.8, 0.06};
    for (size_t count = 1000; count <= 1000000; count *= 10) {
        struct readings r = dense_plan(count);
        readings_measure(&r, &truth, 0.02, 1e-5, 5);
        struct timing t[2];
        for (int i = 0; i < 2; i++)
            t[i].elapsed_ms = t[i].total_ms = t[i].cpu_ms = (double)INFINITY;
        for (int i = 0; i < rounds; i++)
            for (int threads = 1; threads <= 2; threads++)
                run(&r, threads, &t[threads - 1]);
        bool same = !memcmp(&t[0].result.params, &t[1].result.params, sizeof truth);
        double per_point = 1e6 * t[0].elapsed_ms / (double)count;
        per_point_first = count == 1000 ? per_point : per_point_first;
        report(count, t, per_point, per_point / per_point_first, same);
        readings_free(&r);
    }
    return 0;
}
