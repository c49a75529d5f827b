// SPDX-License-Identifier: MIT
// uses: base
#include "base/cfg.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <cmocka.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct axis {
    char name[16];
    int unit;
    double speed;
};

struct target {
    char name[8];
    int method;
    double angles_deg[4];
    int angles_count;
    struct {
        double from_deg, step_deg;
        int count;
    } scan;
    bool dense;
    double weight;
    struct axis axes[2];
    int axes_count;
    int words[3], words_count;
};

static const char *const methods[] = {"memetic", "paper", NULL};
#define AT(m) offsetof(struct target, m)
static const struct cfg_row scan_rows[] = {
    {"from_deg", CFG_REAL, .offset = offsetof(struct target, scan.from_deg) - AT(scan),
     .unit = "deg", .min = -90, .max = 90, .help = "Where it begins."},
    {"step_deg", CFG_REAL, .offset = offsetof(struct target, scan.step_deg) - AT(scan),
     .unit = "deg", .min = 0.01, .max = 10, .fallback = "2.5"},
    {"count", CFG_INT, .offset = offsetof(struct target, scan.count) - AT(scan), .fallback = "-3"},
    {0}};
static const struct cfg_row axis_rows[] = {
    {"name", CFG_STRING, .offset = offsetof(struct axis, name), .size = 16},
    {"unit", CFG_INT, .offset = offsetof(struct axis, unit), .min = 1, .max = 247, .fallback = "1"},
    {"speed", CFG_REAL, .offset = offsetof(struct axis, speed), .unit = "deg/s", .min = 0,
     .max = (double)INFINITY, .fallback = "20"},
    {0}};
static const struct cfg_row campaign_rows[] = {
    {"name", CFG_STRING, .offset = AT(name), .size = 8, .fallback = "\"x\""},
    {"method", CFG_CHOICE, .offset = AT(method), .choices = methods, .fallback = "\"paper\""},
    {"words", CFG_CHOICES, .offset = AT(words), .size = 3, .count_offset = AT(words_count),
     .choices = methods, .fallback = "\"paper\""},
    {"theta_i_deg", CFG_REALS, .offset = AT(angles_deg), .size = 4,
     .count_offset = AT(angles_count), .unit = "deg", .max = 85, .help = "Angles of incidence."},
    {"theta_r", CFG_GROUP, .offset = AT(scan), .rows = scan_rows},
    {"dense", CFG_BOOL, .offset = AT(dense), .fallback = "true"},
    {"weight", CFG_REAL, .offset = AT(weight), .fallback = "0.5"},
    {0}};
static const struct cfg_row schema[] = {
    {"campaign", CFG_GROUP, .rows = campaign_rows, .help = "What to measure."},
    {"axes", CFG_GROUPS, .offset = AT(axes), .size = 2, .stride = sizeof(struct axis),
     .count_offset = AT(axes_count), .rows = axis_rows, .fallback = ""},
    {0}};

struct heard {
    char text[4000];
    int lines;
};

static void hear(void *ctx, const char *line)
{
    struct heard *h = ctx;
    h->lines++;
    size_t used = strlen(h->text);
    snprintf(h->text + used, sizeof h->text - used, "%s\n", line);
}

#define GOOD "campaign: { theta_i_deg = 5; theta_r: { from_deg = -85; }; };\n"

// The mistakes of a text, as one string; -1 when it does not parse.
static int take(const char *text, struct target *t, struct heard *h)
{
    *h = (struct heard){0};
    struct cfg_file *f = cfg_parse(text, "c.cfg", (struct cfg_sink){hear, h});
    int mistakes = f ? cfg_take(f, schema, t) : -1;
    cfg_close(f);
    return mistakes;
}

static void complains(const char *text, const char *expected)
{
    struct heard h;
    struct target t, before;
    memset(&t, 0x5a, sizeof t);
    memcpy(&before, &t, sizeof t);
    int mistakes = take(text, &t, &h);
    assert_string_equal(h.text, expected);
    assert_int_equal(mistakes == -1 ? 1 : mistakes, h.lines);
    assert_memory_equal(&t, &before, sizeof t);
}

