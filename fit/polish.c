// SPDX-License-Identifier: MIT
#include "fit/polish.h"

#include "fit/kernel.h"
#include "fit/varpro.h"

#include <string.h>

enum { NONLINEAR = 3 }; // FIT_N, FIT_K, FIT_SIGMA come first in every array
#define DONE 1e-11

// Where the polish stands: the reduced problem in the nonlinear coordinates.
struct state {
    struct fit_optimum at;
    double s[NONLINEAR][NONLINEAR]; // Gauss-Newton matrix with ks and kd projected out
    double g[NONLINEAR];            // downhill: minus half the gradient of q
};

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

// Removes from c = <u, w> what the free linear columns explain: u and w given by their products with a, b.
static double project(const struct kernel_gram *gram, const struct varpro *v, const double u[2],
                      const double w[2])
{
    double aa = gram->m[KERNEL_A][KERNEL_A], ab = gram->m[KERNEL_A][KERNEL_B];
    double bb = gram->m[KERNEL_B][KERNEL_B], det = aa * bb - ab * ab;
    if (v->ks_free && v->kd_free && det > 1e-14 * aa * bb)
        return (u[0] * (bb * w[0] - ab * w[1]) + u[1] * (aa * w[1] - ab * w[0])) / det;
    if (v->ks_free && aa > 0)
        return u[0] * w[0] / aa;
    if (v->kd_free && bb > 0)
        return u[1] * w[1] / bb;
    return 0;
}

// One pass at x, whose ks and kd are only where residuals are taken; false when canceled.
static bool evaluate(const struct fit_set *set, const struct fit_space *space,
                     const double x[FIT_PARAMS], struct fit_control *control, struct state *ret)
{
    struct kernel_gram gram;
    if (!kernel_gram(set, x, control, &gram))
        return false;
    struct varpro v = varpro_solve(&gram, x, space);
    const double (*m)[KERNEL_COLUMNS] = gram.m;
    double ds = v.ks - x[FIT_KS], dd = v.kd - x[FIT_KD];
    for (int i = 0; i < NONLINEAR; i++) {
        double u[2] = {m[i][KERNEL_A], m[i][KERNEL_B]};
        ret->g[i] = v.ks * (m[i][KERNEL_R] - ds * u[0] - dd * u[1]);
        for (int j = 0; j < NONLINEAR; j++) {
            double w[2] = {m[j][KERNEL_A], m[j][KERNEL_B]};
            ret->s[i][j] = v.ks * v.ks * (m[i][j] - project(&gram, &v, u, w));
        }
    }
    memcpy(ret->at.x, x, sizeof ret->at.x);
    ret->at.x[FIT_KS] = v.ks;
    ret->at.x[FIT_KD] = v.kd;
    ret->at.q = v.q;
    return true;
}

// Solves (S + lambda diag S) d = rhs over the coordinates in use, by Cholesky; false when not positive.
static bool solve(const struct state *st, double lambda, const bool use[NONLINEAR],
                  const double rhs[NONLINEAR], double d[NONLINEAR])
{
    double l[NONLINEAR][NONLINEAR] = {{0}}, y[NONLINEAR];
    for (int i = 0; i < NONLINEAR; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = use[i] && use[j] ? st->s[i][j] : 0;
            if (i == j)
                sum = use[i] ? sum * (1 + lambda) : 1;
            for (int k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 0))
                return false;
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
        y[i] = use[i] ? rhs[i] : 0;
        for (int k = 0; k < i; k++)
            y[i] -= l[i][k] * y[k];
        y[i] /= l[i][i];
    }
    for (int i = NONLINEAR - 1; i >= 0; i--) {
        for (int k = i + 1; k < NONLINEAR; k++)
            y[i] -= l[k][i] * y[k];
        y[i] /= l[i][i];
        d[i] = use[i] ? y[i] : 0;
    }
    return true;
}

// The damped step within the bounds: a coordinate that would leave goes to its bound and the others are
// solved again; one that sits on its bound and would leave stays.
static bool bounded_step(const struct state *st, const struct fit_space *space, double lambda,
                         double d[NONLINEAR])
{
    bool use[NONLINEAR];
    double rhs[NONLINEAR], held[NONLINEAR] = {0};
    for (int i = 0; i < NONLINEAR; i++) {
        double x = st->at.x[i];
        use[i] = st->s[i][i] > 0 && space->lower[i] < space->upper[i] &&
                 !(x <= space->lower[i] && st->g[i] < 0) && !(x >= space->upper[i] && st->g[i] > 0);
        rhs[i] = st->g[i];
    }
    for (int round = 0; round <= NONLINEAR; round++) {
        if (!solve(st, lambda, use, rhs, d))
            return false;
        int out = -1;
        for (int i = 0; i < NONLINEAR && out < 0; i++)
            if (use[i] && (st->at.x[i] + d[i] < space->lower[i] || st->at.x[i] + d[i] > space->upper[i]))
                out = i;
        for (int i = 0; i < NONLINEAR; i++)
            d[i] = use[i] ? d[i] : held[i];
        if (out < 0)
            return true;
        use[out] = false;
        held[out] = (d[out] < 0 ? space->lower[out] : space->upper[out]) - st->at.x[out];
        for (int i = 0; i < NONLINEAR; i++)
            rhs[i] -= st->s[i][out] * held[out];
    }
    return true;
}

static double predicted_gain(const struct state *st, const double d[NONLINEAR])
{
    double gain = 0;
    for (int i = 0; i < NONLINEAR; i++) {
        gain += 2 * st->g[i] * d[i];
        for (int j = 0; j < NONLINEAR; j++)
            gain -= d[i] * st->s[i][j] * d[j];
    }
    return gain;
}

bool polish(const struct fit_set *set, const struct fit_space *space, int max_steps,
            struct fit_control *control, struct fit_optimum *optimum)
{
    struct state now, next;
    for (int i = 0; i < FIT_PARAMS; i++)
        optimum->x[i] = clamp(optimum->x[i], space->lower[i], space->upper[i]);
    if (!evaluate(set, space, optimum->x, control, &now))
        return false;
    double lambda = 1e-3;
    for (int step = 0; step < max_steps && lambda < 1e9; step++) {
        double d[NONLINEAR];
        if (!bounded_step(&now, space, lambda, d)) {
            lambda *= 10;
            continue;
        }
        double gain = predicted_gain(&now, d);
        if (!(gain > DONE * now.at.q))
            break;
        double x[FIT_PARAMS];
        memcpy(x, now.at.x, sizeof x);
        for (int i = 0; i < NONLINEAR; i++)
            x[i] = clamp(x[i] + d[i], space->lower[i], space->upper[i]);
        if (!evaluate(set, space, x, control, &next))
            return false;
        if (next.at.q < now.at.q) {
            lambda = next.at.q < now.at.q - 0.5 * gain ? fmax(lambda / 8, 1e-9) : lambda;
            now = next;
        } else {
            lambda *= 6;
        }
    }
    *optimum = now.at;
    return true;
}
