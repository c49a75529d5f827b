// SPDX-License-Identifier: MIT
// One motor axis, in steps. Units, limits, backlash and meaning live above (daemon/instrument.h); the
// driver does I/O. No call waits for motion; each is one or two transactions. Thread: instrument.
//
// move_abs is never repeated by a driver: when its answer is lost, the caller reads the status and
// decides. stop may be repeated and is.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

struct axis;
struct bus;

struct axis_status {
    int32_t position_steps; // encoder
    int32_t target_steps;   // of the command that the controller executes or executed
    bool moving, in_position, ready, homed;
    bool alarm;
    int alarm_code; // 0: none; the text is in alarm_text
};

struct axis_ops {
    int (*identify)(struct axis *a, struct gon_error *err); // talks to the unit and checks that it is one
    int (*status)(struct axis *a, struct axis_status *ret_status, struct gon_error *err);
    int (*move_abs)(struct axis *a, int32_t position_steps, int32_t speed_steps_per_s,
                    int32_t acceleration_steps_per_s2, struct gon_error *err);
    int (*stop)(struct axis *a, struct gon_error *err);
    int (*home)(struct axis *a, struct gon_error *err);
    int (*reset_alarm)(struct axis *a, struct gon_error *err);
    const char *(*alarm_text)(int code);
    void (*free)(struct axis *a);
};

struct axis {
    const struct axis_ops *ops; // first member of each driver's own struct
};

// Oriental Motor AZ (and its relatives with the same core map). The bus is borrowed.
struct axis *axis_az_new(struct bus *bus, int unit);
