// SPDX-License-Identifier: MIT
// The inversion: from readings f(theta_i, theta_r, dphi) to (n, k, sigma, ks, kd), with
// uncertainties and with what the data cannot tell. This header is all that other layers need of
// fit/.
//
// Units: radians and sr^-1. No I/O, no log; threads only within a call, when options ask for more
// than one. The callbacks in options are called by the calling thread alone. Arrays in
// fit_data are borrowed for the duration of the call. Same data, options and seed give the same
// result, to the bit. Thread: any; calls share nothing.
#pragma once
#include "model/brdf.h"
#include "model/state.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum fit_param { FIT_N, FIT_K, FIT_SIGMA, FIT_KS, FIT_KD, FIT_PARAMS };

enum fit_method {
    FIT_MEMETIC, // variable projection for ks and kd, search in (n, sqrt k, log sigma), LM polish
                 // in k^2
    FIT_PAPER    // the paper's binary genetic algorithm, for comparison
};

enum fit_weighting {
    FIT_UNIFORM, // g = 1
    FIT_DENSE, // g = dense_g where |theta_r - theta_i| <= dense_half_width, edges included; else 1
                 // (theta_r counts as negative on the backward half, cos dphi >= 0)
    FIT_RELATIVE, // g = 1/f^2; no reading may be zero
    FIT_VARIANCE  // g = 1/u^2
};

struct fit_data {
    size_t count;
    const double *theta_i_rad; // [0, pi/2)
    const double *theta_r_rad; // [0, pi/2), unsigned
    const double *dphi_rad;    // phi_r - phi_i; pi = specular half plane
    const double *f_per_sr;
    const double *u_per_sr; // type A, uncorrelated, standard uncertainty, > 0; NULL when unknown
    // enum brdf_state of the light and of the analyser (model/channel.h says what f is then), in
    // any mixture: all channels are fitted jointly. NULL: unpolarised, no analyser.
    const unsigned char *pol_in, *pol_out;
};

enum fit_mutation {
    FIT_MUTATE_BIT,       // each bit with probability pm
    FIT_MUTATE_INDIVIDUAL // one bit, chosen at random, of each individual with probability pm
};

enum fit_scaling {
    FIT_SCALING_NONE,  // fitness is 1/Delta
    FIT_SCALING_LINEAR // and then a straight line of it: the mean stays, the best is twice the mean
};

// pc, pm and generations are the paper's; it leaves the others open, their defaults are ours
// (fit_options_default).
struct fit_paper_options {
    int population;  // 100; even, 4..10000
    int bits;        // per gene, 20; 4..30
    int generations; // 1000; 0..FIT_GENERATIONS_MOST
    double pc;       // crossover probability 0.5
    double pm;       // mutation probability 0.05
    enum fit_mutation mutation; // FIT_MUTATE_BIT
    enum fit_scaling scaling;   // FIT_SCALING_NONE
    bool elitism;               // false; true: the best individual lives on unchanged
};

#define FIT_GENERATIONS_MOST 1000000
#define FIT_DENSE_MOST 1e12
#define FIT_READING_MOST 1e100 // of |f| and u: beyond it squares overflow

struct fit_options {
    enum fit_method method;
    enum fit_weighting weighting;
    double dense_g; // above 0, up to FIT_DENSE_MOST
    double dense_half_width_rad;
    enum brdf_diffuse diffuse;
    // Bounds, inclusive, within fit_param_range; equal ones hold a parameter.
    struct brdf_params lower, upper;
    uint64_t seed;
    int threads; // 1..64, the calling one among them: same result to the bit, whatever it is
    double u_scale; // type B: relative standard uncertainty of a scale common to all readings
    int bootstrap;  // replicas, 0..100000; 0: none (fit/bootstrap.h says which kind)
    struct fit_paper_options paper;
    bool (*canceled)(void *ctx); // NULL: never; asked every 1-2 ms of work at any size
    void *cancel_ctx;
    void (*trace)(void *ctx, int generation, double best_delta, double mean_delta); // NULL: none
    void *trace_ctx;
};

