// SPDX-License-Identifier: MIT
// One level's passes over compiled rows (fit/kernel.h), compiled with the flags of that level: only
// on a processor that has it may they be called. from, to, at and count are multiples of SET_LANES;
// ks and kd are those that the residuals r = f - ks a - kd b are taken at.
#pragma once
#include "fit/kernel.h"

struct kernel_products {
    double aa, ab, ar, bb, br, rr;
};

struct kernel_passes {
    void (*moments)(const struct set_rows *rows, size_t from, size_t to,
                    const struct batch_point *point, double ks, double kd,
                    struct kernel_products *ret_sums);
    void (*gram)(const struct set_rows *rows, size_t from, size_t to,
                 const struct batch_point *point, double ks, double kd,
                 double ret_m[KERNEL_COLUMNS][KERNEL_COLUMNS]);
    void (*columns)(const struct set_rows *rows, size_t at, size_t count,
                    const struct batch_point *point, double ks, double kd,
                    double (*ret_column)[KERNEL_BLOCK]);
};

extern const struct kernel_passes kernel_passes_plain;
#ifdef __x86_64__
extern const struct kernel_passes kernel_passes_avx2, kernel_passes_avx512;
#endif
