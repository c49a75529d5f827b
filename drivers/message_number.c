// SPDX-License-Identifier: MIT
// Numbers as instruments write them, without strtod: it follows the locale, and takes "nan" and
// "0x1p3".
#include "drivers/message.h"

#include <math.h>
#include <stdbool.h>

#define OVERFLOWED 9.9e37 // SCPI's way to say so; 9.91e37 is its not-a-number
#define EXPONENT_MOST 9999

struct scan {
    const char *at;
    uint64_t digits; // the first 19 of them
    int scale;       // power of ten that belongs to digits
    bool any;
};

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static void take_digits(struct scan *s, int after_point)
{
    for (; is_digit(*s->at); s->at++) {
        s->any = true;
        if (s->digits < UINT64_MAX / 100) {
            s->digits = 10 * s->digits + (uint64_t)(*s->at - '0');
            s->scale -= after_point;
        } else {
            s->scale += 1 - after_point;
        }
    }
}

// False: an 'e' without digits.
static bool take_exponent(struct scan *s)
{
    int exponent = 0;
    if (*s->at != 'e' && *s->at != 'E')
        return true;
    s->at++;
    const bool negative = *s->at == '-';
    if (*s->at == '-' || *s->at == '+')
        s->at++;
    if (!is_digit(*s->at))
        return false;
    for (; is_digit(*s->at); s->at++)
        if (exponent < EXPONENT_MOST)
            exponent = 10 * exponent + (*s->at - '0');
    s->scale += negative ? -exponent : exponent;
    return true;
}

static double scaled(uint64_t digits, int scale)
{
    const long double m = (long double)digits; // up to 10^27 powers of ten are exact
    if (digits == 0)
        return 0.0;
    return (double)(scale < 0 ? m / powl(10.0L, -scale) : m * powl(10.0L, scale));
}

int message_decimal(const char *text, double *ret_value, struct gon_error *err)
{
    struct scan s = {.at = text};
    while (*s.at == ' ' || *s.at == '\t')
        s.at++;
    const bool negative = *s.at == '-';
    if (*s.at == '-' || *s.at == '+')
        s.at++;
    take_digits(&s, 0);
    if (*s.at == '.') {
        s.at++;
        take_digits(&s, 1);
    }
    bool good = s.any && take_exponent(&s);
    while (*s.at == ' ' || *s.at == '\t')
        s.at++;
    if (!good || *s.at)
        return gon_fail(err, GON_E_LINK, "'%.40s' is not a number", text);
    const double value = scaled(s.digits, s.scale);
    if (isinf(value))
        return gon_fail(err, GON_E_LINK, "'%.40s' is larger than any number", text);
    *ret_value = negative ? -value : value;
    return 0;
}

int message_number(const char *text, double *ret_value, struct gon_error *err)
{
    double value;
    int rc = message_decimal(text, &value, err);
    if (rc < 0)
        return rc;
    if (!(fabs(value) < OVERFLOWED))
        return gon_fail(err, GON_E_LINK, "'%.40s' means overflow, not a value", text);
    *ret_value = value;
    return 0;
}
