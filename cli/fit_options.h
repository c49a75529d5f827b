// SPDX-License-Identifier: MIT
// The options of `gonio fit` as text and what they mean for the fit.
#pragma once
#include "base/err.h"
#include "fit/fit.h"

enum { FIT_MOST_ANGLES = 64, FIT_LEAST_REPLICAS = 40, FIT_MOST_REPLICAS = 100000 };

struct fit_words { // NULL: not given
    const char *weights; // "uniform", "dense:G", "relative", "variance"
    const char *method;  // "memetic", "paper"
    const char *diffuse; // "paper", "lambert"
    const char *bounds;  // "n=0.2:8,kd=0:0.5"
};

// Of the paper's genetic algorithm; 0 and NULL: not given.
struct fit_paper_words {
    long population, bits, generations;
    const char *mutation; // "bit", "individual"
    const char *scaling;  // "none", "linear"
    bool elitism;
};

// Changes what the words name in options and leaves the rest. GON_E_INPUT says which word is wrong.
int fit_words_take(const struct fit_words *words, struct fit_options *options,
                   struct gon_error *err);

// The same for the paper's algorithm, which must be the method when one of them is given.
int fit_paper_take(const struct fit_paper_words *words, struct fit_options *options,
                   struct gon_error *err);

// 0 or FIT_LEAST_REPLICAS..FIT_MOST_REPLICAS.
int fit_bootstrap_take(long replicas, struct fit_options *options, struct gon_error *err);

// "0,10,20.5" into degrees: the count. option: for messages.
int fit_angles_take(const char *option, const char *text, double *ret_deg, int most,
                    struct gon_error *err);
