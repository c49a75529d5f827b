// SPDX-License-Identifier: MIT
// uses: drivers base
// The replies are those of real devices and manuals: SR830 (its manual's chapter 5 and reports of
// users), Keithley 6485 (manual, 9-16), OBIS (public drivers), Cobolt, Laser Quantum, PM100D.
#include "drivers/profile_text.h"

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

static void read_ok(struct sample *s, const char *pattern, const char *answer)
{
    if (profile_text_check(s->p, pattern, true, &s->err) < 0 ||
        profile_text_read(s->p, pattern, answer, &s->d, &s->err) < 0)
        fail_msg("'%s' of '%s': %s", answer, pattern, s->err.text);
}

static void assert_number(const struct sample *s, int value, double expected)
{
    assert_true(s->d.known[value]);
    if (!(fabs(s->d.number[value] - expected) <= 1e-12 * fabs(expected)))
        fail_msg("got %.17g / expected %.17g", s->d.number[value], expected);
}

static void real_answers_are_read(void **state)
{
    struct sample *s = *state;
    read_ok(s, "{x}", "6.10356e-005");
    assert_number(s, S_X, 6.10356e-5);
    read_ok(s, "{x},{unheard},{current_a},{rate_hz}", "0.951359,0.0253297,1000.00,1.234");
    assert_number(s, S_X, 0.951359);
    assert_number(s, S_UNKNOWN, 0.0253297);
    assert_number(s, S_CURRENT, 1000);
    read_ok(s, "{},{model},s/n{count},{}", "Stanford_Research_Systems,SR830,s/n43,ver1.07 ");
    assert_string_equal(s->d.text[S_MODEL], "SR830");
    assert_number(s, S_COUNT, 43);
    read_ok(s, "{current_a}A,{x},{unheard}", "+1.040564E-06A,+2.236299E+02,+1.380000E+02");
    assert_number(s, S_CURRENT, 1.040564e-6);
    assert_number(s, S_UNKNOWN, 138);
    read_ok(s, "{status}", "C8001002");
    assert_number(s, S_STATUS, 3355447298.0);
    read_ok(s, "{x}C", "25.3C");
    read_ok(s, "{x}W", "1.00W");
    read_ok(s, "SHUTTER {model}", "SHUTTER OPENED");
    assert_string_equal(s->d.text[S_MODEL], "OPENED");
    read_ok(s, "{x},\"{model}\"", "-113,\"Undefined header\"");
    assert_string_equal(s->d.text[S_MODEL], "Undefined header");
    read_ok(s, "Coherent, Inc-{model}-{}-{}", "Coherent, Inc-OBIS 1064LX-V1.1-2014");
    assert_string_equal(s->d.text[S_MODEL], "OBIS 1064LX");
}

static void every_type_is_read(void **state)
{
    struct sample *s = *state;
    read_ok(s, "{tau_s}", "2");
    assert_number(s, S_TAU, 1e-4);
    read_ok(s, "{count:x}", "1f");
    assert_number(s, S_COUNT, 31);
    read_ok(s, "{status:08X}", "0x00000003");
    assert_number(s, S_STATUS, 3);
    read_ok(s, "{count}", "+1.0E+01");
    assert_number(s, S_COUNT, 10);
    read_ok(s, "{level_w}", "250.0");
    assert_number(s, S_LEVEL, 0.25);
    read_ok(s, "{state}!", "once!"); // ON would leave "ce!"
    assert_number(s, S_STATE, 2);
    read_ok(s, "{mode}", "4");
    assert_string_equal(s->d.text[S_MODE], "ready");
    read_ok(s, "{rate_hz}", "2500");
    assert_number(s, S_PERIOD, 400);
}

static void blanks_groups_and_doubled_brackets(void **state)
{
    struct sample *s = *state;
    read_ok(s, "P = {x} W", "P  = \t1.5W");
    assert_number(s, S_X, 1.5);
    read_ok(s, "{x}[,{count}]", "2,7");
    assert_number(s, S_COUNT, 7);
    read_ok(s, "{x}[,{count}]", "3");
    assert_number(s, S_X, 3);
    assert_false(s->d.known[S_COUNT]);
    read_ok(s, "{{{x}}} [[{count}]]", "{4} [8]");
    assert_number(s, S_X, 4);
    assert_number(s, S_COUNT, 8);
    read_ok(s, "[{count} ]a{}", "a");
    read_ok(s, "{count:3d},{state:8s}", "  7,    once");
    assert_number(s, S_COUNT, 7);
    read_ok(s, "{x}E", "25E"); // the letter belongs to the pattern
    assert_number(s, S_X, 25);
    read_ok(s, "{model} v{x}", "one v two v3");
    assert_string_equal(s->d.text[S_MODEL], "one v two");
}

