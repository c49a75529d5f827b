// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/identity.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
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

static void it_is_another_only_if_the_former_gave_another_serial_number(void **state)
{
    static const struct {
        const char *before, *now, *told; // NULL: the same
    } cases[] = {
        {"", "Cobolt 06, serial 7, firmware 1", NULL},
        {"Cobolt 06, serial 7, firmware 1", "Cobolt 06, serial 7, firmware 2", NULL},
        {"a lamp", "another lamp", NULL},
        {"a lamp", "a lamp, serial 9", NULL},
        {"Cobolt 06, serial 7", "Cobolt 06, serial 71", "serial number 7 before, 71 now"},
        {"S,SR830,s/n43480,1", "S,SR830,s/n43481,1", "serial number 43480 before, 43481 now"},
        {"S,SR830,s/n43480,1", "S,SR830,43480,1", NULL},
        {"Cobolt 06, serial 7", "Cobolt 06", "serial number 7 before, none now"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct gon_error err = {0};
        const int rc = identity_same(cases[i].before, cases[i].now, &err);
        assert_int_equal(rc, cases[i].told ? GON_E_DEVICE : 0);
        if (cases[i].told)
            assert_non_null(strstr(err.text, cases[i].told));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_serial_number_is_found_as_instruments_write_it),
        cmocka_unit_test(a_long_one_is_cut),
        cmocka_unit_test(it_is_another_only_if_the_former_gave_another_serial_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
