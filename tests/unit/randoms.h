// SPDX-License-Identifier: MIT
// Random geometries and parameters for the tests of model/: every fourth one extreme. SplitMix64
// (Steele, Lea and Flood, OOPSLA 2014); the seed is printed by the tests and taken from
// GONIO_TEST_SEED when that is set.
#pragma once
#include "model/brdf.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define RANDOM_PI 3.14159265358979323846

static inline uint64_t random_seed(void)
{
    const char *text = getenv("GONIO_TEST_SEED");
    const uint64_t seed = text ? strtoull(text, NULL, 10) : 20080228;
    printf("seed %llu\n", (unsigned long long)seed);
    return seed;
}

static inline uint64_t random_next(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline double random_between(uint64_t *state, double low, double high)
{
    return low + (high - low) * ((double)(random_next(state) >> 11) * 0x1p-53);
}

static inline double random_log(uint64_t *state, double low, double high)
{
    return exp(random_between(state, log(low), log(high)));
}

struct random_angles {
    double theta_i, theta_r, dphi; // rad
};

// Anywhere, or near one of: backscatter, specular, normal incidence, grazing.
static inline struct random_angles random_angles(uint64_t *state)
{
    struct random_angles a = {random_between(state, 0, RANDOM_PI / 2 - 1e-9),
                              random_between(state, 0, RANDOM_PI / 2 - 1e-9),
                              random_between(state, -RANDOM_PI, RANDOM_PI)};
    const double off = random_log(state, 1e-12, 0.1);
    switch (random_next(state) % 8) {
    case 0:
        a.theta_r = fmin(a.theta_i + off, RANDOM_PI / 2 - 1e-9);
        a.dphi = random_log(state, 1e-12, 0.1);
        break;
    case 1:
        a.theta_r = fmin(a.theta_i + off, RANDOM_PI / 2 - 1e-9);
        a.dphi = RANDOM_PI - random_log(state, 1e-12, 0.1);
        break;
    case 2: a.theta_i = off; break;
    case 3:
        a.theta_i = RANDOM_PI / 2 - fmax(off, 1e-9);
        a.theta_r = RANDOM_PI / 2 - random_log(state, 1e-9, 1);
        break;
    default: break;
    }
    return a;
}

// ks = 1, kd = 0. What a paint or a metal has, or up to 1e6 from it.
static inline struct brdf_params random_params(uint64_t *state)
{
    struct brdf_params p = {random_between(state, 0.2, 8), random_between(state, 0, 10),
                            random_log(state, 0.01, 0.6), 1, 0};
    switch (random_next(state) % 8) {
    case 0: p.k = 0; break;
    case 1:
        p.n = random_log(state, 1e-6, 1e6);
        p.k = random_log(state, 1e-6, 1e6);
        break;
    case 2: p.n = 1 + random_log(state, 1e-9, 0.1); break;
    case 3: p.sigma = random_log(state, 1e-3, 1e3); break;
    default: break;
    }
    return p;
}
