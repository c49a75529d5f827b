// SPDX-License-Identifier: MIT
// A profile's values in the registers of a Modbus instrument: which registers, and what numbers
// they carry. Pure. Numbers here are those of the wire, before scale and offset (profile_number,
// profile_wire). Registers are as they travel: high byte first (Modbus Application Protocol 1.1b3,
// 4.2), unless registers.byte_order turns each of them round. Coils and discrete inputs are one
// register each here, 0 or 1. Texts are not kept in registers. Thread: any.
#pragma once
#include "drivers/profile.h"

bool registers_is_bit(const struct profile_value *v); // of a table of coils or discrete inputs
int registers_count(const struct profile_value *v);   // 1 or 2

// Of its first register on the wire: the manual's base is subtracted. GON_E_INPUT: not within
// 0..65535, or what is no number.
int registers_address(const struct profile *p, const struct profile_value *v, int *ret_address,
                      struct gon_error *err);
// NAN where an f32 is not finite: no measurement.
double registers_wire(const struct profile *p, const struct profile_value *v,
                      const uint16_t *registers);
// Whole formats take the nearest whole number. GON_E_INPUT: it does not fit the format.
int registers_put(const struct profile *p, const struct profile_value *v, double wire,
                  uint16_t *ret_registers, struct gon_error *err);
