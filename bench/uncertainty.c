// SPDX-License-Identifier: MIT
// uses: fit model
// What knowing costs at the paper's plan (850 readings, one thread): covariance, five profiles,
// bootstrap, for three surfaces and two weightings.
#include "bench/report.h"
#include "fit/bootstrap.h"
#include "fit/covariance.h"
#include "fit/fit.h"
#include "fit/polish.h"
#include "fit/profile.h"
#include "fit/rng.h"

#include <math.h>

enum { ROUNDS = 15, REPEATS = 200, REPLICAS = 1000, SWEEPS = 10, A_SWEEP = 85 };
enum { READINGS = SWEEPS * A_SWEEP };
#define RAD (3.14159265358979323846 / 180)

static const struct {
    const char *name;
    struct brdf_params p;
} truths[] = {{"dielectric", {1.5, 0.02, 0.15, 0.9, 0.05}},
              {"metal", {1.3, 7.5, 0.12, 1, 0.01}},
              {"paper's values", {5.345064, 5.345064, 0.123451, 0.95, 0.092414}}};

struct readings {
    double theta_i[READINGS], theta_r[READINGS], dphi[READINGS], f[READINGS], u[READINGS];
};

// The paper's ten sweeps, 85 readings each, 2 % noise and a floor of 1e-5 sr^-1.
static void measure(const struct brdf_params *p, struct readings *r)
{
    static const double sweep_deg[SWEEPS] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct rng rng;
    rng_seed(&rng, 7);
    for (int i = 0; i < READINGS; i++) {
        double theta_r_deg = -83.7 + 2 * (i % A_SWEEP);
        r->theta_i[i] = sweep_deg[i / A_SWEEP] * RAD;
        r->theta_r[i] = fabs(theta_r_deg) * RAD;
        r->dphi[i] = theta_r_deg < 0 ? 0 : 180 * RAD;
        struct brdf_geometry g = brdf_geometry(r->theta_i[i], r->theta_r[i], r->dphi[i]);
        double f = brdf_f00(p, BRDF_DIFFUSE_PAPER, &g);
        r->u[i] = hypot(0.02 * f, 1e-5);
        r->f[i] = f + r->u[i] * rng_normal(&rng);
    }
}

struct work {
    struct fit_set set;
    struct fit_options options;
    struct fit_space space;
    struct fit_optimum best;
    struct covariance cov;
    struct fit_control control;
};

static double covariance_ns(struct work *w)
{
    double start = report_now_ns();
    for (int i = 0; i < REPEATS; i++)
        covariance_at(&w->set, &w->space, w->best.x, &w->control, &w->cov);
    return (report_now_ns() - start) / REPEATS;
}

static double profiles_ns(struct work *w)
{
    struct fit_optimum best = w->best;
    struct profile profile[FIT_PARAMS];
    bool better;
    double start = report_now_ns();
    profile_intervals(&w->set, &w->space, &w->cov, &w->control, &best, profile, &better);
    return report_now_ns() - start;
}

static double bootstrap_ns(struct work *w)
{
    struct fit_bootstrap result;
    double start = report_now_ns();
    bootstrap_run(&w->set, &w->options, &w->best, &w->cov, &w->control, &result);
    return report_now_ns() - start;
}

static int prepare(const struct fit_data *data, struct work *w)
{
    struct fit_result result;
    w->options = fit_options_default();
    w->options.weighting = data->u_per_sr ? FIT_VARIANCE : FIT_UNIFORM;
    w->options.bootstrap = REPLICAS;
    w->space = space_of_options(&w->options);
    int stop = fit_run(data, &w->options, &result);
    stop = stop ? stop : set_compile(data, &w->options, &w->control, &w->set);
    if (stop)
        return stop;
    space_of_params(&result.params, w->best.x);
    polish(&w->set, &w->space, 100, &w->control, &w->best);
    return 0;
}

static int time_all(const char *name, const struct fit_data *data)
{
    struct work w = {.control = {.canceled = NULL}};
    double least[3] = {(double)INFINITY, (double)INFINITY, (double)INFINITY};
    char what[3][100];
    int stop = prepare(data, &w);
    if (stop) {
        fprintf(stderr, "%s: %s\n", name, fit_stop_text(stop));
        return 1;
    }
    for (int round = 0; round < ROUNDS; round++) {
        double ns[3] = {covariance_ns(&w), profiles_ns(&w), bootstrap_ns(&w)};
        for (int i = 0; i < 3; i++)
            least[i] = fmin(least[i], ns[i]);
    }
    const char *weights = data->u_per_sr ? "1/u^2" : "uniform";
    snprintf(what[0], sizeof what[0], "covariance, %s, %s weights", name, weights);
    snprintf(what[1], sizeof what[1], "five profiles, %s, %s weights", name, weights);
    snprintf(what[2], sizeof what[2], "%d bootstrap replicas, %s, %s weights", REPLICAS, name,
             weights);
    report_row("uncertainty", what[0], least[0] * 1e-3, "us", 0, NULL);
    report_row("uncertainty", what[1], least[1] * 1e-6, "ms", 0, NULL);
    report_row("uncertainty", what[2], least[2] * 1e-6, "ms", 0, NULL);
    set_free(&w.set);
    return 0;
}

int main(void)
{
    int failed = 0;
    for (size_t t = 0; t < sizeof truths / sizeof *truths; t++)
        for (int with_u = 0; with_u < 2; with_u++) {
            struct readings r;
            measure(&truths[t].p, &r);
            const struct fit_data data = {.count = READINGS,
                                          .theta_i_rad = r.theta_i,
                                          .theta_r_rad = r.theta_r,
                                          .dphi_rad = r.dphi,
                                          .f_per_sr = r.f,
                                          .u_per_sr = with_u ? r.u : NULL};
            failed += time_all(truths[t].name, &data);
        }
    return failed != 0;
}
