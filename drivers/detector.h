// SPDX-License-Identifier: MIT
// One detector chain: signal and, where wired, the reference monitor, read in one transaction; made
// by by_profile.h. Opening one sends nothing: call identify and setup next. A value never travels
// without its flags; a reading that is not a number is an error, never a number. The driver does
// I/O; averaging, ranging and settling rules live above (daemon/acquire.h). Thread: instrument.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>

struct detector;
struct link_stats;

// Time until a step of the light has died away to residual (0..1, of the step) behind slope_db / 6
// equal poles (6, 12, 18, 24 dB per octave), for use with any time constant. 0 for a residual of 1
// and more; NAN for another slope or a residual of 0 and less.
double detector_settle_s(double time_constant_s, int slope_db, double residual);

enum detector_flag {
    DETECTOR_SATURATED = 1 << 0, // input, filter or output overload, or >= 0.95 of full scale
    DETECTOR_UNLOCKED = 1 << 1,  // reference lost
    DETECTOR_UNSETTLED = 1 << 2  // something changed the filter or the range, or the device
                                 // restarted: the settling time no longer holds; set it up again
};

struct detector_sample {
    double signal_v;  // signed; the in-phase component of a lock-in; W or A of another kind. Beyond
                      // the range: the full scale, and the condition says saturated
    double monitor_v; // NAN when there is no monitor
    double reference_hz; // NAN when there is none
};

struct detector_setup {
    double time_constant_s;
    int slope_db;         // 6, 12, 18, 24 per octave
    int monitor_aux;      // 1..4; 0: no monitor
    double wavelength_nm; // of the light, for what is calibrated by it; 0: not known
};

struct detector_ops {
    int (*identify)(struct detector *d, char *ret_text, size_t size, struct gon_error *err);
    // Writes the settings as far as the device has them, and reads them back. The time constant is
    // the shortest that is not below the one asked; ret_time_constant_s is what the device has
    // then. Reserve, coupling, phase and reference stay as the operator set them.
    int (*setup)(struct detector *d, const struct detector_setup *s, double *ret_time_constant_s,
                 struct gon_error *err);
    int (*ranges)(struct detector *d); // how many; range 0 is the most sensitive
    double (*full_scale_v)(struct detector *d, int range);
    int (*set_range)(struct detector *d, int range, struct gon_error *err); // read back
    int (*sample)(struct detector *d, struct detector_sample *ret_sample, struct gon_error *err);
    // Forgets the overloads and losses of reference so far (those of the way here): one query.
    int (*clear)(struct detector *d, struct gon_error *err);
    // What happened since clear or the last call, which clears it. Flags of detector_flag.
    int (*condition)(struct detector *d, unsigned *ret_flags, struct gon_error *err);
    int (*reopen)(struct detector *d, struct gon_error *err);
    const struct link_stats *(*stats)(const struct detector *d); // NULL: it has no link
    void (*free)(struct detector *d);
};

struct detector {
    const struct detector_ops *ops; // first member of each driver's own struct
};