// u and the intervals hold what noise does, for any weights: from u_per_sr where it is known,
// else from the residuals (robust against unequal variances). They hold nothing of what the model
// cannot follow. On a bound: all five parameters stay free in the covariance, each with its bounds
// as weak prior knowledge (fit/covariance.h), so that u of sigma, kd, ks_r0 and ks_r45 stays what
// it is and u of a parameter that the data do not identify is at most half the bounds' distance
// (for k by way of k^2). A held parameter has u = 0 and lo95 = hi95 = value. NAN
// for u, lo95, hi95, correlation and derived u when there are no u_per_sr and no more readings than
// free parameters: nothing tells noise then.
struct fit_estimate {
    double value;
    double u;          // standard uncertainty: sandwich covariance, and u_scale where it applies
    double lo95, hi95; // profile likelihood, all five parameters free; widened by u_scale where it
                       // applies; within the bounds
    bool identified;   // not on a bound, and [lo95, hi95] within +-25 % of the value
    bool at_bound;     // within 1e-6 of the bounds' distance and 1 % of u
    bool at_lower;     // and that is the lower bound; equal bounds, which hold it: false
};

struct fit_derived {
    double value, u;
};

struct fit_spread {
    double u, lo95, hi95; // standard deviation and bias-corrected percentiles of the replicas
};

// Noise, and u_scale where it applies. NAN throughout when replicas is 0.
struct fit_bootstrap {
    int replicas;
    bool parametric; // noise drawn from u_per_sr; false: the residuals with random signs
    struct fit_spread param[FIT_PARAMS], ks_r0, ks_r45;
};

// What might be measured next (fit/advice.h).
enum fit_measurement {
    FIT_MEASURE_NOTHING,  // no further reading, but the weights 1/u^2 for those there are
    FIT_MEASURE_AGAIN,     // the same readings once more: what the others are compared with
    FIT_MEASURE_GRAZING,   // sweeps at larger theta_i, up to 80 deg
    FIT_MEASURE_LASER_SP,  // s- and p-polarised laser, no analyser
    FIT_MEASURE_PARALLEL,  // s laser behind an s analyser, and p behind p
    FIT_MEASURE_LINEAR_3X3, // s, p and +45 deg of laser and analyser: nine channels
    FIT_MEASUREMENTS
};

#define FIT_LEAST_GAIN 0.05 // of advice worth a sentence
struct fit_advice {
    enum fit_measurement what;
    double u[FIT_PARAMS]; // that the parameters would have then, as in fit_estimate.u
    double gain;          // mean of log(u now / u then) over the free parameters
    double first_theta_i_rad, last_theta_i_rad; // FIT_MEASURE_GRAZING: of the new sweeps
};

enum fit_warning {
    FIT_WARN_DHR_ABOVE_ONE = 1 << 0, // the fitted surface reflects more than it receives
    FIT_WARN_N_BELOW_ONE = 1 << 1,   // unphysical for a paint or a dielectric
    FIT_WARN_AT_BOUND = 1 << 2,
    FIT_WARN_FEW_SWEEPS = 1 << 3,     // fewer than 3 different theta_i
    FIT_WARN_NOT_IDENTIFIED = 1 << 4, // f_00 alone does not separate n, k and ks
    FIT_WARN_SCALE = 1 << 6,      // the largest reading is below 1e-60 or above 1e30 sr^-1
    FIT_WARN_MODEL_ERROR = 1 << 5 // residuals larger (chi2, with u_per_sr) or smoother than noise
};

// What FIT_WARN_MODEL_ERROR was raised by.
enum fit_model_error {
    FIT_RESIDUALS_LARGE = 1 << 0,  // least_chi2_per_dof
    FIT_RESIDUALS_SMOOTH = 1 << 1, // residual_lag1
    FIT_RESIDUALS_SIGNS = 1 << 2   // residual_signs_z: runs of one sign, which no outlier can sway
};

