// SPDX-License-Identifier: MIT
#include "fit/set.h"

#include "fit/rng.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define EDGE_RAD 1e-9 // the dense zone includes its edges whatever rounding did to them

enum { ARRAYS = 7 };

static int set_new(size_t count, bool with_u, struct fit_set *ret_set)
{
    size_t padded = (count + SET_LANES - 1) / SET_LANES * SET_LANES;
    double *memory = calloc(padded, ARRAYS * sizeof *memory);
    if (!memory)
        return FIT_E_MEMORY;
    *ret_set = (struct fit_set){.count = count, .padded = padded, .memory = memory, .g_scale = 1};
    double **array[ARRAYS] = {&ret_set->tan2_theta, &ret_set->sin2_beta, &ret_set->cos2_beta,
                              &ret_set->spec,       &ret_set->diffuse,   &ret_set->f,
                              &ret_set->u};
    for (int i = 0; i < ARRAYS; i++)
        *array[i] = memory + (size_t)i * padded;
    if (!with_u)
        ret_set->u = NULL;
    for (size_t i = count; i < padded; i++)
        ret_set->cos2_beta[i] = 1;
    return 0;
}

void set_free(struct fit_set *set)
{
    free(set->memory);
    *set = (struct fit_set){.count = 0};
}

// sqrt(g) of one reading, before scaling: unit is `smallest`, the least u or |f| of the set.
static double root_weight(const struct fit_data *d, const struct fit_options *o, size_t i,
                          double unit)
{
    switch (o->weighting) {
    case FIT_UNIFORM: return 1;
    case FIT_DENSE:
        // The signed theta_r of the plane of incidence: forward where cos dphi < 0.
        return fabs((cos(d->dphi_rad[i]) < 0 ? d->theta_r_rad[i] : -d->theta_r_rad[i]) -
                    d->theta_i_rad[i]) <= o->dense_half_width_rad + EDGE_RAD
                   ? sqrt(o->dense_g / fmax(1, o->dense_g))
                   : sqrt(1 / fmax(1, o->dense_g));
    case FIT_RELATIVE: return unit / fabs(d->f_per_sr[i]);
    case FIT_VARIANCE: return unit / d->u_per_sr[i];
    }
    return 1;
}

static bool reading_ok(const struct fit_data *d, const struct fit_options *o, size_t i)
{
    return d->theta_i_rad[i] >= 0 && d->theta_i_rad[i] < PI / 2 && d->theta_r_rad[i] >= 0 &&
           d->theta_r_rad[i] < PI / 2 && isfinite(d->dphi_rad[i]) &&
           fabs(d->f_per_sr[i]) <= 1e100 &&
           (!d->u_per_sr || (d->u_per_sr[i] > 0 && d->u_per_sr[i] <= 1e100)) &&
           (o->weighting != FIT_RELATIVE || d->f_per_sr[i] != 0);
}

// The least u (variance weights) or |f| (relative weights), for scaling; 0 or a negative fit_stop.
static int check_readings(const struct fit_data *d, const struct fit_options *o,
                          struct fit_control *control, double *ret_unit)
{
    if (d->count < FIT_PARAMS)
        return FIT_E_FEW_POINTS;
    double unit = (double)INFINITY, largest = 0;
    for (size_t i = 0; i < d->count; i++) {
        if (i % CONTROL_SLICE == 0 && control_ask(control))
            return FIT_E_CANCELED;
        if (!reading_ok(d, o, i))
            return FIT_E_DATA;
        largest = fmax(largest, fabs(d->f_per_sr[i]));
        if (o->weighting == FIT_RELATIVE)
            unit = fmin(unit, fabs(d->f_per_sr[i]));
        else if (o->weighting == FIT_VARIANCE)
            unit = fmin(unit, d->u_per_sr[i]);
    }
    if (largest == 0)
        return FIT_E_ALL_ZERO;
    *ret_unit = unit;
    return 0;
}

static void compile_reading(const struct fit_data *d, const struct fit_options *o, size_t i,
                            double unit, struct fit_set *s)
{
    double w = root_weight(d, o, i, unit);
    struct brdf_geometry g = brdf_geometry(d->theta_i_rad[i], d->theta_r_rad[i], d->dphi_rad[i]);
    s->tan2_theta[i] = g.tan2_theta;
    s->sin2_beta[i] = g.sin2_beta;
    s->cos2_beta[i] = g.cos2_beta;
    s->spec[i] = w * g.spec_per_sr;
    s->diffuse[i] = w * (o->diffuse == BRDF_DIFFUSE_PAPER ? g.inv_cos_i : 1 / PI);
    s->f[i] = w * d->f_per_sr[i];
    if (s->u)
        s->u[i] = w * d->u_per_sr[i];
}

static void sum_constants(struct fit_set *s)
{
    s->bb = s->ff = 0;
    for (size_t i = 0; i < s->count; i++) {
        s->bb += s->diffuse[i] * s->diffuse[i];
        s->ff += s->f[i] * s->f[i];
    }
}

int set_compile(const struct fit_data *d, const struct fit_options *o, struct fit_control *control,
                struct fit_set *ret_set)
{
    double unit;
    struct fit_set s;
    int e = check_readings(d, o, control, &unit);
    if (e == 0)
        e = set_new(d->count, d->u_per_sr != NULL, &s);
    if (e)
        return e;
    if (o->weighting == FIT_RELATIVE || o->weighting == FIT_VARIANCE)
        s.g_scale = 1 / unit / unit;
    else if (o->weighting == FIT_DENSE)
        s.g_scale = fmax(1, o->dense_g);
    for (size_t i = 0; i < d->count; i++) {
        // Trigonometry: some 100 ns a reading, so the slice is shorter.
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control)) {
            set_free(&s);
            return FIT_E_CANCELED;
        }
        compile_reading(d, o, i, unit, &s);
    }
    sum_constants(&s);
    if (!(s.ff > 0)) { // readings so small that their squares vanish
        set_free(&s);
        return FIT_E_ALL_ZERO;
    }
    *ret_set = s;
    return 0;
}

int set_sample(const struct fit_set *set, size_t count, uint64_t seed, struct fit_control *control,
               struct fit_set *ret_set)
{
    struct fit_set s;
    struct rng rng;
    rng_seed(&rng, seed);
    if (count > set->count)
        count = set->count;
    int e = set_new(count, false, &s);
    if (e)
        return e;
    size_t taken = 0;
    for (size_t i = 0; taken < count; i++) { // selection sampling (Knuth 3.4.2 S)
        if (i % CONTROL_SLICE == 0 && control_ask(control)) {
            set_free(&s);
            return FIT_E_CANCELED;
        }
        if (rng_below(&rng, set->count - i) >= count - taken)
            continue;
        s.tan2_theta[taken] = set->tan2_theta[i];
        s.sin2_beta[taken] = set->sin2_beta[i];
        s.cos2_beta[taken] = set->cos2_beta[i];
        s.spec[taken] = set->spec[i];
        s.diffuse[taken] = set->diffuse[i];
        s.f[taken++] = set->f[i];
    }
    sum_constants(&s);
    *ret_set = s;
    return 0;
}