static void a_small_file_gets_all_defaults(void **state)
{
    (void)state;
    struct heard h;
    struct target t;
    memset(&t, 0x5a, sizeof t);
    assert_int_equal(take(GOOD, &t, &h), 0);
    assert_string_equal(h.text, "");
    assert_string_equal(t.name, "x");
    assert_int_equal(t.method, 1);
    assert_int_equal(t.angles_count, 1);
    assert_true(t.angles_deg[0] == 5 && t.scan.from_deg == -85 && t.scan.step_deg == 2.5 &&
                t.weight == 0.5);
    assert_int_equal(t.scan.count, -3);
    assert_true(t.dense);
    assert_int_equal(t.axes_count, 0);
    assert_true(t.words_count == 1 && t.words[0] == 1);
}

static void every_kind_of_value_arrives(void **state)
{
    (void)state;
    struct heard h;
    struct target t = {0};
    assert_int_equal(
        take("campaign: { name = \"Öl\"; method = \"memetic\"; theta_i_deg = (0, 5, 10.5);\r\n"
             " theta_r: { from_deg = 1; step_deg = 1; count = -7; }; dense = false; weight = 3 };\n"
             "axes = ( { name = \"a\"; }, { name = \"b\"; unit = 7; speed = 2 } ) # end",
             &t, &h),
        0);
    assert_string_equal(h.text, "");
    assert_string_equal(t.name, "Öl");
    assert_int_equal(t.method, 0);
    assert_int_equal(t.angles_count, 3);
    assert_true(t.angles_deg[0] == 0 && t.angles_deg[1] == 5 && t.angles_deg[2] == 10.5);
    assert_true(t.scan.step_deg == 1 && t.scan.count == -7 && !t.dense && t.weight == 3);
    assert_int_equal(t.axes_count, 2);
    assert_true(t.axes[0].unit == 1 && t.axes[0].speed == 20 && t.axes[1].unit == 7 &&
                t.axes[1].speed == 2);
    assert_string_equal(t.axes[1].name, "b");
}

static void every_mistake_is_reported_with_its_line(void **state)
{
    (void)state;
    complains("campaign: {\n  theta_i_deg = (0,\n 5, 95,\n 0.5);\n  theta_r: { from_deg = 1; stpe "
              "= 2; };\n  wieght = 1;\n};\n",
              "c.cfg:3: campaign.theta_i_deg[2] = 95: out of range; allowed 0..85 deg\n"
              "c.cfg:5: unknown setting 'stpe' in campaign.theta_r; did you mean 'step_deg'?\n"
              "c.cfg:6: unknown setting 'wieght' in campaign; did you mean 'weight'?\n");
    complains("campain: { };\n", "c.cfg:1: unknown setting 'campain'; did you mean 'campaign'?\n"
                                 "c.cfg:1: campaign: missing; What to measure.\n");
    complains("\ncampaign: { theta_r: { }; };\n",
              "c.cfg:2: campaign.theta_r.from_deg: missing; Where it begins.\n"
              "c.cfg:2: campaign.theta_i_deg: missing; Angles of incidence.\n");
}

static void wrong_types_are_named(void **state)
{
    (void)state;
    complains("campaign: { name = 5; method = \"papr\"; theta_i_deg = \"5\"; theta_r = 3; dense = "
              "1; weight = (1); };",
              "c.cfg:1: campaign.name = 5: not a text; write it in double quotes\n"
              "c.cfg:1: campaign.method = \"papr\": unknown; allowed \"memetic\", \"paper\"; did "
              "you mean \"paper\"?\n"
              "c.cfg:1: campaign.theta_i_deg = \"5\": not a number or a list of numbers\n"
              "c.cfg:1: campaign.theta_r = 3: not a group; write theta_r: { ... };\n"
              "c.cfg:1: campaign.dense = 1: not true or false\n"
              "c.cfg:1: campaign.weight = ( ... ): not a number\n");
    complains(GOOD "axes = ( { name = \"a\"; unit = 1.5; speed = -1; }, 3 );",
              "c.cfg:2: axes[0].unit = 1.5: not a whole number\n"
              "c.cfg:2: axes[0].speed = -1: out of range; allowed at least 0 deg/s\n"
              "c.cfg:2: axes[1] = 3: not a group; write { ... }\n");
    complains(GOOD "axes = { name = \"a\"; };",
              "c.cfg:2: axes = { ... }: not a list of groups; write ( { ... }, { ... } )\n");
}

