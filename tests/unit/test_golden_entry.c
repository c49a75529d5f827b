// SPDX-License-Identifier: MIT
// uses: drivers base
// Golden entries as text and back, and entries made of bytes as they went over a wire.
#include "drivers/golden_entry.h"

#include "drivers/golden_text.h"
#include "drivers/profile_golden.h"
#include "drivers/profile_use.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ABOUT                                                                                      \
    "profile: { name = \"t\"; title = \"T\"; role = \"inputs\"; source = \"invented\"; protocol "  \
    "= "

static const char plain[] = ABOUT
    "\"message\"; };"
    "values: ( { name = \"x\"; over = [ 9.9e37 ]; }, { name = \"h\"; type = \"hex\"; },"
    "  { name = \"w\"; type = \"word\"; words = ( \"ON\", \"SHUTTER OPEN\" ); },"
    "  { name = \"model\"; type = \"string\"; },"
    "  { name = \"doubt\"; valid = \"x = 1\"; } );"
    "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; };"
    "exchanges: ( { name = \"model\"; send = \"m?\"; answer = \"{model}\"; },"
    "  { name = \"set\"; send = \"x {x:.2f}\"; answer = \"OK\"; },"
    "  { name = \"x\"; send = \"x?\"; answer = \"{x} V\"; }, { name = \"go\"; send = \"g\"; },"
    "  { name = \"all\"; send = \"a?\"; answer = \"{x},{h},{w},{doubt}\"; } );"
    "refusals: ( { like = \"error*\"; } );"
    "inputs: { status = ( \"x\" ); };";

static const char echoes[] =
    ABOUT "\"message\"; };"
          "values: ( { name = \"x\"; } );"
          "framing: { end_out = \"\\r\"; end_in = \"\\r> \"; echo_end = \"\\r\"; };"
          "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; },"
          "  { name = \"go\"; send = \"g\"; } );"
          "inputs: { status = ( \"x\" ); };";

static const char summed[] =
    ABOUT "\"message\"; };"
          "values: ( { name = \"x\"; } );"
          "framing: { end_out = \"\\r\"; end_in = \"\\r\"; ok_line = \"OK\"; };"
          "checksum: { kind = \"sum\"; before = \"*\"; };"
          "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; } );"
          "refusals: ( { like = \"err*\"; } );"
          "inputs: { status = ( \"x\" ); };";

static const char modbus[] = ABOUT "\"modbus\"; };"
                                   "values: ( { name = \"a\"; type = \"int\"; address = 0x10; },"
                                   "  { name = \"b\"; type = \"int\"; address = 0x11; },"
                                   "  { name = \"input\"; type = \"hex\"; address = 0x7d;"
                                   "    bits = ( { bit = 5; name = \"stop\"; } ); } );"
                                   "writes: ( { name = \"move\"; set = ( \"a\", \"b = 1\" ); },"
                                   "  { name = \"stop\"; edge = \"input.stop\"; } );"
                                   "inputs: { status = ( \"input\" ); };";

static void hear(void *ctx, const char *line)
{
    snprintf(ctx, 480, "%s", line);
}

static struct profile *parsed(const char *text)
{
    struct profile *p;
    char why[480] = "";
    if (profile_parse(text, "t", (struct cfg_sink){hear, why}, &p) < 0)
        fail_msg("%s", why);
    return p;
}

// --- text ----------------------------------------------------------------------------------------

static void an_entry_is_read_back_as_it_was(void **state)
{
    struct profile_golden g = {.does = "model",
                               .sent = "x 2.00 \"a\\b\" \x01\x7f%\t",
                               .received = "O\"K\\ \r\x1b",
                               .gives = "model = 'R \"2D\"'",
                               .source = "recorded \\ \"here\""};
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    (void)state;
    fprintf(out, "%sgolden: (\n", plain);
    golden_text_print(out, &g, false);
    fprintf(out, "\n);\n");
    fclose(out);
    struct profile *p = parsed(text);
    assert_int_equal(p->golden_count, 1);
    assert_string_equal(p->golden[0].does, g.does);
    assert_string_equal(p->golden[0].with, g.with);
    assert_string_equal(p->golden[0].sent, g.sent);
    assert_string_equal(p->golden[0].received, g.received);
    assert_string_equal(p->golden[0].gives, g.gives);
    assert_string_equal(p->golden[0].source, g.source);
    free(p);
    free(text);
}

