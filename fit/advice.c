// SPDX-License-Identifier: MIT
#include "fit/advice.h"

#include "fit/noise.h"
#include "fit/reading.h"

#include <math.h>
#include <string.h>

enum { N = FIT_PARAMS, DIRECTIONS = 600 };
#define PI 3.14159265358979323846
#define RAD (PI / 180)
#define GRAZING_MOST_DEG 80
#define GRAZING_STEP_DEG 5

static size_t stride_of(size_t count, size_t most)
{
    return (count + most - 1) / most;
}

// --- information ---------------------------------------------------------------------------------

void advice_information(const struct advice_plan *plan, const double x[N],
                        enum brdf_diffuse diffuse, const struct noise *noise, double ret[N][N])
{
    memset(ret, 0, N * sizeof *ret);
    for (size_t i = 0; i < plan->count; i++) {
        struct brdf_geometry g =
            brdf_geometry(plan->theta_i_rad[i], plan->theta_r_rad[i], plan->dphi_rad[i]);
        struct reading_direction at = reading_direction(&g, x);
        for (int k = 0; k < plan->channels; k++) {
            struct brdf_channel c = brdf_channel(&g, plan->in[k], plan->out[k]);
            double j[N], f = reading_jacobian(&at, &c, x, diffuse, j);
            double u = noise_u(noise, f);
            for (int p = 0; p < N && u > 0; p++)
                for (int q = 0; q < N; q++)
                    ret[p][q] += j[p] / u * (j[q] / u);
        }
    }
}

// --- candidates ----------------------------------------------------------------------------------

struct directions {
    size_t count;
    double ti[DIRECTIONS], tr[DIRECTIONS], dphi[DIRECTIONS];
};

static void add_direction(struct directions *d, double ti, double tr, double dphi)
{
    if (d->count == DIRECTIONS)
        return;
    d->ti[d->count] = ti;
    d->tr[d->count] = tr;
    d->dphi[d->count++] = dphi;
}

static struct directions as_measured(const struct fit_data *data)
{
    struct directions d = {.count = 0};
    for (size_t i = 0; i < data->count; i += stride_of(data->count, DIRECTIONS))
        add_direction(&d, data->theta_i_rad[i], data->theta_r_rad[i], data->dphi_rad[i]);
    return d;
}

static double largest(const double *values, size_t count)
{
    double most = 0;
    for (size_t i = 0; i < count; i++)
        most = fmax(most, values[i]);
    return most;
}

// Sweeps in the plane of incidence: every 2.5 deg, every degree within 5 deg of specular.
static struct directions grazing(const struct fit_data *data, struct fit_advice *advice)
{
    struct directions d = {.count = 0};
    double from_deg = largest(data->theta_i_rad, data->count) / RAD, first_deg;
    double reach_deg =
        fmin(85, floor(largest(data->theta_r_rad, data->count) / RAD * 2 + 0.01) / 2);
    first_deg =
        GRAZING_STEP_DEG * floor(from_deg / GRAZING_STEP_DEG + 1.2); // a degree further at least
    for (double ti = first_deg; ti <= GRAZING_MOST_DEG; ti += GRAZING_STEP_DEG) {
        for (double tr = -reach_deg; tr <= reach_deg; tr += 0.5) {
            bool coarse = fabs(remainder(tr, 2.5)) < 0.01;
            bool dense = fabs(tr - ti) < 5.01 && fabs(remainder(tr, 1)) < 0.01;
            if ((coarse || dense) && fabs(tr + ti) > 0.01)
                add_direction(&d, ti * RAD, fabs(tr) * RAD, tr < 0 ? 0 : PI);
        }
        advice->last_theta_i_rad = ti * RAD;
    }
    advice->first_theta_i_rad = first_deg * RAD;
    return d;
}

static const struct candidate {
    const char *name;
    int channels; // 0: those of the data
    enum brdf_state in[ADVICE_CHANNELS], out[ADVICE_CHANNELS];
} candidates[FIT_MEASUREMENTS] = {
    [FIT_MEASURE_NOTHING] = {"nothing", 0, {BRDF_STATE_U}, {BRDF_STATE_U}},
    [FIT_MEASURE_AGAIN] = {"again", 0, {BRDF_STATE_U}, {BRDF_STATE_U}},
    [FIT_MEASURE_GRAZING] = {"grazing", 0, {BRDF_STATE_U}, {BRDF_STATE_U}},
    [FIT_MEASURE_LASER_SP] = {"laser_sp",
                              2,
                              {BRDF_STATE_S, BRDF_STATE_P},
                              {BRDF_STATE_U, BRDF_STATE_U}},
    [FIT_MEASURE_PARALLEL] = {"parallel_sp",
                              2,
                              {BRDF_STATE_S, BRDF_STATE_P},
                              {BRDF_STATE_S, BRDF_STATE_P}},
    [FIT_MEASURE_LINEAR_3X3] = {"linear_3x3",
                                9,
                                {BRDF_STATE_S, BRDF_STATE_S, BRDF_STATE_S, BRDF_STATE_P,
                                 BRDF_STATE_P, BRDF_STATE_P, BRDF_STATE_PLUS45, BRDF_STATE_PLUS45,
                                 BRDF_STATE_PLUS45},
                                {BRDF_STATE_S, BRDF_STATE_P, BRDF_STATE_PLUS45, BRDF_STATE_S,
                                 BRDF_STATE_P, BRDF_STATE_PLUS45, BRDF_STATE_S, BRDF_STATE_P,
                                 BRDF_STATE_PLUS45}},
};