static void control_characters_are_shown_as_a_file_has_them(void **state)
{
    (void)state;
    complains(
        "campaign: { theta_i_deg = \"5\\r\\n\\t\\f\\x1b[2J\"; theta_r: { from_deg = -85; }; };",
        "c.cfg:1: campaign.theta_i_deg = \"5\\r\\n\\t\\f\\x1b[2J\": not a number or a list of "
        "numbers\n");
    complains("campaign: { method = \"123456789012345678901234567890123456789\\r0\"; "
              "theta_i_deg = 5; theta_r: { from_deg = -85; }; };",
              "c.cfg:1: campaign.method = \"123456789012345678901234567890123456789\\r...\": "
              "unknown; allowed \"memetic\", \"paper\"\n");
}

static void numbers_that_libconfig_bends_are_refused(void **state)
{
    (void)state;
    complains(
        "campaign: { theta_i_deg = 5; weight = 1e400; theta_r: { from_deg = 0x1FFFFFFFF; }; };",
        "c.cfg:1: campaign.weight = inf: out of range\n"
        "c.cfg:1: campaign.theta_r.from_deg = 0x1FFFFFFFF: hexadecimal; write a decimal "
        "number\n");
    complains(GOOD "axes = (\n# 0x10\n{ name = \"0x10\"; speed = 0x10; /* 0x11 */ }, "
                   "{ name = \"b\"; speed = 0X1000000011; } );",
              "c.cfg:4: axes[0].speed = 0x10: hexadecimal; write a decimal number\n"
              "c.cfg:4: axes[1].speed = 0X1000000011: hexadecimal; write a decimal number\n");
    complains(
        "# 3000000000 \" /*\n/* 3000000000 */ a3000000000 = \"\\\" 3000000000\";\nb = -3000000000;",
        "c.cfg:3: 3000000000: too large for a whole number\n");
    complains("a = (1, 99999999999999999999);",
              "c.cfg:1: 99999999999999999999: too large for a whole number\n");
    struct heard h;
    struct target t;
    assert_int_equal(
        take("campaign: { theta_i_deg = 5; weight = 30000000000.0; theta_r: { from_deg = 0;"
             " count = 2147483647; }; };",
             &t, &h),
        0);
    assert_true(t.weight == 3e10 && t.scan.count == 2147483647);
}

static void lists_have_lengths(void **state)
{
    (void)state;
    complains("campaign: { theta_i_deg = [1, 2, 3, 4, 5]; theta_r: { from_deg = 0; }; };",
              "c.cfg:1: campaign.theta_i_deg = [ ... ]: 5 numbers; at most 4 are allowed\n");
    complains("campaign: { theta_i_deg = (); theta_r: { from_deg = 0; }; };",
              "c.cfg:1: campaign.theta_i_deg = ( ... ): an empty list; give at least one number\n");
    complains("campaign: { theta_i_deg = [0, 5, 10.5]; };",
              "c.cfg:1: mismatched element type in array; [ ] holds numbers of one kind: write ( ) "
              "instead\n");
    complains(GOOD "axes = ( { name = \"a\"; }, { name = \"b\"; }, { name = \"c\"; } );",
              "c.cfg:2: axes = ( ... ): 3 groups; at most 2 are allowed\n");
}