static void values_are_read_back_as_they_were(void **state)
{
    struct profile *p = parsed(plain);
    struct profile_data d, back;
    char text[PROFILE_LONG] = "", small[12] = "";
    (void)state;
    profile_data_clear(&d);
    profile_data_clear(&back);
    profile_data_set(p, &d, 0, (double)INFINITY);
    profile_data_set(p, &d, 1, 255);
    profile_data_set(p, &d, 2, 1);
    assert_int_equal(profile_data_set_text(p, &d, 3, "a, b = \"c\"", NULL), 0);
    for (int i = 0; i < 4; i++)
        assert_true(golden_text_value(p, &d, i, text, sizeof text));
    assert_string_equal(text, "x = over, h = 0xFF, w = 'SHUTTER OPEN', model = 'a, b = \"c\"'");
    assert_int_equal(profile_assign_data(p, text, NULL, &back, NULL), 0);
    assert_true(isinf(back.number[0]) && back.number[1] == 255 && back.number[2] == 1);
    assert_string_equal(back.text[3], d.text[3]);
    assert_int_equal(profile_data_set_text(p, &d, 3, "it's", NULL), 0);
    assert_false(golden_text_value(p, &d, 3, text, sizeof text)); // no way to say it
    assert_false(golden_text_value(p, &d, 2, small, sizeof small));
    assert_string_equal(small, "");
    free(p);
}

// --- bytes ---------------------------------------------------------------------------------------

static struct golden_bytes bytes(const char *text, bool hex)
{
    struct golden_bytes b = {.size = 0};
    for (; *text; hex ? (text += text[2] ? 3 : 2) : text++)
        b.byte[b.size++] = (uint8_t)(hex ? strtol(text, NULL, 16) : *text);
    return b;
}

struct made {
    int rc;
    struct profile_golden g;
    struct gon_error err;
};

static struct made make_over(bool is_usb, const char *about, enum golden_wire wire,
                             const char *sent, const char *received, const char *does,
                             const char *with)
{
    struct profile *p = parsed(about);
    const struct golden_maker m = {p, wire, 7, "recorded by this test", is_usb};
    const struct captured c = {bytes(sent, wire != GOLDEN_MESSAGE),
                               bytes(received, wire != GOLDEN_MESSAGE)};
    struct profile_data d;
    struct made made = {.rc = 0};
    profile_data_clear(&d);
    if (wire == GOLDEN_MESSAGE)
        assert_int_equal(profile_assign_data(p, with, NULL, &d, NULL), 0);
    made.rc = golden_entry_make(&m, &c, does, with, &d, &made.g, &made.err);
    if (made.rc == 0) {
        p->golden[0] = made.g;
        p->golden_count = 1;
        assert_int_equal(profile_golden_check(p, 0, NULL), 0);
        assert_string_equal(made.g.source, "recorded by this test");
    }
    free(p);
    return made;
}

static struct made make(const char *about, enum golden_wire wire, const char *sent,
                        const char *received, const char *does, const char *with)
{
    return make_over(false, about, wire, sent, received, does, with);
}

static void only_usb_ends_an_answer_without_its_terminator(void **state)
{
    (void)state;
    const struct made usb = make_over(true, plain, GOLDEN_MESSAGE, "x?\r", "1.5 V", "x", "");
    assert_int_equal(usb.rc, 0);
    assert_string_equal(usb.g.received, "1.5 V");
    assert_string_equal(usb.g.gives, "x = 1.5");
    const struct made cut = make(plain, GOLDEN_MESSAGE, "x?\r", "1.5 V", "x", "");
    assert_int_equal(cut.rc, GON_E_LINK);
    assert_non_null(strstr(cut.err.text, "broken off"));
}

