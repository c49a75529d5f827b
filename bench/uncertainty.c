// SPDX-License-Identifier: MIT
// uses: fit model
// What knowing costs at the paper's plan (850 readings, one thread): covariance, five profiles,
// bootstrap. One JSON object a line: name, value, unit. The least of many rounds, the kinds
// interleaved, so that what else the machine does hurts all alike.
#include "fit/bootstrap.h"
#include "fit/covariance.h"
#include "fit/fit.h"
#include "fit/polish.h"
#include "fit/profile.h"
#include "tests/unit/readings.h"

#include <stdio.h>
#include <time.h>

enum { ROUNDS = 15, REPEATS = 200, REPLICAS = 1000, TRUTHS = 3 };

static double now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static void say(const char *name, const char *truth, double value, const char *unit)
{
    printf("{\"name\": \"%s, %s\", \"value\": %.4g, \"unit\": \"%s\"}\n", name, truth, value, unit);
}

struct work {
    struct fit_set set;
    struct fit_space space;
    struct fit_optimum best;
    struct covariance cov;
    struct fit_options options;
};

static double covariance_us(struct work *w)
{
    struct fit_control control = {.canceled = NULL};
    double start = now_us();
    for (int i = 0; i < REPEATS; i++)
        covariance_at(&w->set, &w->space, w->best.x, &control, &w->cov);
    return (now_us() - start) / REPEATS;
}

static double profiles_us(struct work *w)
{
    struct fit_control control = {.canceled = NULL};
    struct fit_optimum best = w->best;
    struct profile profile[FIT_PARAMS];
    bool better;
    double start = now_us();
    profile_intervals(&w->set, &w->space, &w->cov, &control, &best, profile, &better);
    return now_us() - start;
}

static double bootstrap_us(struct work *w)
{
    struct fit_control control = {.canceled = NULL};
    struct fit_bootstrap result;
    double start = now_us();
    bootstrap_run(&w->set, &w->options, &w->best, &w->cov, &control, &result);
    return now_us() - start;
}

// The paper's ten sweeps with 85 readings each.
static struct readings plan(void)
{
    static const double sweep[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct readings r = readings_new(850);
    for (int s = 0; s < 10; s++)
        for (int i = 0; i < 85; i++)
            readings_add(&r, sweep[s], -83.7 + 2 * i, 0);
    return r;
}

static void measure(const char *name, const struct brdf_params *truth, bool with_u)
{
    struct readings r = plan();
    readings_measure(&r, truth, 0.02, 1e-5, 7);
    struct fit_data data = readings_data(&r, with_u);
    struct fit_options o = fit_options_default();
    o.weighting = with_u ? FIT_VARIANCE : FIT_UNIFORM;
    struct fit_control control = {.canceled = NULL};
    struct fit_result result;
    struct work w;
    if (fit_run(&data, &o, &result) || set_compile(&data, &o, &control, &w.set))
        return;
    w.options = o;
    w.options.bootstrap = REPLICAS;
    w.space = space_of_options(&o);
    space_of_params(&result.params, w.best.x);
    polish(&w.set, &w.space, 100, &control, &w.best);
    double least[3] = {1e300, 1e300, 1e300};
    for (int round = 0; round < ROUNDS; round++) {
        double us[3] = {covariance_us(&w), profiles_us(&w), bootstrap_us(&w)};
        for (int i = 0; i < 3; i++)
            least[i] = us[i] < least[i] ? us[i] : least[i];
    }
    say("covariance", name, least[0], "us");
    say("five profiles", name, least[1] * 1e-3, "ms");
    say("1000 bootstrap replicas", name, least[2] * 1e-3, "ms");
    set_free(&w.set);
    readings_free(&r);
}

int main(void)
{
    static const struct {
        const char *name;
        struct brdf_params p;
    } truth[TRUTHS] = {{"dielectric", {1.5, 0.02, 0.15, 0.9, 0.05}},
                       {"metal", {1.3, 7.5, 0.12, 1, 0.01}},
                       {"paper", {5.345064, 5.345064, 0.123451, 0.95, 0.092414}}};
    for (int t = 0; t < TRUTHS; t++) {
        char name[60];
        for (int with_u = 0; with_u < 2; with_u++) {
            snprintf(name, sizeof name, "%s, %s weights", truth[t].name,
                     with_u ? "variance" : "uniform");
            measure(name, &truth[t].p, with_u);
        }
    }
    return 0;
}
