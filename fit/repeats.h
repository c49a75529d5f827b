// SPDX-License-Identifier: MIT
// Readings whose compiled geometry is the same to the bit, so that one evaluation serves them all:
// whatever made them equal, a direction measured again or two that mirror each other.
#pragma once
#include "fit/control.h"

#include <stdint.h>

#define REPEATS_MOST ((size_t)1 << 30) // readings

// Numbers the distinct rows of `columns` arrays of `count` numbers from 0 on in order of
// appearance. ret_group: `count` numbers. 0, FIT_E_CANCELED or FIT_E_MEMORY (also beyond
// REPEATS_MOST).
int repeats_find(const double *const column[], int columns, size_t count,
                 struct fit_control *control, uint32_t *ret_group, size_t *ret_groups);