static void exchanges_become_entries(void **state)
{
    static const struct {
        const char *about, *sent, *received, *hint, *with; // as they went
        const char *does, *text, *answer, *gives, *told;
    } rows[] = {
        {plain, "x?\r", "1.5 V\r\n", "x", "", "x", "x?", "1.5 V", "x = 1.5", ""},
        {plain, "x?\r", " 1.5 V \r\n", "go", "", "x", "x?", " 1.5 V ", "x = 1.5", ""},
        {plain, "x 2.00\r", "OK\r\n", "set", "x = 2", "set", "x 2.00", "OK", "", "x = 2"},
        {plain, "x 2.00\r", "Error 3\r\n", "set", "x = 2", "set", "x 2.00", "Error 3", "", "x = 2"},
        {plain, "x?\r", "ERROR \"?\"\r\n", "x", "", "x", "x?", "ERROR \"?\"", "", ""},
        {plain, "g\r", "", "go", "", "go", "g", "", "", ""},
        {plain, "m?\r", "it's\r\n", "model", "", "model", "m?", "it's", "", ""},
        {plain, "a?\r", "1,ff,shutter open,3\r\n", "all", "", "all", "a?", "1,ff,shutter open,3",
         "x = 1, h = 0xFF, w = 'SHUTTER OPEN', doubt = 3", ""},
        {plain, "a?\r", "2,ff,on,3\r\n", "all", "", "all", "a?", "2,ff,on,3",
         "x = 2, h = 0xFF, w = 'ON'", ""},
        {echoes, "x?\r", "x?\r3\r> ", "x", "", "x", "x?", "3", "x = 3", ""},
        {echoes, "g\r", "g\r\r> ", "go", "", "go", "g", "", "", ""},
        {summed, "x?*B7\r", "3*33\rOK\r", "x", "", "x", "x?*B7", "3*33", "x = 3", ""},
        {summed, "x?*B7\r", "err*49\r", "x", "", "x", "x?*B7", "err*49", "", ""}, // and no OK
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct made m = make(rows[i].about, GOLDEN_MESSAGE, rows[i].sent, rows[i].received,
                                   rows[i].hint, rows[i].with);
        if (m.rc < 0)
            fail_msg("row %zu: %s", i, m.err.text);
        assert_string_equal(m.g.does, rows[i].does);
        assert_string_equal(m.g.sent, rows[i].text);
        assert_string_equal(m.g.received, rows[i].answer);
        assert_string_equal(m.g.gives, rows[i].gives);
        assert_string_equal(m.g.with, rows[i].told);
    }
}

