// SPDX-License-Identifier: MIT
// Decimal numbers of a CSV, rounded as strtod does it and several times faster. Thread: any.
#pragma once
#include <locale.h>
#include <stdbool.h>
#include <stddef.h>

// [+-]digits[.digits][e[+-]digits] and nothing else, in the C locale, which c_locale must be. What
// follows the text's `size` characters must not continue a number. False: no such number; the value
// may be infinite when it is too large.
bool csv_decimal(const char *text, size_t size, locale_t c_locale, double *ret_value);
