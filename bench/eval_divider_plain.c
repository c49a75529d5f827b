// SPDX-License-Identifier: MIT
#define DIVIDER divider_plain
#include "bench/eval_divider.h"
