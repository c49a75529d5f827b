// SPDX-License-Identifier: MIT
// A double as text with 17 significant digits, which give the same double back: the characters of
// printf's "%.17g" in the C locale, some four times faster. Thread: any.
#pragma once
#include <stddef.h>

enum { NUMBER_SIZE = 32 }; // the longest is -2.2250738585072014e-308

// Writes no terminator; returns how many characters it wrote, less than NUMBER_SIZE.
size_t number_write(char *text, double x);
