// SPDX-License-Identifier: MIT
// What fit/ says in words.
#include "fit/fit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const char *fit_stop_text(int stop)
{
    switch (stop) {
    case FIT_OK: return "fitted";
    case FIT_E_FEW_POINTS: return "fewer than 5 readings: five parameters need at least as many";
    case FIT_E_ALL_ZERO:
        return "every reading is zero, or so small that its square is: eq. 17 has no denominator; "
               "is "
               "this the right column, in sr^-1?";
    case FIT_E_DATA:
        return "a reading that is no finite number or beyond 1e100, an angle outside [0, 90) deg, "
               "an uncertainty "
               "that is not above zero, or a zero reading under relative weights";
    case FIT_E_OPTIONS:
        return "options out of range: bounds need 0 < lower <= upper, variance weights need an "
               "uncertainty for every reading";
    case FIT_E_CANCELED: return "canceled";
    case FIT_E_MEMORY: return "not enough memory";
    default: return "unknown stop code";
    }
}

const char *fit_param_name(enum fit_param p)
{
    static const char *const name[FIT_PARAMS] = {"n", "k", "sigma", "ks", "kd"};
    return p < FIT_PARAMS ? name[p] : "?";
}

static bool held(const struct fit_estimate *e) // by options, not by the data
{
    return e->at_bound && e->u == 0;
}

static int decimals(double x) // that show two digits of x
{
    return 1 - (int)floor(log10(x));
}

// As many digits as fit u, which are two of u, or two of the value where u is above it; no exponent
// where that is short. Four digits where nothing tells u.
static int value_text(double value, double u, char *text, size_t size)
{
    const double large = fabs(value);
    if (!(u > 1e-11 && u < 1e9 && large < 1e9))
        return snprintf(text, size, "%.4g", value);
    const int least = decimals(u), more = large > 1e-11 && large < u ? decimals(large) : least;
    const int shown = more < least + 3 ? more : least + 3;
    return snprintf(text, size, "%.*f", shown > 0 ? shown : 0, value);
}

enum { LIST = 200 };

// ", " between, what does not fit is left out.
static void append(char list[LIST], const char *name, double value, double u)
{
    char text[40], part[80];
    const size_t length = strlen(list);
    value_text(value, u, text, sizeof text);
    const int size = snprintf(part, sizeof part, "%s%s = %s", length ? ", " : "", name, text);
    if (length + (size_t)size < LIST)
        memcpy(list + length, part, (size_t)size + 1);
}

// "n = 0.2, k = 10": of the parameters where `wanted` says so.
static void list(const struct fit_result *r, bool (*wanted)(const struct fit_estimate *e),
                 const enum fit_param *which, int count, char text[LIST])
{
    text[0] = 0;
    for (int i = 0; i < count; i++) {
        const struct fit_estimate *e = &r->estimate[which[i]];
        if (wanted(e))
            append(text, fit_param_name(which[i]), e->value, e->at_bound ? 0 : e->u);
    }
}

static bool unidentified(const struct fit_estimate *e)
{
    return !e->identified && !held(e);
}

static bool identified(const struct fit_estimate *e)
{
    return e->identified;
}

static int measurement_text(const struct fit_advice *a, char *text, size_t size)
{
    const double deg = 57.295779513082321;
    switch (a->what) {
    case FIT_MEASURE_NOTHING:
        return snprintf(text, size, "weights 1/u^2 for the readings there are");
    case FIT_MEASURE_AGAIN: return snprintf(text, size, "the same readings again");
    case FIT_MEASURE_GRAZING:
        return snprintf(text, size, "theta_i from %.0f to %.0f deg", a->first_theta_i_rad * deg,
                        a->last_theta_i_rad * deg);
    case FIT_MEASURE_LASER_SP: return snprintf(text, size, "s- and p-polarised laser");
    case FIT_MEASURE_PARALLEL:
        return snprintf(text, size, "s and p laser, each behind its own analyser");
    case FIT_MEASURE_LINEAR_3X3:
        return snprintf(text, size, "s, p and +45 deg of laser and analyser (3x3 linear block)");
    case FIT_MEASUREMENTS: break;
    }
    return snprintf(text, size, "?");
}

