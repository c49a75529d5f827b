// SPDX-License-Identifier: MIT
// uses: sim model base
// How the simulated instrument reads patterns, conditions, assignments and checksums, with its own
// code.
#include "sim/actor_rule.h"
#include "sim/actor_sum.h"
#include "sim/actor_text.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

enum { POWER, MODE, STATE, RANGE, STATUS, NAME_, COUNT };

static struct profile *profile(void)
{
    struct profile *p = calloc(1, sizeof *p);
    p->values_count = COUNT;
    p->values[POWER] = (struct profile_value){.name = "power_w",
                                              .type = PROFILE_REAL,
                                              .scale = 1e-3,
                                              .max = 0.5,
                                              .over = {9.9e37},
                                              .over_count = 1,
                                              .invalid = {9.91e37},
                                              .invalid_count = 1};
    p->values[MODE] = (struct profile_value){.name = "mode",
                                             .type = PROFILE_INT,
                                             .max = 8,
                                             .words = {"off", "warming", "on"},
                                             .words_count = 3};
    p->values[STATE] = (struct profile_value){
        .name = "state", .type = PROFILE_WORD, .words = {"OFF", "ON", "ONCE"}, .words_count = 3};
    p->values[RANGE] = (struct profile_value){.name = "range",
                                              .type = PROFILE_INT,
                                              .ladder = {0.1, 1, 10},
                                              .ladder_count = 3,
                                              .ladder_first = 4};
    p->values[STATUS] =
        (struct profile_value){.name = "status",
                               .type = PROFILE_HEX,
                               .bits = {{.name = "fault", .bit = 0}, {.name = "moving", .bit = 13}},
                               .bits_count = 2};
    p->values[NAME_] = (struct profile_value){.name = "model", .type = PROFILE_STRING};
    return p;
}

struct fixture {
    struct profile *p;
    struct actor_values v;
};

static struct fixture fixture(void)
{
    struct fixture f = {.p = profile()};
    actor_values_start(&f.v, f.p);
    return f;
}

static void fits(const char *pattern, const char *line, int value, double number)
{
    struct fixture f = fixture();
    assert_int_equal(actor_text_match(&f.v, pattern, line), ACTOR_FITS);
    assert_float_equal(f.v.number[value], number, 1e-12);
    free(f.p);
}

static void is_fit(const char *pattern, const char *line, enum actor_fit expected)
{
    struct fixture f = fixture();
    assert_int_equal(actor_text_match(&f.v, pattern, line), expected);
    free(f.p);
}

static void commands_are_matched_and_their_values_taken(void **state)
{
    (void)state;
    fits("p {power_w:.4f}", "p 100.5", POWER, 0.1005);
    fits("p {power_w:.4f}", "p1e+002", POWER, 0.1); // a blank is any number of blanks
    fits("p {power_w},{mode}", "p .5,3", MODE, 3);
    fits("AM:STAT {state}", "AM:STAT ONCE", STATE, 2); // the longest word
    fits("SENS {range}", "SENS 6", RANGE, 10);
    fits("X{status:04x}Y", "X2001Y", STATUS, 0x2001);
    fits("{{{mode}}}", "{7}", MODE, 7);
    is_fit("l?", "l?", ACTOR_FITS);
    is_fit("l?", "l? ", ACTOR_FITS);
    is_fit("l?", "l", ACTOR_OTHER);
    is_fit("l?", "l?x", ACTOR_OTHER);
    is_fit("p {power_w}", "p?", ACTOR_OTHER);
    is_fit("p {power_w}", "p nan", ACTOR_OTHER);
    is_fit("p {power_w}", "p 0x10", ACTOR_OTHER);
    is_fit("p {power_w}", "p 501", ACTOR_BEYOND);
    is_fit("m {mode}", "m 9", ACTOR_BEYOND);
    is_fit("m {mode}", "m 1.5", ACTOR_BEYOND);
    is_fit("SENS {range}", "SENS 3", ACTOR_BEYOND);
    is_fit("AM {state}", "AM MAYBE", ACTOR_OTHER);
    struct fixture f = fixture();
    assert_int_equal(actor_text_match(&f.v, "name {model};", "name abc def;"), ACTOR_FITS);
    assert_string_equal(f.v.text[NAME_], "abc def");
    free(f.p);
}

