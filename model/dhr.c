// SPDX-License-Identifier: MIT
// Directional-hemispherical reflectance by quadrature over the slopes (x, y) of the facets, where
// the Gaussian is round and narrow whatever theta_i. With rho^2 = x^2 + y^2, q = 1 + x tan theta_i,
//
//   DHR = ks integral (v/pi) exp(-v rho^2) F(beta) min(q, 4 q/(1 + rho^2) - 2, 2) dx dy + diffuse,
//
// because cos beta = q cos theta_i cos theta, d omega_r = 4 cos beta d omega_h = 4 cos beta cos^3
// theta dx dy, and cos theta_r = 2 cos beta cos theta - cos theta_i. The three terms of the minimum
// are G = 1, G limited by theta_r, and G limited by theta_i. The minimum has kinks, whose places in
// y are known for each x: the inner integral is split there, and the outer one where a kink enters
// or leaves. So is F at total reflection (n < 1), which k rounds off over 2 n k in sin^2 beta.
#include "model/brdf.h"

#include <math.h>

#define PI 3.14159265358979323846
#define REACH 7.0 // in sigma: the Gaussian beyond weighs 1e-11
#define NODES 12
#define DEPTH 12   // of the outer bisection
#define CRITICAL 3 // places of total reflection: find_critical
#define WIDTH 6.0
#define MOST_CUTS 20

struct dhr {
    double n, k, v;
    double cos_i, tan_i;
    double reach;              // of the Gaussian that matters, in slope
    double critical[CRITICAL]; // sin^2 beta where total reflection begins; NAN: nowhere
};

// Gauss-Legendre on [0, 1], 12 nodes, the lower half (Abramowitz and Stegun table 25.4, mapped).
static const double node[NODES / 2] = {
    0.009219682876640375, 0.04794137181476257, 0.11504866290284766,
    0.20634102285669127,  0.31608425050090994, 0.43738329574426554,
};
static const double weight[NODES / 2] = {
    0.02358766819325591, 0.05346966299765922, 0.08003916427167311,
    0.10158371336153296, 0.11674626826917740, 0.12457352290670139,
};

// Substitutes u = s^2 (3 - 2 s), which flattens square-root ends (total reflection, kinks that
// leave).
static double smooth_node(int i, double *ret_weight)
{
    double s = i < NODES / 2 ? node[i] : 1 - node[NODES - 1 - i];
    *ret_weight = weight[i < NODES / 2 ? i : NODES - 1 - i] * 6 * s * (1 - s);
    return s * s * (3 - 2 * s);
}

static double integrand(const struct dhr *d, double x, double q, double y)
{
    double sec2 = 1 + x * x + y * y;
    double shadowed = fmin(fmin(q, 4 * q / sec2 - 2), 2);
    if (!(shadowed > 0))
        return 0;
    double cos_b = q * d->cos_i;
    double cos2_b = fmin(1, cos_b * cos_b / sec2);
    double f = brdf_fresnel_mean(d->n, d->k, 1 - cos2_b, cos2_b);
    return f * shadowed * exp(-d->v * y * y);
}

static double inner_piece(const struct dhr *d, double x, double q, double from, double to)
{
    double sum = 0;
    for (int i = 0; i < NODES; i++) {
        double w, u = smooth_node(i, &w);
        sum += w * integrand(d, x, q, from + (to - from) * u);
    }
    return sum * (to - from);
}

static void sort(double *x, int count)
{
    for (int i = 1; i < count; i++)
        for (int j = i; j > 0 && x[j] < x[j - 1]; j--) {
            double swap = x[j];
            x[j] = x[j - 1];
            x[j - 1] = swap;
        }
}