static void lists_of_words_are_checked_word_by_word(void **state)
{
    (void)state;
    struct heard h;
    struct target t;
#define WORDS(list) "campaign: { theta_i_deg = 5; theta_r: { from_deg = 0; }; words = " list "; };"
    assert_int_equal(take(WORDS("(\"paper\", \"memetic\")"), &t, &h), 0);
    assert_true(t.words_count == 2 && t.words[0] == 1 && t.words[1] == 0);
    assert_int_equal(take(WORDS("[\"memetic\"]"), &t, &h), 0);
    assert_true(t.words_count == 1 && t.words[0] == 0);
    assert_int_equal(take(WORDS("\"memetic\""), &t, &h), 0);
    assert_true(t.words_count == 1 && t.words[0] == 0);
    complains(WORDS("(\"paper\", \"papr\", 3)"),
              "c.cfg:1: campaign.words[1] = \"papr\": unknown; allowed \"memetic\", \"paper\"; did "
              "you mean \"paper\"?\n"
              "c.cfg:1: campaign.words[2] = 3: not a text in double quotes; allowed \"memetic\", "
              "\"paper\"\n");
    complains(WORDS("()"),
              "c.cfg:1: campaign.words = ( ... ): an empty list; give at least one word\n");
    complains(WORDS("(\"paper\", \"paper\", \"paper\", \"paper\")"),
              "c.cfg:1: campaign.words = ( ... ): 4 words; at most 3 are allowed\n");
#undef WORDS
}

static void strings_are_utf8_and_never_cut(void **state)
{
    (void)state;
    complains("campaign: { name = \"12345678\"; theta_i_deg = 5; theta_r: { from_deg = 0; }; };",
              "c.cfg:1: campaign.name = \"12345678\": 8 bytes long; at most 7 are allowed\n");
    complains("campaign: { name = \"\\xff\"; theta_i_deg = 5; theta_r: { from_deg = 0; }; };",
              "c.cfg:1: campaign.name: not UTF-8 text, or with control characters in it\n");
    complains(
        "campaign: { name = \"\xed\xa0\x80\"; theta_i_deg = 5; theta_r: { from_deg = 0; }; };",
        "c.cfg:1: campaign.name: not UTF-8 text, or with control characters in it\n");
}

static void what_is_not_a_configuration_is_refused(void **state)
{
    (void)state;
    complains("a = 1; a = 2;", "c.cfg:1: duplicate setting name\n");
    complains("# c\n \t@include \"/tmp/fifo\"\n",
              "c.cfg:2: @include is not allowed: a configuration is one file\n");
    complains("campaign: {\n name = \"a\n};", "c.cfg:4: syntax error; look for a missing ';', "
                                              "quote or bracket here or on the line before\n");
    struct heard h;
    struct target t;
    assert_int_equal(take("\xef\xbb\xbf" GOOD, &t, &h), 0); // a byte-order mark is fine
}

static void only_regular_files_are_opened(void **state)
{
    (void)state;
    char dir[] = "/tmp/gonio-cfg-XXXXXX", path[64], expected[300];
    assert_non_null(mkdtemp(dir));
    struct heard h = {0};
    struct cfg_sink sink = {hear, &h};
    snprintf(path, sizeof path, "%s/fifo", dir);
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_null(cfg_open(path, sink)); // and does not hang
    unlink(path);
    assert_null(cfg_open(path, sink));
    assert_null(cfg_open(dir, sink));
    int fd = open(path, O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(fd, "a\0b", 3), 3);
    assert_null(cfg_open(path, sink));
    assert_int_equal(ftruncate(fd, (1 << 20) + 1), 0);
    assert_null(cfg_open(path, sink));
    close(fd);
    snprintf(expected, sizeof expected,
             "%s: not a regular file\n%s: No such file or directory\n%s: not a regular file\n",
             path, path, dir);
    assert_memory_equal(h.text, expected, strlen(expected));
    assert_non_null(strstr(h.text, "zero byte"));
    assert_non_null(strstr(h.text, "1048577 bytes"));
    assert_int_equal(h.lines, 5);
    unlink(path);
    rmdir(dir);
}

static void a_file_is_read_whole_and_kept(void **state)
{
    (void)state;
    char path[] = "/tmp/gonio-cfg-XXXXXX";
    int fd = mkstemp(path);
    assert_int_equal(write(fd, GOOD, sizeof GOOD - 1), sizeof GOOD - 1);
    close(fd);
    struct cfg_file *f = cfg_open(path, (struct cfg_sink){0});
    assert_non_null(f);
    assert_string_equal(cfg_text(f), GOOD);
    cfg_close(f);
    unlink(path);
}

