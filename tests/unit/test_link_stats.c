// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/link_stats.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

static void assert_near(double value, double expected)
{
    if (!(fabs(value - expected) <= 1e-12 * fabs(expected)))
        fail_msg("%.15g, not %.15g", value, expected);
}

static void buckets_go_1_2_5_from_10_us_to_10_s(void **state)
{
    (void)state;
    for (int i = 0; i + 1 < LINK_BUCKETS; i++) {
        static const double steps[] = {1, 2, 5};
        assert_near(link_stats_bound_s(i), steps[i % 3] * pow(10, i / 3 - 5));
    }
    assert_true(isinf(link_stats_bound_s(LINK_BUCKETS - 1)));
    assert_near(link_stats_bound_s(LINK_BUCKETS - 2), 10.0);
}

static void an_answer_lands_in_the_bucket_that_still_holds_it(void **state)
{
    struct link_stats s = {0};
    (void)state;
    link_stats_answer(&s, 0);
    link_stats_answer(&s, 10000); // a bound belongs to what is below it
    link_stats_answer(&s, 10001);
    link_stats_answer(&s, 10000000000);
    link_stats_answer(&s, 10000000001);
    assert_int_equal(s.answers[0], 2);
    assert_int_equal(s.answers[1], 1);
    assert_int_equal(s.answers[LINK_BUCKETS - 2], 1);
    assert_int_equal(s.answers[LINK_BUCKETS - 1], 1);
    assert_int_equal(link_stats_answers(&s), 5);
    assert_int_equal(s.latency_sum_ns, 20000020002);
    assert_int_equal(s.latency_last_ns, 10000000001);
    link_stats_answer(&s, 5);
    assert_int_equal(s.latency_last_ns, 5);
    for (int i = 1; i + 2 < LINK_BUCKETS; i++) {
        const uint64_t before = s.answers[i];
        link_stats_answer(&s, llround(link_stats_bound_s(i) * 1e9));
        assert_int_equal(s.answers[i], before + 1);
    }
    assert_int_equal(s.latency_worst_ns, 10000000001);
}

static void quantiles_are_linear_within_a_bucket(void **state)
{
    struct link_stats s = {0};
    (void)state;
    assert_true(isnan(link_stats_quantile_s(&s, 0.5)));
    for (int i = 0; i < 90; i++)
        link_stats_answer(&s, 1500000); // 1..2 ms
    for (int i = 0; i < 10; i++)
        link_stats_answer(&s, 100000000); // 50..100 ms
    assert_near(link_stats_quantile_s(&s, 0.45), 0.0015);
    assert_near(link_stats_quantile_s(&s, 0.9), 0.002);
    assert_near(link_stats_quantile_s(&s, 0.95), 0.075);
    assert_near(link_stats_quantile_s(&s, 1.0), 0.1);
}

static void no_quantile_exceeds_the_worst_seen(void **state)
{
    struct link_stats s = {0};
    (void)state;
    link_stats_answer(&s, 51000000);
    assert_near(link_stats_quantile_s(&s, 1.0), 0.051);
    link_stats_answer(&s, 30000000000); // beyond the last bound
    assert_near(link_stats_quantile_s(&s, 1.0), 30.0);
    assert_near(link_stats_quantile_s(&s, 0.75), 20.0);
}

static void errors_are_named_and_added_up(void **state)
{
    struct link_stats s = {.errors = {[LINK_SILENT] = 2, [LINK_HUNG_UP] = 3}};
    (void)state;
    assert_int_equal(link_stats_failures(&s), 5);
    assert_string_equal(link_error_name(LINK_SILENT), "silent");
    assert_string_equal(link_error_name(LINK_HUNG_UP), "hung-up");
    for (int i = 0; i < LINK_ERRORS; i++)
        for (int j = 0; j < i; j++)
            assert_string_not_equal(link_error_name(i), link_error_name(j));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(buckets_go_1_2_5_from_10_us_to_10_s),
        cmocka_unit_test(an_answer_lands_in_the_bucket_that_still_holds_it),
        cmocka_unit_test(quantiles_are_linear_within_a_bucket),
        cmocka_unit_test(no_quantile_exceeds_the_worst_seen),
        cmocka_unit_test(errors_are_named_and_added_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
