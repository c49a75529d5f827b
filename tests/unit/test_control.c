// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit model base
#include "daemon/control.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static void nobody_has_it_at_first(void **state)
{
    (void)state;
    struct control c = {0};
    assert_false(control_taken(&c));
    assert_int_equal(control_check(&c, "anna", NULL), 0);
    assert_int_equal(control_check(&c, "", NULL), 0);
    assert_int_equal(control_release(&c, "anna", NULL), 0);
}

static void others_are_told_who_since_when_and_why(void **state)
{
    (void)state;
    struct control c = {0};
    struct gon_error err;
    setenv("TZ", "UTC", 1);
    tzset();
    assert_int_equal(control_take(&c, "anna", "night run", NULL, 1800000000000, NULL), 0);
    assert_int_equal(control_check(&c, "anna", NULL), 0);
    assert_int_equal(control_check(&c, "bert", &err), GON_E_REFUSED);
    assert_string_equal(err.text, "anna has control since 2027-01-15 08:00 (night run); ask, or take "
                                  "it: gonio control take --from 'anna'");
    assert_int_equal(control_take(&c, "bert", NULL, NULL, 1, &err), GON_E_REFUSED);
    assert_int_equal(control_take(&c, "bert", NULL, "carl", 1, &err), GON_E_REFUSED);
    assert_int_equal(control_release(&c, "bert", &err), GON_E_REFUSED);
    assert_string_equal(c.name, "anna");
}

static void it_is_taken_from_whom_one_names(void **state)
{
    (void)state;
    struct control c = {0};
    struct gon_error err;
    assert_int_equal(control_take(&c, "anna", NULL, NULL, 1000, NULL), 0);
    assert_int_equal(control_check(&c, "bert", &err), GON_E_REFUSED);
    assert_null(strchr(err.text, '(')); // no reason, no brackets
    assert_int_equal(control_take(&c, "anna", "more", NULL, 2000, NULL), 0);
    assert_int_equal(c.since_utc_ms, 1000); // still hers
    assert_int_equal(control_take(&c, "bert", "", "anna", 3000, NULL), 0);
    assert_int_equal(c.since_utc_ms, 3000);
    assert_int_equal(control_check(&c, "anna", NULL), GON_E_REFUSED);
    assert_int_equal(control_release(&c, "bert", NULL), 0);
    assert_false(control_taken(&c));
}

static void it_needs_a_name(void **state)
{
    (void)state;
    struct control c = {0};
    char name[CONTROL_NAME + 1];
    memset(name, 'x', sizeof name);
    name[CONTROL_NAME] = 0;
    assert_int_equal(control_take(&c, "", NULL, NULL, 1, NULL), GON_E_INPUT);
    assert_int_equal(control_take(&c, name, NULL, NULL, 1, NULL), GON_E_INPUT);
    name[CONTROL_NAME - 1] = 0;
    assert_int_equal(control_take(&c, name, NULL, NULL, 1, NULL), 0);
    assert_int_equal(control_check(&c, name, NULL), 0);
    char reason[CONTROL_REASON + 1];
    memset(reason, 'x', sizeof reason);
    reason[CONTROL_REASON] = 0;
    assert_int_equal(control_take(&c, name, reason, NULL, 1, NULL), GON_E_INPUT);
    assert_string_equal(c.reason, ""); // as it was
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nobody_has_it_at_first),
        cmocka_unit_test(others_are_told_who_since_when_and_why),
        cmocka_unit_test(it_is_taken_from_whom_one_names),
        cmocka_unit_test(it_needs_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
