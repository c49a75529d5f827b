// SPDX-License-Identifier: MIT
#include "fit/reading.h"

#include <math.h>

enum { N = FIT_PARAMS };
#define PI 3.14159265358979323846

static struct brdf_fresnel difference(struct brdf_fresnel a, struct brdf_fresnel b, double step)
{
    return (struct brdf_fresnel){(a.ss - b.ss) / step, (a.pp - b.pp) / step, (a.re - b.re) / step,
                                 (a.im - b.im) / step};
}

// Differences over a 1e-5 of n and k^2, forward where k^2 has no room below: good to 1e-5.
struct reading_direction reading_direction(const struct brdf_geometry *g, const double x[N])
{
    double n = x[FIT_N], kappa = x[FIT_K], v = 0.5 * exp(-2 * x[FIT_SIGMA]);
    double s2 = g->sin2_beta, c2 = g->cos2_beta, dn = 1e-5 * n, dk = 1e-5 * (n * n + kappa);
    double low = fmax(0, kappa - dk), high = kappa + dk;
    return (struct reading_direction){
        .height = v * g->spec_per_sr * exp(-v * g->tan2_theta),
        .slope = 2 * v * g->tan2_theta - 2,
        .inv_cos_i = g->inv_cos_i,
        .f = brdf_fresnel(n, sqrt(kappa), s2, c2),
        .by_n = difference(brdf_fresnel(n + dn, sqrt(kappa), s2, c2),
                           brdf_fresnel(n - dn, sqrt(kappa), s2, c2), 2 * dn),
        .by_kappa = difference(brdf_fresnel(n, sqrt(high), s2, c2),
                               brdf_fresnel(n, sqrt(low), s2, c2), high - low),
    };
}

static double mix(const struct brdf_channel *c, const struct brdf_fresnel *f)
{
    return c->w_ss * f->ss + c->w_pp * f->pp + c->w_re * f->re + c->w_im * f->im;
}

double reading_jacobian(const struct reading_direction *d, const struct brdf_channel *c,
                        const double x[N], enum brdf_diffuse diffuse, double j[N])
{
    double ks = x[FIT_KS], a = d->height * mix(c, &d->f);
    double b = c->w_kd * (diffuse == BRDF_DIFFUSE_PAPER ? d->inv_cos_i : 1 / PI);
    j[FIT_N] = ks * d->height * mix(c, &d->by_n);
    j[FIT_K] = ks * d->height * mix(c, &d->by_kappa);
    j[FIT_SIGMA] = ks * a * d->slope;
    j[FIT_KS] = a;
    j[FIT_KD] = b;
    return ks * a + x[FIT_KD] * b;
}
