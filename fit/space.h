// SPDX-License-Identifier: MIT
// The coordinates of search and polish: x = (n, k^2, log sigma, ks, kd), indexed by enum fit_param.
// The Fresnel mean is even in k, so that k = 0 is stationary in k but not in k^2; sigma is a scale.
#pragma once
#include "fit/fit.h"

#include <math.h>

struct fit_space {
    double lower[FIT_PARAMS], upper[FIT_PARAMS]; // of x, inclusive
};

static inline void space_of_params(const struct brdf_params *p, double x[FIT_PARAMS])
{
    x[FIT_N] = p->n;
    x[FIT_K] = p->k * p->k;
    x[FIT_SIGMA] = log(p->sigma);
    x[FIT_KS] = p->ks;
    x[FIT_KD] = p->kd;
}

static inline struct brdf_params space_params(const double x[FIT_PARAMS])
{
    return (struct brdf_params){x[FIT_N], sqrt(x[FIT_K]), exp(x[FIT_SIGMA]), x[FIT_KS], x[FIT_KD]};
}

static inline struct fit_space space_of_options(const struct fit_options *o)
{
    struct fit_space s;
    space_of_params(&o->lower, s.lower);
    space_of_params(&o->upper, s.upper);
    return s;
}
