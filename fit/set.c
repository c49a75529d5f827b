// SPDX-License-Identifier: MIT
#include "fit/set.h"

#include "fit/pool.h"
#include "fit/repeats.h"
#include "fit/rng.h"
#include "fit/set_rows.h"
#include "model/channel.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
#define EDGE_RAD 1e-9 // the dense zone includes its edges whatever rounding did to them
#define RANGE_LEAST 1024 // readings of a thread's turn

void set_free(struct fit_set *set)
{
    for (int i = 0; i < SET_MEMORY; i++)
        free(set->memory[i]);
    *set = (struct fit_set){.count = 0};
}

// --- checks --------------------------------------------------------------------------------------
static bool state_ok(const unsigned char *state, size_t i)
{
    return !state || state[i] < BRDF_STATES;
}

static bool reading_ok(const struct fit_data *d, const struct fit_options *o, size_t i)
{
    return d->theta_i_rad[i] >= 0 && d->theta_i_rad[i] < PI / 2 && d->theta_r_rad[i] >= 0 &&
           d->theta_r_rad[i] < PI / 2 && isfinite(d->dphi_rad[i]) && state_ok(d->pol_in, i) &&
           state_ok(d->pol_out, i) && fabs(d->f_per_sr[i]) <= FIT_READING_MOST &&
           (!d->u_per_sr || (d->u_per_sr[i] > 0 && d->u_per_sr[i] <= FIT_READING_MOST)) &&
           (o->weighting != FIT_RELATIVE || d->f_per_sr[i] != 0);
}

static enum brdf_state state_at(const unsigned char *state, size_t i)
{
    return state ? (enum brdf_state)state[i] : BRDF_STATE_U;
}

// What readings say as a whole.
struct survey {
    double unit; // the least u (variance weights) or |f| (relative weights), for scaling
    double largest;
    bool polarised, bad;
};

struct compilation {
    const struct fit_data *data;
    const struct fit_options *options;
    double unit;
    struct fit_set *set;
    struct survey part[POOL_PARTS];
};

static void survey_reading(const struct fit_data *d, const struct fit_options *o, size_t i,
                           struct survey *s)
{
    s->bad = s->bad || !reading_ok(d, o, i);
    s->largest = fmax(s->largest, fabs(d->f_per_sr[i]));
    s->polarised = s->polarised || state_at(d->pol_in, i) != BRDF_STATE_U ||
                   state_at(d->pol_out, i) != BRDF_STATE_U;
    if (o->weighting == FIT_RELATIVE)
        s->unit = fmin(s->unit, fabs(d->f_per_sr[i]));
    else if (o->weighting == FIT_VARIANCE && d->u_per_sr)
        s->unit = fmin(s->unit, d->u_per_sr[i]);
}

static bool survey_range(void *ctx, int part, size_t from, size_t to, struct fit_control *control)
{
    struct compilation *c = ctx;
    struct survey s = {.unit = (double)INFINITY};
    for (size_t i = from; i < to; i++) {
        if (i % CONTROL_SLICE == 0 && control_ask(control))
            return false;
        survey_reading(c->data, c->options, i, &s);
    }
    c->part[part] = s;
    return true;
}

static int survey_readings(struct compilation *c, struct fit_control *control,
                           struct survey *ret_survey)
{
    size_t count = c->data->count;
    if (count < FIT_PARAMS)
        return FIT_E_FEW_POINTS;
    if (!pool_ranges(control, count, RANGE_LEAST, survey_range, c))
        return FIT_E_CANCELED;
    struct survey s = {.unit = (double)INFINITY};
    size_t length = pool_range_length(count, RANGE_LEAST);
    for (size_t i = 0; i * length < count; i++) {
        s.unit = fmin(s.unit, c->part[i].unit);
        s.largest = fmax(s.largest, c->part[i].largest);
        s.polarised = s.polarised || c->part[i].polarised;
        s.bad = s.bad || c->part[i].bad;
    }
    *ret_survey = s;
    return s.bad ? FIT_E_DATA : s.largest == 0 ? FIT_E_ALL_ZERO : 0;
}

