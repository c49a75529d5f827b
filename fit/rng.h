// SPDX-License-Identifier: MIT
// The seeded generator of every random choice in fit/: xoshiro256** (Blackman and Vigna 2018), its
// state filled by splitmix64. The same seed gives the same sequence on every machine. A struct rng
// belongs to one thread; not for secrets.
#pragma once
#include <stdint.h>

struct rng {
    uint64_t s[4];
};

void rng_seed(struct rng *r, uint64_t seed); // any seed, 0 too
uint64_t rng_next(struct rng *r);
double rng_uniform(struct rng *r);                      // [0, 1), 53 bits
uint64_t rng_below(struct rng *r, uint64_t bound); // [0, bound), bound > 0; bias below bound/2^64
double rng_normal(struct rng *r);                       // mean 0, standard deviation 1
