// SPDX-License-Identifier: MIT
#include "fit/kernel.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

// What of the parameters a reading needs.
struct point {
    double n, n2, v;
    double re, im2;   // of N^2: n^2 - k^2, and the square of 2 n k
    double w, wn, wk; // |N^2 - 1|^2 and its derivatives by n and kappa
};

static struct point point_at(const double x[FIT_PARAMS])
{
    double n = x[FIT_N], n2 = n * n, kappa = x[FIT_K];
    double above = (n - 1) * (n + 1) - kappa;
    return (struct point){
        .n = n,
        .n2 = n2,
        .v = 0.5 * exp(-2 * x[FIT_SIGMA]),
        .re = n2 - kappa,
        .im2 = 4 * n2 * kappa,
        .w = above * above + 4 * n2 * kappa,
        .wn = 4 * n * (n2 + kappa - 1),
        .wk = 2 * (n2 + kappa + 1),
    };
}

// exp for x <= 0. Adding 1.5 * 2^52 leaves the exponent in the low bits; |r| <= log(2)/2.
static inline double exp_negative(double x)
{
    x = x > -150 ? x : -150;
    double shifted = x * 1.4426950408889634 + 6755399441055744.0;
    double e = shifted - 6755399441055744.0;
    double r = (x - e * 0.693147180369123816490) - e * 1.90821492927058770002e-10;
    double p = 1.0 / 39916800;
    p = p * r + 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = p * r + 1;
    p = p * r + 1;
    uint64_t bits;
    double scale;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 1023) << 52;
    memcpy(&scale, &bits, sizeof scale);
    return p * scale;
}

// See brdf_fresnel_mean. 1e-300 keeps the one place of total reflection at grazing incidence
// finite.
static inline double fresnel(const struct point *p, double s2, double c2)
{
    double re = p->re - s2;
    double m = sqrt(re * re + p->im2);
    double y = sqrt(2 * c2 * (m + re));
    double x_plus_y = m + c2 + y;
    double z = m * c2 + s2 * s2;
    return p->w * z / (x_plus_y * x_plus_y * (z + y * s2) + 1e-300);
}

// Y vanishes at total reflection (n < sin beta, k = 0), where dF/dkappa is infinite, and m on the
// critical angle: floors keep the slope large and finite, which is what a step of the polish needs.
static inline void fresnel_slope(const struct point *p, double s2, double c2, double *f, double *fn,
                                 double *fk)
{
    double re = p->re - s2;
    double m = sqrt(re * re + p->im2);
    double y = sqrt(2 * c2 * (m + re));
    double sum = m + c2 + y, z = m * c2 + s2 * s2, tail = z + y * s2;
    double norm = 1 / (sum * sum * tail + 1e-300);
    double value = p->w * z * norm;
    double inv_m = 1 / (m > 1e-9 ? m : 1e-9), inv_y = c2 / (y > 1e-6 ? y : 1e-6);
    double mn = 2 * p->n * (re + 2 * (p->n2 - p->re)) * inv_m, mk = (2 * p->n2 - re) * inv_m;
    double yn = (mn + 2 * p->n) * inv_y, yk = (mk - 1) * inv_y;
    double zn = mn * c2, zk = mk * c2;
    double two = 2 * sum * tail, sum2 = sum * sum;
    *f = value;
    *fn = (p->wn * z + p->w * zn - value * (two * (mn + yn) + sum2 * (zn + yn * s2))) * norm;
    *fk = (p->wk * z + p->w * zk - value * (two * (mk + yk) + sum2 * (zk + yk * s2))) * norm;
}

static void specular(const struct fit_set *set, const struct point *p, size_t at, size_t count,
                     double *restrict a)
{
    const double *restrict t2 = set->tan2_theta + at, *restrict s2 = set->sin2_beta + at;
    const double *restrict c2 = set->cos2_beta + at, *restrict spec = set->spec + at;
    double v = p->v;
    struct point q = *p;
    for (size_t i = 0; i < count; i++)
        a[i] = spec[i] * v * exp_negative(-v * t2[i]) * fresnel(&q, s2[i], c2[i]);
}

static void specular_slope(const struct fit_set *set, const struct point *p, size_t at,
                           size_t count, double (*restrict c)[KERNEL_BLOCK])
{
    const double *restrict t2 = set->tan2_theta + at, *restrict s2 = set->sin2_beta + at;
    const double *restrict c2 = set->cos2_beta + at, *restrict spec = set->spec + at;
    double *restrict dn = c[KERNEL_DN], *restrict dk = c[KERNEL_DKAPPA];
    double *restrict ds = c[KERNEL_DSIGMA], *restrict a = c[KERNEL_A];
    double v = p->v;
    struct point q = *p;
    for (size_t i = 0; i < count; i++) {
        double f, fn, fk;
        double height = spec[i] * v * exp_negative(-v * t2[i]);
        fresnel_slope(&q, s2[i], c2[i], &f, &fn, &fk);
        a[i] = height * f;
        dn[i] = height * fn;
        dk[i] = height * fk;
        ds[i] = a[i] * (2 * v * t2[i] - 2);
    }
}