// --- weights -------------------------------------------------------------------------------------
// sqrt(g) of one reading, scaled: unit is the least u or |f| of the set.
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

static double g_scale_of(const struct fit_options *o, double unit)
{
    switch (o->weighting) {
    case FIT_UNIFORM: return 1;
    case FIT_DENSE: return fmax(1, o->dense_g);
    case FIT_RELATIVE:
    case FIT_VARIANCE: return 1 / unit / unit;
    }
    return 1;
}

// --- compilation ---------------------------------------------------------------------------------
// A reading before its weight is multiplied in.
static void compile_reading(const struct fit_data *d, const struct fit_options *o, size_t i,
                            double unit, struct set_rows *r)
{
    struct brdf_geometry g = brdf_geometry(d->theta_i_rad[i], d->theta_r_rad[i], d->dphi_rad[i]);
    r->tan2_theta[i] = g.tan2_theta;
    r->cos_beta[i] = sqrt(g.cos2_beta);
    r->spec[i] = g.spec_per_sr;
    r->diffuse[i] = o->diffuse == BRDF_DIFFUSE_PAPER ? g.inv_cos_i : 1 / PI;
    r->root_g[i] = root_weight(d, o, i, unit);
    r->f[i] = d->f_per_sr[i] * r->root_g[i];
    if (!r->channel[0])
        return;
    struct brdf_channel c = brdf_channel(&g, state_at(d->pol_in, i), state_at(d->pol_out, i));
    r->diffuse[i] *= c.w_kd;
    r->channel[SET_SS][i] = g.spec_per_sr * c.w_ss;
    r->channel[SET_PP][i] = g.spec_per_sr * c.w_pp;
    r->channel[SET_RE][i] = g.spec_per_sr * c.w_re;
    r->channel[SET_IM][i] = g.spec_per_sr * c.w_im;
}

static bool compile_range(void *ctx, int part, size_t from, size_t to, struct fit_control *control)
{
    const struct compilation *c = ctx;
    struct fit_set *s = c->set;
    (void)part;
    for (size_t i = from; i < to; i++) {
        // Trigonometry: some 100 ns a reading, so the slice is shorter.
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control))
            return false;
        compile_reading(c->data, c->options, i, c->unit, &s->all);
        if (s->u)
            s->u[i] = c->data->u_per_sr[i] * s->all.root_g[i];
    }
    return true;
}

static int find_distinct(struct fit_control *control, struct fit_set *s)
{
    size_t groups;
    s->row = s->memory[2] = malloc(s->count * sizeof *s->row);
    if (!s->row)
        return FIT_E_MEMORY;
    const double *column[SET_ARRAYS];
    int columns = set_rows_geometry(&s->all, column);
    int e = repeats_find(column, columns, s->count, control, s->row, &groups);
    if (e || groups == s->count) {
        s->row = NULL;
        s->distinct = s->all;
        return e;
    }
    e = set_rows_new(groups, s->all.channel[0] != NULL, &s->distinct, &s->memory[1]);
    return e ? e : set_rows_merge(&s->all, s->row, control, &s->distinct);
}

static int compile(struct compilation *c, struct fit_control *control, struct fit_set *s)
{
    c->set = s;
    int e = pool_ranges(control, s->count, RANGE_LEAST, compile_range, c) ? 0 : FIT_E_CANCELED;
    if (e == 0)
        e = find_distinct(control, s);
    if (e == 0)
        e = set_rows_weigh(&s->all, control);
    if (e == 0 && s->row)
        e = set_rows_weigh(&s->distinct, control);
    if (e == 0)
        e = set_revalue(s, control);
    return e ? e : s->ff > 0 ? 0 : FIT_E_ALL_ZERO; // readings so small that their squares vanish
}