const char *fit_measurement_name(enum fit_measurement m)
{
    return m < FIT_MEASUREMENTS ? candidates[m].name : "?";
}

// The different channels in the data.
static void channels_of(const struct fit_data *d, struct advice_plan *plan)
{
    plan->channels = 0;
    for (size_t i = 0; i < d->count && plan->channels < ADVICE_CHANNELS; i++) {
        enum brdf_state in = reading_state(d->pol_in, i), out = reading_state(d->pol_out, i);
        bool is_new = true;
        for (int k = 0; k < plan->channels; k++)
            is_new = is_new && (plan->in[k] != in || plan->out[k] != out);
        if (is_new) {
            plan->in[plan->channels] = in;
            plan->out[plan->channels++] = out;
        }
        if (!d->pol_in && !d->pol_out)
            break;
    }
}

// All channels of the candidate are in the data: it is FIT_MEASURE_AGAIN under another name.
static bool measured_already(const struct candidate *c, const struct advice_plan *data)
{
    bool all = c->channels > 0;
    for (int k = 0; k < c->channels; k++) {
        bool found = false;
        for (int i = 0; i < data->channels; i++)
            found = found || (data->in[i] == c->in[k] && data->out[i] == c->out[k]);
        all = all && found;
    }
    return all;
}

static double u_of_coordinate(int i, const double x[N], double variance)
{
    double spread = sqrt(variance);
    return i == FIT_K       ? sqrt(x[i] + spread) - sqrt(x[i])
           : i == FIT_SIGMA ? exp(x[i]) * spread
                            : spread;
}

struct question {
    const struct fit_data *data;
    const struct fit_options *options;
    const struct covariance *cov;
    struct noise noise;
    double x[N];
    const struct fit_result *result;
};

// u then, and the gain over u now.
static void answer(const struct question *q, const double added[N][N], struct fit_advice *a)
{
    struct fit_space space = space_of_options(q->options);
    double sum[N][N], c[N][N], gain = 0, free = 0;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            sum[i][j] =
                (a->what == FIT_MEASURE_NOTHING ? 0 : q->cov->information[i][j]) + added[i][j];
    covariance_combine(sum, &space, c);
    for (int i = 0; i < N; i++) {
        double scale = i >= FIT_KS && !q->cov->known[i] ? q->options->u_scale * q->x[i] : 0;
        a->u[i] = u_of_coordinate(i, q->x, c[i][i] + scale * scale);
        if (a->u[i] > 0 && q->result->estimate[i].u > 0) {
            gain += log(q->result->estimate[i].u / a->u[i]);
            free++;
        }
    }
    a->gain = free > 0 ? gain / free : 0;
}

// False when there is nothing to be measured.
static bool consider(const struct question *q, enum fit_measurement what, struct fit_advice *a)
{
    const struct candidate *candidate = &candidates[what];
    struct advice_plan plan;
    double added[N][N];
    *a = (struct fit_advice){.what = what};
    struct directions d = what == FIT_MEASURE_GRAZING ? grazing(q->data, a) : as_measured(q->data);
    plan.count = d.count;
    plan.theta_i_rad = d.ti;
    plan.theta_r_rad = d.tr;
    plan.dphi_rad = d.dphi;
    channels_of(q->data, &plan);
    if (plan.count == 0 || measured_already(candidate, &plan))
        return false;
    if (candidate->channels > 0) {
        plan.channels = candidate->channels;
        memcpy(plan.in, candidate->in, sizeof plan.in);
        memcpy(plan.out, candidate->out, sizeof plan.out);
    }
    advice_information(&plan, q->x, q->options->diffuse, &q->noise, added);
    double effort = (double)q->data->count / (double)plan.count / plan.channels;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            added[i][j] *= effort;
    answer(q, added, a);
    return isfinite(a->gain);
}

bool advise(const struct fit_data *data, const struct fit_options *options,
            const struct covariance *cov, struct fit_control *control, struct fit_result *r)
{
    struct question q = {.data = data, .options = options, .cov = cov, .result = r};
    r->advice_count = 0;
    r->advice_readings = data->count;
    for (int i = 0; i < N; i++)
        if (isnan(cov->c[i][i]))
            return true;
    space_of_params(&r->params, q.x);
    q.noise = noise_of(data, options->diffuse, q.x);
    if (!(q.noise.relative + q.noise.floor_per_sr > 0))
        return true;
    for (int what = 0; what < FIT_MEASUREMENTS; what++) {
        struct fit_advice a;
        if (control_ask(control))
            return false;
        if (what == FIT_MEASURE_NOTHING && options->weighting == FIT_VARIANCE)
            continue;
        if (!consider(&q, (enum fit_measurement)what, &a))
            continue;
        int place = r->advice_count++;
        for (; place > 0 && r->advice[place - 1].gain < a.gain; place--)
            r->advice[place] = r->advice[place - 1];
        r->advice[place] = a;
    }
    return true;
}
