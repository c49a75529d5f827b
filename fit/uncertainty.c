// SPDX-License-Identifier: MIT
#include "fit/uncertainty.h"

#include "fit/advice.h"
#include "fit/bootstrap.h"
#include "fit/covariance.h"
#include "fit/kernel.h"
#include "fit/objective.h"
#include "fit/profile.h"
#include "fit/residuals.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define Z95 1.959963984540054
#define ON_BOUND 1e-6     // of the bounds' distance
#define ON_BOUND_U 0.01   // of u
#define ROUNDS 8
#define LEAST_READING 1e-60 // fourth powers of readings stay in the range of doubles
#define MOST_READING 1e30

static double *param_of(struct brdf_params *p, int i)
{
    double *member[FIT_PARAMS] = {&p->n, &p->k, &p->sigma, &p->ks, &p->kd};
    return member[i];
}

// exp(log(bound)) may miss the bound by an ulp.
static struct brdf_params within_bounds(const double x[FIT_PARAMS], const struct fit_options *o)
{
    struct brdf_params p = space_params(x), low = o->lower, high = o->upper;
    for (int i = 0; i < FIT_PARAMS; i++)
        *param_of(&p, i) = fmin(fmax(*param_of(&p, i), *param_of(&low, i)), *param_of(&high, i));
    return p;
}

static double u_of_param(const struct covariance *cov, const double x[FIT_PARAMS], int i)
{
    double spread = sqrt(cov->c[i][i]);
    switch (i) {
    case FIT_K: return sqrt(x[i] + spread) - sqrt(x[i]);
    case FIT_SIGMA: return exp(x[i]) * spread;
    default: return spread;
    }
}

// A scale common to all readings is in ks and kd alike (type B): fully correlated, relative.
static void add_scale(struct covariance *cov, const double x[FIT_PARAMS], double u_scale)
{
    for (int i = FIT_KS; i <= FIT_KD; i++)
        for (int j = FIT_KS; j <= FIT_KD; j++)
            if (!cov->known[i] && !cov->known[j])
                cov->c[i][j] += u_scale * u_scale * x[i] * x[j];
}

static void fill_correlation(const struct covariance *cov, struct fit_result *r)
{
    for (int i = 0; i < FIT_PARAMS; i++)
        for (int j = 0; j < FIT_PARAMS; j++) {
            double norm = sqrt(cov->c[i][i] * cov->c[j][j]);
            r->correlation[i][j] = i == j ? 1 : norm > 0 ? cov->c[i][j] / norm : 0 * norm;
        }
}

static struct fit_derived ks_reflectance(const struct covariance *cov, const struct brdf_params *p,
                                         double beta_rad)
{
    double s2 = sin(beta_rad) * sin(beta_rad), f[3];
    kernel_fresnel(p->n, p->k * p->k, s2, 1 - s2, f);
    double gradient[FIT_PARAMS] = {p->ks * f[1], p->ks * f[2], 0, f[0], 0};
    return (struct fit_derived){p->ks * f[0], covariance_u(cov, gradient)};
}

static bool move(double x[FIT_PARAMS], const double axis[FIT_PARAMS], double t)
{
    for (int i = 0; i < FIT_PARAMS; i++)
        x[i] += t * axis[i];
    return x[FIT_N] > 0 && x[FIT_K] >= 0 && x[FIT_KS] >= 0 && x[FIT_KD] >= 0;
}

static double dhr_at(const double x[FIT_PARAMS], enum brdf_diffuse diffuse, double theta_i_rad)
{
    struct brdf_params p = space_params(x);
    return brdf_dhr(&p, diffuse, theta_i_rad);
}

// Along each axis of the covariance by a small part of it (at most 2 % of a parameter), so that the
// long, compensating changes of n, k and ks cancel in the parameters and not between large
// derivatives.
static double dhr_slope(const double x[FIT_PARAMS], const double axis[FIT_PARAMS], double centre,
                        enum brdf_diffuse diffuse, double theta_i_rad)
{
    double size = fmax(fmax(fabs(axis[FIT_N]) / x[FIT_N], fabs(axis[FIT_K]) / (1 + x[FIT_K])),
                       fabs(axis[FIT_SIGMA]));
    double t = 0.02 / fmax(size, 0.2), up[FIT_PARAMS], down[FIT_PARAMS];
    memcpy(up, x, sizeof up);
    memcpy(down, x, sizeof down);
    bool upward = move(up, axis, t), downward = move(down, axis, -t);
    double high = upward ? dhr_at(up, diffuse, theta_i_rad) : centre;
    double low = downward ? dhr_at(down, diffuse, theta_i_rad) : centre;
    return upward || downward ? (high - low) / (t * (upward + downward)) : 0;
}

