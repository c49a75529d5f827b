// SPDX-License-Identifier: MIT
#include "model/brdf.h"

#include <math.h>
#include <stdbool.h>

#define PI 3.14159265358979323846

static bool in_domain(const struct brdf_params *p)
{
    return p->sigma > 0 && isfinite(p->sigma) && p->ks >= 0 && isfinite(p->ks) && p->kd >= 0 &&
           isfinite(p->kd);
}

double brdf_f00(const struct brdf_params *p, enum brdf_diffuse diffuse,
                const struct brdf_geometry *g)
{
    if (!in_domain(p))
        return (double)NAN;
    double v = 1 / (2 * p->sigma * p->sigma);
    double fresnel = brdf_fresnel_mean(p->n, p->k, g->sin2_beta, g->cos2_beta);
    double specular = p->ks * v * g->spec_per_sr * exp(-v * g->tan2_theta) * fresnel;
    return specular + p->kd * (diffuse == BRDF_DIFFUSE_PAPER ? g->inv_cos_i : 1 / PI);
}
