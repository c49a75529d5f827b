// SPDX-License-Identifier: MIT
#include "sim/noise.h"

#include <math.h>

static uint64_t mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

void noise_init(struct noise *n, uint64_t seed, uint64_t stream)
{
    *n = (struct noise){.key = mix(mix(seed + 0x9e3779b97f4a7c15u) + stream)};
}

uint64_t noise_bits(struct noise *n)
{
    return mix(n->key + 0x9e3779b97f4a7c15u * ++n->count);
}

double noise_uniform(struct noise *n)
{
    return ((double)(noise_bits(n) >> 12) + 0.5) * 0x1p-52;
}

double noise_normal(struct noise *n)
{
    if (n->has_spare) {
        n->has_spare = 0;
        return n->spare;
    }
    double r = sqrt(-2 * log(noise_uniform(n)));
    double phase = 2 * 3.14159265358979323846 * noise_uniform(n);
    n->spare = r * sin(phase);
    n->has_spare = 1;
    return r * cos(phase);
}

void noise_drift_step(struct noise_drift *d, struct noise *n, double dt_s)
{
    if (d->rms <= 0 || d->tau_s <= 0 || dt_s <= 0)
        return;
    if (dt_s != d->dt_s) {
        d->dt_s = dt_s;
        d->keep = exp(-dt_s / d->tau_s);
        d->add = sqrt(-expm1(-2 * dt_s / d->tau_s));
    }
    d->value = d->value * d->keep + d->rms * d->add * noise_normal(n);
}
