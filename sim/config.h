// SPDX-License-Identifier: MIT
// What can be set about the simulated bench: one table (base/cfg.h) for sim.cfg, for --set and for
// the man page. Later wins: defaults, the file, --fast, --seed, --set. Thread: any.
#pragma once
#include "base/cfg.h"
#include "base/err.h"
#include "sim/bench.h"

#include <stdbool.h>

enum { SIM_CONFIG_PATH = 400 };

struct sim_config {
    struct bench_spec bench;
    int seed;
    // names or files; absolute paths once sim/profiles.h has found them
    char axes_profile[SIM_CONFIG_PATH], laser_profile[SIM_CONFIG_PATH],
        detector_profile[SIM_CONFIG_PATH];
    double steps_per_unit, backlash; // of all axes; of those that turn
    // what the bench files for goniod say
    double speed, acceleration; // units/s, units/s2
    double power_w;
    double time_constant_s;
    int slope_db;
    // wires
    bool wire_speed;
    int axes_baud, laser_baud, detector_baud;
};

extern const struct cfg_row sim_config_schema[];

int sim_config_defaults(struct sim_config *ret_config, struct gon_error *err);
// The whole file; its mistakes go to sink, one a line. GON_E_INPUT when there are any.
int sim_config_file(struct sim_config *c, const char *path, struct cfg_sink sink);
void sim_config_fast(struct sim_config *c); // for demonstrations and tests
// name is a path in the table ("laser.power_w"), value as in a file. GON_E_INPUT.
int sim_config_set(struct sim_config *c, const char *name, const char *value,
                   struct gon_error *err);
// Puts what is said once into every place where it is used; last.
void sim_config_finish(struct sim_config *c);
