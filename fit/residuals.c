// SPDX-License-Identifier: MIT
#include "fit/residuals.h"

#include "fit/objective.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
#define SAME_RAD 1e-7

struct place {
    double theta_i, plane, theta_r; // theta_r signed within its plane
    double r;
};

// A plane of azimuth is dphi modulo pi; its forward half has cos(dphi) < 0.
static struct place place_of(const struct fit_data *d, size_t i, double r)
{
    double dphi = remainder(d->dphi_rad[i], 2 * PI);
    double plane = dphi - PI * floor(dphi / PI + SAME_RAD);
    return (struct place){d->theta_i_rad[i], fabs(plane) < SAME_RAD ? 0 : plane,
                          copysign(d->theta_r_rad[i], -cos(dphi)), r};
}

static int by_place(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    if (fabs(p->theta_i - q->theta_i) > SAME_RAD)
        return p->theta_i < q->theta_i ? -1 : 1;
    if (fabs(p->plane - q->plane) > SAME_RAD)
        return p->plane < q->plane ? -1 : 1;
    return (p->theta_r > q->theta_r) - (p->theta_r < q->theta_r);
}

struct sums {
    double product, product2, square;
    size_t pairs;
};

static void add_pair(struct sums *s, const struct place *p, const struct place *q)
{
    if (fabs(p->theta_i - q->theta_i) > SAME_RAD || fabs(p->plane - q->plane) > SAME_RAD)
        return;
    double product = p->r * q->r;
    s->product += product;
    s->product2 += product * product;
    s->square += (p->r * p->r + q->r * q->r) / 2;
    s->pairs++;
}

static int count_sweeps(const struct fit_data *d)
{
    double seen[3];
    int count = 0;
    for (size_t i = 0; i < d->count && count < 3; i++) {
        bool is_new = true;
        for (int j = 0; j < count; j++)
            is_new = is_new && fabs(d->theta_i_rad[i] - seen[j]) > SAME_RAD;
        if (is_new)
            seen[count++] = d->theta_i_rad[i];
    }
    return count;
}

int residuals_study(const struct fit_data *data, const struct fit_set *set,
                    const struct brdf_params *p, struct fit_control *control,
                    struct residuals *ret_residuals)
{
    struct residuals out = {.lag1 = (double)NAN, .z = 0, .chi2 = set->u ? 0 : (double)NAN};
    bool sorted = set->count <= RESIDUALS_SORT_MAX;
    struct place *all = sorted ? malloc(set->count * sizeof *all) : NULL, last = {.r = 0};
    struct sums sums = {.pairs = 0};
    if (sorted && !all)
        return FIT_E_MEMORY;
    for (size_t i = 0; i < set->count; i++) {
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control)) {
            free(all);
            return FIT_E_CANCELED;
        }
        double r = objective_residual(set, p, i);
        if (set->u)
            out.chi2 += (r / set->u[i]) * (r / set->u[i]);
        struct place here = place_of(data, i, r);
        if (sorted)
            all[i] = here;
        else if (i > 0)
            add_pair(&sums, &last, &here);
        last = here;
    }
    if (sorted) {
        qsort(all, set->count, sizeof *all, by_place);
        for (size_t i = 1; i < set->count; i++)
            add_pair(&sums, &all[i - 1], &all[i]);
    }
    free(all);
    if (sums.pairs > 0 && sums.square > 0)
        out.lag1 = sums.product / sums.square;
    if (sums.product2 > 0)
        out.z = sums.product / sqrt(sums.product2);
    out.sweeps = count_sweeps(data);
    *ret_residuals = out;
    return 0;
}
