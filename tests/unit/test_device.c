// SPDX-License-Identifier: MIT
// uses: drivers base
// Devices by the names of their profiles.
#include "drivers/device.h"

#include "drivers/profile.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

// A port that is not there: so each profile was found, loaded and is one of the role.
static void a_profile_of_the_role_is_opened_by_its_name(void **state)
{
    struct profile *laser = NULL, *detector = NULL;
    struct laser *l;
    struct detector *d;
    struct gon_error err;
    (void)state;
    assert_int_equal(device_open_laser("cobolt-05", "configs", &laser, "serial:/dev/not-there",
                                       clk_system(), NULL, &l, &err),
                     GON_E_GONE);
    assert_string_equal(laser->name, "cobolt-05");
    assert_int_equal(device_open_detector("sr830", "configs", &detector, "serial:/dev/not-there",
                                          clk_system(), NULL, &d, &err),
                     GON_E_GONE);
    assert_string_equal(detector->name, "sr830");
    free(laser);
    free(detector);
}

static void one_of_another_role_or_name_is_an_error_of_the_bench_file(void **state)
{
    struct profile *p = NULL;
    struct laser *l;
    struct axis *a;
    struct gon_error err;
    (void)state;
    assert_int_equal(device_open_laser("cobolt", "configs", &p, "serial:/dev/not-there",
                                       clk_system(), NULL, &l, &err),
                     GON_E_INPUT);
    assert_non_null(strstr(err.text, "no profile 'cobolt'"));
    assert_null(p);
    assert_int_equal(device_open_laser("sr830", "configs", &p, "serial:/dev/not-there",
                                       clk_system(), NULL, &l, &err),
                     GON_E_INPUT);
    assert_string_equal(err.text, "profile sr830 is not of a laser");
    assert_int_equal(device_new_axis("sr830", "configs", &p, NULL, 1, &a, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "the profile 'sr830' is not one of an axis"));
    free(p);
    struct profile *inputs = calloc(1, sizeof *inputs);
    inputs->role = PROFILE_INPUTS;
    inputs->protocol = PROFILE_MODBUS;
    assert_int_equal(device_new_axis("door", "configs", &inputs, NULL, 1, &a, &err), GON_E_INPUT);
    struct inputs *in;
    assert_int_equal(device_open_inputs("door", "configs", &inputs, "serial:/dev/not-there",
                                        clk_system(), NULL, &in, &err),
                     GON_E_INPUT);
    assert_non_null(strstr(err.text, "'door' is not one of inputs on a link of its own"));
    inputs->role = PROFILE_SELECTOR;
    assert_int_equal(
        device_new_inputs("door", "configs", &inputs, NULL, 1, clk_system(), &in, &err),
        GON_E_INPUT);
    assert_non_null(strstr(err.text, "'door' is not one of inputs on a Modbus bus"));
    free(inputs);
    struct selector *z;
    p = NULL;
    assert_int_equal(device_open_selector("thorlabs-sc10", "configs", &p, "serial:/dev/not-there",
                                          clk_system(), NULL, &z, &err),
                     GON_E_GONE);
    free(p);
    p = NULL;
    assert_int_equal(device_open_selector("sr830", "configs", &p, "serial:/dev/not-there",
                                          clk_system(), NULL, &z, &err),
                     GON_E_INPUT);
    free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_profile_of_the_role_is_opened_by_its_name),
        cmocka_unit_test(one_of_another_role_or_name_is_an_error_of_the_bench_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