static void what_is_no_exchange_becomes_none(void **state)
{
    static const struct {
        const char *about, *sent, *received, *says;
    } rows[] = {
        {plain, "x?\r", "", "no answer"},
        {plain, "x?\r", "1,5 V\r\n", "1,5 V"},
        {plain, "y?\r", "1\r\n", "none of the profile's"},
        {plain, "x?", "1.5 V\r\n", "as a whole"},
        {plain, "g\r", "what\r\n", "where none comes"},
        {echoes, "x?\r", "X?\r3\r> ", "not repeated"},
        {summed, "x?*B7\r", "3*34\rOK\r", "34"},
        {plain, "x?\r", "1.5 \xb5V\r\n", "cannot be written"},
        {summed, "x?*B8\r", "3*33\rOK\r", "none of the profile's"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct made m =
            make(rows[i].about, GOLDEN_MESSAGE, rows[i].sent, rows[i].received, "x", "");
        assert_true(m.rc == GON_E_LINK || m.rc == GON_E_INPUT);
        if (!strstr(m.err.text, rows[i].says))
            fail_msg("row %zu: %s", i, m.err.text);
    }
}

static void frames_become_entries(void **state)
{
    struct made m =
        make(modbus, GOLDEN_RTU, "07 03 00 7D 00 01 14 74", "07 03 02 00 20 31 9C", "", "");
    (void)state;
    assert_int_equal(m.rc, 0);
    assert_int_equal(m.g.asks_count, 1);
    assert_int_equal(m.g.unit, 7);
    assert_string_equal(m.g.asks[0], "input");
    assert_string_equal(m.g.gives, "input = 0x20");
    assert_string_equal(m.g.sent, "07 03 00 7D 00 01 14 74");
    // Over TCP: the same frames, with the header that went instead of the CRC.
    m = make(modbus, GOLDEN_TCP, "00 01 00 00 00 06 07 03 00 7D 00 01",
             "00 01 00 00 00 05 07 03 02 00 20", "", "");
    assert_int_equal(m.rc, 0);
    assert_string_equal(m.g.sent, "07 03 00 7D 00 01 14 74");
    assert_string_equal(m.g.received, "07 03 02 00 20 31 9C");
    // An exception.
    m = make(modbus, GOLDEN_TCP, "00 01 00 00 00 06 07 03 00 7D 00 01",
             "00 01 00 00 00 03 07 83 02", "", "");
    assert_int_equal(m.rc, 0);
    assert_string_equal(m.g.received, "07 83 02 20 F0");
    assert_string_equal(m.g.gives, "");
    // A write with its value, and the frame of an edge, not the one that takes it back.
    m = make(modbus, GOLDEN_TCP, "00 01 00 00 00 0B 07 10 00 10 00 02 04 00 05 00 01",
             "00 01 00 00 00 06 07 10 00 10 00 02", "move", "a = 5");
    assert_int_equal(m.rc, 0);
    assert_string_equal(m.g.with, "a = 5");
    m = make(modbus, GOLDEN_RTU, "07 10 00 7D 00 01 02 00 20 86 05", "07 10 00 7D 00 01 91 B7",
             "stop", "");
    assert_int_equal(m.rc, 0);
    m = make(modbus, GOLDEN_RTU, "07 10 00 7D 00 01 02 00 00 87 DD", "07 10 00 7D 00 01 91 B7",
             "stop", "");
    assert_int_equal(m.rc, GON_E_INPUT);
    assert_non_null(strstr(m.err.text, "at byte 8"));
}

static void frames_that_are_none_become_none(void **state)
{
    static const struct {
        const char *sent, *received, *says;
    } rows[] = {
        {"07 03 00 7D 00 01 14 74", "", "no answer"},
        {"07 03 00 7D 00 01 14 74", "07 03 04 00 20 00 00 5C 3B", "no answer to this"},
        {"07 03 00 7D 00 01 14 74", "07 03 02 00 20 31 9D", "does not answer"}, // its CRC
        {"07 03 00 20 00 01 85 A6", "07 03 02 00 20 31 9C", "none of the profile's"},
        {"07 03 00", "", "no Modbus frame"},
        {"07 10 00 7D 00 01 02 00 20 86 05", "", "no answer"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct made m = make(modbus, GOLDEN_RTU, rows[i].sent, rows[i].received, "stop", "");
        assert_true(m.rc == GON_E_LINK || m.rc == GON_E_INPUT);
        if (!strstr(m.err.text, rows[i].says) && !strstr(m.err.text, "cannot be trusted"))
            fail_msg("row %zu: %s", i, m.err.text);
    }
}

// --- what a profile may be told
// --------------------------------------------------------------------

static void a_setter_needs_fewest_others(void **state)
{
    struct profile *p = parsed(plain), *m = parsed(modbus);
    (void)state;
    assert_int_equal(profile_setter(p, 0), profile_exchange(p, "set"));
    assert_int_equal(profile_setter(p, 1), -1);
    assert_int_equal(profile_setter(m, 0), profile_write(m, "move"));
    assert_int_equal(profile_setter(m, 1), -1); // it is always 1
    assert_int_equal(profile_setter(m, 2), -1); // a bit's edge
    assert_true(profile_only_asks(p, profile_exchange(p, "x")));
    assert_false(profile_only_asks(p, profile_exchange(p, "set")));
    assert_false(profile_only_asks(p, profile_exchange(p, "go")));
    free(p);
    free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_entry_is_read_back_as_it_was),
        cmocka_unit_test(values_are_read_back_as_they_were),
        cmocka_unit_test(only_usb_ends_an_answer_without_its_terminator),
        cmocka_unit_test(exchanges_become_entries),
        cmocka_unit_test(what_is_no_exchange_becomes_none),
        cmocka_unit_test(frames_become_entries),
        cmocka_unit_test(frames_that_are_none_become_none),
        cmocka_unit_test(a_setter_needs_fewest_others),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
