// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/identity.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static void the_serial_number_is_found_as_instruments_write_it(void **state)
{
    static const char *const cases[][2] = {
        {"Stanford_Research_Systems,SR830,s/n43480,ver1.07", "43480"},
        {"Cobolt 1064-05-01-0500-100, serial 12345, firmware 3.0", "12345"},
        {"KEITHLEY INSTRUMENTS INC.,MODEL 6485,0796541,B01", "0796541"},
        {"THORLABS,PM100D, P0012345 ,2.4.0", "P0012345"},
        {"Oriental Motor AZ", ""},
        {"maker,model,no more", ""},
        {"", ""},
        {"serial ", ""},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char serial[32] = "before";
        identity_serial(cases[i][0], serial, sizeof serial);
        assert_string_equal(serial, cases[i][1]);
    }
}

static void a_long_one_is_cut(void **state)
{
    char serial[4];
    (void)state;
    identity_serial("a,b,1234567,c", serial, sizeof serial);
    assert_string_equal(serial, "123");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_serial_number_is_found_as_instruments_write_it),
        cmocka_unit_test(a_long_one_is_cut),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
