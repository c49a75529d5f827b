// SPDX-License-Identifier: MIT
// Randomness of the simulated bench: a counter through a mixing function (SplitMix64: Steele, Lea
// and Flood, OOPSLA 2014), so that the same seed gives the same bench whatever else runs, and each
// source has its own stream. Not for secrets. Thread: one per struct.
#pragma once
#include <stdint.h>

struct noise {
    uint64_t key, count;
    double spare; // second value of the last pair
    int has_spare;
};

void noise_init(struct noise *n, uint64_t seed, uint64_t stream);
uint64_t noise_bits(struct noise *n);
double noise_uniform(struct noise *n); // in (0, 1)
double noise_normal(struct noise *n);  // mean 0, variance 1 (Box and Muller)

// A stationary, exponentially correlated process (Ornstein-Uhlenbeck), exact for any step.
struct noise_drift {
    double value, rms, tau_s;
    double dt_s, keep, add; // of the last step: steps are often alike
};

void noise_drift_step(struct noise_drift *d, struct noise *n, double dt_s);
