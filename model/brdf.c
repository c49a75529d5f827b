// SPDX-License-Identifier: MIT
#include "model/brdf.h"

#include "model/channel.h"

#include <math.h>
#include <stdbool.h>

#define PI 3.14159265358979323846

static bool within(double x, double least, double most)
{
    return x >= least && x <= most; // NAN is not
}

// What multiplies the facet's Fresnel terms.
static double facets_per_sr(const struct brdf_params *p, const struct brdf_geometry *g)
{
    if (!within(p->sigma, BRDF_SIGMA_MIN, BRDF_SIGMA_MAX) || !within(p->ks, 0, BRDF_STRENGTH_MAX))
        return (double)NAN;
    const double v = 1 / (2 * p->sigma * p->sigma);
    return p->ks * v * g->spec_per_sr * exp(-v * g->tan2_theta);
}

static double diffuse_per_sr(const struct brdf_params *p, enum brdf_diffuse diffuse,
                             const struct brdf_geometry *g)
{
    if (!within(p->kd, 0, BRDF_STRENGTH_MAX))
        return (double)NAN;
    return p->kd * (diffuse == BRDF_DIFFUSE_PAPER ? g->inv_cos_i : 1 / PI);
}

double brdf_f00(const struct brdf_params *p, enum brdf_diffuse diffuse,
                const struct brdf_geometry *g)
{
    return facets_per_sr(p, g) * brdf_fresnel_mean(p->n, p->k, g->sin2_beta, g->cos2_beta) +
           diffuse_per_sr(p, diffuse, g);
}

struct brdf_mueller brdf_mueller(const struct brdf_params *p, enum brdf_diffuse diffuse,
                                 const struct brdf_geometry *g)
{
    const struct brdf_fresnel r = brdf_fresnel(p->n, p->k, g->sin2_beta, g->cos2_beta);
    struct brdf_mueller f = brdf_mueller_of_facet(&g->rotation, &r);
    const double factor = facets_per_sr(p, g), kd_per_sr = diffuse_per_sr(p, diffuse, g);
    const bool inside = !isnan(factor + r.ss + kd_per_sr);
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++)
            f.m[j][k] = inside ? f.m[j][k] * factor : (double)NAN;
    f.m[0][0] += kd_per_sr;
    return f;
}

double brdf_between(const struct brdf_params *p, enum brdf_diffuse diffuse,
                    const struct brdf_geometry *g, enum brdf_state in, enum brdf_state out)
{
    const struct brdf_channel w = brdf_channel(g, in, out);
    const struct brdf_fresnel r = brdf_fresnel(p->n, p->k, g->sin2_beta, g->cos2_beta);
    return facets_per_sr(p, g) * (w.w_ss * r.ss + w.w_pp * r.pp + w.w_re * r.re + w.w_im * r.im) +
           w.w_kd * diffuse_per_sr(p, diffuse, g);
}
