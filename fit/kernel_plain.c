// SPDX-License-Identifier: MIT
#define KERNEL kernel_passes_plain
#include "fit/kernel_pass.h"
