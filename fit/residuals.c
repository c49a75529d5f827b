// SPDX-License-Identifier: MIT
#include "fit/residuals.h"

#include "fit/noise.h"
#include "fit/objective.h"
#include "fit/reading.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
#define SAME_RAD 1e-7
enum { REPOLISH = 40 };

struct place {
    double theta_i, plane, theta_r; // theta_r signed within its plane
    int channel;
    double r;
};

// A plane of azimuth is dphi modulo pi; its forward half has cos(dphi) < 0.
static struct place place_of(const struct fit_data *d, size_t i, double r)
{
    double dphi = remainder(d->dphi_rad[i], 2 * PI);
    double plane = dphi - PI * floor(dphi / PI + SAME_RAD);
    return (struct place){
        d->theta_i_rad[i], fabs(plane) < SAME_RAD ? 0 : plane,
        copysign(d->theta_r_rad[i], -cos(dphi)),
        BRDF_STATES * (int)reading_state(d->pol_in, i) + (int)reading_state(d->pol_out, i), r};
}

static int by_place(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    if (p->channel != q->channel)
        return p->channel < q->channel ? -1 : 1;
    if (fabs(p->theta_i - q->theta_i) > SAME_RAD)
        return p->theta_i < q->theta_i ? -1 : 1;
    if (fabs(p->plane - q->plane) > SAME_RAD)
        return p->plane < q->plane ? -1 : 1;
    return (p->theta_r > q->theta_r) - (p->theta_r < q->theta_r);
}

struct sums {
    double product, product2, square;
    size_t pairs, alike; // in sign
};

static void add_pair(struct sums *s, const struct place *p, const struct place *q)
{
    if (fabs(p->theta_i - q->theta_i) > SAME_RAD || fabs(p->plane - q->plane) > SAME_RAD ||
        p->channel != q->channel)
        return;
    double product = p->r * q->r;
    s->product += product;
    s->product2 += product * product;
    s->square += (p->r * p->r + q->r * q->r) / 2;
    s->alike += product > 0;
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

static bool chi2_at(const struct fit_set *set, const struct brdf_params *p,
                    struct fit_control *control, double *ret_chi2)
{
    double sum = set->u ? 0 : (double)NAN;
    for (size_t i = 0; i < set->count && set->u; i++) {
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control))
            return false;
        double z = objective_residual(set, p, i) / set->u[i];
        sum += z * z;
    }
    *ret_chi2 = sum;
    return true;
}

static int compare_neighbours(const struct fit_data *data, const struct fit_set *set,
                              const struct brdf_params *p, struct fit_control *control,
                              struct sums *ret_sums)
{
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
        struct place here = place_of(data, i, objective_residual(set, p, i));
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
    *ret_sums = sums;
    return 0;
}

// The noise of each reading, `u` having room for them: as measured, or by the law that the
// residuals follow. False: there is none.
static bool noise_of_each(const struct fit_data *data, const struct fit_options *o,
                          const struct fit_set *set, const struct fit_optimum *optimum, double *u)
{
    struct brdf_params p = space_params(optimum->x);
    struct noise law = noise_of(data, o->diffuse, optimum->x);
    bool some = law.relative > 0 || law.floor_per_sr > 0;
    for (size_t i = 0; i < data->count && some; i++) {
        double root_g = set->all.root_g[i];
        double model = data->f_per_sr[i] - objective_residual(set, &p, i) / root_g;
        u[i] = data->u_per_sr ? data->u_per_sr[i] : noise_u(&law, model);
        some = some && u[i] > 0;
    }
    return some;
}

// As compare_neighbours, at the fit with weights 1/noise^2.
static int compare_reweighted(const struct fit_data *data, const struct fit_set *set,
                              const struct fit_options *options, const struct fit_optimum *optimum,
                              struct fit_control *control, struct sums *ret_sums, double *ret_chi2)
{
    double *u = malloc(data->count * sizeof *u);
    struct fit_data weighted = *data;
    struct fit_options o = *options;
    struct fit_space space = space_of_options(options);
    struct fit_optimum at = *optimum;
    struct fit_set again = {.count = 0};
    int stop = u ? 0 : FIT_E_MEMORY;
    if (!stop && noise_of_each(data, options, set, optimum, u)) {
        weighted.u_per_sr = u;
        o.weighting = FIT_VARIANCE;
        stop = set_compile(&weighted, &o, control, &again);
        if (!stop && !polish(&again, &space, REPOLISH, control, &at))
            stop = FIT_E_CANCELED;
        struct brdf_params p = space_params(at.x);
        if (!stop)
            stop = compare_neighbours(data, &again, &p, control, ret_sums);
        if (!stop && data->u_per_sr && !chi2_at(&again, &p, control, ret_chi2))
            stop = FIT_E_CANCELED;
    }
    set_free(&again);
    free(u);
    return stop;
}

int residuals_study(const struct fit_data *data, const struct fit_set *set,
                    const struct fit_options *options, const struct brdf_params *p,
                    const struct fit_optimum *optimum, struct fit_control *control,
                    struct residuals *ret_residuals)
{
    struct residuals out = {.lag1 = (double)NAN, .sweeps = count_sweeps(data)};
    struct sums sums = {.pairs = 0};
    bool as_given = options->weighting == FIT_VARIANCE || data->count > RESIDUALS_SORT_MAX;
    if (!chi2_at(set, p, control, &out.chi2))
        return FIT_E_CANCELED;
    out.least_chi2 = out.chi2;
    int stop =
        as_given ? compare_neighbours(data, set, p, control, &sums)
                 : compare_reweighted(data, set, options, optimum, control, &sums, &out.least_chi2);
    if (stop)
        return stop;
    if (sums.pairs > 0 && sums.square > 0)
        out.lag1 = sums.product / sums.square;
    if (sums.product2 > 0)
        out.z = sums.product / sqrt(sums.product2);
    double pairs = (double)sums.pairs;
    if (sums.pairs > 0 && sums.square > 0)
        out.signs_z = (2 * (double)sums.alike - pairs) / sqrt(pairs);
    *ret_residuals = out;
    return 0;
}
