// SPDX-License-Identifier: MIT
// The plan: every point of a campaign in the order of measurement. Computed from the configuration
// alone, and from the bench where there is one; moves nothing. Thread: any.
//
//   sweep 0            dark (laser off), then the beam in each state of the light
//   sweep 1..sweeps    one theta_i each, in the file's order; theta_r from low to high, so that the
//                      axis always comes from the same side; coarse grid and dense zone merged, a
//                      direction that both ask for is measured once
//   sweep sweeps + 1   the beam again in each state, then dark (laser off)
//
// With several states of polarisation a sweep is measured in one after the other, all directions
// in each: elements move slowly, so they move once a state and not once a direction; and the fit
// after a sweep, or a campaign that was stopped, has every state of the sweeps it has.
#pragma once
#include "base/err.h"
#include "campaign/bench.h"
#include "campaign/config.h"

#include <stdbool.h>

enum plan_kind { PLAN_SAMPLE, PLAN_BEAM, PLAN_DARK };
enum plan_skip_reason {
    PLAN_SKIP_BLIND,
    PLAN_SKIP_LIMITS,   // of an axis, in sweeps
    PLAN_SKIP_KEEP_OUT, // lies in one
    PLAN_SKIP_CUT_OFF,  // a keep-out is in the way from the point before
    PLAN_SKIP_REASONS
};
enum { PLAN_MOST_POINTS = 1000000 };

struct plan_point {
    int sweep, point;         // identify the point; point counts from 0 within its sweep
    enum plan_kind kind;
    char station[BENCH_NAME]; // "" on the sample
    double theta_i_deg;       // nominal, multiples of 1e-6; of a station with a bench, else 0
    double theta_r_deg;       // signed: positive forward
    int pol_in, pol_out;      // enum polarisation; unknown also where "laser" has no bench
    double weight;            // g of eq. 17
    bool dense;               // within the dense zone
    bool done;                // has an accepted reading that stands; false in a new plan
    bool again;               // has accepted readings and is to be measured again all the same
    int excluded;             // accepted readings that do not count, as somebody decided
    int attempts;             // readings there are, accepted or not; the last attempt's number
};

struct plan_skip {
    int sweep;
    double theta_i_deg, theta_r_deg;
    enum plan_skip_reason reason;
};

struct plan_step { // what a person does, as campaign/plan_steps.h
    int before;    // index of a point
    int sweep;     // of that
    char text[CAMPAIGN_STEP];
};

struct plan {
    struct plan_point *points;
    int count;   // all points: samples and references
    int samples; // of them on the sample
    int sweeps;  // one a theta_i, numbered 1..sweeps; one of which nothing is left has no points
    struct plan_skip *skips;
    int skips_count;
    struct plan_step *steps; // of a plan that was made, not of one that was read
    int steps_count;
    char (*warnings)[240]; // one sentence each
    int warnings_count;
    double duration_s; // estimate; NAN without a bench
};

// bench may be NULL. GON_E_INPUT: more than PLAN_MOST_POINTS, nothing is left to measure, or no way
// to the beam's station.
int plan_make(const struct campaign_config *config, const struct bench_config *bench,
              struct plan *ret_plan, struct gon_error *err);
void plan_clear(struct plan *p); // frees what it holds, not p; NULL is fine

const char *plan_kind_name(enum plan_kind k); // "sample", "beam", "dark"
// "in the detector's shadow", "beyond an axis's limits", ...
const char *plan_skip_text(enum plan_skip_reason r);

// What a reading costs the detector (daemon/acquire.h says why): until the step response of n equal
// poles is within 1e-4, and between samples that are nearly independent.
double plan_settle_s(double time_constant_s, int slope_db);
double plan_spacing_s(double time_constant_s, int slope_db);