static void residual(const struct fit_set *set, const double x[FIT_PARAMS], size_t at, size_t count,
                     const double *restrict a, double *restrict r)
{
    const double *restrict f = set->f + at, *restrict b = set->diffuse + at;
    double ks = x[FIT_KS], kd = x[FIT_KD];
    for (size_t i = 0; i < count; i++)
        r[i] = f[i] - ks * a[i] - kd * b[i];
}

static double dot(const double *restrict x, const double *restrict y, size_t count)
{
    double lane[SET_LANES] = {0};
    for (size_t i = 0; i < count; i += SET_LANES)
        for (int j = 0; j < SET_LANES; j++)
            lane[j] += x[i + (size_t)j] * y[i + (size_t)j];
    return ((lane[0] + lane[4]) + (lane[1] + lane[5])) +
           ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

static size_t block_length(const struct fit_set *set, size_t at)
{
    return set->padded - at < KERNEL_BLOCK ? set->padded - at : KERNEL_BLOCK;
}

bool kernel_moments(const struct fit_set *set, const double x[FIT_PARAMS],
                    struct fit_control *control, struct kernel_gram *ret_gram)
{
    struct point p = point_at(x);
    double a[KERNEL_BLOCK], r[KERNEL_BLOCK];
    double aa = 0, ab = 0, ar = 0, br = 0, rr = 0;
    for (size_t at = 0; at < set->padded; at += KERNEL_BLOCK) {
        size_t count = block_length(set, at);
        if (control_spend(control, count))
            return false;
        specular(set, &p, at, count, a);
        residual(set, x, at, count, a, r);
        aa += dot(a, a, count);
        ab += dot(a, set->diffuse + at, count);
        ar += dot(a, r, count);
        br += dot(set->diffuse + at, r, count);
        rr += dot(r, r, count);
    }
    double (*m)[KERNEL_COLUMNS] = ret_gram->m;
    m[KERNEL_A][KERNEL_A] = aa;
    m[KERNEL_A][KERNEL_B] = m[KERNEL_B][KERNEL_A] = ab;
    m[KERNEL_A][KERNEL_R] = m[KERNEL_R][KERNEL_A] = ar;
    m[KERNEL_B][KERNEL_R] = m[KERNEL_R][KERNEL_B] = br;
    m[KERNEL_B][KERNEL_B] = set->bb;
    m[KERNEL_R][KERNEL_R] = rr;
    return true;
}

bool kernel_gram(const struct fit_set *set, const double x[FIT_PARAMS], struct fit_control *control,
                 struct kernel_gram *ret_gram)
{
    struct point p = point_at(x);
    struct kernel_gram g = {.m = {{0}}};
    double column[KERNEL_COLUMNS][KERNEL_BLOCK];
    for (size_t at = 0; at < set->padded; at += KERNEL_BLOCK) {
        size_t count = block_length(set, at);
        if (control_spend(control, count))
            return false;
        specular_slope(set, &p, at, count, column);
        residual(set, x, at, count, column[KERNEL_A], column[KERNEL_R]);
        memcpy(column[KERNEL_B], set->diffuse + at, count * sizeof(double));
        for (int i = 0; i < KERNEL_COLUMNS; i++)
            for (int j = i; j < KERNEL_COLUMNS; j++)
                g.m[i][j] += dot(column[i], column[j], count);
    }
    for (int i = 0; i < KERNEL_COLUMNS; i++)
        for (int j = 0; j < i; j++)
            g.m[i][j] = g.m[j][i];
    *ret_gram = g;
    return true;
}

size_t kernel_jacobian(const struct fit_set *set, const double x[FIT_PARAMS], size_t at,
                       struct kernel_block *ret_block)
{
    struct point p = point_at(x);
    size_t count = block_length(set, at);
    double column[KERNEL_COLUMNS][KERNEL_BLOCK];
    specular_slope(set, &p, at, count, column);
    residual(set, x, at, count, column[KERNEL_A], ret_block->r);
    for (size_t i = 0; i < count; i++) {
        ret_block->j[FIT_N][i] = x[FIT_KS] * column[KERNEL_DN][i];
        ret_block->j[FIT_K][i] = x[FIT_KS] * column[KERNEL_DKAPPA][i];
        ret_block->j[FIT_SIGMA][i] = x[FIT_KS] * column[KERNEL_DSIGMA][i];
    }
    memcpy(ret_block->j[FIT_KS], column[KERNEL_A], count * sizeof(double));
    memcpy(ret_block->j[FIT_KD], set->diffuse + at, count * sizeof(double));
    return count;
}

void kernel_fresnel(double n, double kappa, double sin2_beta, double cos2_beta, double ret_f[3])
{
    double x[FIT_PARAMS] = {[FIT_N] = n, [FIT_K] = kappa};
    struct point p = point_at(x);
    fresnel_slope(&p, sin2_beta, cos2_beta, &ret_f[0], &ret_f[1], &ret_f[2]);
}
