// SPDX-License-Identifier: MIT
// The directions and the normal z are a spherical triangle: sides theta_r, theta_i and 2 beta,
// angle dphi between the first two, alpha_i and alpha_r the others. Delambre's formulas give their
// half sums from four products,
//
//   cos beta cos((alpha_i + alpha_r)/2) = cos((theta_i + theta_r)/2) sin(dphi/2)
//   cos beta sin((alpha_i + alpha_r)/2) = cos((theta_r - theta_i)/2) cos(dphi/2)
//   sin beta cos((alpha_i - alpha_r)/2) = sin((theta_i + theta_r)/2) sin(dphi/2)
//   sin beta sin((alpha_i - alpha_r)/2) = sin((theta_r - theta_i)/2) cos(dphi/2),
//
// and beta from the sums of their squares. Nothing is subtracted but the two angles, so that there
// is no place where digits are lost: eq. 10 loses them as 1/beta^2 near backscatter.
#include "model/geometry.h"

#include "model/shadowing.h"

#include <math.h>
#include <stdbool.h>

#define PI 3.14159265358979323846
#define IN_PLANE 1e-15

static bool is_polar_angle(double theta_rad)
{
    return theta_rad >= 0 && theta_rad < PI / 2;
}

static double snapped(double x)
{
    return fabs(x) < IN_PLANE ? 0 : x;
}

// sum and difference are (cos, sin) of half the sum and half the difference, times cos beta and
// sin beta. Without a difference (backscatter) the plane of incidence is free: alpha_i = alpha_r.
static struct brdf_rotation rotation(const double sum[2], const double difference[2],
                                     double cos_beta, double sin_beta)
{
    const double a = sum[0] / cos_beta, b = sum[1] / cos_beta;
    const double c = sin_beta > 0 ? difference[0] / sin_beta : 1;
    const double d = sin_beta > 0 ? difference[1] / sin_beta : 0;
    return (struct brdf_rotation){.cos_i = a * c - b * d,
                                  .sin_i = b * c + a * d,
                                  .cos_r = a * c + b * d,
                                  .sin_r = b * c - a * d};
}

static struct brdf_geometry nowhere(void)
{
    const double nan = (double)NAN;
    return (struct brdf_geometry){nan, nan, nan, nan, nan, {nan, nan, nan, nan}};
}

struct brdf_geometry brdf_geometry(double theta_i_rad, double theta_r_rad, double dphi_rad)
{
    if (!is_polar_angle(theta_i_rad) || !is_polar_angle(theta_r_rad) || !isfinite(dphi_rad))
        return nowhere();
    const double sin_i = sin(theta_i_rad), cos_i = cos(theta_i_rad);
    const double sin_r = sin(theta_r_rad), cos_r = cos(theta_r_rad);
    const double half_rad = (theta_r_rad - theta_i_rad) / 2;
    const double sin_half = sin(half_rad), cos_half = cos(half_rad);
    const double sin_phi = snapped(sin(dphi_rad / 2)), cos_phi = snapped(cos(dphi_rad / 2));
    // Half the sum of theta would be rounded at grazing, where its cosine is small.
    const double mean_z = (cos_i + cos_r) / 2; // cos theta cos beta
    const double cos_mean = mean_z / cos_half, sin_mean = (sin_i + sin_r) / 2 / cos_half;

    const double sum[2] = {cos_mean * sin_phi, cos_half * cos_phi};
    const double difference[2] = {sin_mean * sin_phi, sin_half * cos_phi};
    const double cos2_b = sum[0] * sum[0] + sum[1] * sum[1];
    const double sin2_b = difference[0] * difference[0] + difference[1] * difference[1];
    const double sec2_t = cos2_b / (mean_z * mean_z), tan_half = sin_half / cos_half;
    const double bend = cos_phi / mean_z;
    return (struct brdf_geometry){
        .tan2_theta = tan_half * tan_half + sin_i * sin_r * bend * bend,
        .sin2_beta = sin2_b,
        .cos2_beta = cos2_b,
        .spec_per_sr =
            shadowing(cos_i, cos_r, mean_z / cos2_b) * sec2_t * sec2_t / (4 * PI * (cos_i * cos_r)),
        .inv_cos_i = 1 / cos_i,
        .rotation = rotation(sum, difference, sqrt(cos2_b), sqrt(sin2_b)),
    };
}