// Each reflectance is some 0.2 ms of quadrature.
static struct fit_derived dhr(const struct covariance *cov, const struct brdf_params *p,
                              enum brdf_diffuse diffuse, double theta_i_rad,
                              struct fit_control *control)
{
    double axis[FIT_PARAMS][FIT_PARAMS], x[FIT_PARAMS], sum = 0;
    double centre = brdf_dhr(p, diffuse, theta_i_rad);
    space_of_params(p, x);
    for (int i = 0; i < FIT_PARAMS; i++)
        if (isnan(cov->c[i][i]))
            return (struct fit_derived){centre, (double)NAN};
    covariance_axes(cov, axis);
    for (int i = 0; i < FIT_PARAMS && !control_ask(control); i++) {
        double slope = dhr_slope(x, axis[i], centre, diffuse, theta_i_rad);
        sum += slope * slope;
    }
    return (struct fit_derived){centre, sqrt(sum)};
}

// On the bound, and not only near it by the measure of bounds far apart.
static bool touches(double distance, double width, double u)
{
    return distance <= ON_BOUND * width && !(distance > ON_BOUND_U * u);
}

// The intervals belong to the optimum `top`, which the reported x need not be (FIT_PAPER).
static void fill_estimates(const struct fit_options *o, const struct covariance *cov,
                           const double x[FIT_PARAMS], const double top[FIT_PARAMS],
                           const struct profile profile[FIT_PARAMS], struct fit_result *r)
{
    struct brdf_params low = o->lower, high = o->upper, centre = within_bounds(top, o);
    for (int i = 0; i < FIT_PARAMS; i++) {
        struct fit_estimate *e = &r->estimate[i];
        double l = *param_of(&low, i), h = *param_of(&high, i), v = *param_of(&r->params, i);
        *e = (struct fit_estimate){.value = v, .u = u_of_param(cov, x, i)};
        double scale = i >= FIT_KS && !cov->known[i] ? Z95 * o->u_scale * v : 0;
        double c = *param_of(&centre, i);
        e->lo95 = fmax(l, c - hypot(c - profile[i].lo95, scale));
        e->hi95 = fmin(h, c + hypot(profile[i].hi95 - c, scale));
        if (isnan(profile[i].lo95 + profile[i].hi95))
            e->lo95 = e->hi95 = (double)NAN;
        e->at_bound = touches(v - l, h - l, e->u) || touches(h - v, h - l, e->u);
        e->at_lower = e->at_bound && v - l < h - v;
        // No width is no knowledge: a curvature that vanished, or numbers that underflowed.
        e->identified = !e->at_bound && e->u > 0 && e->lo95 < e->hi95 && e->lo95 >= 0.75 * v &&
                        e->hi95 <= 1.25 * v;
    }
}

static double largest(const struct fit_data *d)
{
    double most = 0;
    for (size_t i = 0; i < d->count; i++)
        most = fmax(most, fabs(d->f_per_sr[i]));
    return most;
}

// Chance does these once in 1,000,000, in 10,000 and in 1000 fits.
static unsigned model_error(const struct residuals *res, double chi2_per_dof, double dof)
{
    unsigned all = 0;
    if (chi2_per_dof > 1 + 5 * sqrt(2 / dof))
        all |= FIT_RESIDUALS_LARGE;
    if (res->z > 3.7 && res->lag1 > 0.1)
        all |= FIT_RESIDUALS_SMOOTH;
    if (res->signs_z > 3.1)
        all |= FIT_RESIDUALS_SIGNS;
    return all;
}

