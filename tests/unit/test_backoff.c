// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/backoff.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static void the_pause_doubles_from_100_ms_to_5_s(void **state)
{
    static const int64_t waits_ns[] = {CLK_MS(100), CLK_MS(200), CLK_MS(400), CLK_MS(800),
                                       CLK_S(1.6),  CLK_S(3.2),  CLK_S(5),    CLK_S(5)};
    struct backoff b = {0};
    int64_t now_ns = CLK_S(7);
    (void)state;
    assert_true(backoff_due(&b, now_ns));
    assert_true(backoff_due(&b, 0));
    for (size_t i = 0; i < sizeof waits_ns / sizeof *waits_ns; i++) {
        backoff_failed(&b, now_ns);
        assert_false(backoff_due(&b, now_ns));
        now_ns += waits_ns[i];
        assert_false(backoff_due(&b, now_ns - 1));
        assert_true(backoff_due(&b, now_ns));
    }
}

static void what_came_back_is_tried_at_once_when_it_goes_again(void **state)
{
    struct backoff b = {0};
    (void)state;
    for (int i = 0; i < 10; i++)
        backoff_failed(&b, CLK_S(i));
    backoff_reset(&b);
    assert_true(backoff_due(&b, CLK_S(10)));
    backoff_failed(&b, CLK_S(10));
    assert_true(backoff_due(&b, CLK_S(10.1)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_pause_doubles_from_100_ms_to_5_s),
        cmocka_unit_test(what_came_back_is_tried_at_once_when_it_goes_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