int fit_percent_text(double part, char *text, size_t size)
{
    const int before = part > 0 ? (int)floor(log10(100 * part)) : 0;
    return snprintf(text, size, "%.*f %%", before < 1 ? 1 - before : 0, 100 * part);
}

// The parameter that gains most, of those that are not identified if there are any; none that is
// held.
static int most_helped(const struct fit_result *r, const struct fit_advice *a)
{
    int most = 0;
    double most_gain = -HUGE_VAL;
    for (int i = 0; i < FIT_PARAMS; i++) {
        const double ratio = a->u[i] > 0 ? r->estimate[i].u / a->u[i] : 0;
        if (held(&r->estimate[i]))
            continue;
        const double gain = r->estimate[i].identified ? -1 / (1 + ratio) : ratio;
        if (gain > most_gain) {
            most_gain = gain;
            most = i;
        }
    }
    return most;
}

int fit_advice_text(const struct fit_result *r, int which, char *text, size_t size)
{
    const struct fit_advice *a = &r->advice[which];
    char what[100];
    const int most = most_helped(r, a);
    const struct fit_estimate *e = &r->estimate[most];
    measurement_text(a, what, sizeof what);
    if (e->value > 0 && e->u < 100 * e->value) {
        char now[40], then[40];
        fit_percent_text(e->u / e->value, now, sizeof now);
        fit_percent_text(a->u[most] / e->value, then, sizeof then);
        return snprintf(text, size, "%s: u(%s) %s -> %s", what,
                        fit_param_name((enum fit_param)most), now, then);
    }
    return snprintf(text, size, "%s: u(%s) %.2g -> %.2g", what,
                    fit_param_name((enum fit_param)most), e->u, a->u[most]);
}

// What a lower bound is to physics: 0 is the least of k, ks and kd, and below n = 1 there is
// nothing to find for a paint, so that wider bounds help neither.
static bool at_natural_bound(const struct fit_result *r, int p)
{
    const struct fit_estimate *e = &r->estimate[p];
    const bool n = p == FIT_N && e->value < 1 + 1e-5, zero = p != FIT_SIGMA && e->value < 1e-5;
    return e->at_lower && (n || zero);
}

static int natural_bound_text(const struct fit_result *r, int p, char *text, size_t size)
{
    static const char *const part[FIT_PARAMS] = {
        [FIT_K] = "absorption", [FIT_KS] = "specular part", [FIT_KD] = "diffuse part"};
    const struct fit_estimate *e = &r->estimate[p];
    const char *name = fit_param_name((enum fit_param)p);
    char most[100] = "", number[40];
    if (p == FIT_N)
        return snprintf(text, size,
                        "n = %.4g, its lower bound: the readings want n %s. Wider bounds do not "
                        "help: the model does not describe this sample.",
                        e->value, e->value < 1 - 1e-5 ? "lower still" : "below 1");
    value_text(e->hi95, e->hi95, number, sizeof number);
    if (e->hi95 > e->value)
        snprintf(most, sizeof most, " (%s up to %s is within the 95 %% interval)", name, number);
    return snprintf(text, size, "%s = 0, the least it can be: the readings show no %s%s.", name,
                    part[p], most);
}

// One sentence for the bounds that are somebody's choice, and one for each of nature's.
static int at_bound_text(const struct fit_result *r, char *text, size_t size)
{
    char names[LIST] = "";
    size_t length = 0;
    for (int i = 0; i < FIT_PARAMS; i++) {
        const struct fit_estimate *e = &r->estimate[i];
        if (e->at_bound && !held(e) && !at_natural_bound(r, i))
            append(names, fit_param_name((enum fit_param)i), e->value, 0);
    }
    *text = 0;
    if (*names)
        length = (size_t)snprintf(text, size, "On a bound: %s; widen the bounds or measure more "
                                  "angles.", names);
    for (int i = 0; i < FIT_PARAMS && length < size; i++)
        if (at_natural_bound(r, i)) {
            const char *space = length ? " " : "";
            length += (size_t)snprintf(text + length, size - length, "%s", space);
            length += (size_t)natural_bound_text(r, i, text + length, size - length);
        }
    return (int)length;
}

