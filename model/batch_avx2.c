// SPDX-License-Identifier: MIT
#include "model/batch_level.h"

#ifdef __x86_64__
#define BATCH batch_passes_avx2
#include "model/batch_pass.h"
#endif
