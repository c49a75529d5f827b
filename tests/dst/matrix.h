// SPDX-License-Identifier: MIT
// The fault x state matrix: each row of the table of faults in each state of the engine, on a bench
// and a short campaign that have what it needs. Thread: one.
#pragma once
#include "tests/dst/trial.h"

// Prints the table and what it means; returns how many cells are not as they must be.
int matrix_run(const char *profiles, int only, FILE *out); // only: one row; -1: all