static void writes(const struct actor_values *v, const char *pattern, const char *expected)
{
    char text[100];
    actor_text_write(v, pattern, text, sizeof text);
    assert_string_equal(text, expected);
}

static void answers_are_written_as_printf_would(void **state)
{
    (void)state;
    struct fixture f = fixture();
    f.v.number[POWER] = 0.1234567;
    f.v.number[MODE] = 2;
    f.v.number[STATE] = 1;
    f.v.number[RANGE] = 10;
    f.v.number[STATUS] = 0x2001;
    strcpy(f.v.text[NAME_], "Rumba 1064");
    writes(&f.v, "{power_w}", "123.4567");
    writes(&f.v, "{power_w:.2f} mW", "123.46 mW");
    writes(&f.v, "{power_w:010.3e}", "01.235e+02");
    writes(&f.v, "{power_w:.3g}|{mode}|{state}|{range}|{status}", "123|2|ON|6|2001");
    writes(&f.v, "{mode:03d},{mode:4d},{status:08x}", "002,   2,00002001");
    writes(&f.v, "[{model} ]{}{{}}", "Rumba 1064 0{}");
    writes(&f.v, "[{}][ A]", " A"); // what nobody keeps and need not be there
    f.v.number[POWER] = -0.0025;
    writes(&f.v, "{power_w:06.1f}", "-002.5");
    f.v.number[POWER] = (double)INFINITY;
    writes(&f.v, "{power_w:.1e}", "9.9e+37");
    f.v.number[POWER] = (double)NAN;
    writes(&f.v, "{power_w:.2e}", "9.91e+37");
    char little[4];
    actor_text_write(&f.v, "{model}", little, sizeof little);
    assert_string_equal(little, "Rum");
    actor_text_unglob("*syntax error?*", little, sizeof little);
    assert_string_equal(little, "syn");
    char all[40];
    actor_text_unglob("*syntax error?*", all, sizeof all);
    assert_string_equal(all, "syntax error?");
    free(f.p);
}

static void when(const struct actor_values *v, const char *condition, bool expected)
{
    if (actor_when(v, condition) != expected)
        fail_msg("'%s' is not %s", condition, expected ? "true" : "false");
}

static void conditions_hold_or_not(void **state)
{
    (void)state;
    struct fixture f = fixture();
    f.v.number[POWER] = -0.3;
    f.v.number[MODE] = 1;
    f.v.number[RANGE] = 0.1;
    f.v.number[STATUS] = 0x2000;
    strcpy(f.v.text[NAME_], "1064-05-01");
    const char *const yes[] = {"",
                               "mode = 1",
                               "mode = warming",
                               "mode != on and mode < 2",
                               "mode >= 1 and mode <= 1 and mode > 0",
                               "status.moving and not status.fault",
                               "status has 0x3000",
                               "status lacks 0x07",
                               "|power_w| > 2.5 * range",
                               "power_w < range",
                               "model ~ '*-05-*'",
                               "model !~ '*-06-*'",
                               "model = '1064-05-01'",
                               "state = OFF",
                               "power_w known",
                               "model known",
                               "status.moving = 1",
                               "mode",
                               "power_w != over"};
    const char *const no[] = {"mode = 2",
                              "mode = on",
                              "status.fault",
                              "not status.moving",
                              "status has 0x07",
                              "status lacks 0x2000",
                              "|power_w| > 3.5 * range",
                              "model ~ '*-06-*'",
                              "mode = 1 and mode = 2",
                              "power_w unknown",
                              "nothing = 1",
                              "mode =",
                              "mode = 1 or",
                              "and",
                              "mode = 1 mode = 1",
                              "status.nothing",
                              "model has 3"};
    for (size_t i = 0; i < sizeof yes / sizeof yes[0]; i++)
        when(&f.v, yes[i], true);
    for (size_t i = 0; i < sizeof no / sizeof no[0]; i++)
        when(&f.v, no[i], false);
    f.v.number[POWER] = (double)INFINITY;
    when(&f.v, "power_w = over", true);
    f.v.number[POWER] = (double)NAN;
    const char *const unknown[] = {"power_w = 1", "power_w != 1",   "power_w < 1",  "not power_w",
                                   "power_w",     "|power_w| >= 0", "power_w known"};
    for (size_t i = 0; i < sizeof unknown / sizeof unknown[0]; i++)
        when(&f.v, unknown[i], false);
    when(&f.v, "power_w unknown", true);
    free(f.p);
}

