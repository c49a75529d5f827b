// SPDX-License-Identifier: MIT
// uses: cli campaign drivers fit model base
#include "cli/number.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>
#include <string.h>

static void check(double x)
{
    char text[NUMBER_SIZE + 1], want[64];
    memset(text, '!', sizeof text);
    const size_t size = number_write(text, x);
    snprintf(want, sizeof want, "%.17g", x);
    if (size != strlen(want) || memcmp(text, want, size) != 0)
        fail_msg("'%.*s' instead of '%s'", (int)size, text, want);
}

static void numbers_are_those_of_printf(void **state)
{
    (void)state;
    static const double some[] = {0,
                                  -0.0,
                                  1,
                                  -1,
                                  0.1,
                                  0.5,
                                  100,
                                  1e15,
                                  1e16,
                                  1e17,
                                  1e22,
                                  1e23,
                                  1e-4,
                                  1e-5,
                                  9.5e-5,
                                  1e-10,
                                  1e-7,
                                  0.001,
                                  123,
                                  12345,
                                  1e99,
                                  1e-99,
                                  DBL_MAX,
                                  DBL_MIN,
                                  5e-324,
                                  0.30000000000000004,
                                  99999999999999984.0};
    for (size_t i = 0; i < sizeof some / sizeof *some; i++) {
        check(some[i]);
        check(nextafter(some[i], 1e300));
        check(-nextafter(some[i], -1e300));
    }
    for (int e = -20; e < 25; e++)
        for (int digit = 1; digit < 10; digit++)
            check(digit * pow(10, e));
}

static void random_numbers_are_those_of_printf(void **state)
{
    (void)state;
    const uint64_t seed = 17;
    uint64_t bits = seed;
    print_message("seed %llu\n", (unsigned long long)seed);
    for (int i = 0; i < 400000; i++) {
        bits = bits * 6364136223846793005u + 1442695040888963407u;
        const double mantissa = 1 + (double)(bits >> 12) * 0x1p-52;
        check(ldexp(mantissa, (int)(bits % 97) - 45)); // 3e-14 to 4e15
    }
}

// Halves of the last digit, which printf rounds to even: integers of 54 bits over two.
static void halves_are_rounded_as_printf_does(void **state)
{
    (void)state;
    for (int i = 0; i < 2000; i++)
        for (int shift = 1; shift < 60; shift++)
            check(ldexp(9007199254740992.0 - 1 - 4503 * i, -shift));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_those_of_printf),
        cmocka_unit_test(random_numbers_are_those_of_printf),
        cmocka_unit_test(halves_are_rounded_as_printf_does),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
