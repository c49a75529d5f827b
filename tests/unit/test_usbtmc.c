// SPDX-License-Identifier: MIT
// uses: drivers base
// Frames as in the tables of USBTMC 1.0 (section 3.2) and USB488 (section 4.2), and random bytes.
#include "drivers/usbtmc.h"

#include "tests/unit/randoms.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

static void a_command_is_framed_and_padded(void **state)
{
    static const uint8_t expected[] = {1, 1, 0xfe, 0,   6,   0,   0,   0,    1, 0,
                                       0, 0, '*',  'I', 'D', 'N', '?', '\n', 0, 0};
    uint8_t frame[64];
    (void)state;
    memset(frame, 0xaa, sizeof frame);
    assert_int_equal(usbtmc_frame_out(frame, sizeof frame, 1, "*IDN?\n", 6, true), sizeof expected);
    assert_memory_equal(frame, expected, sizeof expected);
    assert_int_equal(frame[sizeof expected], 0xaa);
    assert_int_equal(usbtmc_frame_out(frame, sizeof frame, 200, "12345678", 8, false), 20);
    assert_int_equal(frame[1], 200);
    assert_int_equal(frame[2], 55);
    assert_int_equal(frame[8], 0); // more of the message follows
}

static void what_does_not_fit_is_not_framed(void **state)
{
    uint8_t frame[32];
    (void)state;
    assert_int_equal(usbtmc_frame_out(frame, 0, 1, "x", 1, true), 0);
    assert_int_equal(usbtmc_frame_out(frame, 15, 1, "x", 1, true), 0);
    assert_int_equal(usbtmc_frame_out(frame, 16, 1, "x", 1, true), 16);
    assert_int_equal(usbtmc_frame_out(frame, sizeof frame, 1, "x", SIZE_MAX, true), 0);
}

static void a_request_says_how_much_may_come(void **state)
{
    static const uint8_t expected[] = {2, 3, 0xfc, 0, 0x34, 0x12, 0, 0, 0, 0, 0, 0};
    uint8_t frame[USBTMC_HEADER];
    (void)state;
    usbtmc_frame_request(frame, 3, 0x1234);
    assert_memory_equal(frame, expected, sizeof expected);
}

static void tags_count_without_zero(void **state)
{
    uint8_t tag = 0;
    (void)state;
    for (int i = 1; i <= 255; i++)
        assert_int_equal(tag = usbtmc_next_tag(tag), i);
    assert_int_equal(usbtmc_next_tag(tag), 1);
}

static void an_answer_is_checked_against_its_request(void **state)
{
    static const struct {
        uint8_t bytes[USBTMC_HEADER];
        size_t size;
        enum usbtmc_verdict verdict;
    } rows[] = {
        {{2, 7, 0xf8, 0, 5, 0, 0, 0, 1}, 12, USBTMC_GOOD},
        {{2, 7, 0xf8, 0, 5, 0, 0, 0, 0}, 12, USBTMC_GOOD},
        {{2, 7, 0xf8, 0, 0, 0, 0, 0, 1}, 12, USBTMC_GOOD},
        {{2, 7, 0xf8, 0, 100, 0, 0, 0, 1}, 12, USBTMC_GOOD},
        {{2, 7, 0xf8, 0, 5, 0, 0, 0, 1}, 11, USBTMC_SHORT},
        {{2, 7, 0xf8, 0, 5, 0, 0, 0, 1}, 0, USBTMC_SHORT},
        {{1, 7, 0xf8, 0, 5, 0, 0, 0, 1}, 12, USBTMC_WRONG_ID},
        {{2, 8, 0xf7, 0, 5, 0, 0, 0, 1}, 12, USBTMC_WRONG_TAG},
        {{2, 7, 0xf7, 0, 5, 0, 0, 0, 1}, 12, USBTMC_WRONG_TAG},
        {{2, 7, 0xf8, 0, 101, 0, 0, 0, 1}, 12, USBTMC_WRONG_SIZE},
        {{2, 7, 0xf8, 0, 5, 0, 0, 0x80, 1}, 12, USBTMC_WRONG_SIZE},
        {{2, 7, 0xf8, 0, 0xff, 0xff, 0xff, 0xff, 1}, 12, USBTMC_WRONG_SIZE},
        {{2, 7, 0xf8, 0, 0, 0, 0, 0, 0}, 12, USBTMC_WRONG_SIZE},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct usbtmc_in in = {.size = 4711};
        assert_int_equal(usbtmc_parse_in(rows[i].bytes, rows[i].size, 7, 100, &in),
                         rows[i].verdict);
        assert_int_equal(in.size, rows[i].verdict == USBTMC_GOOD ? rows[i].bytes[4] : 4711);
        if (rows[i].verdict == USBTMC_GOOD)
            assert_int_equal(in.end, rows[i].bytes[8]);
    }
}

