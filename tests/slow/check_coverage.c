// SPDX-License-Identifier: MIT
// uses: fit model
// Do 95 % intervals hold the truth 95 times in a hundred? Five truths, many noise seeds, 2 % noise
// with a floor of 1e-5 sr^-1, the paper's ten sweeps; weights 1/u^2, uniform without u and uniform
// with u.
//
//   check_coverage [-s SEED] [-n SEEDS]
//
// Promised are sigma, kd, ks R(0) and ks R(45) by value +- 1.96 u: 90..99 % for each truth, 92..98
// % over all five. Profile intervals, and uniform weights with u: 89..99.4 % and 92..98 %.
// Bootstrap percentiles promise less and are guarded only against breaking, 86..99.4 % and 90..98
// %: where k or n sits on its bound, half of the replicas do so too, and the replicas of what
// correlates with it spread 10 % less than estimates do (Andrews 2000: no bootstrap is right on a
// bound). More steps a replica change nothing.
#include "fit/fit.h"
#include "tests/unit/readings.h"

#include <getopt.h>
#include <stdio.h>

enum { TRUTHS = 5, MODES = 3, REPLICAS = 400 };
enum { SIGMA, KD, R0, R45, QUANTITIES };
enum { BY_U, BY_PROFILE, BY_BOOTSTRAP, KINDS };

static const struct {
    const char *name;
    struct brdf_params p;
} truths[TRUTHS] = {{"dielectric", {1.5, 0.02, 0.15, 0.9, 0.05}},
                    {"metal", {1.3, 7.5, 0.12, 1, 0.01}},
                    {"paper", {5.345064, 5.345064, 0.123451, 0.95, 0.092414}},
                    {"absorbing", {2.5, 1, 0.08, 0.5, 0.02}},
                    {"matt", {1.6, 0.3, 0.3, 0.6, 0.15}}};
static const char *const mode_name[MODES] = {"variance", "uniform", "uniform with u"};
static const char *const kind_name[KINDS] = {"1.96 u", "profile", "bootstrap"};
static const char *const quantity_name[QUANTITIES] = {"sigma", "kd", "ks R(0)", "ks R(45)"};

static int covered[MODES][KINDS][QUANTITIES][TRUTHS];

static bool holds(double low, double high, double truth)
{
    return low <= truth && truth <= high;
}

static void count(const struct fit_result *f, const struct brdf_params *p, int mode, int truth)
{
    const double want[QUANTITIES] = {p->sigma, p->kd, p->ks * brdf_fresnel_mean(p->n, p->k, 0, 1),
                                     p->ks * brdf_fresnel_mean(p->n, p->k, 0.5, 0.5)};
    const struct fit_estimate *e[2] = {&f->estimate[FIT_SIGMA], &f->estimate[FIT_KD]};
    const struct fit_derived d[QUANTITIES] = {
        {e[0]->value, e[0]->u}, {e[1]->value, e[1]->u}, f->ks_r0, f->ks_r45};
    const struct fit_spread *b[QUANTITIES] = {&f->bootstrap.param[FIT_SIGMA],
                                              &f->bootstrap.param[FIT_KD], &f->bootstrap.ks_r0,
                                              &f->bootstrap.ks_r45};
    for (int q = 0; q < QUANTITIES; q++) {
        double half = 1.959963984540054 * d[q].u;
        covered[mode][BY_U][q][truth] += holds(d[q].value - half, d[q].value + half, want[q]);
        covered[mode][BY_BOOTSTRAP][q][truth] += holds(b[q]->lo95, b[q]->hi95, want[q]);
        if (q <= KD)
            covered[mode][BY_PROFILE][q][truth] += holds(e[q]->lo95, e[q]->hi95, want[q]);
    }
}

static int measure(int mode, int truth, uint64_t seed)
{
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    struct fit_result f;
    o.weighting = mode == 0 ? FIT_VARIANCE : FIT_UNIFORM;
    o.bootstrap = REPLICAS;
    readings_measure(&r, &truths[truth].p, 0.02, 1e-5, seed);
    struct fit_data d = readings_data(&r, mode != 1);
    int stop = fit_run(&d, &o, &f);
    if (stop)
        printf("seed %llu: %s\n", (unsigned long long)seed, fit_stop_text(stop));
    else
        count(&f, &truths[truth].p, mode, truth);
    readings_free(&r);
    return stop;
}

// --- what chance does ----------------------------------------------------------------------------

// That fewer than low or more than high of n intervals hold a truth that each holds with 95 %.
static double outside(int n, int low, int high)
{
    double p = 0;
    for (int k = 0; k <= n; k++)
        if (k < low || k > high)
            p += exp(lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) + k * log(0.95) +
                     (n - k) * log(0.05));
    return p;
}

struct verdict {
    int failures;
    double false_alarm; // an upper bound: the sum over all judgements
};

static void judge(int count, int n, double low_percent, double high_percent, struct verdict *v)
{
    int low = (int)ceil(n * low_percent / 100 - 1e-9);
    int high = (int)floor(n * high_percent / 100 + 1e-9);
    bool bad = count < low || count > high;
    printf("  %5.1f%s", 100.0 * count / n, bad ? "!" : " ");
    v->failures += bad;
    v->false_alarm += outside(n, low, high);
}

static void row(int mode, int kind, int q, int seeds, struct verdict *v)
{
    const int *of = covered[mode][kind][q];
    bool promised = kind == BY_U && mode < 2, guarded = kind == BY_BOOTSTRAP;
    int sum = 0;
    printf("%-15s %-10s %-9s", mode_name[mode], kind_name[kind], quantity_name[q]);
    for (int t = 0; t < TRUTHS; t++) {
        judge(of[t], seeds, promised ? 90 : guarded ? 86 : 89, promised ? 99 : 99.4, v);
        sum += of[t];
    }
    printf("   |");
    judge(sum, TRUTHS * seeds, guarded ? 90 : 92, 98, v);
    printf("\n");
}

int main(int argc, char **argv)
{
    unsigned long long first = 70000;
    int seeds = 300, stop = 0;
    for (int c; (c = getopt(argc, argv, "s:n:")) != -1;) {
        if (c == 's')
            first = strtoull(optarg, NULL, 10);
        else if (c == 'n')
            seeds = atoi(optarg);
        else
            return 2;
    }
    if (seeds < 1)
        return 2;
    printf("seeds %llu..%llu for each truth and weighting, %d replicas\n", first,
           first + (unsigned long long)(TRUTHS * seeds) - 1, REPLICAS);
    for (int t = 0; t < TRUTHS && !stop; t++)
        for (int i = 0; i < seeds && !stop; i++)
            for (int mode = 0; mode < MODES && !stop; mode++)
                stop = measure(mode, t, first + (uint64_t)(t * seeds + i));
    printf("held by %% of the intervals%14s", "");
    for (int t = 0; t < TRUTHS; t++)
        printf(" %.7s", truths[t].name);
    printf("    |  all\n");
    struct verdict v = {stop != 0, 0};
    for (int mode = 0; mode < MODES; mode++)
        for (int kind = 0; kind < KINDS; kind++)
            for (int q = 0; q < (kind == BY_PROFILE ? R0 : QUANTITIES); q++)
                row(mode, kind, q, seeds, &v);
    printf("false alarms with intervals of exactly 95 %%: in at most %.2g %% of other seeds\n",
           100 * v.false_alarm);
    printf("coverage: %s, %d outside\n", v.failures ? "FAILED" : "ok", v.failures);
    return v.failures != 0;
}
