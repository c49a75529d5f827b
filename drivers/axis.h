// SPDX-License-Identifier: MIT
// One motor axis, in steps. Units, limits, backlash and meaning live above (daemon/instrument.h);
// the driver does I/O. No call waits for motion; each is one or two transactions. Thread:
// instrument.
//
// Axes are made from profiles (by_profile.h). move_abs is never repeated by a driver: when its
// answer is lost, the caller reads the status and decides. stop may be repeated and is.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

struct axis;
struct bus;
struct link_stats;

struct axis_status {
    int32_t position_steps; // encoder
    int32_t target_steps; // at rest: its command position; while it moves: where the last move that
                          // it acknowledged leads, or without one where its profile is now
    bool moving, in_position, ready, homed;
    bool alarm, limit, following; // limit: stands at a limit switch; following: missed its target
    int alarm_code;               // 0: none; the text is in alarm_text
};

struct axis_ops {
    // Talks to the unit and checks that it is one; also takes back command bits left set.
    int (*identify)(struct axis *a, struct gon_error *err);
    int (*status)(struct axis *a, struct axis_status *ret_status, struct gon_error *err);
    // GON_E_INPUT, and nothing sent, for a speed or acceleration outside the controller's range.
    int (*move_abs)(struct axis *a, int32_t position_steps, int32_t speed_steps_per_s,
                    int32_t acceleration_steps_per_s2, struct gon_error *err);
    int (*stop)(struct axis *a, struct gon_error *err);
    int (*home)(struct axis *a, struct gon_error *err);
    int (*reset_alarm)(struct axis *a, struct gon_error *err);
    const char *(*alarm_text)(const struct axis *a, int code);
    const struct link_stats *(*stats)(const struct axis *a); // of its bus; NULL: it has no link
    void (*free)(struct axis *a);
};

struct axis {
    const struct axis_ops *ops; // first member of each driver's own struct
};
