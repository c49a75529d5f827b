// SPDX-License-Identifier: MIT
// What a profile's table of settings cannot see: that every name in it exists and is of the right
// kind, that patterns and conditions can be read and that what they speak of is asked before, that
// registers lie where Modbus has some and no two values claim the same, that a role has what it
// needs to be safe (a laser: how it goes off, and how that is seen). Each mistake goes to the
// file's sink as "file:line: path = value: what is wrong". Thread: any.
#pragma once
#include "drivers/profile.h"

// The profile was taken from this file. Returns the number of mistakes.
int profile_check(struct cfg_file *f, const struct profile *p);