static void others_can_complain_too(void **state)
{
    (void)state;
    struct heard h = {0};
    struct cfg_file *f =
        cfg_parse(GOOD "axes = ( { name = \"a\"; },\n { name = \"b\"; unit = 3; } );", "c.cfg",
                  (struct cfg_sink){hear, &h});
    assert_int_equal(cfg_complain(f, "axes[1].unit", "taken by %s", "a"), 1);
    cfg_complain(f, "axes[1].speed", "too slow"); // not in the file
    cfg_complain(f, "axes[7].speed", "no such axis");
    cfg_complain(f, "campaign.theta_r.from_deg", "not below to_deg");
    cfg_complain(f, "daemon", "missing");
    cfg_close(f);
    assert_string_equal(h.text, "c.cfg:3: axes[1].unit = 3: taken by a\n"
                                "c.cfg:3: axes[1].speed: too slow\n"
                                "c.cfg:2: axes[7].speed: no such axis\n"
                                "c.cfg:1: campaign.theta_r.from_deg = -85: not below to_deg\n"
                                "c.cfg:1: daemon: missing\n");
}

static void the_table_describes_itself(void **state)
{
    (void)state;
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    cfg_describe(out, schema);
    fclose(out);
    assert_non_null(strstr(text, "*campaign.theta_i_deg*: list of numbers, deg, 0 to 85, must be "
                                 "given\n\tAngles of incidence.\n\n"));
    assert_non_null(
        strstr(text, "*campaign.method*: one of \"memetic\", \"paper\", default \"paper\"\n"));
    assert_non_null(strstr(text, "*campaign.words*: one or a list of \"memetic\", \"paper\", "
                                 "default \"paper\"\n"));
    assert_non_null(strstr(text, "*axes[].speed*: number, deg/s, at least 0, default 20\n"));
    free(text);
}

static void whole_numbers_are_written_out(void **state)
{
    (void)state;
    static const struct cfg_row seeds[] = {
        {"seed", CFG_INT, .min = 0, .max = 2147483647, .fallback = "1"}, {0}};
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    cfg_describe(out, seeds);
    fclose(out);
    assert_string_equal(text, "*seed*: whole number, 0 to 2147483647, default 1\n\t\n\n");
    free(text);

    struct heard h = {0};
    int seed = 7;
    struct cfg_file *f = cfg_parse("seed = -1;\n", "c.cfg", (struct cfg_sink){hear, &h});
    assert_int_equal(cfg_take(f, seeds, &seed), 1);
    cfg_close(f);
    assert_string_equal(h.text, "c.cfg:1: seed = -1: out of range; allowed 0..2147483647\n");
}

// --- what instruments need -----------------------------------------------------------------------

struct wire {
    char end[8];
    uint32_t address;
    char asks[3][8];
    int asks_count;
};
static const struct cfg_row wire_rows[] = {
    {"end", CFG_BYTES, .offset = offsetof(struct wire, end), .size = 8, .fallback = ""},
    {"address", CFG_HEX, .offset = offsetof(struct wire, address), .max = 0xffff, .fallback = "7"},
    {"asks", CFG_STRINGS, .offset = offsetof(struct wire, asks), .size = 3, .stride = 8,
     .count_offset = offsetof(struct wire, asks_count), .fallback = ""},
    {0}};

static int take_wire(const char *text, struct wire *w, struct heard *h)
{
    *h = (struct heard){0};
    struct cfg_file *f = cfg_parse(text, "w.cfg", (struct cfg_sink){hear, h});
    assert_non_null(f);
    int mistakes = cfg_take(f, wire_rows, w);
    cfg_close(f);
    return mistakes;
}

static void bytes_hexadecimal_numbers_and_lists_of_texts_are_taken(void **state)
{
    struct wire w = {0};
    struct heard h;
    (void)state;
    assert_int_equal(
        take_wire("end = \"\\r\\n\\x1b\"; address = 0x007E; asks = ( \"a\", \"bc\" );", &w, &h), 0);
    assert_string_equal(w.end, "\r\n\x1b");
    assert_int_equal(w.address, 0x7e);
    assert_int_equal(w.asks_count, 2);
    assert_string_equal(w.asks[1], "bc");
    assert_int_equal(take_wire("address = 126; asks = \"x\";", &w, &h), 0);
    assert_int_equal(w.address, 126);
    assert_int_equal(w.asks_count, 1);
    assert_int_equal(take_wire("", &w, &h), 0);
    assert_int_equal(w.address, 7);
    assert_int_equal(w.asks_count, 0);
    assert_string_equal(w.end, "");
}

