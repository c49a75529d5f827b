// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/profile_when.h"

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
    return profile_assign_data(s->p,
                               "x = -1.5, count = 7, status = 0x80000002, model = 'Rumba-06-91', "
                               "state = 'no head', tau_s = 1, mode = ready, current_a = over",
                               NULL, &s->d, NULL);
}

static int end(void **state)
{
    struct sample *s = *state;
    free(s->p);
    free(s);
    return 0;
}

static void assert_all(struct sample *s, const char *const *conditions, bool expected)
{
    for (; *conditions; conditions++) {
        if (profile_when_check(s->p, *conditions, &s->err) < 0)
            fail_msg("%s: %s", *conditions, s->err.text);
        if (profile_when(s->p, *conditions, &s->d) != expected)
            fail_msg("'%s' should be %s", *conditions, expected ? "true" : "false");
    }
}

static const char *const true_ones[] = {
    "",
    "  ",
    "status.on",
    "status.key_off",
    "not status.fault",
    "count = 7",
    "count=7",
    "count != 8",
    "x < -1",
    "x <= -1.5",
    "x >= -1.5",
    "|x| >= 1.5",
    "|x| = 1.5",
    "| x | > 1.4",
    "|x| <= 1.5 * tau_s",
    "|x| <= 1.5*tau_s",
    "|x| > tau_s",
    "count > tau_s",
    "mode = ready",
    "mode = READY",
    "mode = 4",
    "mode != warming",
    "mode > warming",
    "state = 'no head'",
    "state != OFF",
    "state ~ 'NO*'",
    "current_a = over",
    "x != over",
    "current_a > 1e30",
    "status has 0x02",
    "status has 0x80000000",
    "status has 3",
    "status lacks 0x05",
    "model ~ '*-06-*'",
    "model ~ 'rumba*'",
    "model !~ '*-05-*'",
    "x known",
    "unheard unknown",
    "status.on and x < 0 and mode = ready",
    NULL,
};

static const char *const false_ones[] = {
    "status.fault",
    "not status.on",
    "count = 8",
    "count != 7",
    "x < -1.5",
    "x > -1.5",
    "x >= -1.4",
    "|x| < 1.5",
    "|x| <= 1.4 * tau_s",
    "mode = warming",
    "mode != ready",
    "state = ON",
    "x = over",
    "current_a != over",
    "current_a < 1",
    "status has 0x01",
    "status lacks 0x03",
    "model ~ '*-05-*'",
    "model !~ 'RUMBA*'",
    "model ~ 'Rumba'",
    "x unknown",
    "unheard known",
    "status.on and x > 0",
    "x > 0 and status.on",
    NULL,
};

static void every_form_is_true_when_it_is(void **state)
{
    assert_all(*state, true_ones, true);
}

static void every_form_is_false_when_it_is(void **state)
{
    assert_all(*state, false_ones, false);
}

static void what_is_not_known_is_false_whatever_is_said(void **state)
{
    static const char *const conditions[] = {"unheard = 0",
                                             "unheard != 0",
                                             "unheard < 1",
                                             "unheard >= 0",
                                             "unheard = over",
                                             "unheard != over",
                                             "|unheard| < 1",
                                             "unheard has 1",
                                             "unheard lacks 1",
                                             "x < unheard",
                                             "x != 2 * unheard",
                                             "status.fault",
                                             "not status.fault",
                                             "model ~ '*'",
                                             "model !~ 'x'",
                                             "state != OFF",
                                             "state = OFF",
                                             "mode != warming",
                                             NULL};
    struct sample *s = *state;
    s->d.known[S_STATUS] = s->d.known[S_MODEL] = s->d.known[S_STATE] = s->d.known[S_MODE] = false;
    assert_all(s, conditions, false);
}

static void mistakes_are_named(void **state)
{
    static const struct {
        const char *condition, *says;
    } wrong[] = {
        {"y = 1", "there is no value 'y'"},
        {"y.fault", "there is no value 'y'"},
        {"status.broken", "status has no bit 'broken'"},
        {"not x", "behind not stands a bit, VALUE.NAME"},
        {"x", "nothing is said about x"},
        {"x == 1", "x is compared with nothing"},
        {"x = ", "x is compared with nothing"},
        {"x = nobody", "'nobody' is neither a number nor a word of x nor a value"},
        {"x < 2 * nobody", "'nobody' is neither a number nor a word of x nor a value"},
        {"x < model", "model is a text, not a number"},
        {"|x < 1", "the second | is missing behind x"},
        {"|x|", "|x| is compared with nothing"},
        {"|x| has 1", "|x| is compared with nothing"},
        {"model = 'a'", "model is a text; it is compared by ~ '...'"},
        {"state < ON", "state is a word; it is compared by = or !="},
        {"x ~ 'a'", "x is not a text"},
        {"model ~ abc", "what model is compared with stands in '...'"},
        {"model ~ 'abc", "what model is compared with stands in '...'"},
        {"model has 1", "model has no bits"},
        {"status has red", "'red' is no set of bits"},
        {"status has 0", "'0' is no set of bits"},
        {"x = 1 mode = 4", "'and' is missing before 'mode'"},
        {"x = 1 or x = 2", "'and' is missing before 'or'"},
        {"x = 1 and", "a value's name is missing at its end"},
        {"and x = 1", "there is no value 'and'"},
    };
    struct sample *s = *state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(profile_when_check(s->p, wrong[i].condition, &s->err), GON_E_INPUT);
        assert_string_equal(s->err.text, wrong[i].says);
        assert_false(profile_when(s->p, wrong[i].condition, &s->d));
    }
}

static void it_tells_what_it_speaks_of(void **state)
{
    struct sample *s = *state;
    bool uses[PROFILE_VALUES] = {false};
    uses[S_MODEL] = true; // stays
    profile_when_uses(s->p, "status.on and |x| < 2 * tau_s and mode known", uses);
    for (int i = 0; i < PROFILE_VALUES; i++)
        assert_int_equal(uses[i],
                         i == S_STATUS || i == S_X || i == S_TAU || i == S_MODE || i == S_MODEL);
}

static void any_text_is_a_condition_or_an_error(void **state)
{
    static const char *const pieces[] = {"x",   "status", ".on",   " and ", "not ", "=",
                                         "<=",  "has ",   "lacks", "known", "|",    "*",
                                         "1.5", "0x",     "'a'",   "'",     "mode", "ready",
                                         "~",   "!~",     "over",  " ",     "\xff", "model"};
    struct sample *s = *state;
    uint64_t seed = random_seed();
    for (int round = 0; round < 100000; round++) {
        char text[160] = "";
        for (uint64_t n = random_next(&seed) % 10; n > 0; n--)
            strcat(text, pieces[random_next(&seed) % (sizeof pieces / sizeof *pieces)]);
        const int rc = profile_when_check(s->p, text, &s->err);
        assert_true(rc == 0 || rc == GON_E_INPUT);
        profile_when(s->p, text, &s->d);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_form_is_true_when_it_is),
        TEST(every_form_is_false_when_it_is),
        TEST(what_is_not_known_is_false_whatever_is_said),
        TEST(mistakes_are_named),
        TEST(it_tells_what_it_speaks_of),
        TEST(any_text_is_a_condition_or_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
