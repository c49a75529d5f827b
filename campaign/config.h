// SPDX-License-Identifier: MIT
// A campaign file: what to measure. Plain data; man campaign.cfg(5) is printed from its table.
// Degrees. Thread: any.
#pragma once
#include "base/cfg.h"
#include "base/err.h"
#include "campaign/polarisation.h"
#include "fit/fit.h"

#include <stdint.h>

enum {
    CAMPAIGN_ANGLES = 100,
    CAMPAIGN_NAME = 64,
    CAMPAIGN_NOTES = 1024,
    CAMPAIGN_STEPS = 16,
    CAMPAIGN_STEP = 160,
    CAMPAIGN_STATES = 16,                            // in a list
    CAMPAIGN_CHANNELS = (POL_KNOWN + 1) * POL_KNOWN, // all there can be
    POL_IN_LASER = POL_UNKNOWN
};

enum campaign_combine {
    CAMPAIGN_EACH, // every pol_in with every pol_out, pol_in by pol_in
    CAMPAIGN_PAIRS // the first with the first, the second with the second, ...
};

struct campaign_step { // what a person does
    int before_sweep;  // 0: before everything; sweeps + 1: before the closing references
    char text[CAMPAIGN_STEP];
};

struct campaign_channel { // as pol_in and pol_out of the configuration
    int in, out;
};

struct campaign_config {
    char name[CAMPAIGN_NAME], sample[CAMPAIGN_NAME], operator_name[CAMPAIGN_NAME];
    char notes[CAMPAIGN_NOTES];
    double theta_i_deg[CAMPAIGN_ANGLES]; // in the order of measurement, all different, 0..85
    int theta_i_count;
    double from_deg, to_deg, step_deg; // theta_r, signed
    double dense_half_width_deg, dense_step_deg,
        dense_weight; // |theta_r - theta_i| <= half width, edges included
    double phi_deg;   // how the sample was mounted: recorded, nothing moves
    // States of the light, enum polarisation or POL_IN_LASER (what the bench says of its laser),
    // and of the analyser (POL_U: none); how they combine says pol_combine.
    int pol_in[CAMPAIGN_STATES], pol_in_count;
    int pol_out[CAMPAIGN_STATES], pol_out_count;
    int pol_combine;       // enum campaign_combine
    double blind_half_deg; // |theta_r + theta_i| < this is skipped: the detector shadows the beam;
                           // 0: nothing
    struct campaign_step steps[CAMPAIGN_STEPS];
    int steps_count;
    int readings, dark_readings, beam_readings; // samples averaged a point
    struct {
        int method, weighting, diffuse; // enum fit_method, fit_weighting, brdf_diffuse
        int seed;
        double theta_i_max_deg;
    } fit;
};

extern const struct cfg_row campaign_config_schema[];

// Reads and checks a file; every mistake goes to the sink as "file:line: ...". ret_text (may be
// NULL) gets the file as it was read; free it. GON_E_INPUT when anything is wrong.
int campaign_config_load(const char *path, struct cfg_sink sink, struct campaign_config *ret_config,
                         char **ret_text);
// The same from a text; name stands in messages where the path would.
int campaign_config_parse(const char *text, const char *name, struct cfg_sink sink,
                          struct campaign_config *ret_config);

// What each sweep is measured in, in order; returns how many, at least 1.
int campaign_channels(const struct campaign_config *c,
                      struct campaign_channel ret_channels[CAMPAIGN_CHANNELS]);

// What the campaign asks of the fit: method, weights, diffuse part, seed, dense weight and zone
// (wider by 0.01 deg, so that an encoder's last digit does not push a point of the edge out of it).
struct fit_options campaign_fit_options(const struct campaign_config *c);
