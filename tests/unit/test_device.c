// SPDX-License-Identifier: MIT
// uses: campaign drivers fit model base
#include "drivers/device.h"

#include "campaign/bench.h"
#include "drivers/axis.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static void every_driver_that_a_bench_file_may_name_can_be_opened(void **state)
{
    struct gon_error err;
    struct laser *laser = NULL;
    struct detector *detector = NULL;
    (void)state;
    for (int i = 0; bench_laser_drivers[i]; i++)
        assert_int_equal(device_open_laser(bench_laser_drivers[i], "serial:/nowhere/l",
                                           clk_system(), NULL, &laser, &err),
                         GON_E_GONE);
    for (int i = 0; bench_detector_drivers[i]; i++)
        assert_int_equal(device_open_detector(bench_detector_drivers[i], "serial:/nowhere/d",
                                              clk_system(), NULL, &detector, &err),
                         GON_E_GONE);
    for (int i = 0; bench_axis_drivers[i]; i++) {
        struct axis *axis = NULL;
        assert_int_equal(device_new_axis(bench_axis_drivers[i], NULL, 1, &axis, &err), 0);
        axis->ops->free(axis);
    }
    assert_null(laser);
    assert_null(detector);
}

static void an_unknown_one_is_an_error_of_the_bench_file(void **state)
{
    struct gon_error err;
    struct laser *laser;
    struct detector *detector;
    struct axis *axis;
    (void)state;
    assert_int_equal(device_open_laser("x", "serial:/l", clk_system(), NULL, &laser, &err),
                     GON_E_INPUT);
    assert_non_null(strstr(err.text, "no driver 'x' for a laser"));
    assert_int_equal(device_open_detector("x", "serial:/d", clk_system(), NULL, &detector, &err),
                     GON_E_INPUT);
    assert_int_equal(device_new_axis("x", NULL, 1, &axis, &err), GON_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_driver_that_a_bench_file_may_name_can_be_opened),
        cmocka_unit_test(an_unknown_one_is_an_error_of_the_bench_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
