// SPDX-License-Identifier: MIT
// Order statistics in linear time.
#pragma once
#include <stddef.h>

// The quantile p in [0, 1] of count > 0 finite values, linear between neighbours (Hyndman and Fan's
// type 7). Reorders them.
double select_quantile(double *values, size_t count, double p);
