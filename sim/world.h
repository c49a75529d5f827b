// SPDX-License-Identifier: MIT
// The simulated bench's world: sample, three axes (five where the spec has elements of
// polarisation), laser, optics and detector chain, in one struct that is stepped by the times
// passed in. No I/O, no clock: with the same seed and the same calls at the same times it is the
// same world, at any speed. Thread: one.
//
// Light is evaluated lazily. world_see brings laser and filter up to a time, in steps of 1/8 time
// constant and at most 60 time constants back (older input is forgotten by any filter to 1e-20).
// Whatever changes the light (a move, a laser command, a filter setting) calls it first, so that
// the past is filtered as it was. Times before the last one count as the last one.
#pragma once
#include "sim/laser.h"
#include "sim/lockin.h"
#include "sim/motion.h"
#include "sim/noise.h"
#include "sim/optics.h"

#include <stdbool.h>
#include <stdint.h>

enum world_axis {
    WORLD_THETA_I,
    WORLD_THETA_R,
    WORLD_SAMPLE,
    WORLD_POLARISER, // these two only with elements of polarisation
    WORLD_ANALYSER,
    WORLD_AXES
};

struct world_axis_spec {
    double min, max; // hard limits: deg; mm of the sample
    double start;    // where it stands at power-up
    double backlash;
};

struct world_spec {
    uint64_t seed;
    struct optics_spec optics;
    struct elements_spec elements;
    struct world_axis_spec axis[WORLD_AXES];
    struct sim_laser_spec laser;
    double responsivity_v_per_w, offset_v, noise_v_per_rthz; // signal
    double monitor_v_per_w, monitor_dark_v,
        monitor_noise_v; // Aux In 1; noise is rms of one reading
    double reference_hz;
};

// A laser's power in W, or an axis' motor in its unit, that something else simulates: asked at
// times that never go back. NULL: the world's own.
struct world_source {
    double (*at)(void *ctx, int64_t t_ns);
    void *ctx;
};

struct world {
    struct world_spec spec;
    struct world_source light, place[WORLD_AXES];
    int64_t t_ns; // laser and filter are here
    struct motion axis[WORLD_AXES];
    struct sim_laser laser;
    struct lockin lockin;
    struct noise monitor_noise;
    struct world_view { // the detector's power per watt, while no axis moves
        uint64_t plan[WORLD_AXES];
        double motor0[WORLD_AXES];
        unsigned off;
        double per_w; // NAN: not known
    } view;
    double lets_out; // part of its light that leaves the source: a shutter; 1
    double lets_in;  // part of the light that reaches the detector, not the monitor: filters; 1
    bool saturate;   // fault injection: the input sees far too much
};

// "theta_i", "theta_r", "sample", "polariser", "analyser"
extern const char *const world_axis_names[WORLD_AXES];
int world_axes(const struct world_spec *spec); // how many of them there are

void world_defaults(struct world_spec *ret_spec); // a painted sample under 50 mW at 1.06 um
void world_init(struct world *w, const struct world_spec *spec, int64_t t_ns);
void world_see(struct world *w, int64_t t_ns);
double world_input_v(struct world *w, int64_t t_ns); // the lock-in's input without noise
double world_aux_v(struct world *w, int input);      // Aux In 1..4 now, with noise, steps of 1/3 mV
// Rests after power-up or a jump: the filter has seen the present input for ever.
void world_settle(struct world *w);
