// SPDX-License-Identifier: MIT
#include "fit/covariance.h"

#include "fit/eigen.h"
#include "fit/kernel.h"

#include <math.h>
#include <string.h>

enum { N = FIT_PARAMS };
#define LEVERAGE_MAX 0.99 // a reading that alone determines a parameter says nothing of its noise
#define FLOOR 1e-14       // of the largest eigenvalue

static void add_outer(const struct kernel_block *b, size_t i, double weight, double m[N][N])
{
    for (int p = 0; p < N; p++)
        for (int q = p; q < N; q++)
            m[p][q] += weight * b->j[p][i] * b->j[q][i];
}

static void mirror(double m[N][N])
{
    for (int p = 0; p < N; p++)
        for (int q = 0; q < p; q++)
            m[p][q] = m[q][p];
}

// H and M; the noise of a reading is u where known, else r/(1 - h) with the leverage h = J^T
// inverse J (no leverage while inverse is NULL).
static bool accumulate(const struct fit_set *set, const double x[N], const double (*inverse)[N],
                       struct fit_control *control, double h[N][N], double m[N][N])
{
    struct kernel_block b;
    memset(h, 0, N * sizeof *h);
    memset(m, 0, N * sizeof *m);
    for (size_t at = 0; at < set->padded; at += KERNEL_BLOCK) {
        if (control_spend(control, 2 * KERNEL_BLOCK))
            return false;
        size_t count = kernel_jacobian(set, x, at, &b);
        for (size_t i = 0; i < count; i++) {
            double noise = set->u ? set->u[at + i] : b.r[i], leverage = 0;
            if (inverse && !set->u) {
                for (int p = 0; p < N; p++)
                    for (int q = 0; q < N; q++)
                        leverage += b.j[p][i] * inverse[p][q] * b.j[q][i];
                noise /= 1 - fmin(leverage, LEVERAGE_MAX);
            }
            add_outer(&b, i, 1, h);
            add_outer(&b, i, noise * noise, m);
        }
    }
    mirror(h);
    mirror(m);
    return true;
}

// The pseudo-observations: in H with the noise variance that the data have along this parameter, in
// M with its square, so that alone they would give width^2/12.
static void add_bounds(const struct fit_space *space, const double tau[N], double h[N][N],
                       double m[N][N])
{
    for (int i = 0; i < N; i++) {
        double width = space->upper[i] - space->lower[i], info = 12 / (width * width);
        if (!(width > 0))
            continue;
        h[i][i] += tau[i] * info;
        m[i][i] += tau[i] * tau[i] * info;
    }
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

static void sandwich(const double inverse[N][N], const double m[N][N], double ret[N][N])
{
    double left[N][N] = {{0}};
    memset(ret, 0, N * sizeof *ret);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < N; k++)
                left[i][j] += inverse[i][k] * m[k][j];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < N; k++)
                ret[i][j] += left[i][k] * inverse[k][j];
}

static void say_nothing(struct covariance *cov)
{
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            cov->c[i][j] = cov->inverse[i][j] = cov->known[i] || cov->known[j] ? 0 : (double)NAN;
}

bool covariance_at(const struct fit_set *set, const struct fit_space *space, const double x[N],
                   struct fit_control *control, struct covariance *ret_cov)
{
    struct covariance cov = {.dof = (double)set->count};
    for (int i = 0; i < N; i++) {
        cov.known[i] = !(space->lower[i] < space->upper[i]);
        cov.dof -= !cov.known[i];
    }
    double h[N][N], m[N][N], tau[N];
    if (!accumulate(set, x, NULL, control, h, m))
        return false;
    if (!set->u && cov.dof < 1) {
        say_nothing(&cov);
        *ret_cov = cov;
        return true;
    }
    for (int i = 0; i < N; i++)
        tau[i] = h[i][i] > 0 ? m[i][i] / h[i][i] : 0;
    if (!set->u) {
        double plain[N][N];
        invert(h, cov.known, plain);
        if (!accumulate(set, x, plain, control, h, m))
            return false;
        for (int i = 0; i < N; i++)
            tau[i] *= (double)set->count / cov.dof;
    }
    add_bounds(space, tau, h, m);
    invert(h, cov.known, cov.inverse);
    sandwich(cov.inverse, m, cov.c);
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
