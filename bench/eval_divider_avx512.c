// SPDX-License-Identifier: MIT
#ifdef __x86_64__
#define DIVIDER divider_avx512
#include "bench/eval_divider.h"
#endif
