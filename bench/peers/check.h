// SPDX-License-Identifier: MIT
// A comparison is fair only when the peers are given right derivatives.
#pragma once
#include "bench/peers/task.h"

// Largest disagreement, relative, between attempt_slope, attempt_rows and central differences of
// attempt_value over random genes of a task.
double check_slopes(const struct task *t);