static void their_mistakes_are_said(void **state)
{
    struct wire w;
    struct heard h;
    (void)state;
    assert_int_equal(take_wire("address = 0x10000007E;", &w, &h), 1);
    assert_non_null(strstr(h.text, "address = 0x10000007E: out of range; allowed 0..65535"));
    assert_int_equal(take_wire("asks = ( \"a\", 3, \"12345678\" );", &w, &h), 2);
    assert_non_null(strstr(h.text, "asks[1] = 3: not a text"));
    assert_non_null(strstr(h.text, "asks[2] = \"12345678\": 8 bytes long; at most 7"));
    assert_int_equal(take_wire("asks = ( \"a\", \"a\", \"a\", \"a\" );", &w, &h), 1);
    assert_non_null(strstr(h.text, "4 texts; at most 3 are allowed"));
}

static void pairs_are_lists_of_two(void **state)
{
    (void)state;
    struct outline {
        double corner[3][2];
        int count;
    } t = {.count = -1};
    static const struct cfg_row rows[] = {{"corners", CFG_PAIRS, .size = 3,
                                           .count_offset = offsetof(struct outline, count),
                                           .unit = "deg", .min = -90, .max = 90},
                                          {0}};
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"corners = ( (1, -2.5), [3, 4] );", ""},
        {"corners = ( (1, 2), (3, 4, 5), 6,\n (7, 95) );",
         "c.cfg:1: corners = ( ... ): 4 pairs; at most 3 are allowed\n"},
        {"corners = ( (3, 4, 5), 6,\n (\"7\", 95) );",
         "c.cfg:1: corners[0] = ( ... ): not a pair of numbers; write (a, b)\n"
         "c.cfg:1: corners[1] = 6: not a pair of numbers; write (a, b)\n"
         "c.cfg:2: corners[2][0] = \"7\": not a number\n"
         "c.cfg:2: corners[2][1] = 95: out of range; allowed -90..90 deg\n"},
        {"corners = ( );", "c.cfg:1: corners = ( ... ): an empty list; give at least one pair\n"},
        {"corners = [1, 2];",
         "c.cfg:1: corners = [ ... ]: not a list of pairs; write ( (a, b), (a, b) )\n"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct heard h = {0};
        struct cfg_file *f = cfg_parse(cases[i].text, "c.cfg", (struct cfg_sink){hear, &h});
        const int mistakes = cfg_take(f, rows, &t);
        cfg_close(f);
        assert_string_equal(h.text, cases[i].says);
        assert_int_equal(mistakes, h.lines);
        assert_int_equal(t.count, 2); // of the first, that no other changed
        assert_true(t.corner[0][0] == 1 && t.corner[0][1] == -2.5 && t.corner[1][1] == 4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_small_file_gets_all_defaults),
        cmocka_unit_test(every_kind_of_value_arrives),
        cmocka_unit_test(every_mistake_is_reported_with_its_line),
        cmocka_unit_test(wrong_types_are_named),
        cmocka_unit_test(control_characters_are_shown_as_a_file_has_them),
        cmocka_unit_test(numbers_that_libconfig_bends_are_refused),
        cmocka_unit_test(lists_have_lengths),
        cmocka_unit_test(lists_of_words_are_checked_word_by_word),
        cmocka_unit_test(strings_are_utf8_and_never_cut),
        cmocka_unit_test(what_is_not_a_configuration_is_refused),
        cmocka_unit_test(only_regular_files_are_opened),
        cmocka_unit_test(a_file_is_read_whole_and_kept),
        cmocka_unit_test(others_can_complain_too),
        cmocka_unit_test(the_table_describes_itself),
        cmocka_unit_test(whole_numbers_are_written_out),
        cmocka_unit_test(bytes_hexadecimal_numbers_and_lists_of_texts_are_taken),
        cmocka_unit_test(their_mistakes_are_said),
        cmocka_unit_test(pairs_are_lists_of_two),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
