// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/profile_data.h"

#include "tests/unit/profile_sample.h"
#include "tests/unit/randoms.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

struct sample {
    struct profile *p;
    struct profile_data d;
    struct gon_error err;
};

static int begin(void **state)
{
    struct sample *s = calloc(1, sizeof *s);
    *state = s;
    s->p = profile_sample();
    return 0;
}

static int end(void **state)
{
    struct sample *s = *state;
    free(s->p);
    free(s);
    return 0;
}

static void assert_near(double got, double expected)
{
    if (!(fabs(got - expected) <= 1e-12 * fabs(expected)))
        print_error("got %.17g / expected %.17g\n", got, expected);
    assert_true(fabs(got - expected) <= 1e-12 * fabs(expected));
}

static void names_are_found_and_others_are_not(void **state)
{
    struct sample *s = *state;
    assert_int_equal(profile_value(s->p, "tau_s"), S_TAU);
    assert_int_equal(profile_value(s->p, "tau"), -1);
    assert_int_equal(profile_value(s->p, ""), -1);
    assert_int_equal(profile_exchange(s->p, "x"), -1);
    strcpy(s->p->writes[2].name, "go");
    s->p->writes_count = 3;
    assert_int_equal(profile_write(s->p, "go"), 2);
}

static void what_is_set_is_known_and_what_is_not_is_nan(void **state)
{
    struct sample *s = *state;
    profile_data_set(s->p, &s->d, S_X, 2.5);
    assert_true(s->d.known[S_X]);
    assert_near(profile_data_number(s->p, &s->d, "x"), 2.5);
    assert_true(isnan(profile_data_number(s->p, &s->d, "count")));
    assert_true(isnan(profile_data_number(s->p, &s->d, "")));
    assert_true(isnan(profile_data_number(s->p, &s->d, "nobody")));
    profile_data_set(s->p, &s->d, S_X, (double)NAN);
    assert_false(s->d.known[S_X]);
    profile_data_set(s->p, &s->d, S_CURRENT, (double)INFINITY);
    assert_true(s->d.known[S_CURRENT]);
    profile_data_clear(&s->d);
    assert_false(s->d.known[S_CURRENT]);
}

static void words_have_numbers_and_numbers_words(void **state)
{
    struct sample *s = *state;
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_STATE, "once", &s->err), 0);
    assert_near(s->d.number[S_STATE], 2);
    assert_string_equal(s->d.text[S_STATE], "ONCE");
    profile_data_set(s->p, &s->d, S_STATE, 3);
    assert_string_equal(s->d.text[S_STATE], "no head");
    profile_data_set(s->p, &s->d, S_STATE, 4); // there is no such word
    assert_false(s->d.known[S_STATE]);
    profile_data_set(s->p, &s->d, S_MODE, 4); // counted from 3
    assert_string_equal(s->d.text[S_MODE], "ready");
    profile_data_set(s->p, &s->d, S_MODE, 9); // a whole number needs none
    assert_true(s->d.known[S_MODE]);
    assert_string_equal(s->d.text[S_MODE], "");
}

static void a_text_that_does_not_fit_is_refused(void **state)
{
    struct sample *s = *state;
    char longer[PROFILE_DATA_TEXT + 1];
    memset(longer, 'x', sizeof longer - 1);
    longer[sizeof longer - 1] = 0;
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_MODEL, longer, &s->err), GON_E_INPUT);
    assert_false(s->d.known[S_MODEL]);
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_MODEL, longer + 1, NULL), 0);
    assert_string_equal(s->d.text[S_MODEL], longer + 1);
    assert_true(isnan(s->d.number[S_MODEL]));
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_STATE, "HALF", &s->err), GON_E_INPUT);
    assert_string_equal(s->err.text, "'HALF' is no word of state");
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_X, "1,5", &s->err), GON_E_INPUT);
    assert_string_equal(s->err.text, "'1,5' is not a number");
}

static void literals_are_decimal_hexadecimal_words_or_over(void **state)
{
    struct sample *s = *state;
    double n;
    assert_int_equal(profile_literal(NULL, "-1.5e3", &n, NULL), 0);
    assert_near(n, -1500);
    assert_int_equal(profile_literal(NULL, "0xC8001002", &n, NULL), 0);
    assert_near(n, 3355447298.0);
    assert_int_equal(profile_literal(NULL, "over", &n, NULL), 0);
    assert_true(isinf(n));
    assert_int_equal(profile_literal(&s->p->values[S_MODE], "Ready", &n, NULL), 0);
    assert_near(n, 4);
    assert_int_equal(profile_literal(&s->p->values[S_MODE], "7", &n, NULL), 0);
    assert_near(n, 7);
    assert_int_equal(profile_literal(&s->p->values[S_STATE], "1", &n, NULL), GON_E_INPUT);
    static const char *const none[] = {"",    "0x",  "0x1G", "0x1234567890ABC",
                                       "nan", "inf", "1 2",  "-"};
    for (int i = 0; i < 8; i++)
        assert_int_equal(profile_literal(NULL, none[i], &n, NULL), GON_E_INPUT);
}