static void over_is_known_and_invalid_unknown(void **state)
{
    struct sample *s = *state;
    read_ok(s, "{current_a}A", "+9.9E37A");
    assert_true(s->d.known[S_CURRENT] && isinf(s->d.number[S_CURRENT]));
    read_ok(s, "{current_a}A", "+9.91E37A");
    assert_false(s->d.known[S_CURRENT]);
}

static void what_does_not_fit_leaves_all_as_it_was(void **state)
{
    static const struct {
        const char *pattern, *answer, *says;
    } wrong[] = {
        {"{x}", "", "got '' / expected '{x}' / at byte 0"},
        {"{x}", "1.5 ", "got '1.5 ' / expected '{x}' / at byte 3"},
        {"{x}", "1,5", "got '1,5' / expected '{x}' / at byte 1"},
        {"{x}", "nan", "got 'nan' / expected '{x}' / at byte 0"},
        {"{x}", "inf", "got 'inf' / expected '{x}' / at byte 0"},
        {"{x}", "0x1p3", "got '0x1p3' / expected '{x}' / at byte 1"},
        {"{x}", "--1", "got '--1' / expected '{x}' / at byte 0"},
        {"{x}V", "1.5", "got '1.5' / expected '{x}V' / at byte 3"},
        {"OK", "OKK", "got 'OKK' / expected 'OK' / at byte 2"},
        {"OK", "ok", "got 'ok' / expected 'OK' / at byte 0"},
        {"{model}", "", "got '' / expected '{model}' / at byte 0"},
        {"{state}", "HALF", "got 'HALF' / expected '{state}' / at byte 0"},
        {"{count}", "101", "count: 101 is not in 0..100"},
        {"{count}", "1.5", "count: 1.5 is not a whole number"},
        {"{tau_s}", "5", "tau_s: 5 is not in 0..4"},
        {"{x},{count}", "9,101", "count: 101 is not in 0..100"},
        {"{x}", "1e9999", "got '1e9999' / expected '{x}' / at byte 4"},
    };
    struct sample *s = *state;
    profile_data_set(s->p, &s->d, S_X, 7);
    const struct profile_data before = s->d;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(profile_text_read(s->p, wrong[i].pattern, wrong[i].answer, &s->d, &s->err),
                         GON_E_LINK);
        assert_string_equal(s->err.text, wrong[i].says);
        assert_memory_equal(&s->d, &before, sizeof before);
    }
}

static void commands_are_written(void **state)
{
    static const struct {
        const char *pattern, *text;
    } right[] = {
        {"l?", "l?"},
        {"p {x:.4f}", "p -1.2500"},
        {"SENS {tau_s}", "SENS 3"},
        {"POWER={x:06.2f}", "POWER=-01.25"},
        {"POW {x:.3e};{x}", "POW -1.250e+00;-1.25"},
        {"N {count:03d} {count:x} {count}", "N 031 1f 31"},
        {"{status} {status:08x} {status:d}", "C8001002 c8001002 3355447298"},
        {"SOUR:AM:STAT {state}", "SOUR:AM:STAT ONCE"},
        {"'{model}' {model:8s}", "'Rumba'    Rumba"},
        {"{{{level_w}}} [[", "{250} ["},
        {"{mode} {rate_hz:g}", "4 2500"},
        {"{current_a}", "9.9e+37"},
    };
    struct sample *s = *state;
    char text[80];
    assert_int_equal(
        profile_assign_data(s->p,
                            "x = -1.25, count = 31, status = 0xC8001002, state = once, "
                            "tau_s = 3, level_w = 0.25, mode = ready, rate_hz = 400, "
                            "model = Rumba, current_a = over",
                            NULL, &s->d, &s->err),
        0);
    for (size_t i = 0; i < sizeof right / sizeof *right; i++) {
        if (profile_text_check(s->p, right[i].pattern, false, &s->err) < 0 ||
            profile_text_write(s->p, right[i].pattern, &s->d, text, sizeof text, &s->err) < 0)
            fail_msg("'%s': %s", right[i].pattern, s->err.text);
        assert_string_equal(text, right[i].text);
    }
}

