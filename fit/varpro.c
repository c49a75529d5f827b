// SPDX-License-Identifier: MIT
#include "fit/varpro.h"

// q(s, d) - q(0, 0) for steps s, d of ks and kd.
struct quadratic {
    double aa, ab, bb, ar, br;
};

static double change(const struct quadratic *q, double s, double d)
{
    return s * (q->aa * s + 2 * q->ab * d - 2 * q->ar) + d * (q->bb * d - 2 * q->br);
}

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

// The least on the line where one step is fixed: the other's best, clamped.
static double along(double curvature, double slope, double low, double high)
{
    return curvature > 0 ? clamp(slope / curvature, low, high) : clamp(0, low, high);
}

// A convex quadratic over a box is least at its stationary point when that lies inside, else on an
// edge; a degenerate one (a and b parallel) is least on an edge too, as its valley leaves the box
// there.
static double solve_box(const struct quadratic *q, const double low[2], const double high[2],
                        double ret_step[2])
{
    double det = q->aa * q->bb - q->ab * q->ab;
    if (det > 1e-14 * q->aa * q->bb) {
        double s = (q->ar * q->bb - q->br * q->ab) / det, d = (q->br * q->aa - q->ar * q->ab) / det;
        if (s >= low[0] && s <= high[0] && d >= low[1] && d <= high[1]) {
            ret_step[0] = s;
            ret_step[1] = d;
            return change(q, s, d);
        }
    }
    double best = (double)INFINITY;
    for (int edge = 0; edge < 4; edge++) {
        double s = edge & 1 ? high[0] : low[0], d = edge & 1 ? high[1] : low[1];
        if (edge < 2)
            d = along(q->bb, q->br - q->ab * s, low[1], high[1]);
        else
            s = along(q->aa, q->ar - q->ab * d, low[0], high[0]);
        double c = change(q, s, d);
        if (c < best) {
            best = c;
            ret_step[0] = s;
            ret_step[1] = d;
        }
    }
    return best;
}

struct varpro varpro_solve(const struct kernel_gram *gram, const double x[FIT_PARAMS],
                           const struct fit_space *space)
{
    const double (*m)[KERNEL_COLUMNS] = gram->m;
    struct quadratic q = {m[KERNEL_A][KERNEL_A], m[KERNEL_A][KERNEL_B], m[KERNEL_B][KERNEL_B],
                          m[KERNEL_A][KERNEL_R], m[KERNEL_B][KERNEL_R]};
    const double *lower = space->lower, *upper = space->upper;
    double low[2] = {lower[FIT_KS] - x[FIT_KS], lower[FIT_KD] - x[FIT_KD]};
    double high[2] = {upper[FIT_KS] - x[FIT_KS], upper[FIT_KD] - x[FIT_KD]};
    double step[2] = {0, 0};
    double gain = solve_box(&q, low, high, step);
    struct varpro v = {
        .ks = clamp(x[FIT_KS] + step[0], lower[FIT_KS], upper[FIT_KS]),
        .kd = clamp(x[FIT_KD] + step[1], lower[FIT_KD], upper[FIT_KD]),
        .q = fmax(0, m[KERNEL_R][KERNEL_R] + gain),
        .ks_free = step[0] > low[0] && step[0] < high[0],
        .kd_free = step[1] > low[1] && step[1] < high[1],
    };
    return v;
}
