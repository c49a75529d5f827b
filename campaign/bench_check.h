// SPDX-License-Identifier: MIT
// Private to campaign/bench*.c: what a table cannot say of a bench file.
#pragma once
#include "base/cfg.h"
#include "campaign/bench.h"

// Reports every contradiction between settings with its line; returns how many there are.
int bench_check(struct cfg_file *f, const struct bench_config *b);
