// SPDX-License-Identifier: MIT
#include "bench/naive.h"

#include <complex.h>
#include <math.h>

#define PI 3.14159265358979323846

static double squared(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

double naive_f00(double theta_i_rad, double theta_r_rad, double dphi_rad,
                 const struct brdf_params *p)
{
    double ci = cos(theta_i_rad), si = sin(theta_i_rad);
    double cr = cos(theta_r_rad), sr = sin(theta_r_rad);

    // eqs. 2 to 4: the facet's local angle of incidence and its tilt
    double cos_2beta = ci * cr + si * sr * cos(dphi_rad);
    double cos_beta = sqrt((1 + cos_2beta) / 2), sin2_beta = (1 - cos_2beta) / 2;
    double cos_theta = (ci + cr) / (2 * cos_beta);
    double tan2_theta = 1 / (cos_theta * cos_theta) - 1;

    // eqs. 11 to 13
    double complex eps = (p->n + I * p->k) * (p->n + I * p->k);
    double complex q = csqrt(eps - sin2_beta);
    double complex rs = (cos_beta - q) / (cos_beta + q);
    double complex rp = (eps * cos_beta - q) / (eps * cos_beta + q);
    double m00 = (squared(rs) + squared(rp)) / 2;

    // eqs. 15 and 16
    double g = fmin(1, 2 * cos_theta * fmin(ci, cr) / cos_beta);
    double lobe = exp(-tan2_theta / (2 * p->sigma * p->sigma));
    double cos4_theta = cos_theta * cos_theta * cos_theta * cos_theta;
    return p->ks / (2 * PI) / (4 * p->sigma * p->sigma) * g / cos4_theta * lobe / (ci * cr) * m00 +
           p->kd / ci;
}
