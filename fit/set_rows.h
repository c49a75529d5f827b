// SPDX-License-Identifier: MIT
// The arrays of a compiled set (fit/set.h), for fit/set.c alone: what is done to all of them alike.
#pragma once
#include "fit/set.h"

enum { SET_ARRAYS = 6 + SET_CHANNELS };

// Arrays in one allocation, which the caller frees; rows past `count` have no weight and a geometry
// that is harmless to evaluate. 0 or FIT_E_MEMORY.
int set_rows_new(size_t count, bool polarised, struct set_rows *ret_rows, void **ret_memory);

// The arrays that depend on directions and states alone; returns how many.
int set_rows_geometry(const struct set_rows *rows, const double *ret_array[SET_ARRAYS]);

void set_rows_copy(const struct set_rows *from, size_t i, struct set_rows *to, size_t j);

// Readings not yet weighed to distinct rows: the geometry of the first of each, the sum of all g;
// not the values. 0 or FIT_E_CANCELED.
int set_rows_merge(const struct set_rows *all, const uint32_t *row, struct fit_control *control,
                   struct set_rows *distinct);

// Multiplies sqrt(g) into spec, diffuse and channel. 0 or FIT_E_CANCELED.
int set_rows_weigh(struct set_rows *rows, struct fit_control *control);
