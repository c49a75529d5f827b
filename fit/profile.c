// SPDX-License-Identifier: MIT
#include "fit/profile.h"

#include "fit/hold.h"

#include <math.h>
#include <string.h>

enum { TRIALS = 16, STEPS = 40 };
#define CLOSE 0.01   // of the quantile: an end within 1 % of the interval's half width
#define BETTER 1e-7  // a lower q counts as another optimum, not as rounding

struct walk {
    const struct fit_set *set;
    const struct fit_space *space;
    const struct covariance *cov;
    struct fit_control *control;
    enum fit_param which;
    double scale;    // q to z^2
    double quantile; // where the interval ends, in z
    const struct fit_optimum *best;
    struct profile reached[FIT_PARAMS]; // by points within the limit, of whatever profile
};

static double outside(enum fit_param which, double x) // from x to the parameter
{
    return which == FIT_K ? sqrt(x) : which == FIT_SIGMA ? exp(x) : x;
}

static double inside(enum fit_param which, double value)
{
    return which == FIT_K ? value * value : which == FIT_SIGMA ? log(value) : value;
}

// Student's t for 97.5 % (Cornish and Fisher; within 1 % from 3 degrees on), the normal's for known
// u.
static double quantile_of(const struct fit_set *set, double dof)
{
    const double z = 1.959963984540054;
    if (set->u)
        return z;
    double n = fmax(dof, 2), z3 = z * z * z, z5 = z3 * z * z;
    return z + (z3 + z) / (4 * n) + (5 * z5 + 16 * z3 + 3 * z) / (96 * n * n);
}

static bool hold(const struct walk *w, double value, const struct fit_optimum *from,
                 struct fit_optimum *ret_at, double *ret_z)
{
    const struct hold h = {w->set, w->space, w->cov, w->control};
    if (!hold_at(&h, w->which, inside(w->which, value), from, ret_at))
        return false;
    *ret_z = sqrt(fmax(0, (ret_at->q - w->best->q) * w->scale));
    return true;
}

// What n, k and ks are at a point that the limit admits is within their own intervals too.
static void note_reached(struct walk *w, const struct fit_optimum *at)
{
    for (int i = 0; i < FIT_PARAMS; i++) {
        double value = outside((enum fit_param)i, at->x[i]);
        w->reached[i].lo95 = fmin(w->reached[i].lo95, value);
        w->reached[i].hi95 = fmax(w->reached[i].hi95, value);
    }
}

// One end. z grows about linearly with the distance, so a secant on z, kept between what was
// bracketed.
static bool find_end(struct walk *w, double direction, double u, double *ret_end,
                     struct fit_optimum *ret_lowest)
{
    double centre = outside(w->which, w->best->x[w->which]);
    double bound =
        outside(w->which, direction < 0 ? w->space->lower[w->which] : w->space->upper[w->which]);
    double room = fabs(bound - centre), inner = 0, inner_z = 0, outer = (double)INFINITY,
           outer_z = (double)INFINITY;
    double distance = fmin(w->quantile * u, room);
    struct fit_optimum at, inner_at = *w->best;
    *ret_end = bound;
    if (!(room > 0) || !isfinite(w->scale))
        return true;
    for (int trial = 0; trial < TRIALS; trial++) {
        double z;
        if (!hold(w, distance < room ? centre + direction * distance : bound, &inner_at, &at, &z))
            return false;
        if (at.q < ret_lowest->q)
            *ret_lowest = at;
        if (z <= w->quantile)
            note_reached(w, &at);
        if (fabs(z - w->quantile) <= CLOSE * w->quantile) {
            *ret_end = centre + direction * distance;
            return true;
        }
        if (z < w->quantile) {
            if (distance >= room)
                return true;
            inner = distance;
            inner_z = z;
            inner_at = at;
        } else {
            outer = distance;
            outer_z = z;
        }
        if (isinf(outer))
            distance = fmin(room, distance * fmin(4, fmax(1.1, w->quantile / fmax(z, 1e-3))));
        else
            distance = inner + (outer - inner) *
                       fmin(0.9, fmax(0.1, (w->quantile - inner_z) / (outer_z - inner_z)));
    }
    *ret_end = centre + direction * (inner + fmin(outer, room)) / 2;
    return true;
}

// u of the parameter itself, from its coordinate's.
static double first_step(enum fit_param which, double x, double spread)
{
    return which == FIT_K       ? sqrt(x + spread) - sqrt(x)
           : which == FIT_SIGMA ? exp(x) * spread
                                : spread;
}

static bool one_interval(struct walk *w, struct fit_optimum *lowest, struct profile *ret_profile)
{
    double own = w->cov->c[w->which][w->which], x = w->best->x[w->which];
    *ret_profile = (struct profile){outside(w->which, x), outside(w->which, x)};
    if (w->cov->known[w->which] || own == 0) // fixed, or no noise at all: the value itself
        return true;
    if (isnan(own)) {
        *ret_profile = (struct profile){(double)NAN, (double)NAN};
        return true;
    }
    double u = first_step(w->which, x, sqrt(own));
    w->scale = w->cov->rise[w->which];
    return find_end(w, -1, u, &ret_profile->lo95, lowest) &&
           find_end(w, +1, u, &ret_profile->hi95, lowest);
}

bool profile_intervals(const struct fit_set *set, const struct fit_space *space,
                       const struct covariance *cov, struct fit_control *control,
                       struct fit_optimum *best, struct profile ret_profile[FIT_PARAMS],
                       bool *ret_better)
{
    struct walk w = {.set = set, .space = space, .cov = cov, .control = control, .best = best,
                     .quantile = quantile_of(set, cov->dof)};
    struct fit_optimum lowest = *best;
    *ret_better = false;
    for (int i = 0; i < FIT_PARAMS; i++)
        w.reached[i].lo95 = w.reached[i].hi95 = outside((enum fit_param)i, best->x[i]);
    for (int i = 0; i < FIT_PARAMS; i++) {
        w.which = (enum fit_param)i;
        if (!one_interval(&w, &lowest, &ret_profile[i]))
            return false;
        if (lowest.q < best->q * (1 - BETTER)) {
            *ret_better = true;
            *best = lowest;
            return polish(set, space, 5 * STEPS, control, best);
        }
    }
    static const enum fit_param valley[] = {FIT_N, FIT_K, FIT_KS};
    for (int i = 0; i < 3; i++) {
        struct profile *p = &ret_profile[valley[i]];
        if (isnan(p->lo95) || cov->known[valley[i]])
            continue;
        p->lo95 = fmin(p->lo95, w.reached[valley[i]].lo95);
        p->hi95 = fmax(p->hi95, w.reached[valley[i]].hi95);
    }
    return true;
}