static void random_headers_never_promise_more_than_was_asked(void **state)
{
    uint64_t seed = random_seed();
    int good = 0;
    (void)state;
    for (int i = 0; i < 200000; i++) {
        uint8_t bytes[USBTMC_HEADER];
        struct usbtmc_in in;
        const uint8_t tag = (uint8_t)(1 + random_next(&seed) % 255);
        const uint32_t most = (uint32_t)random_next(&seed) >> (random_next(&seed) % 32);
        for (size_t k = 0; k < sizeof bytes; k++)
            bytes[k] = (uint8_t)random_next(&seed);
        if (i % 2) { // half of them get past the tag
            bytes[0] = 2;
            bytes[1] = tag;
            bytes[2] = (uint8_t)~tag;
        }
        const size_t size = random_next(&seed) % (sizeof bytes + 1);
        if (usbtmc_parse_in(bytes, size, tag, most, &in) != USBTMC_GOOD)
            continue;
        good++;
        assert_true(size == sizeof bytes && in.size <= most && (in.size > 0 || in.end));
    }
    assert_true(good > 100);
}

static void requests_name_their_recipient(void **state)
{
    (void)state;
    struct usbtmc_setup s = usbtmc_setup(USBTMC_INITIATE_ABORT_BULK_IN, 9, 0x82);
    assert_true(s.type == 0xa2 && s.request == 3 && s.value == 9 && s.index == 0x82);
    assert_int_equal(s.length, 2);
    s = usbtmc_setup(USBTMC_CHECK_CLEAR, 0, 1);
    assert_true(s.type == 0xa1 && s.request == 6 && s.index == 1 && s.length == 2);
    s = usbtmc_setup(USBTMC_CHECK_ABORT_BULK_IN, 0, 0x82);
    assert_true(s.type == 0xa2 && s.request == 4 && s.index == 0x82 && s.length == 8);
    assert_int_equal(usbtmc_setup(USBTMC_CHECK_ABORT_BULK_OUT, 0, 2).length, 8);
    assert_int_equal(usbtmc_setup(USBTMC_GET_CAPABILITIES, 0, 0).length, 24);
    assert_int_equal(usbtmc_setup(USBTMC_REN_CONTROL, 1, 0).length, 1);
}

static void capabilities_are_read(void **state)
{
    uint8_t bytes[USBTMC_CAPABILITIES] = {[0] = 1, [2] = 0, [3] = 1, [14] = 0x06};
    struct usbtmc_capabilities c;
    (void)state;
    assert_true(usbtmc_parse_capabilities(bytes, sizeof bytes, true, &c));
    assert_true(c.usb488 && c.remote);
    bytes[14] = 0x04;
    assert_true(usbtmc_parse_capabilities(bytes, sizeof bytes, true, &c));
    assert_true(c.usb488 && !c.remote);
    bytes[14] = 0xff; // reserved where the interface is not USB488
    assert_true(usbtmc_parse_capabilities(bytes, sizeof bytes, false, &c));
    assert_false(c.usb488 || c.remote);
    assert_true(usbtmc_parse_capabilities(bytes, 14, true, &c)); // a short answer
    assert_true(c.usb488 && !c.remote);
    assert_false(usbtmc_parse_capabilities(bytes, 0, true, &c));
    bytes[0] = USBTMC_FAILED;
    assert_false(usbtmc_parse_capabilities(bytes, sizeof bytes, true, &c));
}

static void strings_become_ascii(void **state)
{
    static const uint8_t serial[] = {12, 3, ' ', 0, 'P', 0, '1', 0, 0xb5, 0, ' ', 0};
    static const uint8_t liar[] = {255, 3, 'A', 0, 'B', 0};
    char text[8];
    (void)state;
    assert_true(usbtmc_parse_string(serial, sizeof serial, text, sizeof text));
    assert_string_equal(text, "P1?");
    assert_true(usbtmc_parse_string(liar, sizeof liar, text, sizeof text));
    assert_string_equal(text, "AB");
    assert_true(usbtmc_parse_string(serial, sizeof serial, text, 3));
    assert_string_equal(text, "P1");
    assert_false(usbtmc_parse_string(serial, 1, text, sizeof text));
    assert_false(usbtmc_parse_string((const uint8_t[]){4, 2, 'x', 0}, 4, text, sizeof text));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_is_framed_and_padded),
        cmocka_unit_test(what_does_not_fit_is_not_framed),
        cmocka_unit_test(a_request_says_how_much_may_come),
        cmocka_unit_test(tags_count_without_zero),
        cmocka_unit_test(an_answer_is_checked_against_its_request),
        cmocka_unit_test(random_headers_never_promise_more_than_was_asked),
        cmocka_unit_test(requests_name_their_recipient),
        cmocka_unit_test(capabilities_are_read),
        cmocka_unit_test(strings_become_ascii),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
