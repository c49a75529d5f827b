// SPDX-License-Identifier: MIT
#include "fit/kernel_level.h"

#ifdef __x86_64__
#define KERNEL kernel_passes_avx2
#include "fit/kernel_pass.h"
#endif
