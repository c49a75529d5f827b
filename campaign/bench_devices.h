// SPDX-License-Identifier: MIT
// The bench's further devices: a detector of its own as monitor, selectors (shutter, filter wheel,
// chopper) and inputs (door, temperatures, a relay). Parts of the bench file; man goniod.cfg(5) is
// printed from their tables. Thread: any.
#pragma once
#include "base/cfg.h"
#include "base/err.h"

#include <stdbool.h>

enum { BENCH_DEVICES = 8, BENCH_DEVICE_NAME = 32, BENCH_DEVICE_LINK = 256 };

struct bench_config;

// Set up with the wavelength, and with the detector's time constant and slope as far as it has
// them.
struct bench_monitor {
    char driver[BENCH_DEVICE_LINK]; // a profile of a detector; "": the bench has no such monitor
    char link[BENCH_DEVICE_LINK];
    double full_scale; // the most it will see, in its unit; 0: found when the laser is warm
};

enum bench_use {
    BENCH_SHUTTER,
    BENCH_FILTER,
    BENCH_CHOPPER,
    BENCH_OTHER, // some other selector
    BENCH_INPUTS // no selector: it is only read
};

// A selector is on a link, inputs are on a link or are a unit of a bus.
struct bench_device {
    char name[BENCH_DEVICE_NAME];
    char driver[BENCH_DEVICE_LINK];
    char link[BENCH_DEVICE_LINK]; // "": on a bus
    char bus[BENCH_DEVICE_NAME];
    int unit;
    int use;                          // enum bench_use
    char position[BENCH_DEVICE_NAME]; // where a selector stands while something is measured
    char safe[BENCH_DEVICE_NAME];     // where it goes when a run pauses or ends; "": of a shutter
                                      // what its profile says, of others nothing
    bool darks;                       // a shutter that makes the darks while the laser stays on
};

// Where a device stands at a station. A filter of the beam's station has to say what it does to
// the signal there, against where it stands on the sample and over what it does to the monitor: 1
// when it stands before the monitor, too.
struct bench_place {
    char name[BENCH_DEVICE_NAME];
    char position[BENCH_DEVICE_NAME];
    double transmission; // 0: not given
    double u_transmission;
};

extern const struct cfg_row bench_monitor_rows[], bench_device_rows[], bench_place_rows[];
extern const char *const bench_uses[]; // "shutter", "filter", "chopper", "other", "inputs"; NULL

// Checks across settings: reports each mistake with its line. Returns how many. What positions a
// device has only its profile says: gonio check looks there.
int bench_devices_check(struct cfg_file *f, const struct bench_config *b);

// -1: none.
int bench_device_index(const struct bench_config *b, const char *name);
int bench_dark_shutter(const struct bench_config *b); // that makes the darks
// What the filters of the beam's station pass of the beam; 1 without any.
double bench_beam_passes(const struct bench_config *b, double *ret_u_rel);
// Whether a campaign may go on with these devices: the same kind of monitor, selectors at the same
// positions, the same filters in the beam. GON_E_REFUSED.
int bench_same_devices(const struct bench_config *then, const struct bench_config *now,
                       struct gon_error *err);
