// SPDX-License-Identifier: MIT
#include "bench/peers/attempt.h"

#include "fit/kernel.h"
#include "fit/passes.h"
#include "fit/varpro.h"

#include <string.h>
#include <time.h>

double attempt_now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

void attempt_begin(struct attempt *a)
{
    a->best = (double)INFINITY;
    a->values = a->slopes = 0;
    a->hit = a->over = a->done = false;
    a->control = (struct fit_control){.stop = false};
    a->start_ms = attempt_now_ms();
}

void attempt_run(struct attempt *a, long stall)
{
    a->run_best = (double)INFINITY;
    a->stall = stall;
    a->idle = 0;
    a->over = a->done;
}

double attempt_spent_ms(const struct attempt *a)
{
    return attempt_now_ms() - a->start_ms;
}

void attempt_found(struct attempt *a, double delta)
{
    if (delta < a->best)
        a->best = delta;
    if (!a->hit && a->best <= a->target) {
        a->hit = true;
        a->hit_ms = attempt_spent_ms(a);
        a->done = a->stop_at_target;
    }
    if ((a->values + a->slopes) % 256 == 0 && attempt_spent_ms(a) > a->limit_ms)
        a->done = true;
    a->over = a->over || a->done;
}

static double clamp(double v)
{
    return v < 0 ? 0 : v > 1 ? 1 : v;
}

// x of the genes, ks = kd = 0, and the derivative of each coordinate by its gene.
static void decode(const struct attempt *a, const double gene[], double x[], double dx[])
{
    const double *low = a->task->space.lower, *high = a->task->space.upper;
    double power = a->k_power;
    double root_low = pow(low[FIT_K], 1 / power), root_high = pow(high[FIT_K], 1 / power);
    double root = root_low + (root_high - root_low) * clamp(gene[1]);
    dx[0] = high[FIT_N] - low[FIT_N];
    dx[1] = power * pow(root, power - 1) * (root_high - root_low);
    dx[2] = high[FIT_SIGMA] - low[FIT_SIGMA];
    x[FIT_N] = low[FIT_N] + dx[0] * clamp(gene[0]);
    x[FIT_K] = pow(root, power);
    x[FIT_SIGMA] = low[FIT_SIGMA] + dx[2] * clamp(gene[2]);
    x[FIT_KS] = x[FIT_KD] = 0;
}

static void keep(struct attempt *a, const double gene[], double delta)
{
    a->idle = delta < a->run_best * (1 - ATTEMPT_GAIN) ? 0 : a->idle + 1;
    if (delta < a->run_best) {
        a->run_best = delta;
        memcpy(a->run_gene, gene, sizeof a->run_gene);
    }
    attempt_found(a, delta);
    a->over = a->over || (a->stall > 0 && a->idle >= a->stall);
}

double attempt_value(struct attempt *a, const double gene[ATTEMPT_GENES])
{
    double x[FIT_PARAMS], dx[ATTEMPT_GENES];
    struct kernel_gram gram;
    decode(a, gene, x, dx);
    passes_moments(&a->task->set, x, &a->control, &gram);
    double delta = varpro_solve(&gram, x, &a->task->space).q / a->task->set.ff;
    a->values++;
    keep(a, gene, delta);
    return a->log ? log(delta) : delta;
}

static struct varpro project(struct attempt *a, const double gene[], double dx[],
                             struct kernel_gram *gram)
{
    double x[FIT_PARAMS];
    decode(a, gene, x, dx);
    passes_gram(&a->task->set, x, &a->control, gram);
    struct varpro v = varpro_solve(gram, x, &a->task->space);
    a->slopes++;
    keep(a, gene, v.q / a->task->set.ff);
    return v;
}

// <column, f - ks a - kd b>
static double with_residual(const struct kernel_gram *g, const struct varpro *v, int column)
{
    const double *m = g->m[column];
    return m[KERNEL_R] - v->ks * m[KERNEL_A] - v->kd * m[KERNEL_B];
}

// At the projected ks and kd their own derivatives do not count (envelope theorem).
double attempt_slope(struct attempt *a, const double gene[ATTEMPT_GENES],
                     double ret_slope[ATTEMPT_GENES])
{
    double dx[ATTEMPT_GENES];
    struct kernel_gram gram;
    struct varpro v = project(a, gene, dx, &gram);
    double unit = a->log ? v.q : a->task->set.ff; // of d log q, or of d Delta
    for (int i = 0; i < ATTEMPT_GENES; i++)
        ret_slope[i] = -2 * v.ks * with_residual(&gram, &v, i) * dx[i] / unit;
    return a->log ? log(v.q / a->task->set.ff) : v.q / a->task->set.ff;
}

// What of <u, w> is left when the free ones of ks and kd follow (Kaufman's Jacobian).
static double left_over(const struct kernel_gram *g, const struct varpro *v, int u, int w)
{
    double aa = g->m[KERNEL_A][KERNEL_A], ab = g->m[KERNEL_A][KERNEL_B];
    double bb = g->m[KERNEL_B][KERNEL_B], det = aa * bb - ab * ab;
    double ua = g->m[u][KERNEL_A], ub = g->m[u][KERNEL_B];
    double wa = g->m[w][KERNEL_A], wb = g->m[w][KERNEL_B];
    if (v->ks_free && v->kd_free && det > 1e-14 * aa * bb)
        return g->m[u][w] - (ua * (bb * wa - ab * wb) + ub * (aa * wb - ab * wa)) / det;
    if (v->ks_free && aa > 0)
        return g->m[u][w] - ua * wa / aa;
    if (v->kd_free && bb > 0)
        return g->m[u][w] - ub * wb / bb;
    return g->m[u][w];
}

void attempt_rows(struct attempt *a, const double gene[ATTEMPT_GENES], double ret_r[ATTEMPT_ROWS],
                  double ret_j[ATTEMPT_ROWS][ATTEMPT_GENES])
{
    double dx[ATTEMPT_GENES], s[ATTEMPT_ROWS][ATTEMPT_ROWS], l[ATTEMPT_ROWS][ATTEMPT_ROWS] = {{0}};
    struct kernel_gram gram;
    struct varpro v = project(a, gene, dx, &gram);
    for (int i = 0; i < ATTEMPT_GENES; i++) {
        for (int j = 0; j < ATTEMPT_GENES; j++)
            s[i][j] = left_over(&gram, &v, i, j) * v.ks * v.ks * dx[i] * dx[j];
        s[3][i] = -with_residual(&gram, &v, i) * v.ks * dx[i];
    }
    s[3][3] = v.q;
    for (int i = 0; i < ATTEMPT_ROWS; i++)
        for (int j = 0; j <= i; j++) {
            double sum = s[i][j];
            for (int k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            l[i][j] = i == j ? sqrt(fmax(sum, 0)) : l[j][j] > 0 ? sum / l[j][j] : 0;
        }
    for (int row = 0; row < ATTEMPT_ROWS; row++) {
        ret_r[row] = l[3][row];
        for (int i = 0; i < ATTEMPT_GENES; i++)
            ret_j[row][i] = i >= row ? l[i][row] : 0;
    }
}