static void the_wire_carries_scaled_inverse_and_indexed_numbers(void **state)
{
    struct sample *s = *state;
    static const struct {
        int value;
        double number, wire;
    } pairs[] = {{S_X, 2.5, 2.5},       {S_LEVEL, 0.25, 250}, {S_TAU, 3e-5, 1},    {S_TAU, 1, 4},
                 {S_PERIOD, 400, 2500}, {S_STATE, 3, 3},      {S_COUNT, 100, 100}, {S_MODE, 4, 4}};
    for (int i = 0; i < 8; i++) {
        double got;
        const struct profile_value *v = &s->p->values[pairs[i].value];
        assert_int_equal(profile_wire(v, pairs[i].number, &got, &s->err), 0);
        assert_near(got, pairs[i].wire);
        assert_int_equal(profile_number(v, pairs[i].wire, &got, &s->err), 0);
        assert_near(got, pairs[i].number);
    }
}

static void an_offset_is_added_to_what_came(void **state)
{
    struct sample *s = *state;
    struct profile_value kelvin = {.name = "t_c", .scale = 0.1, .offset = -273.15};
    double got;
    (void)s;
    assert_int_equal(profile_number(&kelvin, 2981.5, &got, NULL), 0);
    assert_near(got, 0.1 * 2981.5 - 273.15);
    assert_int_equal(profile_wire(&kelvin, 25, &got, NULL), 0);
    assert_near(got, 298.15 / 0.1);
}

static void what_the_wire_cannot_say_is_refused(void **state)
{
    struct sample *s = *state;
    static const struct {
        int value;
        double number;
        const char *says;
    } wrong[] = {
        {S_LEVEL, 0.6, "level_w = 0.6 W; allowed: 0..0.5"},
        {S_LEVEL, -0.1, "level_w = -0.1 W; allowed: 0..0.5"},
        {S_TAU, 1.9e-5, "tau_s = 1.9e-05 s is not one of its settings; nearest: 1e-05"},
        {S_COUNT, 2.5, "count = 2.5 is not a whole number"},
        {S_STATE, 4, "state = 4 has no word"},
        {S_PERIOD, 0, "rate_hz = 0 cannot be said: it would be 1/0"},
    };
    double got = 7;
    for (int i = 0; i < 6; i++) {
        assert_int_equal(
            profile_wire(&s->p->values[wrong[i].value], wrong[i].number, &got, &s->err),
            GON_E_INPUT);
        assert_string_equal(s->err.text, wrong[i].says);
    }
    assert_int_equal(profile_wire(&s->p->values[S_X], (double)NAN, &got, NULL), GON_E_INPUT);
    assert_int_equal(profile_wire(&s->p->values[S_X], (double)INFINITY, &got, NULL), GON_E_INPUT);
    assert_near(got, 7);
}

static void what_the_device_cannot_have_said_is_refused(void **state)
{
    struct sample *s = *state;
    static const struct {
        int value;
        double wire;
        const char *says;
    } wrong[] = {
        {S_LEVEL, 501, "level_w: 0.501 W is not in 0..0.5"},
        {S_TAU, 5, "tau_s: 5 is not in 0..4"},
        {S_TAU, 1.5, "tau_s: 1.5 is not in 0..4"},
        {S_COUNT, 1.5, "count: 1.5 is not a whole number"},
        {S_STATE, -1, "state: -1 is no word's number"},
    };
    double got = 7;
    for (int i = 0; i < 5; i++) {
        assert_int_equal(
            profile_number(&s->p->values[wrong[i].value], wrong[i].wire, &got, &s->err),
            GON_E_LINK);
        assert_string_equal(s->err.text, wrong[i].says);
    }
    assert_int_equal(profile_number(&s->p->values[S_X], (double)INFINITY, &got, NULL), GON_E_LINK);
    assert_int_equal(profile_number(&s->p->values[S_PERIOD], 0, &got, NULL), GON_E_LINK);
    assert_near(got, 7);
}

static void over_is_infinite_and_invalid_is_no_number(void **state)
{
    struct sample *s = *state;
    const struct profile_value *v = &s->p->values[S_CURRENT];
    double got;
    assert_int_equal(profile_number(v, 9.9e37, &got, NULL), 0);
    assert_true(isinf(got));
    assert_int_equal(profile_number(v, 9.91e37, &got, NULL), 0);
    assert_true(isnan(got));
    assert_int_equal(profile_wire(v, (double)INFINITY, &got, NULL), 0);
    assert_near(got, 9.9e37);
}