int set_compile(const struct fit_data *d, const struct fit_options *o, struct fit_control *control,
                struct fit_set *ret_set)
{
    struct survey survey;
    struct compilation c = {.data = d, .options = o};
    int e = survey_readings(&c, control, &survey);
    if (e)
        return e;
    c.unit = survey.unit;
    struct fit_set s = {.g_scale = g_scale_of(o, survey.unit), .level = batch_best_level()};
    e = set_rows_new(d->count, survey.polarised, &s.all, &s.memory[0]);
    s.count = s.all.count;
    s.padded = s.all.padded;
    if (e == 0 && d->u_per_sr) {
        s.u = s.memory[3] = calloc(s.padded, sizeof *s.u);
        e = s.u ? 0 : FIT_E_MEMORY;
    }
    if (e == 0)
        e = compile(&c, control, &s);
    if (e)
        set_free(&s);
    else
        *ret_set = s;
    return e;
}

// --- values --------------------------------------------------------------------------------------
// sqrt(G) times the weighted mean of each row's readings.
static int mean_values(struct fit_set *s, struct fit_control *control)
{
    double *f = s->distinct.f;
    for (size_t i = 0; i < s->distinct.count; i++)
        f[i] = 0;
    for (size_t i = 0; i < s->count; i++) {
        if (i % CONTROL_SLICE == 0 && control_ask(control))
            return FIT_E_CANCELED;
        f[s->row[i]] += s->all.root_g[i] * s->all.f[i];
    }
    for (size_t i = 0; i < s->distinct.count; i++)
        f[i] /= s->distinct.root_g[i] > 0 ? s->distinct.root_g[i] : 1;
    return 0;
}

static double off_mean(const struct fit_set *s, size_t i)
{
    size_t row = s->row[i];
    double g = s->distinct.root_g[row];
    return g > 0 ? s->all.f[i] - s->all.root_g[i] / g * s->distinct.f[row] : 0;
}

int set_revalue(struct fit_set *s, struct fit_control *control)
{
    if (!s->row)
        s->distinct.f = s->all.f;
    else if (mean_values(s, control))
        return FIT_E_CANCELED;
    s->ff = s->scatter = 0;
    for (size_t i = 0; i < s->count; i++) {
        if (i % CONTROL_SLICE == 0 && control_ask(control))
            return FIT_E_CANCELED;
        double off = s->row ? off_mean(s, i) : 0;
        s->ff += s->all.f[i] * s->all.f[i];
        s->scatter += off * off;
    }
    return 0;
}

int set_replica(const struct fit_set *set, struct fit_set *ret_set)
{
    struct fit_set s = *set;
    for (int i = 0; i < SET_MEMORY; i++)
        s.memory[i] = NULL;
    size_t own = s.padded + (s.row ? s.distinct.padded : 0);
    double *f = s.memory[0] = calloc(own, sizeof *f);
    if (!f)
        return FIT_E_MEMORY;
    s.all.f = f;
    s.distinct.f = s.row ? f + s.padded : f;
    for (size_t i = 0; i < s.count; i++)
        s.all.f[i] = set->all.f[i];
    for (size_t i = 0; i < s.distinct.count; i++)
        s.distinct.f[i] = set->distinct.f[i];
    *ret_set = s;
    return 0;
}

// --- samples -------------------------------------------------------------------------------------
// One row of each of to->count strata of equal length: in order, none twice, and of every stretch
// of the set alike.
static void draw_rows(const struct set_rows *from, struct rng *rng, struct set_rows *to)
{
    for (size_t i = 0; i < to->count; i++) {
        size_t begin = i * from->count / to->count, end = (i + 1) * from->count / to->count;
        set_rows_copy(from, begin + rng_below(rng, end - begin), to, i);
    }
}

int set_sample(const struct fit_set *set, size_t count, uint64_t seed, struct fit_control *control,
               struct fit_set *ret_set)
{
    const struct set_rows *source = &set->distinct;
    struct fit_set s = {.g_scale = set->g_scale, .level = set->level};
    struct rng rng;
    rng_seed(&rng, seed);
    if (count > source->count)
        count = source->count;
    int e = set_rows_new(count, source->channel[0] != NULL, &s.all, &s.memory[0]);
    if (e)
        return e;
    draw_rows(source, &rng, &s.all);
    s.count = s.all.count;
    s.padded = s.all.padded;
    s.distinct = s.all;
    e = set_revalue(&s, control);
    if (e)
        set_free(&s);
    else
        *ret_set = s;
    return e;
}
