// SPDX-License-Identifier: MIT
// A profile's write as one Modbus transaction. Pure. Thread: any.
//
// "set" lists assignments ("speed = $speed, type = 1"); a name alone ("setpoint") stands for the
// value that is known by then. Their registers must follow each other without a gap, in any order,
// in one table that can be written. "edge" names a bit, VALUE.BIT: the value is written with that
// bit alone.
#pragma once
#include "drivers/profile_data.h"

enum { REGISTER_WRITE_MOST = 2 * PROFILE_ITEMS };

struct register_write {
    int table, address, count;
    uint16_t registers[REGISTER_WRITE_MOST];
    struct {
        int value; // of the profile
        double number;
    } item[PROFILE_ITEMS]; // in the order of their registers
    int items;
};

// What "set" sends. GON_E_INPUT: a value beyond its range, unknown or read only, a gap.
int register_write_set(const struct profile *p, const struct profile_write *w,
                       const struct profile_param *params, const struct profile_data *d,
                       struct register_write *ret_write, struct gon_error *err);
// One value.
int register_write_one(const struct profile *p, int value, double number,
                       struct register_write *ret_write, struct gon_error *err);
// The value that "edge" speaks of and the number that it has with the bit alone.
int register_write_edge(const struct profile *p, const struct profile_write *w, int *ret_value,
                        double *ret_number, struct gon_error *err);
