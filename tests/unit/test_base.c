// SPDX-License-Identifier: MIT
// uses: base
#include "base/cancel.h"
#include "base/clk.h"
#include "base/crc32c.h"
#include "base/err.h"
#include "base/mail.h"
#include "base/paths.h"
#include "base/units.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static void error_text_names_who_before_what(void **state)
{
    (void)state;
    struct gon_error err;
    assert_int_equal(gon_fail(&err, GON_E_LINK, "no answer in %d ms", 100), GON_E_LINK);
    assert_int_equal(gon_prefix(&err, "axis %s", "theta_r"), GON_E_LINK);
    assert_string_equal(err.text, "axis theta_r: no answer in 100 ms");
}

static void error_text_too_long_is_cut_not_overrun(void **state)
{
    (void)state;
    struct gon_error err;
    char longer[2 * sizeof err.text];
    memset(longer, 'x', sizeof longer);
    longer[sizeof longer - 1] = 0;
    gon_fail(&err, GON_E_INPUT, "%s", longer);
    gon_prefix(&err, "%s", longer);
    assert_int_equal(strlen(err.text), sizeof err.text - 1);
}

static void crc32c_of_the_standard_check_string(void **state)
{
    (void)state;
    assert_int_equal(crc32c(0, "123456789", 9),
                     0xe3069283); // RFC 3720 polynomial, catalogue check value
    assert_int_equal(crc32c(crc32c(0, "1234", 4), "56789", 5), 0xe3069283);
    unsigned char zeros[32] = {0};
    assert_int_equal(crc32c(0, zeros, 32), 0x8a9136aa); // RFC 3720 B.4
}

static void virtual_time_moves_only_by_sleeping(void **state)
{
    (void)state;
    struct clk_virtual v;
    struct clk *clk = clk_virtual_init(&v, 1000, 5000);
    assert_int_equal(clk_now_ns(clk), 1000);
    assert_int_equal(clk_sleep(clk, CLK_S(3600), NULL), 0);
    assert_int_equal(clk_now_ns(clk), 1000 + CLK_S(3600));
    assert_int_equal(clk_utc_ns(clk), 5000 + CLK_S(3600));
    assert_int_equal(clk_sleep_until(clk, 0, NULL), 0); // the past costs nothing
    assert_int_equal(clk_now_ns(clk), 1000 + CLK_S(3600));
}

static void *request(void *c)
{
    cancel_request(c);
    return NULL;
}

static void a_cancel_wakes_a_sleeper(void **state)
{
    (void)state;
    struct cancel *c = cancel_new();
    pthread_t t;
    pthread_create(&t, NULL, request, c);
    int64_t start_ns = clk_now_ns(clk_system());
    assert_int_equal(clk_sleep(clk_system(), CLK_S(60), c), GON_E_CANCELED);
    assert_true(clk_now_ns(clk_system()) - start_ns < CLK_S(30));
    pthread_join(t, NULL);
    cancel_reset(c);
    assert_int_equal(clk_sleep(clk_system(), 1, c), 0);
    cancel_free(c);
}

struct number {
    struct letter letter;
    int value;
};

static void mail_arrives_in_order_and_wakes_the_owner(void **state)
{
    (void)state;
    struct mail *m = mail_new();
    struct number a = {.value = 1}, b = {.value = 2};
    assert_null(mail_take(m));
    mail_post(m, &a.letter);
    mail_post(m, &b.letter);
    assert_int_equal(((struct number *)mail_wait(m, 1000, NULL))->value, 1);
    assert_int_equal(((struct number *)mail_wait(m, 1000, NULL))->value, 2);
    assert_null(mail_wait(m, 1, NULL));
    mail_free(m, NULL);
}

static void angles_survive_storage(void **state)
{
    (void)state;
    assert_int_equal(units_udeg(-82.5), -82500000);
    assert_true(units_deg_of_udeg(units_udeg(0.1)) == 0.1);
    assert_true(fabs(units_rad(180.0) - UNITS_PI) < 1e-15);
    assert_true(fabs(units_deg(units_rad(59.5)) - 59.5) < 1e-13);
}

static void the_guards_socket_stands_beside_the_daemons(void **state)
{
    (void)state;
    static const char *const pairs[][2] = {{"/run/goniod.sock", "/run/goniod-guard.sock"},
                                           {"/tmp/x", "/tmp/x-guard.sock"},
                                           {".sock", ".sock-guard.sock"}};
    char path[200], longest[120];
    struct gon_error err;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(paths_guard(pairs[i][0], path, sizeof path, &err), 0);
        assert_string_equal(path, pairs[i][1]);
    }
    memset(longest, 'x', sizeof longest);
    longest[107 - 11] = 0;
    assert_int_equal(paths_guard(longest, path, sizeof path, &err), 0);
    longest[107 - 11] = 'x';
    longest[107 - 10] = 0;
    assert_int_equal(paths_guard(longest, path, sizeof path, &err), GON_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(error_text_names_who_before_what),
        cmocka_unit_test(error_text_too_long_is_cut_not_overrun),
        cmocka_unit_test(crc32c_of_the_standard_check_string),
        cmocka_unit_test(virtual_time_moves_only_by_sleeping),
        cmocka_unit_test(a_cancel_wakes_a_sleeper),
        cmocka_unit_test(mail_arrives_in_order_and_wakes_the_owner),
        cmocka_unit_test(angles_survive_storage),
        cmocka_unit_test(the_guards_socket_stands_beside_the_daemons),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