static void what_cannot_be_written_is_refused(void **state)
{
    static const struct {
        const char *pattern, *says;
    } wrong[] = {
        {"p {unheard}", "unheard is not known"},
        {"p {count}", "count = 101; allowed: 0..100"},
        {"t {tau_s}", "tau_s = 2 s is not one of its settings; nearest: 3"},
        {"m {model}", "model contains a control character"},
        {"x {x:x}", "x: -1 cannot be written as a hexadecimal number"},
        {"x {level_w:d}", "level_w: 0.5 cannot be written as a whole number"},
        {"x [y]", "'x [y]' cannot be sent: it is an answer"},
        {"x {}", "'x {}' cannot be sent: it is an answer"},
        {"0123456789", "'0123456789': longer than 9 characters"},
        {"{x:20.3f}", "'{x:20.3f}': longer than 9 characters"},
    };
    struct sample *s = *state;
    char text[10] = "as before";
    profile_data_set(s->p, &s->d, S_COUNT, 101);
    profile_data_set(s->p, &s->d, S_TAU, 2);
    profile_data_set(s->p, &s->d, S_X, -1);
    profile_data_set(s->p, &s->d, S_LEVEL, 0.0005);
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_MODEL, "a\rl1", NULL), 0);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(
            profile_text_write(s->p, wrong[i].pattern, &s->d, text, sizeof text, &s->err),
            GON_E_INPUT);
        assert_string_equal(s->err.text, wrong[i].says);
        assert_string_equal(text, "as before");
    }
}

#define NO_FORMAT "not a format (0, width, .digits, one of d x X f e g s; no + or -)"
static void patterns_that_are_wrong_say_why(void **state)
{
    static const struct {
        const char *pattern;
        bool reading;
        const char *says;
    } wrong[] = {
        {"{y}", true, "there is no such value at '{y}'"},
        {"{x", true, "'}' is missing at '{x'"},
        {"x}", true, "'{' is missing before '}' at '}'"},
        {"[a", true, "']' is missing"},
        {"a]", true, "'[' is missing before ']'"},
        {"[a[b]]", true, "a [ ] inside another"},
        {"{x:}", true, NO_FORMAT " at '{x:}'"},
        {"{x:5}", true, NO_FORMAT " at '{x:5}'"},
        {"{x:%f}", true, NO_FORMAT " at '{x:%f}'"},
        {"{x:*d}", true, NO_FORMAT " at '{x:*d}'"},
        {"{x:n}", true, NO_FORMAT " at '{x:n}'"},
        {"{x:.1.1f}", true, NO_FORMAT " at '{x:.1.1f}'"},
        {"{x:+.3f}", true, NO_FORMAT " at '{x:+.3f}'"},
        {"{x:12345.6f}", true, NO_FORMAT " at '{x:12345.6f}'"},
        {"{model:d}", true, "{model:d}: a text is written by s"},
        {"{x:s}", true, "{x:s}: a number is not written by s"},
        {"{x:d}", true, "{x:d}: it is real, and written by f, e or g"},
        {"{x}{count}", true, "nothing stands between two values, so where does the first one end?"},
        {"{x}{}", true, "nothing stands between two values, so where does the first one end?"},
        {"{x}[{}]", true, "nothing stands between two values, so where does the first one end?"},
        {"{x},{x}", true, "{x} stands twice in it"},
        {"a{}", false, "{} only stands in an answer"},
        {"a[b]", false, "[ ] only stands in an answer"},
    };
    struct sample *s = *state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(profile_text_check(s->p, wrong[i].pattern, wrong[i].reading, &s->err),
                         GON_E_INPUT);
        assert_string_equal(s->err.text, wrong[i].says);
    }
    assert_int_equal(profile_text_check(s->p, "{x}{count}", false, NULL), 0);
}

static void it_tells_what_it_speaks_of(void **state)
{
    struct sample *s = *state;
    bool uses[PROFILE_VALUES] = {false};
    profile_text_uses(s->p, "{x}{{count}}[{model}],{}", uses);
    for (int i = 0; i < PROFILE_VALUES; i++)
        assert_int_equal(uses[i], i == S_X || i == S_MODEL);
}

