// SPDX-License-Identifier: MIT
// Samples to measure with the paper's plan: 850 readings, ten sweeps of 2.5 deg with 0.5 deg within
// 5 deg of specular. Truths cover the default bounds as far as surfaces go: dielectrics, metals,
// what is between, and what is hard for a search.
#pragma once
#include "tests/unit/readings.h"

static inline struct readings samples_plan(void)
{
    static const double sweep[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct readings r = readings_new(1000);
    for (int s = 0; s < 10; s++)
        for (int i = -170; i <= 170; i++) {
            double theta_r_deg = 0.5 * i;
            if (i % 5 == 0 || fabs(theta_r_deg - sweep[s]) <= 5)
                readings_add(&r, sweep[s], theta_r_deg, 0);
        }
    return r;
}

static inline double samples_log(struct rng *rng, double low, double high)
{
    return low * exp(rng_uniform(rng) * log(high / low));
}

static inline double samples_lin(struct rng *rng, double low, double high)
{
    return low + rng_uniform(rng) * (high - low);
}

enum { SAMPLES_KINDS = 8 };

static inline const char *samples_kind(int i)
{
    static const char *const kind[SAMPLES_KINDS] = {
        "dielectric",  "metal",      "between",     "anywhere",
        "no k at all", "n equals k", "n below one", "beyond the bounds",
    };
    return kind[i % SAMPLES_KINDS];
}

// Number i of a sequence; noise moves many an optimum to a bound of k, n or ks, and these are put
// there: ks of every seventh, kd = 0 of every fifth, the last kind's n and k.
static inline struct brdf_params samples_truth(struct rng *rng, int i)
{
    struct brdf_params p = {.sigma = samples_log(rng, 0.02, 0.5)};
    switch (i % SAMPLES_KINDS) {
    case 0: p.n = samples_lin(rng, 1.25, 2.5), p.k = samples_log(rng, 1e-4, 0.1); break;
    case 1: p.n = samples_log(rng, 0.2, 5), p.k = samples_lin(rng, 1.5, 9.5); break;
    case 2: p.n = samples_lin(rng, 1.1, 6), p.k = samples_log(rng, 0.05, 5); break;
    case 3: p.n = samples_lin(rng, 1.2, 7.5), p.k = samples_lin(rng, 0, 9.5); break;
    case 4: p.n = samples_lin(rng, 1.25, 4), p.k = 0; break;
    case 5: p.n = p.k = samples_lin(rng, 1, 7); break;
    case 6: p.n = samples_log(rng, 0.3, 1), p.k = samples_log(rng, 0.01, 3); break;
    case 7: p.n = samples_lin(rng, 7, 12), p.k = samples_lin(rng, 0, 14); break;
    }
    p.ks = i % 7 == 3 ? 1.5 : samples_lin(rng, 0.2, 1.4);
    p.kd = i % 5 == 2 ? 0 : samples_log(rng, 0.003, 0.4);
    return p;
}
