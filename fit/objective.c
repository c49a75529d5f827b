// SPDX-License-Identifier: MIT
#include "fit/objective.h"

#include <math.h>

double objective_residual(const struct fit_set *set, const struct brdf_params *p, size_t i)
{
    double v = 1 / (2 * p->sigma * p->sigma);
    double fresnel = brdf_fresnel_mean(p->n, p->k, set->sin2_beta[i], set->cos2_beta[i]);
    double specular = v * set->spec[i] * exp(-v * set->tan2_theta[i]) * fresnel;
    return set->f[i] - p->ks * specular - p->kd * set->diffuse[i];
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
