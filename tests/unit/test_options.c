// SPDX-License-Identifier: MIT
// uses: base
#include "base/options.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct target {
    bool json;
    const char *trace;
    long seed;
    double width;
};

static const struct option_row rows[] = {
    {"--json", OPTION_FLAG, offsetof(struct target, json), NULL, 0, 0, "print JSON"},
    {"--trace", OPTION_TEXT, offsetof(struct target, trace), "FILE", 0, 0, "write a trace"},
    {"--seed", OPTION_INT, offsetof(struct target, seed), "N", 0, 100, "seed"},
    {"--width", OPTION_REAL, offsetof(struct target, width), "DEG", 0, 0, "width"},
    {NULL, OPTION_FLAG, 0, NULL, 0, 0, NULL},
};

static struct gon_error err;
static const char *operands[2];

// Words separated by blanks, after the program's name.
static int take(const char *line, struct target *t)
{
    static char buffer[200];
    char *argv[20] = {(char *)"gonio"};
    int argc = 1;
    snprintf(buffer, sizeof buffer, "%s", line);
    for (char *w = strtok(buffer, " "); w; w = strtok(NULL, " "))
        argv[argc++] = w;
    *t = (struct target){.seed = 7};
    memset(&err, 0, sizeof err);
    return options_take(argc, argv, rows, t, operands, 2, &err);
}

static void options_and_operands_may_be_mixed(void **state)
{
    (void)state;
    struct target t;
    assert_int_equal(take("a.csv --json --trace=x.txt b.csv --seed 12 --width -2.5e1", &t), 2);
    assert_string_equal(operands[0], "a.csv");
    assert_string_equal(operands[1], "b.csv");
    assert_true(t.json);
    assert_string_equal(t.trace, "x.txt");
    assert_int_equal(t.seed, 12);
    assert_true(t.width == -25.0);
}

static void defaults_stay_and_two_dashes_end_the_options(void **state)
{
    (void)state;
    struct target t;
    assert_int_equal(take("-- --json", &t), 1);
    assert_string_equal(operands[0], "--json");
    assert_false(t.json);
    assert_int_equal(t.seed, 7);
}

static void mistakes_say_what_was_meant(void **state)
{
    (void)state;
    struct target t;
    assert_int_equal(take("--sed 3", &t), GON_E_INPUT);
    assert_string_equal(err.text, "unknown option '--sed' (did you mean '--seed'?)");
    assert_int_equal(take("--frobnicate=1", &t), GON_E_INPUT);
    assert_string_equal(err.text, "unknown option '--frobnicate'; see --help");
    assert_int_equal(take("--seed", &t), GON_E_INPUT);
    assert_string_equal(err.text, "--seed needs a value: --seed N");
    assert_int_equal(take("--seed 101", &t), GON_E_INPUT);
    assert_string_equal(err.text, "--seed 101 is out of range; allowed 0..100");
    assert_int_equal(take("--seed 1.5", &t), GON_E_INPUT);
    assert_int_equal(take("--width 1,5", &t), GON_E_INPUT);
    assert_string_equal(err.text, "--width '1,5' is not a number");
    assert_int_equal(take("--width nan", &t), GON_E_INPUT);
    assert_int_equal(take("--json=1", &t), GON_E_INPUT);
    assert_int_equal(take("a b c", &t), GON_E_INPUT);
    assert_string_equal(err.text, "'c' is one argument too many");
}

static void suggestions_are_near_or_absent(void **state)
{
    (void)state;
    static const char *const words[] = {"plan", "pause", "run", "resume", "status", "stop", NULL};
    assert_string_equal(options_suggest("plna", words), "plan");
    assert_string_equal(options_suggest("stauts", words), "status");
    assert_string_equal(options_suggest("res", words), "resume");
    assert_null(options_suggest("frobnicate", words));
}

static void words_fill_lines_of_79_columns(void **state)
{
    (void)state;
    char words[400] = "", *text = NULL, *line, *rest;
    size_t size = 0;
    int lines = 0;
    for (int i = 0; i < 60; i++)
        strcat(words, i % 7 ? "four " : "four\n");
    FILE *out = open_memstream(&text, &size);
    options_fill(out, words, 20);
    fclose(out);
    assert_int_equal(size, 60 * 5 + 4 * 20); // twelve words are 59 columns: five lines
    for (rest = text; (line = strsep(&rest, "\n")) && *line; lines++)
        assert_int_equal(strlen(line), lines ? 20 + 12 * 5 - 1 : 12 * 5 - 1);
    assert_int_equal(lines, 5);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(options_and_operands_may_be_mixed),
        cmocka_unit_test(defaults_stay_and_two_dashes_end_the_options),
        cmocka_unit_test(mistakes_say_what_was_meant),
        cmocka_unit_test(suggestions_are_near_or_absent),
        cmocka_unit_test(words_fill_lines_of_79_columns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
