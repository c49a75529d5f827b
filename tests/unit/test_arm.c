// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit model base
#include "daemon/arm.h"

#include "base/clk.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define NOON_MS INT64_C(1800000000000)

static void nobody_has_armed_at_first(void **state)
{
    (void)state;
    struct arm a = {0};
    struct gon_error err;
    assert_false(arm_is_live(&a, 0) || arm_is_live(NULL, 0));
    assert_int_equal(arm_check(&a, 0, &err), GON_E_REFUSED);
    assert_string_equal(err.text, "not armed; gonio laser arm --for 8h");
    assert_int_equal(arm_check(NULL, 0, NULL), GON_E_REFUSED);
    arm_end(&a, "nothing");
    arm_tick(&a, INT64_MAX);
    assert_true(a.changes == 0 && !*a.end);
}

static void it_lasts_until_its_expiry_and_no_longer(void **state)
{
    (void)state;
    struct arm a = {0};
    struct gon_error err;
    const int64_t start_ns = CLK_S(1000);
    assert_int_equal(arm_set(&a, "anna", "night run", 10, start_ns, NOON_MS, NULL), 0);
    assert_true(a.since_utc_ms == NOON_MS && a.until_utc_ms == NOON_MS + 10000);
    assert_int_equal(arm_check(&a, start_ns, NULL), 0);
    arm_tick(&a, start_ns + CLK_S(10) - 1);
    assert_true(a.live && arm_is_live(&a, start_ns + CLK_S(10) - 1));
    // also before anybody stepped it
    assert_false(arm_is_live(&a, start_ns + CLK_S(10)));
    assert_int_equal(arm_check(&a, start_ns + CLK_S(10), &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "the arm of anna ended: it ran out"));
    arm_tick(&a, start_ns + CLK_S(10));
    assert_false(a.live || arm_is_live(&a, start_ns));
    assert_true(a.changes == 2);
    arm_tick(&a, start_ns + CLK_S(11));
    assert_true(a.changes == 2);
}

static void the_first_reason_of_an_end_stays(void **state)
{
    (void)state;
    struct arm a = {0};
    struct gon_error err;
    assert_int_equal(arm_set(&a, "anna", NULL, 10, 0, NOON_MS, NULL), 0);
    arm_end(&a, "disarmed by bert");
    arm_end(&a, "the run was paused");
    arm_tick(&a, CLK_S(20));
    assert_int_equal(arm_check(&a, 1, &err), GON_E_REFUSED);
    assert_string_equal(err.text, "not armed (the arm of anna ended: disarmed by bert); "
                                  "gonio laser arm --for 8h");
    assert_true(a.changes == 2);
    // only a person brings it back
    assert_int_equal(arm_set(&a, "bert", NULL, 10, CLK_S(30), NOON_MS, NULL), 0);
    assert_true(arm_is_live(&a, CLK_S(39)) && !*a.end && a.changes == 3);
}

static void a_command_extends_it_and_never_shortens_it(void **state)
{
    (void)state;
    struct arm a = {0};
    assert_int_equal(arm_extend(&a, "anna", NULL, 100, 0, NOON_MS, NULL), 0);
    assert_string_equal(a.name, "anna");
    assert_int_equal(arm_extend(&a, "bert", NULL, 50, CLK_S(10), NOON_MS, NULL), 0);
    assert_string_equal(a.name, "anna");
    assert_true(a.changes == 1 && arm_is_live(&a, CLK_S(99)));
    assert_int_equal(arm_extend(&a, "bert", NULL, 100, CLK_S(10), NOON_MS, NULL), 0);
    assert_string_equal(a.name, "bert");
    assert_true(arm_is_live(&a, CLK_S(109)) && !arm_is_live(&a, CLK_S(110)));
    // a person says how long
    assert_int_equal(arm_set(&a, "bert", NULL, 5, CLK_S(20), NOON_MS, NULL), 0);
    assert_false(arm_is_live(&a, CLK_S(25)));
    // one that ended is not extended by its old expiry
    assert_int_equal(arm_set(&a, "anna", NULL, 100, 0, NOON_MS, NULL), 0);
    arm_end(&a, "stopped");
    assert_int_equal(arm_extend(&a, "bert", NULL, 10, 0, NOON_MS, NULL), 0);
    assert_true(arm_is_live(&a, CLK_S(9)) && !arm_is_live(&a, CLK_S(10)));
}

static void a_bad_request_changes_nothing(void **state)
{
    (void)state;
    struct arm a = {0};
    char name[ARM_NAME + 1], reason[ARM_REASON + 1];
    memset(name, 'n', sizeof name - 1);
    memset(reason, 'r', sizeof reason - 1);
    name[ARM_NAME] = reason[ARM_REASON] = 0;
    assert_int_equal(arm_set(&a, "anna", NULL, 10, 0, NOON_MS, NULL), 0);
    const struct arm before = a;
    const double bad[] = {0, -1, ARM_LEAST_S / 2, ARM_MOST_S * 1.001, (double)NAN, (double)INFINITY};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(arm_set(&a, "bert", NULL, bad[i], 0, NOON_MS, NULL), GON_E_INPUT);
        assert_int_equal(arm_extend(&a, "bert", NULL, bad[i], 0, NOON_MS, NULL), GON_E_INPUT);
    }
    assert_int_equal(arm_set(&a, "", NULL, 10, 0, NOON_MS, NULL), GON_E_INPUT);
    assert_int_equal(arm_set(&a, name, NULL, 10, 0, NOON_MS, NULL), GON_E_INPUT);
    assert_int_equal(arm_set(&a, "bert", reason, 10, 0, NOON_MS, NULL), GON_E_INPUT);
    assert_memory_equal(&a, &before, sizeof a);
}

static void it_is_described(void **state)
{
    (void)state;
    struct arm a = {0};
    char text[400];
    setenv("TZ", "UTC", 1);
    tzset();
    arm_describe(&a, text, sizeof text);
    assert_string_equal(text, "not armed");
    assert_int_equal(arm_set(&a, "anna", "night", 7200, 0, NOON_MS, NULL), 0);
    arm_describe(&a, text, sizeof text);
    assert_string_equal(text, "armed by anna until 2027-01-15 10:00 (night)");
    arm_end(&a, "stopped by uid 7");
    arm_describe(&a, text, sizeof text);
    assert_string_equal(text, "not armed; the arm of anna ended: stopped by uid 7");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nobody_has_armed_at_first),
        cmocka_unit_test(it_lasts_until_its_expiry_and_no_longer),
        cmocka_unit_test(the_first_reason_of_an_end_stays),
        cmocka_unit_test(a_command_extends_it_and_never_shortens_it),
        cmocka_unit_test(a_bad_request_changes_nothing),
        cmocka_unit_test(it_is_described),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