// What the readings do not tell, what can be used instead, and what would help.
static int not_identified_text(const struct fit_result *r, char *text, size_t size)
{
    static const enum fit_param optical[] = {FIT_N, FIT_K, FIT_KS}, others[] = {FIT_SIGMA, FIT_KD};
    char names[LIST], more[LIST], use[LIST], advice[200] = "";
    list(r, unidentified, optical, 3, names);
    list(r, unidentified, others, 2, more);
    list(r, identified, others, 2, use);
    if (1.96 * r->ks_r45.u <= 0.25 * r->ks_r45.value) // as for a parameter
        append(use, "ks R(45 deg)", r->ks_r45.value, r->ks_r45.u);
    if (r->advice_count > 0 && r->advice[0].gain > FIT_LEAST_GAIN)
        fit_advice_text(r, 0, advice, sizeof advice);
    return snprintf(text, size, "These readings do not separate n, k and ks (%s)%s%s: use %s%s%s.",
                    names, *more ? ", nor do they identify " : "", more,
                    *use ? use : "none of them", *advice ? ". What helps most: " : "", advice);
}

// By which measure the warning came.
static int model_error_text(const struct fit_result *r, char *text, size_t size)
{
    char large[100] = "", smooth[80] = "", signs[120] = "";
    if (r->model_error & FIT_RESIDUALS_LARGE)
        snprintf(large, sizeof large,
                 "larger than noise (chi2 per degree of freedom %.3g with weights 1/u^2)",
                 r->least_chi2_per_dof);
    if (r->model_error & FIT_RESIDUALS_SMOOTH)
        snprintf(smooth, sizeof smooth, "%ssmoother than noise (neighbours correlate by %.2f)",
                 *large ? ", " : "", r->residual_lag1);
    else if (r->model_error & FIT_RESIDUALS_SIGNS)
        snprintf(signs, sizeof signs,
                 "%sof one sign in runs (neighbours share it more often than noise would, by %.1f "
                 "standard deviations)",
                 *large ? ", " : "", r->residual_signs_z);
    return snprintf(text, size,
                    "Residuals are %s%s%s: the intervals hold noise only, not what the model "
                    "cannot follow.",
                    large, smooth, signs);
}

int fit_warning_text(const struct fit_result *r, enum fit_warning w, char *text, size_t size)
{
    switch (w) {
    case FIT_WARN_DHR_ABOVE_ONE:
        return snprintf(
            text, size,
            "The fitted surface reflects more than it receives (directional-hemispherical "
            "reflectance %.3f at 0, %.3f at 45, %.3f at 60 deg): do not extrapolate it%s.",
            r->dhr_0.value, r->dhr_45.value, r->dhr_60.value,
            r->params.kd > 0 ? ", or try the Lambert form of the diffuse part" : "");
    case FIT_WARN_N_BELOW_ONE:
        return snprintf(
            text, size,
            "n = %.3f is below 1, unphysical for a paint or a dielectric: the model does not "
            "describe this sample, or n is not identified; --bounds n=1:8 keeps it "
            "above.",
            r->params.n);
    case FIT_WARN_AT_BOUND: return at_bound_text(r, text, size);
    case FIT_WARN_FEW_SWEEPS:
        return snprintf(
            text, size,
            "Fewer than 3 angles of incidence: reflectance and diffuse part cannot be told "
            "apart reliably; measure more sweeps.");
    case FIT_WARN_NOT_IDENTIFIED: return not_identified_text(r, text, size);
    case FIT_WARN_SCALE:
        return snprintf(
            text, size,
            "The largest reading is %.3g sr^-1, which no surface has: squares of such numbers "
            "leave the range of arithmetic and nothing can be identified; is the unit right?",
            r->largest_per_sr);
    case FIT_WARN_MODEL_ERROR: return model_error_text(r, text, size);
    }
    return snprintf(text, size, "unknown warning %u", (unsigned)w);
}