static void fill_warnings(const struct fit_options *o, const struct residuals *res, double dof,
                          struct fit_result *r)
{
    struct brdf_params low = o->lower, high = o->upper;
    if (r->dhr_0.value > 1 || r->dhr_45.value > 1 || r->dhr_60.value > 1)
        r->warnings |= FIT_WARN_DHR_ABOVE_ONE;
    if (r->params.n < 1)
        r->warnings |= FIT_WARN_N_BELOW_ONE;
    for (int i = 0; i < FIT_PARAMS; i++) {
        bool held = !(*param_of(&low, i) < *param_of(&high, i)); // by options, not by the data
        if (!held && r->estimate[i].at_bound)
            r->warnings |= FIT_WARN_AT_BOUND;
        if (!held && !r->estimate[i].identified && (i == FIT_N || i == FIT_K || i == FIT_KS))
            r->warnings |= FIT_WARN_NOT_IDENTIFIED;
    }
    if (!(r->largest_per_sr >= LEAST_READING && r->largest_per_sr <= MOST_READING))
        r->warnings |= FIT_WARN_SCALE;
    if (res->sweeps < 3)
        r->warnings |= FIT_WARN_FEW_SWEEPS;
    r->model_error = model_error(res, r->least_chi2_per_dof, dof);
    if (r->model_error)
        r->warnings |= FIT_WARN_MODEL_ERROR;
}

// Covariance and profiles at *top, made again while a profile finds a lower place; where that has
// no end, nothing is said of intervals.
static bool explore(const struct fit_set *set, const struct fit_space *space,
                    struct fit_control *control, struct fit_optimum *top, struct covariance *cov,
                    struct profile profile[FIT_PARAMS])
{
    for (int round = 0; round < ROUNDS; round++) {
        bool better = false;
        if (!covariance_at(set, space, top->x, control, cov) ||
            !profile_intervals(set, space, cov, control, top, profile, &better))
            return false;
        if (!better)
            return true;
    }
    for (int i = 0; i < FIT_PARAMS; i++)
        profile[i] = (struct profile){(double)NAN, (double)NAN};
    return covariance_at(set, space, top->x, control, cov);
}

int uncertainty_estimate(const struct fit_data *data, const struct fit_set *set,
                         const struct fit_options *options, struct fit_control *control,
                         struct fit_optimum *optimum, struct fit_result *ret_result)
{
    struct fit_result r = *ret_result;
    struct fit_space space = space_of_options(options);
    struct fit_optimum top = *optimum;
    struct covariance cov;
    struct profile profile[FIT_PARAMS];
    struct residuals res;
    // The paper's algorithm stops short of an optimum: likelihoods belong to the optimum next to
    // it, the covariance to what it reports.
    if (options->method == FIT_PAPER && !polish(set, &space, 200, control, &top))
        return FIT_E_CANCELED;
    if (!explore(set, &space, control, &top, &cov, profile))
        return FIT_E_CANCELED;
    int stop = bootstrap_run(set, options, &top, &cov, control, &r.bootstrap);
    if (stop)
        return stop;
    if (options->method == FIT_MEMETIC)
        *optimum = top;
    else if (!covariance_at(set, &space, optimum->x, control, &cov))
        return FIT_E_CANCELED;
    r.params = within_bounds(optimum->x, options);
    stop = objective_delta(set, &r.params, control, &r.delta);
    if (!stop)
        stop = residuals_study(data, set, options, &r.params, &top, control, &res);
    if (stop)
        return stop;
    double x[FIT_PARAMS];
    space_of_params(&r.params, x);
    add_scale(&cov, x, options->u_scale);
    fill_estimates(options, &cov, x, top.x, profile, &r);
    fill_correlation(&cov, &r);
    if (!advise(data, options, &cov, control, &r))
        return FIT_E_CANCELED;
    r.ks_r0 = ks_reflectance(&cov, &r.params, 0);
    r.ks_r45 = ks_reflectance(&cov, &r.params, PI / 4);
    r.dhr_0 = dhr(&cov, &r.params, options->diffuse, 0, control);
    r.dhr_45 = dhr(&cov, &r.params, options->diffuse, PI / 4, control);
    r.dhr_60 = dhr(&cov, &r.params, options->diffuse, PI / 3, control);
    if (control->stop)
        return FIT_E_CANCELED;
    r.chi2_per_dof = cov.dof >= 1 ? res.chi2 / cov.dof : (double)NAN;
    r.least_chi2_per_dof = cov.dof >= 1 ? res.least_chi2 / cov.dof : (double)NAN;
    r.residual_lag1 = res.lag1;
    r.residual_signs_z = res.signs_z;
    r.largest_per_sr = largest(data);
    fill_warnings(options, &res, cov.dof, &r);
    *ret_result = r;
    return 0;
}
