// SPDX-License-Identifier: MIT
// The bench's states of polarisation: named sets of positions of its elements, on the source side
// (pol_in: polariser, retarder, in or out of the beam) and before the detector (pol_out; "u" is
// the analyser out of the beam). A part of the bench file, group polarisation; man goniod.cfg(5)
// is printed from its table. Thread: any.
//
// Each state of a side places every axis of that side, so that what stands in the beam never
// depends on the state before; no axis belongs to both sides, and stations do not place it. A
// polariser's angle counts from s towards +45.
#pragma once
#include "base/cfg.h"
#include "base/err.h"
#include "campaign/polarisation.h"

enum { BENCH_STATES = POL_KNOWN, BENCH_STATE_AXES = 4, BENCH_STATE_NAME = 32 };

struct bench_config;

struct bench_position {
    char name[BENCH_STATE_NAME]; // of an axis
    double at;                   // user units
};

struct bench_state {
    int is; // enum polarisation, known
    struct bench_position axes[BENCH_STATE_AXES];
    int axes_count;
};

struct bench_states {
    struct bench_state state[BENCH_STATES];
    int count; // 0: nothing on this side moves
};

// Both as parts of what they pass of light along their axis.
struct bench_polarisation {
    struct bench_states pol_in, pol_out;
    double polariser_extinction;                     // most that it passes of crossed light
    double transmission, u_transmission, extinction; // of the analyser
};

extern const struct cfg_row bench_polarisation_rows[];

// Checks across settings: reports each mistake with its line. Returns how many.
int bench_states_check(struct cfg_file *f, const struct bench_config *b);

// Whether a campaign may go on with these elements: the same states at the same places, and the
// same analyser. GON_E_REFUSED.
int bench_same_states(const struct bench_polarisation *then, const struct bench_polarisation *now,
                      struct gon_error *err);

const struct bench_state *bench_find_state(const struct bench_states *s,
                                           int is); // NULL: the side has no such state
