// SPDX-License-Identifier: MIT
// uses: drivers base
// Entries that are right, each way to be wrong, and every entry of every shipped profile.
#include "drivers/profile_golden.h"

#include <glob.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#define ABOUT                                                                                      \
    "profile: { name = \"t\"; title = \"T\"; role = \"inputs\"; source = \"invented\"; protocol "  \
    "= "

static const char plain[] = ABOUT
    "\"message\"; };"
    "values: ( { name = \"x\"; }, { name = \"model\"; type = \"string\"; } );"
    "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; gap_ms = 1000; sync = \"model\"; };"
    "exchanges: ( { name = \"model\"; send = \"m?\"; answer = \"{model}\"; },"
    "  { name = \"set\"; send = \"x {x:.2f}\"; answer = \"OK\"; verify = \"x\"; },"
    "  { name = \"x\"; send = \"x?\"; answer = \"{x} V\"; }, { name = \"go\"; send = \"g\"; } );"
    "refusals: ( { like = \"error*\"; } );"
    "inputs: { status = ( \"x\" ); };"
    "golden: ( { source = \"manual\"; ";

static const char wrapped[] =
    ABOUT "\"message\"; };"
          "values: ( { name = \"x\"; } );"
          "framing: { end_out = \"\\r\"; end_in = \"> \"; echo_end = \"\\r\"; };"
          "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; } );"
          "inputs: { status = ( \"x\" ); };"
          "golden: ( { source = \"manual\"; ";

static const char summed[] =
    ABOUT "\"message\"; };"
          "values: ( { name = \"x\"; } );"
          "framing: { end_out = \"\\r\"; end_in = \"\\r\"; ok_line = \"OK\"; };"
          "checksum: { kind = \"sum\"; before = \"*\"; };"
          "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; } );"
          "inputs: { status = ( \"x\" ); };"
          "golden: ( { source = \"manual\"; ";

// Leadshine's frame is the one that its manual prints.
static const char modbus[] =
    ABOUT "\"modbus\"; };"
          "values: ( { name = \"kind\"; address = 0x6200; }, { name = \"to\"; type = \"int\";"
          "  format = \"s32\"; address = 0x6201; }, { name = \"speed\"; address = 0x6203; },"
          "  { name = \"up\"; address = 0x6204; }, { name = \"down\"; address = 0x6205; },"
          "  { name = \"pause\"; address = 0x6206; }, { name = \"start\"; address = 0x6207; },"
          "  { name = \"input\"; type = \"hex\"; address = 0x7d;"
          "    bits = ( { bit = 5; name = \"stop\"; } ); } );"
          "writes: ( { name = \"move\"; set = ( \"kind = 1\", \"to\", \"speed = 0, up = 10000\","
          "    \"down = 10000, pause = 0, start = 16\" ); readback = true; },"
          "  { name = \"stop\"; edge = \"input.stop\"; } );"
          "inputs: { status = ( \"input\" ); };"
          "golden: ( { source = \"manual\"; unit = 7; ";

static void hear(void *ctx, const char *line)
{
    snprintf(ctx, 480, "%s", line);
}

static int try_entry(const char *about, const char *entry, struct gon_error *err)
{
    struct profile *p;
    char text[4000];
    snprintf(text, sizeof text, "%s%s } );", about, entry);
    *err = (struct gon_error){0};
    if (profile_parse(text, "t", (struct cfg_sink){hear, err->text}, &p) < 0)
        fail_msg("%s", err->text);
    int rc = profile_golden_check(p, 0, err);
    free(p);
    return rc;
}