// FIT_PAPER reports params, delta and u of what its algorithm ended with; lo95 and hi95 belong to
// the data and so to the optimum next to it, and need not include it.
struct fit_result {
    struct brdf_params params;
    double delta; // eq. 17 with the weights given, at params
    struct fit_estimate estimate[FIT_PARAMS];
    struct fit_derived ks_r0, ks_r45; // ks times mean Fresnel reflectance at beta = 0 and 45 deg
    struct fit_derived dhr_0, dhr_45, dhr_60; // directional-hemispherical reflectance of the fit
    double correlation[FIT_PARAMS][FIT_PARAMS];
    double chi2_per_dof;    // NAN without u_per_sr
    struct fit_bootstrap bootstrap;
    struct fit_advice advice[FIT_MEASUREMENTS]; // the most helpful first
    int advice_count;                           // 0: nothing tells noise
    size_t advice_readings;                     // that each but FIT_MEASURE_NOTHING would add
    // Autocorrelation of neighbouring residuals within a sweep, each divided by its noise, at the
    // fit with weights 1/noise^2; NAN: none.
    double residual_lag1;
    // How many standard deviations more neighbours share a sign there than half of them.
    double residual_signs_z;
    double least_chi2_per_dof; // at the fit with weights 1/u^2; NAN without u_per_sr
    unsigned model_error;      // of fit_model_error; 0 without FIT_WARN_MODEL_ERROR
    double largest_per_sr; // reading, without its sign
    unsigned warnings;      // of fit_warning
    long evaluations;       // of the whole data set
    double elapsed_ms;       // search and polish
    double elapsed_total_ms; // with uncertainties
};

// Negative: nothing was fitted. fit_stop_text says it in words.
enum fit_stop {
    FIT_OK = 0,
    FIT_E_FEW_POINTS = -1, // fewer points than parameters
    FIT_E_ALL_ZERO = -2,   // eq. 17 has no denominator
    FIT_E_DATA =
        -3, // a NAN or infinite value, theta outside [0, pi/2), u <= 0, f = 0 when relative, a
            // state that does not exist
    FIT_E_OPTIONS = -4, // empty or negative bounds, variance weighting without u, ...
    FIT_E_CANCELED = -5,
    FIT_E_MEMORY = -6
};

struct fit_options
fit_options_default(void); // memetic, uniform, paper's diffuse, bounds of the manual, seed 1
int fit_run(const struct fit_data *data, const struct fit_options *options,
            struct fit_result *ret_result);
const char *fit_stop_text(int stop);
const char *fit_param_name(enum fit_param p); // "n", "k", "sigma", "ks", "kd"

// What bounds may be: least <= lower <= upper <= most.
void fit_param_range(enum fit_param p, double *ret_least, double *ret_most);

// One sentence a person can act on, for one bit of result->warnings; the numbers are in it.
// Returns the length that snprintf would.
int fit_warning_text(const struct fit_result *r, enum fit_warning w, char *text, size_t size);

// What of the `which`-th advice a person needs: "s- and p-polarised laser: u(n) 141 % -> 33 %", for
// the parameter that gains most. Returns the length that snprintf would.
int fit_advice_text(const struct fit_result *r, int which, char *text, size_t size);
// "550 %", "3.9 %", "0.018 %": two digits, and no exponent where a person reads. As snprintf.
int fit_percent_text(double part, char *text, size_t size);
const char *fit_measurement_name(enum fit_measurement m); // "nothing", "again", "grazing", ...

// How well parameters describe readings that were held out of the fit. A negative fit_stop on fewer
// than five readings, bad data or options.
struct fit_validation {
    size_t points;
    double delta;          // eq. 17 with the weights given
    double chi2_per_point; // sum (r/u)^2 / points, about 1 where only noise is left; NAN without u
    double rms_relative;   // root mean square of (f - model)/model
};
int fit_validate(const struct fit_data *data, const struct fit_options *options,
                 const struct brdf_params *p, struct fit_validation *ret_validation);

// Eq. 17 at given parameters: sum g (model - f)^2 / sum g f^2; NAN outside the model's domain.
// Bounds are checked but p need not lie within them. Negative fit_stop on bad data.
int fit_delta(const struct fit_data *data, const struct fit_options *options,
              const struct brdf_params *p, double *ret_delta);
