// SPDX-License-Identifier: MIT
// With D = n^2 - k^2 - sin^2, m = |q|^2 = |N^2 - sin^2|, Y = 2 cos Re q, X = m + cos^2 and
// Z = m cos^2 + sin^4 (all of beta),
//
//   rs = (1 - N^2)/(cos + q)^2                  |cos + q|^2 = X + Y
//   rp = rs (sin^2 - q cos)/(sin^2 + q cos)     |sin^2 + q cos|^2 = Z + Y sin^2
//
// and the mean of the two reflectances is (X - Y) Z / ((X + Y)(Z + Y sin^2)). X - Y vanishes as
// n -> 1; but X^2 - Y^2 = |N^2 - 1|^2 whatever beta, and that has no cancellation.
#include "model/fresnel.h"

#include <math.h>
#include <stdbool.h>

struct parts {
    double w;         // |N^2 - 1|^2
    double m;         // |q|^2
    double two_re_qc; // Y
    double two_im_qc; // 2 cos Im q
    double z, norm;   // norm = (X + Y)^2 (Z + Y sin^2)
};

static bool in_domain(double n, double k)
{
    return n > 0 && n <= BRDF_INDEX_MAX && k >= 0 && k <= BRDF_INDEX_MAX;
}

// 2 (Re q)^2 = m + D and 2 (Im q)^2 = m - D: the one that cancels comes from the other.
static struct parts parts_of(double n, double k, double sin2, double cos2)
{
    const double im = 2 * n * k; // of N^2
    const double above = (n - 1) * (n + 1) - k * k;
    const double d = cos2 < sin2 ? above + cos2 : (n - k) * (n + k) - sin2; // what rounds less
    const double m = sqrt(d * d + im * im);
    const double m_plus_d = d >= 0 ? m + d : im * im / (m - d); // total reflection inside, n < 1
    const double m_minus_d = d <= 0 ? m - d : im * im / (m + d);
    const double y = sqrt(2 * cos2 * m_plus_d);
    const double x_plus_y = m + cos2 + y, z = m * cos2 + sin2 * sin2;
    return (struct parts){.w = above * above + im * im,
                          .m = m,
                          .two_re_qc = y,
                          .two_im_qc = sqrt(2 * cos2 * m_minus_d),
                          .z = z,
                          .norm = x_plus_y * x_plus_y * (z + y * sin2)};
}

struct brdf_fresnel brdf_fresnel(double n, double k, double sin2_beta, double cos2_beta)
{
    if (!in_domain(n, k))
        return (struct brdf_fresnel){(double)NAN, (double)NAN, (double)NAN, (double)NAN};
    const double sin2 = sin2_beta, cos2 = cos2_beta;
    const struct parts p = parts_of(n, k, sin2, cos2);
    if (p.norm == 0) // N^2 = 0 in doubles, or grazing exactly on the critical angle: all reflected
        return (struct brdf_fresnel){1, 1, sin2 < cos2 ? -1 : 1, 0};
    const double unit = p.w / p.norm;                               // |rs|^2 / |sin^2 + q cos|^2
    const double re = sin2 - p.two_re_qc / 2, im = p.two_im_qc / 2; // of sin^2 - (q cos)*
    return (struct brdf_fresnel){.ss = unit * (p.z + p.two_re_qc * sin2),
                                 .pp = unit * (re * re + im * im),
                                 .re = unit * (sin2 * sin2 - p.m * cos2),
                                 .im = unit * sin2 * p.two_im_qc};
}

double brdf_fresnel_mean(double n, double k, double sin2_beta, double cos2_beta)
{
    if (!in_domain(n, k))
        return (double)NAN;
    const struct parts p = parts_of(n, k, sin2_beta, cos2_beta);
    return p.norm == 0 ? 1 : p.w * p.z / p.norm;
}
