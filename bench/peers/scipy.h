// SPDX-License-Identifier: MIT
// gonio beside scipy's differential_evolution with a vectorised numpy objective (scipy_de.py).
#pragma once
#include "bench/peers/task.h"

// Runs the script once a task and form, gonio's search in turn with it, and reports like the rest.
// Without scipy: says that it was not measured. false: out of memory or no place for a file.
bool scipy_compare(const struct task *task, int tasks);
