// SPDX-License-Identifier: MIT
#include "campaign/csv_decimal.h"

#include <stdint.h>
#include <stdlib.h>

static bool digit(char c)
{
    return c >= '0' && c <= '9';
}

struct decimal {
    uint64_t digits; // up to 19 of them
    int exponent;    // of ten
    bool negative, exact, valid;
};

static const char *take_digits(const char *p, const char *end, struct decimal *d, int step,
                               bool *any)
{
    for (; p < end && digit(*p); p++) {
        *any = true;
        if (d->digits < 1000000000000000000u) {
            d->digits = d->digits * 10 + (uint64_t)(*p - '0');
            d->exponent += step;
        } else {
            d->exact = false;
        }
    }
    return p;
}

// [+-]digits[.digits][e[+-]digits] and nothing else: no hexadecimal, no "nan", no "inf".
static struct decimal scan(const char *p, const char *end)
{
    struct decimal d = {.exact = true};
    bool any = false, exponent_any = false, negative = false;
    if (p < end && (*p == '+' || *p == '-'))
        d.negative = *p++ == '-';
    p = take_digits(p, end, &d, 0, &any);
    if (p < end && *p == '.')
        p = take_digits(p + 1, end, &d, -1, &any);
    if (p < end && any && (*p == 'e' || *p == 'E')) {
        int e = 0;
        if (++p < end && (*p == '+' || *p == '-'))
            negative = *p++ == '-';
        for (; p < end && digit(*p); p++, exponent_any = true)
            e = e < 100000 ? e * 10 + (*p - '0') : e;
        d.exponent += negative ? -e : e;
        any = exponent_any;
    }
    d.valid = any && p == end;
    return d;
}

// Digits below 2^53 and a power of ten up to 22 are exact, so that their product is rounded once,
// as strtod would (Clinger, PLDI 1990); strtod does the others.
static double value_of(const char *text, locale_t c_locale, const struct decimal *d)
{
    static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    if (d->exact && d->digits <= (1ull << 53) && abs(d->exponent) <= 22) {
        const double v = d->exponent < 0 ? (double)d->digits / powers[-d->exponent]
                                         : (double)d->digits * powers[d->exponent];
        return d->negative ? -v : v;
    }
    return strtod_l(text, NULL, c_locale); // ends at the comma, quote or line's end
}

bool csv_decimal(const char *text, size_t size, locale_t c_locale, double *ret_value)
{
    const struct decimal d = scan(text, text + size);
    if (d.valid)
        *ret_value = value_of(text, c_locale, &d);
    return d.valid;
}