static void entries_that_are_right_pass(void **state)
{
    static const struct {
        const char *about, *entry;
    } right[] = {
        {plain, "does = \"x\"; sent = \"x?\"; received = \"1.5 V\"; gives = \"x = 1.5\";"},
        {plain, "does = \"set\"; with = \"x = 2\"; sent = \"x 2.00\"; received = \"OK\";"},
        {plain, "does = \"set\"; with = \"x = 2\"; sent = \"x 2.00\"; received = \"Error 3\";"},
        {plain,
         "does = \"model\"; sent = \"m?\"; received = \"R 2D\"; gives = \"model = 'R 2D'\";"},
        {plain, "does = \"x\"; sent = \"x?\";"},
        {plain, "does = \"go\"; sent = \"g\";"},
        {wrapped, "does = \"x\"; sent = \"x?\"; received = \"3\"; gives = \"x = 3\";"},
        {summed, "does = \"x\"; sent = \"x?*B7\"; received = \"3*33\"; gives = \"x = 3\";"},
        {modbus,
         "does = \"move\"; with = \"to = 10000\"; sent = \"07 10 62 00 00 08 10 00 01 00 00 27"
         " 10 00 00 27 10 27 10 00 00 00 10 8D 50\"; received = \"07 10 62 00 00 08 DE 11\";"},
        {modbus, "does = \"stop\"; sent = \"07 10 00 7D 00 01 02 00 20 86 05\";"
                 " received = \"07 10 00 7D 00 01 91 B7\";"},
        {modbus, "asks = ( \"input\" ); sent = \"07 03 00 7D 00 01 14 74\";"
                 " received = \"07 03 02 00 20 31 9C\"; gives = \"input = 0x20\";"},
    };
    struct gon_error err;
    (void)state;
    for (size_t i = 0; i < sizeof right / sizeof *right; i++)
        if (try_entry(right[i].about, right[i].entry, &err) < 0)
            fail_msg("%s: %s", right[i].entry, err.text);
}

static void entries_that_are_wrong_say_where(void **state)
{
    static const struct {
        const char *about, *entry, *says;
    } wrong[] = {
        {plain, "does = \"x\"; sent = \"X?\"; received = \"1 V\";",
         "sent: got x?\\r / expected X?\\r / at byte 0"},
        {plain, "does = \"set\"; with = \"x = 2\"; sent = \"x 2.000\"; received = \"OK\";",
         "sent: got x 2.00\\r / expected x 2.000\\r / at byte 6"},
        {plain, "does = \"set\"; with = \"x = 2\"; sent = \"x 2.0\"; received = \"OK\";",
         "sent: got x 2.00\\r / expected x 2.0\\r / at byte 5"},
        {plain, "does = \"x\"; sent = \"x?\"; received = \"1 V\"; gives = \"x = 2\";",
         "x: got 1 / expected 2"},
        {plain, "does = \"x\"; sent = \"x?\"; received = \"1 A\"; gives = \"x = 1\";",
         "'x?' was answered '1 A': got '1 A' / expected '{x} V' / at byte 2"},
        {plain, "does = \"x\"; sent = \"x?\"; received = \"Error\"; gives = \"x = 1\";",
         "refuses 'x?': Error"},
        {summed, "does = \"x\"; sent = \"x?*B7\"; received = \"3*34\"; gives = \"x = 3\";",
         "wrong checksum: got '34' / expected '33'"},
        {modbus, "does = \"stop\"; sent = \"07 10 00 7D 00 01 02 00 21 47 C5\";",
         "sent: got 07 10 00 7D 00 01 02 00 20 86 05 / expected 07 10 00 7D 00 01 02 00 21 47 C5 / "
         "at byte 8"},
        {modbus, "does = \"stop\"; sent = \"07 1\";", "sent: '1' is not bytes in hexadecimal"},
        {modbus, "does = \"move\"; with = \"to 1\"; sent = \"07\";",
         "with: 'to 1' is not NAME = NUMBER, ..."},
        {modbus,
         "asks = ( \"input\" ); sent = \"07 03 00 7D 00 01 14 74\";"
         " received = \"07 03 02 00 20 31 9C\"; gives = \"input = 0x21\";",
         "input: got 32 / expected 33"},
    };
    struct gon_error err;
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(try_entry(wrong[i].about, wrong[i].entry, &err), GON_E_INPUT);
        if (!strstr(err.text, wrong[i].says)) // a port's name may stand before
            fail_msg("%s\n  got      %s\n  expected %s", wrong[i].entry, err.text, wrong[i].says);
    }
}

static void all_that_is_shipped_passes(void **state)
{
    glob_t files;
    int entries = 0;
    (void)state;
    assert_int_equal(glob("configs/profiles/*.cfg", 0, NULL, &files), 0);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        struct profile *p;
        struct gon_error err = {0};
        if (profile_load(files.gl_pathv[i], (struct cfg_sink){hear, err.text}, &p, NULL) < 0)
            fail_msg("%s", err.text);
        for (int k = 0; k < p->golden_count; k++, entries++)
            if (profile_golden_check(p, k, &err) < 0)
                fail_msg("%s: golden[%d]: %s", files.gl_pathv[i], k, err.text);
        free(p);
    }
    print_message("%zu profiles, %d golden entries\n", files.gl_pathc, entries);
    globfree(&files);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(entries_that_are_right_pass),
        cmocka_unit_test(entries_that_are_wrong_say_where),
        cmocka_unit_test(all_that_is_shipped_passes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
