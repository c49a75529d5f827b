// SPDX-License-Identifier: MIT
#include "bench/naive.h"

#include <complex.h>
#include <math.h>

#define PI 3.14159265358979323846

double naive_f00(double theta_i_rad, double theta_r_rad, double dphi_rad,
                 const struct brdf_params *p)
{
    double ci = cos(theta_i_rad), si = sin(theta_i_rad);
    double cr = cos(theta_r_rad), sr = sin(theta_r_rad);
    double beta = acos(ci * cr + si * sr * cos(dphi_rad)) / 2;
    double theta = acos((ci + cr) / (2 * cos(beta)));

    double complex index = p->n + (double complex)I * p->k, eps = index * index;
    double complex q = csqrt(eps - sin(beta) * sin(beta));
    double complex rs = (cos(beta) - q) / (cos(beta) + q);
    double complex rp = (eps * cos(beta) - q) / (eps * cos(beta) + q);
    double m00 = (pow(cabs(rs), 2) + pow(cabs(rp), 2)) / 2;

    double g = fmin(1, fmin(2 * cos(theta) * cr / cos(beta), 2 * cos(theta) * ci / cos(beta)));
    double lobe = exp(-pow(tan(theta), 2) / (2 * p->sigma * p->sigma));
    return p->ks / (2 * PI) / (4 * p->sigma * p->sigma) * g / pow(cos(theta), 4) * lobe /
               (ci * cr) * m00 +
           p->kd / ci;
}

static double squared(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

double naive_f00_trimmed(double theta_i_rad, double theta_r_rad, double dphi_rad,
                         const struct brdf_params *p)
{
    double ci = cos(theta_i_rad), si = sin(theta_i_rad);
    double cr = cos(theta_r_rad), sr = sin(theta_r_rad);
    double cos_2beta = ci * cr + si * sr * cos(dphi_rad);
    double cos_beta = sqrt((1 + cos_2beta) / 2), sin2_beta = (1 - cos_2beta) / 2;
    double cos_theta = (ci + cr) / (2 * cos_beta), cos2_theta = cos_theta * cos_theta;

    double complex index = p->n + (double complex)I * p->k, eps = index * index;
    double complex q = csqrt(eps - sin2_beta);
    double complex rs = (cos_beta - q) / (cos_beta + q);
    double complex rp = (eps * cos_beta - q) / (eps * cos_beta + q);
    double m00 = (squared(rs) + squared(rp)) / 2;

    double g = fmin(1, 2 * cos_theta * fmin(ci, cr) / cos_beta);
    double lobe = exp(-(1 / cos2_theta - 1) / (2 * p->sigma * p->sigma));
    return p->ks / (2 * PI) / (4 * p->sigma * p->sigma) * g / (cos2_theta * cos2_theta) * lobe /
               (ci * cr) * m00 +
           p->kd / ci;
}
