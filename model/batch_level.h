// SPDX-License-Identifier: MIT
// One level's passes over a whole batch (model/batch.h), compiled with the flags of that level:
// only on a processor that has it may they be called. Parameters are within the domain.
#pragma once
#include "model/batch.h"

struct batch_passes {
    void (*f00)(const struct batch *b, const struct batch_point *point, double ks, double kd,
                double *restrict ret_f);
    void (*jacobian)(const struct batch *b, const struct batch_point *point, double ks, double kd,
                     double *const ret_column[BATCH_COLUMNS]);
};

extern const struct batch_passes batch_passes_plain;
#ifdef __x86_64__
extern const struct batch_passes batch_passes_avx2, batch_passes_avx512;
#endif