// Texts that take as little as possible could be tried in n^5 ways.
static void a_hostile_answer_takes_no_longer_than_another(void **state)
{
    struct sample *s = *state;
    char answer[PROFILE_ANSWER + 2];
    memset(answer, ',', sizeof answer - 1);
    answer[PROFILE_ANSWER] = 0;
    assert_int_equal(profile_text_read(s->p, "{},{},{},{},{model},{x}", answer, &s->d, &s->err),
                     GON_E_LINK);
    memset(answer, '1', sizeof answer - 1);
    answer[PROFILE_ANSWER] = 0;
    assert_int_equal(profile_text_read(s->p, "{}1{}1{}1{}1{x}1", answer, &s->d, &s->err), 0);
    assert_int_equal(profile_text_read(s->p, "{model}", answer, &s->d, &s->err), GON_E_LINK);
    assert_string_equal(s->err.text, "model: longer than 95 characters");
    answer[PROFILE_ANSWER] = '1';
    answer[PROFILE_ANSWER + 1] = 0;
    assert_int_equal(profile_text_read(s->p, "{}", answer, &s->d, &s->err), GON_E_LINK);
    assert_string_equal(s->err.text, "an answer of 1025 characters; at most 1024 are read");
}

static void random_bytes_are_read_or_refused(void **state)
{
    static const char *const patterns[] = {"{x},{unheard}",        "{status:X}",
                                           "[{count} ]{model},{}", "{state}[,{tau_s}]",
                                           "P = {level_w} W",      "{},{model},s/n{count},{}"};
    static const char likely[] = "0123456789+-.eEx, \tONoffPW=s/n";
    struct sample *s = *state;
    uint64_t seed = random_seed();
    for (int round = 0; round < 100000; round++) {
        char answer[48] = "";
        const size_t size = random_next(&seed) % 40;
        const bool wild = random_next(&seed) % 4 == 0;
        for (size_t i = 0; i < size; i++)
            answer[i] = (char)(wild ? random_next(&seed) % 255 + 1
                                    : (uint64_t)likely[random_next(&seed) % (sizeof likely - 1)]);
        const int rc =
            profile_text_read(s->p, patterns[random_next(&seed) % 6], answer, &s->d, NULL);
        assert_true(rc == 0 || rc == GON_E_LINK);
    }
}

static void random_patterns_are_checked_and_those_that_pass_work(void **state)
{
    static const char *const pieces[] = {
        "{x}", "{",  "}",         "[", "]", "{{",  "]]",      "{}",        "{x:",  ".", "4",
        "f}",  "d}", "{count:3d", ",", " ", "abc", "{state}", "{model:s}", "\xff", ":", "{tau_s}"};
    struct sample *s = *state;
    uint64_t seed = random_seed();
    for (int i = 0; i < s->p->values_count; i++)
        profile_data_set(s->p, &s->d, i, 1);
    assert_int_equal(profile_data_set_text(s->p, &s->d, S_MODEL, "m", NULL), 0);
    for (int round = 0; round < 100000; round++) {
        char pattern[PROFILE_TEXT] = "", text[PROFILE_ANSWER];
        for (uint64_t n = random_next(&seed) % 10; n > 0; n--)
            strcat(pattern, pieces[random_next(&seed) % (sizeof pieces / sizeof *pieces)]);
        if (profile_text_check(s->p, pattern, false, &s->err) < 0)
            continue;
        if (profile_text_write(s->p, pattern, &s->d, text, sizeof text, &s->err) < 0)
            fail_msg("'%s': %s", pattern, s->err.text);
        if (profile_text_check(s->p, pattern, true, NULL) == 0 &&
            profile_text_read(s->p, pattern, text, &s->d, &s->err) < 0)
            fail_msg("'%s' of '%s': %s", text, pattern, s->err.text);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(real_answers_are_read),
        TEST(every_type_is_read),
        TEST(blanks_groups_and_doubled_brackets),
        TEST(over_is_known_and_invalid_unknown),
        TEST(what_does_not_fit_leaves_all_as_it_was),
        TEST(commands_are_written),
        TEST(what_cannot_be_written_is_refused),
        TEST(patterns_that_are_wrong_say_why),
        TEST(it_tells_what_it_speaks_of),
        TEST(a_hostile_answer_takes_no_longer_than_another),
        TEST(random_bytes_are_read_or_refused),
        TEST(random_patterns_are_checked_and_those_that_pass_work),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
