// SPDX-License-Identifier: MIT
#include "model/brdf.h"

#include <math.h>
#include <stdbool.h>

#define PI 3.14159265358979323846

static bool is_polar_angle(double theta_rad)
{
    return theta_rad >= 0 && theta_rad < PI / 2;
}

// Everything comes from h = wi + wr and wi - wr: no acos, no 1 - cos^2, which lose half the digits
// near specular and near backscatter.
struct brdf_geometry brdf_geometry(double theta_i_rad, double theta_r_rad, double dphi_rad)
{
    if (!is_polar_angle(theta_i_rad) || !is_polar_angle(theta_r_rad) || !isfinite(dphi_rad))
        return (struct brdf_geometry){(double)NAN, (double)NAN, (double)NAN, (double)NAN,
                                      (double)NAN};
    double si = sin(theta_i_rad), ci = cos(theta_i_rad);
    double sr = sin(theta_r_rad), cr = cos(theta_r_rad);
    double rx = sr * cos(dphi_rad), ry = sr * sin(dphi_rad);
    double hx = si + rx, hz = ci + cr;
    double h2 = hx * hx + ry * ry + hz * hz;
    double d2 = (si - rx) * (si - rx) + ry * ry + (ci - cr) * (ci - cr);
    double cos_b = sqrt(h2) / 2;
    double cos_t = hz / sqrt(h2);
    double g = fmin(1, 2 * cos_t * fmin(ci, cr) / cos_b); // Blinn's form of G, depends on dphi too
    double cos2_t = cos_t * cos_t;
    return (struct brdf_geometry){
        .tan2_theta = (hx * hx + ry * ry) / (hz * hz),
        .sin2_beta = d2 / 4,
        .cos2_beta = h2 / 4,
        .spec_per_sr = g / (4 * PI * cos2_t * cos2_t * ci * cr),
        .inv_cos_i = 1 / ci,
    };
}

// With D = n^2 - k^2 - sin^2, m = |N^2 - sin^2|, Y = 2 cos Re q, X = m + cos^2, Z = m cos^2 + sin^4
// the mean of the two reflectances is (X - Y) Z / ((X + Y)(Z + Y sin^2)). X - Y vanishes as n -> 1;
// but X^2 - Y^2 = (n^2 - k^2 - 1)^2 + 4 n^2 k^2 whatever beta, and that has no cancellation.
double brdf_fresnel_mean(double n, double k, double sin2_beta, double cos2_beta)
{
    if (!(n > 0 && n <= BRDF_INDEX_MAX && k >= 0 && k <= BRDF_INDEX_MAX))
        return (double)NAN;
    double im = 2 * n * k; // of N^2
    double re = (n - k) * (n + k) - sin2_beta;
    double m = sqrt(re * re + im * im);
    double m_plus_re = re >= 0 ? m + re : im * im / (m - re); // total reflection inside, n < 1
    double y = sqrt(2 * cos2_beta * m_plus_re);
    double x_plus_y = m + cos2_beta + y;
    double w = (n - 1) * (n + 1) - k * k;
    double z = m * cos2_beta + sin2_beta * sin2_beta;
    double norm = x_plus_y * x_plus_y * (z + y * sin2_beta);
    // Zero only at grazing incidence exactly on the critical angle, where all is reflected.
    return norm == 0 ? 1 : (w * w + im * im) * z / norm;
}

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