static void assignments_are_done_all_or_none(void **state)
{
    (void)state;
    struct fixture f = fixture();
    struct gon_error err;
    assert_int_equal(actor_then(&f.v, "mode = warming, power_w = 0.25, status.moving = 1", &err),
                     0);
    assert_float_equal(f.v.number[MODE], 1, 0);
    assert_float_equal(f.v.number[POWER], 0.25, 0);
    assert_float_equal(f.v.number[STATUS], 0x2000, 0);
    assert_int_equal(actor_then(&f.v, "status.fault = 1, range = power_w, status.moving = 0", &err),
                     0);
    assert_float_equal(f.v.number[STATUS], 1, 0);
    assert_float_equal(f.v.number[RANGE], 0.25, 0);
    assert_int_equal(actor_then(&f.v, "status.fault = not status.fault, model = 'x y'", &err), 0);
    assert_float_equal(f.v.number[STATUS], 0, 0);
    assert_string_equal(f.v.text[NAME_], "x y");
    assert_int_equal(actor_then(&f.v, "state = ON, nothing = 1", &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "there is no value 'nothing'"));
    assert_int_equal(actor_then(&f.v, "mode = green", &err), GON_E_INPUT);
    assert_int_equal(actor_then(&f.v, "mode 1", &err), GON_E_INPUT);
    assert_int_equal(actor_then(&f.v, "model = 3", &err), GON_E_INPUT);
    assert_float_equal(f.v.number[STATE], 0, 0); // nothing of it was done
    assert_int_equal(actor_then(&f.v, "", &err), 0);
    free(f.p);
}

// The catalogue of CRCs gives the first six; the last three are sums that anybody can add up.
static void checksums_are_the_catalogues(void **state)
{
    (void)state;
    static const struct {
        struct profile_checksum c;
        const char *line;
        size_t size;
    } sums[] = {
        {{PROFILE_CRC, 8, 0x07, 0, 0, false, false, PROFILE_HEX_UPPER, "*"}, "123456789*F4", 12},
        {{PROFILE_CRC, 8, 0x31, 0, 0, true, true, PROFILE_HEX_LOWER, ""}, "123456789a1", 11},
        {{PROFILE_CRC, 16, 0x1021, 0xffff, 0, false, false, PROFILE_HEX_UPPER, ""},
         "12345678929B1",
         13},
        {{PROFILE_CRC, 16, 0x8005, 0xffff, 0, true, true, PROFILE_RAW_LOW, ""},
         "123456789\x37\x4b",
         11},
        {{PROFILE_CRC, 16, 0x1021, 0, 0, false, false, PROFILE_RAW_HIGH, ""},
         "123456789\x31\xc3",
         11},
        {{PROFILE_CRC, 32, 0x04c11db7, 0xffffffff, 0xffffffff, true, true, PROFILE_HEX_UPPER, ""},
         "123456789CBF43926",
         17},
        {{.kind = PROFILE_SUM, .width = 8}, "123456789DD", 11},
        {{.kind = PROFILE_XOR, .width = 8}, "12345678931", 11},
        {{.kind = PROFILE_LRC, .width = 8}, "12345678923", 11},
    };
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; i++) {
        char line[64] = "123456789";
        size_t size = actor_sum_add(&sums[i].c, line, 9);
        assert_int_equal(size, sums[i].size);
        assert_memory_equal(line, sums[i].line, size);
        assert_int_equal(actor_sum_check(&sums[i].c, line, size), 9);
        line[3] ^= 1;
        assert_int_equal(actor_sum_check(&sums[i].c, line, size), -1);
        assert_int_equal(actor_sum_check(&sums[i].c, "1", 1), -1);
    }
    static const struct profile_checksum none = {.kind = PROFILE_NO_SUM};
    assert_int_equal(actor_sum_check(&none, "1", 1), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_are_matched_and_their_values_taken),
        cmocka_unit_test(answers_are_written_as_printf_would),
        cmocka_unit_test(conditions_hold_or_not),
        cmocka_unit_test(assignments_are_done_all_or_none),
        cmocka_unit_test(checksums_are_the_catalogues),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