static void the_setting_that_is_at_least_what_was_asked(void **state)
{
    struct sample *s = *state;
    const struct profile_value *v = &s->p->values[S_TAU];
    double got;
    assert_int_equal(profile_at_least(v, 2e-4, &got, NULL), 0);
    assert_near(got, 1); // not 3, which stands before it
    assert_int_equal(profile_at_least(v, 3e-5 * (1 + 1e-10), &got, NULL), 0);
    assert_near(got, 3e-5);
    assert_int_equal(profile_at_least(v, -1, &got, NULL), 0);
    assert_near(got, 1e-5);
    assert_int_equal(profile_at_least(&s->p->values[S_X], 0.3, &got, NULL), 0);
    assert_near(got, 0.3);
    assert_int_equal(profile_at_least(v, 3.1, &got, &s->err), GON_E_INPUT);
    assert_string_equal(s->err.text, "tau_s: 3.1 s is more than its largest setting");
}

static void assignments_take_numbers_words_texts_and_params(void **state)
{
    struct sample *s = *state;
    const struct profile_param params[] = {{"speed", 1200}, {NULL, 0}};
    assert_int_equal(profile_assign_data(s->p,
                                         "x=-1e-3, status = 0x07,mode = ready , state = 'no head', "
                                         "model = 'a, b', count = $speed, current_a = over",
                                         params, &s->d, &s->err),
                     0);
    assert_near(s->d.number[S_X], -1e-3);
    assert_near(s->d.number[S_STATUS], 7);
    assert_near(s->d.number[S_MODE], 4);
    assert_near(s->d.number[S_STATE], 3);
    assert_string_equal(s->d.text[S_MODEL], "a, b");
    assert_near(s->d.number[S_COUNT], 1200);
    assert_true(isinf(s->d.number[S_CURRENT]));
    assert_int_equal(profile_assign_data(s->p, "", NULL, &s->d, NULL), 0);
}

static void assignments_that_are_wrong_say_why(void **state)
{
    static const struct {
        const char *text, *says;
    } wrong[] = {
        {"y = 1", "there is no value 'y'"},
        {"x", "'=' is missing behind x"},
        {"x = ", "x = what?"},
        {"x = , count = 1", "x = what?"},
        {"x = one", "'one' is not a number"},
        {"state = HALF", "'HALF' is no word of state"},
        {"x = 1 count = 2", "a comma is missing before 'count'"},
        {"x = 1,", "nothing stands behind the last comma"},
        {"x = $speed", "there is no $speed here"},
        {"model = 'open", "model = what?"},
        {", x = 1", "there is no value ','"},
    };
    struct sample *s = *state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(profile_assign_data(s->p, wrong[i].text, NULL, &s->d, &s->err),
                         GON_E_INPUT);
        assert_string_equal(s->err.text, wrong[i].says);
    }
}

static int refuse(void *ctx, int value, double number, const char *text, struct gon_error *err)
{
    (void)ctx, (void)value, (void)number, (void)text;
    return gon_fail(err, GON_E_DEVICE, "no");
}

static void what_take_returns_ends_it(void **state)
{
    struct sample *s = *state;
    assert_int_equal(profile_assign(s->p, "x = 1", NULL, refuse, NULL, NULL), GON_E_DEVICE);
}

static void any_text_is_an_assignment_or_an_error(void **state)
{
    static const char letters[] = "x=count$speed,'1 .e-0x mode\t\\\xff*|<>!~";
    struct sample *s = *state;
    uint64_t seed = random_seed();
    for (int round = 0; round < 100000; round++) {
        char text[64] = "";
        const size_t size = random_next(&seed) % 40;
        for (size_t i = 0; i < size; i++)
            text[i] = letters[random_next(&seed) % (sizeof letters - 1)];
        const int rc = profile_assign_data(s->p, text, NULL, &s->d, &s->err);
        assert_true(rc == 0 || rc == GON_E_INPUT);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(names_are_found_and_others_are_not),
        TEST(what_is_set_is_known_and_what_is_not_is_nan),
        TEST(words_have_numbers_and_numbers_words),
        TEST(a_text_that_does_not_fit_is_refused),
        TEST(literals_are_decimal_hexadecimal_words_or_over),
        TEST(the_wire_carries_scaled_inverse_and_indexed_numbers),
        TEST(an_offset_is_added_to_what_came),
        TEST(what_the_wire_cannot_say_is_refused),
        TEST(what_the_device_cannot_have_said_is_refused),
        TEST(over_is_infinite_and_invalid_is_no_number),
        TEST(the_setting_that_is_at_least_what_was_asked),
        TEST(assignments_take_numbers_words_texts_and_params),
        TEST(assignments_that_are_wrong_say_why),
        TEST(what_take_returns_ends_it),
        TEST(any_text_is_an_assignment_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
