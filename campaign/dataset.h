// SPDX-License-Identifier: MIT
// Data for the fit, from a CSV or from a campaign file. Degrees become radians here. Thread: any.
//
// CSV: '#' lines are comments; the first other line names the columns. Needed: theta_i_deg;
// theta_r_signed_deg (>= 0: forward, dphi = 180 deg) or theta_r_deg and dphi_deg; a value column,
// f_r unless another is named. Used when there: u_f_r (type A, standard uncertainty), pol_in and
// pol_out (u, s, p, +45, -45, R, L: model/state.h; without the column all are u). Other columns are
// ignored, with a note when one is nearly called like an optional one that is not there, and one
// when no angle reaches 1.6. CRLF, a byte-order mark and rows that occur twice are fine. Errors are
// "file:line: ...", GON_E_INPUT: an empty field, what is not a finite number with a decimal point,
// a ragged row, theta outside [0, 90), a value column that is all zero, u_f_r <= 0, another state
// of polarisation.
#pragma once
#include "base/err.h"
#include "campaign/store.h"
#include "fit/fit.h"

#include <stdbool.h>
#include <stddef.h>

enum { DATASET_ANGLES = 100 };

struct dataset_filter {
    double theta_i_max_deg; // INFINITY: all
    double theta_i_deg[DATASET_ANGLES];
    int theta_i_count;                  // 0: all
    double without_deg[DATASET_ANGLES]; // these sweeps are left out, whatever the rest says
    int without_count;
};

struct dataset {
    size_t count;
    double *theta_i_rad, *theta_r_rad, *dphi_rad, *f_per_sr;
    double *u_per_sr;                // NULL unless every row has one
    unsigned char *pol_in, *pol_out; // enum brdf_state of each; NULL when all are u
    double u_scale;                  // relative standard uncertainty common to all; 0 from a CSV
    size_t left_out;                 // by the filter
    int excluded;                    // readings of the campaign that somebody excluded
    char source[512];
    char note[200]; // what the numbers are not (reduction_warning), or what in the file looks like
                    // a mistake; "" when there is nothing to say
};

struct dataset_filter dataset_filter_all(void);

// column: NULL for "f_r".
int dataset_from_csv(const char *path, const char *column, const struct dataset_filter *filter,
                     struct dataset *ret_data, struct gon_error *err);
// Reduces the readings. ret_reduction may be NULL; otherwise it holds what was reduced
// (reduction_clear). Nominal angles of the plan are filtered, the encoders' are fitted.
int dataset_from_store(struct store *s, const struct dataset_filter *filter,
                       struct dataset *ret_data, struct reduction *ret_reduction,
                       struct gon_error *err);
void dataset_clear(struct dataset *d); // frees what it holds, not d; NULL is fine

struct fit_data dataset_fit_data(const struct dataset *d); // borrowed from d
