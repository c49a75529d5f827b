// SPDX-License-Identifier: MIT
// A fit as the JSON that `gonio fit --json`, the daemon and the campaign file share, and as a row
// of the file's fit table. Thread: any.
#pragma once
#include "campaign/dataset.h"
#include "fit/fit.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct fit_hold_out { // sweeps that were not fitted
    int count;        // 0: none were held out
    double theta_i_deg[DATASET_ANGLES];
    struct fit_validation validation;
};

struct fit_record {
    int sweep;         // after which; -1: not of a campaign
    int64_t reduction; // id in the file; 0: none
    size_t points;
    int excluded;      // readings of the campaign that somebody excluded; 0 of a CSV
    struct fit_options options;
    struct fit_result result;
    const char *trace; // text, may be NULL
    struct fit_hold_out hold_out;
    char note[200]; // one more warning, of the data set; "": none
};

// {"method","weights","points","excluded","seed","delta","params":{...},"derived":{...},"correlation":[...],
// "chi2_per_dof","residual_lag1","advice":[{"measure","text","readings","u":{..},"gain"},..],
// "evaluations","elapsed_ms","elapsed_total_ms","warnings":[...]}, and where asked for
// "bootstrap":{"replicas","noise","params":{..},"derived":{..}} and "hold_out":{"theta_i_deg":[..],
// "points","delta","chi2_per_point","rms_relative"}. 17 significant digits; what is not finite is
// null. indent: 0 one line, else that many blanks. Free it; NULL without memory.
char *fit_json(const struct fit_record *f, int indent);

const char *fit_method_name(enum fit_method m);       // "memetic", "paper"
const char *fit_weighting_name(enum fit_weighting w); // "uniform", "dense", "relative", "variance"
const char *fit_diffuse_name(enum brdf_diffuse d);    // "paper", "lambert"
extern const char *const fit_method_names[], *const fit_weighting_names[],
                                                 *const fit_diffuse_names[]; // NULL-ended