// Over y in [0, ymax], split at the kink of G and at the critical angle, and into halves when it is
// long.
static double inner(const struct dhr *d, double x)
{
    double q = 1 + x * d->tan_i;
    double end2 = 2 * q - 1 - x * x; // cos theta_r = 0
    if (!(q > 0 && end2 > 0))
        return 0;
    double end = fmin(sqrt(end2), d->reach), cut[3 + CRITICAL];
    double kink2 = (q < 2 ? 4 * q / (q + 2) : q) - 1 - x * x;
    int count = 0;
    cut[count++] = 0;
    cut[count++] = sqrt(fmax(kink2, 0));
    for (int i = 0; i < CRITICAL; i++) {
        double cos_b = q * d->cos_i, y2 = cos_b * cos_b / (1 - d->critical[i]) - 1 - x * x;
        cut[count++] = sqrt(fmax(y2, 0)); // 0 of NAN
    }
    cut[count++] = end;
    sort(cut, count);
    double sum = 0, longest = d->reach / 2;
    for (int i = 0; i + 1 < count && cut[i] < end; i++) {
        double from = cut[i], to = cut[i + 1];
        if (!(to > from))
            continue;
        int pieces = to - from > longest ? 2 : 1;
        for (int j = 0; j < pieces; j++)
            sum += inner_piece(d, x, q, from + (to - from) * j / pieces,
                               from + (to - from) * (j + 1) / pieces);
    }
    return exp(-d->v * x * x) * sum * 2 * d->v / PI;
}

static double outer_rule(const struct dhr *d, double from, double to)
{
    double sum = 0;
    for (int i = 0; i < NODES; i++) {
        double w, u = smooth_node(i, &w);
        sum += w * inner(d, from + (to - from) * u);
    }
    return sum * (to - from);
}

static double outer(const struct dhr *d, double from, double to, double whole, int depth)
{
    double mid = (from + to) / 2;
    double left = outer_rule(d, from, mid), right = outer_rule(d, mid, to);
    // Halving gains at least a factor of 2^3 even at a kink that was missed: the error left is far
    // less.
    if (depth <= 0 || fabs(left + right - whole) < 1e-7)
        return left + right;
    return outer(d, from, mid, left, depth - 1) + outer(d, mid, to, right, depth - 1);
}

// The places in x where a kink or the edge of the hemisphere crosses y = 0, in rising order within
// +-reach.
static int outer_cuts(const struct dhr *d, double theta_i_rad, double ret_cut[MOST_CUTS])
{
    double t = theta_i_rad;
    double special[8 + 2 * CRITICAL] = {
        0, // also G = 1 meets G limited by theta_i
        tan(t),
        tan((t - PI / 2) / 2),
        tan((t + PI / 2) / 2), // cos theta_r = 0: facets that mirror to 90 deg
        1 / d->tan_i,
        tan((t - PI / 2) / 3),
        tan((t + PI / 2) / 3),
        -1 / d->tan_i, // G limited by theta_r begins
    };
    int specials = 8, count = 0;
    for (int i = 0; i < CRITICAL; i++) {
        double critical_rad = asin(sqrt(d->critical[i]));
        special[specials++] = tan(t - critical_rad);
        special[specials++] = tan(t + critical_rad);
    }
    ret_cut[count++] = -d->reach;
    for (int i = 0; i < specials; i++)
        if (special[i] > -d->reach && special[i] < d->reach)
            ret_cut[count++] = special[i];
    ret_cut[count++] = d->reach;
    sort(ret_cut, count);
    return count;
}

// Where total reflection sets in, and WIDTH times the width of its rounding to both sides.
static void find_critical(struct dhr *d)
{
    for (int i = 0; i < CRITICAL; i++) {
        double sin2 = d->n * d->n - d->k * d->k + (i - 1) * WIDTH * 2 * d->n * d->k;
        d->critical[i] = d->n < 1 && sin2 > 0 && sin2 < 1 ? sin2 : (double)NAN;
    }
}

double brdf_dhr(const struct brdf_params *p, enum brdf_diffuse diffuse, double theta_i_rad)
{
    struct brdf_geometry normal = brdf_geometry(theta_i_rad, 0, PI);
    if (isnan(brdf_f00(p, diffuse, &normal)))
        return (double)NAN;
    struct dhr d = {.n = p->n,
                    .k = p->k,
                    .v = 1 / (2 * p->sigma * p->sigma),
                    .cos_i = cos(theta_i_rad),
                    .tan_i = tan(theta_i_rad),
                    .reach = REACH * p->sigma};
    double cut[MOST_CUTS];
    find_critical(&d);
    int count = outer_cuts(&d, theta_i_rad, cut);
    double specular = 0;
    for (int i = 0; i + 1 < count; i++)
        if (cut[i + 1] > cut[i])
            specular += outer(&d, cut[i], cut[i + 1], outer_rule(&d, cut[i], cut[i + 1]), DEPTH);
    double lambert = diffuse == BRDF_DIFFUSE_PAPER ? PI * normal.inv_cos_i : 1;
    return p->ks * specular + p->kd * lambert;
}
