// SPDX-License-Identifier: MIT
#include "fit/covariance.h"

#include "fit/eigen.h"
#include "fit/kernel.h"

#include <math.h>
#include <string.h>

enum { N = FIT_PARAMS };
#define LEVERAGE_MAX 0.99 // a reading that alone determines a parameter says nothing of its noise
#define FLOOR 1e-14       // of the largest eigenvalue
#define ROUNDING 2.2e-16  // a reading's, beside the others: there is no less noise than this

static double dot(const double *restrict x, const double *restrict y, size_t count)
{
    double lane[SET_LANES] = {0};
    for (size_t i = 0; i < count; i += SET_LANES)
        for (int j = 0; j < SET_LANES; j++)
            lane[j] += x[i + (size_t)j] * y[i + (size_t)j];
    return ((lane[0] + lane[4]) + (lane[1] + lane[5])) +
           ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

void covariance_noise(const struct fit_set *set, const struct covariance *cov,
                      const struct kernel_block *b, size_t at, size_t count, double *restrict s)
{
    if (set->u) {
        memcpy(s, set->u + at, count * sizeof *s);
        return;
    }
    for (size_t i = 0; i < count; i++)
        s[i] = 1;
    for (int p = 0; p < N; p++)
        for (int q = 0; q <= p; q++) {
            const double *restrict jp = b->j[p], *restrict jq = b->j[q];
            const double weight = cov->inverse[p][q] * (p == q ? 1 : 2);
            for (size_t i = 0; i < count; i++)
                s[i] -= weight * jp[i] * jq[i];
        }
    for (size_t i = 0; i < count; i++)
        s[i] = b->r[i] / (s[i] > 1 - LEVERAGE_MAX ? s[i] : 1 - LEVERAGE_MAX);
}

static void mirror(double m[N][N])
{
    for (int p = 0; p < N; p++)
        for (int q = 0; q < p; q++)
            m[p][q] = m[q][p];
}

static bool accumulate_h(const struct fit_set *set, const double x[N], struct fit_control *control,
                         double h[N][N])
{
    struct kernel_block b;
    memset(h, 0, N * sizeof *h);
    for (size_t at = 0; at < set->padded; at += KERNEL_BLOCK) {
        if (control_spend(control, 2 * KERNEL_BLOCK))
            return false;
        size_t count = kernel_jacobian(set, x, at, &b);
        for (int p = 0; p < N; p++)
            for (int q = p; q < N; q++)
                h[p][q] += dot(b.j[p], b.j[q], count);
    }
    mirror(h);
    return true;
}

static bool accumulate_m(const struct fit_set *set, const double x[N], const struct covariance *cov,
                         struct fit_control *control, double m[N][N])
{
    struct kernel_block b;
    double s[KERNEL_BLOCK];
    memset(m, 0, N * sizeof *m);
    for (size_t at = 0; at < set->padded; at += KERNEL_BLOCK) {
        if (control_spend(control, 2 * KERNEL_BLOCK))
            return false;
        size_t count = kernel_jacobian(set, x, at, &b);
        covariance_noise(set, cov, &b, at, count, s);
        for (int p = 0; p < N; p++)
            for (size_t i = 0; i < count; i++)
                b.j[p][i] *= s[i];
        for (int p = 0; p < N; p++)
            for (int q = p; q < N; q++)
                m[p][q] += dot(b.j[p], b.j[q], count);
    }
    mirror(m);
    return true;
}

// Inverse of h over the parameters in use, through the eigenvalues of h scaled to a unit diagonal.
static void invert(const double h[N][N], const bool known[N], double ret[N][N])
{
    double s[N][N], scale[N], value[N], vector[N][N], largest = 0;
    for (int i = 0; i < N; i++)
        scale[i] = known[i] || !(h[i][i] > 0) ? 0 : 1 / sqrt(h[i][i]);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            s[i][j] = h[i][j] * scale[i] * scale[j];
    eigen_symmetric(s, value, vector);
    for (int i = 0; i < N; i++)
        largest = fmax(largest, value[i]);
    memset(ret, 0, N * sizeof *ret);
    if (!(largest > 0))
        return;
    for (int e = 0; e < N; e++)
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++)
                ret[i][j] += scale[i] * vector[e][i] * vector[e][j] * scale[j] /
                             fmax(value[e], FLOOR * largest);
}

// outer inner outer, both symmetric.
static void sandwich(const double outer[N][N], const double inner[N][N], double ret[N][N])
{
    double left[N][N] = {{0}};
    memset(ret, 0, N * sizeof *ret);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < N; k++)
                left[i][j] += outer[i][k] * inner[k][j];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < N; k++)
                ret[i][j] += left[i][k] * outer[k][j];
}

void covariance_combine(const double information[N][N], const struct fit_space *space,
                        double ret_c[N][N])
{
    double sum[N][N];
    bool known[N];
    for (int i = 0; i < N; i++) {
        double half = (space->upper[i] - space->lower[i]) / 2;
        known[i] = !(half > 0);
        for (int j = 0; j < N; j++)
            sum[i][j] = (information[i][j] + information[j][i]) / 2;
        if (!known[i])
            sum[i][i] += 1 / (half * half);
    }
    invert(sum, known, ret_c);
}

static void say_nothing(struct covariance *cov)
{
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            cov->c[i][j] = cov->known[i] || cov->known[j] ? 0 : (double)NAN;
}

bool covariance_at(const struct fit_set *set, const struct fit_space *space, const double x[N],
                   struct fit_control *control, struct covariance *ret_cov)
{
    struct covariance cov = {.dof = (double)set->count};
    double h[N][N], m[N][N], pure[N][N];
    for (int i = 0; i < N; i++) {
        cov.known[i] = !(space->lower[i] < space->upper[i]);
        cov.dof -= !cov.known[i];
    }
    if (!accumulate_h(set, x, control, h))
        return false;
    invert(h, cov.known, cov.inverse);
    if (!accumulate_m(set, x, &cov, control, m))
        return false;
    double least = ROUNDING * ROUNDING * set->ff / (double)set->count;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            m[i][j] += least * h[i][j];
    sandwich(cov.inverse, m, pure);
    for (int i = 0; i < N; i++)
        cov.rise[i] = cov.inverse[i][i] / pure[i][i];
    invert(m, cov.known, pure);
    sandwich(h, pure, cov.information);
    if (set->u || cov.dof >= 1)
        covariance_combine(cov.information, space, cov.c);
    else
        say_nothing(&cov);
    *ret_cov = cov;
    return true;
}

double covariance_u(const struct covariance *cov, const double gradient[N])
{
    double sum = 0;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            sum += gradient[i] * cov->c[i][j] * gradient[j];
    return sqrt(fmax(sum, 0 * sum));
}

void covariance_axes(const struct covariance *cov, double ret_axis[N][N])
{
    double s[N][N], scale[N], value[N], vector[N][N];
    for (int i = 0; i < N; i++)
        scale[i] = cov->c[i][i] > 0 ? sqrt(cov->c[i][i]) : 0;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            s[i][j] = scale[i] > 0 && scale[j] > 0 ? cov->c[i][j] / (scale[i] * scale[j]) : 0;
    eigen_symmetric(s, value, vector);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            ret_axis[i][j] = sqrt(fmax(value[i], 0)) * vector[i][j] * scale[j];
}
