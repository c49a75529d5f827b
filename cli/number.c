// SPDX-License-Identifier: MIT
// 17 digits are an integer below 10^17 < 2^57. An extended product with an exact power of ten is
// right to 64 bits, so that at least seven bits behind the point say how to round; where they are
// too near a half, and for numbers too small or too large, printf decides.
#include "cli/number.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum { DIGITS = 17, EXACT = 27 }; // 5^27 < 2^64: the powers up to 10^27 are exact

static const long double powers[EXACT + 1] = {1e0L,  1e1L,  1e2L,  1e3L,  1e4L,  1e5L,  1e6L,
                                              1e7L,  1e8L,  1e9L,  1e10L, 1e11L, 1e12L, 1e13L,
                                              1e14L, 1e15L, 1e16L, 1e17L, 1e18L, 1e19L, 1e20L,
                                              1e21L, 1e22L, 1e23L, 1e24L, 1e25L, 1e26L, 1e27L};

// x = digits * 10^(exponent - 16), rounded; false when only printf can say.
static bool scale(double x, uint64_t *ret_digits, int *ret_exponent)
{
    if (LDBL_MANT_DIG < 64 || !(x > 1e-10 && x < 1e16))
        return false;
    int binary;
    frexp(x, &binary); // x >= 2^(binary - 1), so that the exponent is this one or the next
    int exponent = (int)floor((binary - 1) * 0.301029995663981195);
    long double scaled = (long double)x * powers[DIGITS - 1 - exponent];
    if (scaled >= 1e17L)
        scaled = (long double)x * powers[DIGITS - 1 - ++exponent];
    const uint64_t whole = (uint64_t)scaled;
    const double rest = (double)(scaled - (long double)whole);
    if (fabs(rest - 0.5) < 1.0 / 64 || whole == 99999999999999999u)
        return false;
    *ret_digits = whole + (rest > 0.5);
    *ret_exponent = exponent;
    return true;
}

static void split_digits(char *digits, int count, uint32_t value)
{
    for (int i = count - 1; i >= 0; i--, value /= 10)
        digits[i] = (char)('0' + value % 10);
}

static char *put(char *at, const char *from, int count)
{
    memcpy(at, from, (size_t)count);
    return at + count;
}

static char *put_with_point(char *at, const char *digits, int count, int before)
{
    at = put(at, digits, before);
    if (count <= before)
        return at;
    *at++ = '.';
    return put(at, digits + before, count - before);
}

size_t number_write(char *text, double x)
{
    char digits[DIGITS], *at = text;
    uint64_t whole;
    int exponent, count = DIGITS;
    if (!scale(fabs(x), &whole, &exponent))
        return (size_t)sprintf(text, "%.17g", x);
    split_digits(digits, 8, (uint32_t)(whole / 1000000000));
    split_digits(digits + 8, 9, (uint32_t)(whole % 1000000000));
    while (digits[count - 1] == '0')
        count--;
    if (x < 0)
        *at++ = '-';
    if (exponent >= 0) {
        at = put_with_point(at, digits, count, exponent + 1);
    } else if (exponent >= -4) {
        at = put(at, "0.000", 1 - exponent);
        at = put(at, digits, count);
    } else {
        at = put_with_point(at, digits, count, 1);
        at = put(at, exponent > -10 ? "e-0" : "e-1", 3);
        *at++ = (char)('0' + -exponent % 10);
    }
    return (size_t)(at - text);
}
