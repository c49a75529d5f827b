// SPDX-License-Identifier: MIT
#include "fit/objective.h"

#include <math.h>

// The specular factor without ks v exp(-v tan^2 theta).
static double reflectance(const struct set_rows *r, const struct brdf_params *p, size_t i)
{
    double cos2 = r->cos_beta[i] * r->cos_beta[i], sin2 = 1 - cos2;
    if (!r->channel[0])
        return r->spec[i] * brdf_fresnel_mean(p->n, p->k, sin2, cos2);
    struct brdf_fresnel f = brdf_fresnel(p->n, p->k, sin2, cos2);
    return r->channel[SET_SS][i] * f.ss + r->channel[SET_PP][i] * f.pp +
           r->channel[SET_RE][i] * f.re + r->channel[SET_IM][i] * f.im;
}

double objective_residual(const struct fit_set *set, const struct brdf_params *p, size_t i)
{
    const struct set_rows *r = &set->all;
    double v = 1 / (2 * p->sigma * p->sigma);
    double specular = v * exp(-v * r->tan2_theta[i]) * reflectance(r, p, i);
    return r->f[i] - p->ks * specular - p->kd * r->diffuse[i];
}

int objective_delta(const struct fit_set *set, const struct brdf_params *p,
                    struct fit_control *control, double *ret_delta)
{
    double sum = 0;
    for (size_t i = 0; i < set->count; i++) {
        if (i % (CONTROL_SLICE / 4) == 0 && control_ask(control))
            return FIT_E_CANCELED;
        double r = objective_residual(set, p, i);
        sum += r * r;
    }
    *ret_delta = sum / set->ff;
    return 0;
}
