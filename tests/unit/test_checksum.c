// SPDX-License-Identifier: MIT
// uses: drivers base
// Check values over "123456789" from the catalogue of parametrised CRC algorithms; the LRC by hand
// from the Modbus over Serial Line specification, 2.5.2.2.
#include "drivers/checksum.h"

#include "tests/unit/randoms.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static const char digits[] = "123456789";

static const struct known {
    const char *name;
    struct profile_checksum c;
    uint32_t check;
} known[] = {
    {"CRC-8/SMBUS", {PROFILE_CRC, 8, 0x07, 0, 0, false, false, 0, ""}, 0xf4},
    {"CRC-8/MAXIM-DOW", {PROFILE_CRC, 8, 0x31, 0, 0, true, true, 0, ""}, 0xa1},
    {"CRC-8/I-432-1", {PROFILE_CRC, 8, 0x07, 0, 0x55, false, false, 0, ""}, 0xa1},
    {"CRC-16/ARC", {PROFILE_CRC, 16, 0x8005, 0, 0, true, true, 0, ""}, 0xbb3d},
    {"CRC-16/MODBUS", {PROFILE_CRC, 16, 0x8005, 0xffff, 0, true, true, 0, ""}, 0x4b37},
    {"CRC-16/IBM-3740", {PROFILE_CRC, 16, 0x1021, 0xffff, 0, false, false, 0, ""}, 0x29b1},
    {"CRC-16/XMODEM", {PROFILE_CRC, 16, 0x1021, 0, 0, false, false, 0, ""}, 0x31c3},
    {"CRC-16/KERMIT", {PROFILE_CRC, 16, 0x1021, 0, 0, true, true, 0, ""}, 0x2189},
    {"CRC-16/IBM-SDLC", {PROFILE_CRC, 16, 0x1021, 0xffff, 0xffff, true, true, 0, ""}, 0x906e},
    {"CRC-16/USB", {PROFILE_CRC, 16, 0x8005, 0xffff, 0xffff, true, true, 0, ""}, 0xb4c8},
    {"CRC-32/ISO-HDLC",
     {PROFILE_CRC, 32, 0x04c11db7, 0xffffffff, 0xffffffff, true, true, 0, ""},
     0xcbf43926},
    {"CRC-32/BZIP2",
     {PROFILE_CRC, 32, 0x04c11db7, 0xffffffff, 0xffffffff, false, false, 0, ""},
     0xfc891918},
    {"CRC-32/ISCSI",
     {PROFILE_CRC, 32, 0x1edc6f41, 0xffffffff, 0xffffffff, true, true, 0, ""},
     0xe3069283},
    {"CRC-32/MPEG-2",
     {PROFILE_CRC, 32, 0x04c11db7, 0xffffffff, 0, false, false, 0, ""},
     0x0376e6e7},
    {"CRC-12/UMTS", {PROFILE_CRC, 12, 0x80f, 0, 0, false, true, 0, ""}, 0xdaf}, // turned at its end
    {"sum of 8 bits", {PROFILE_SUM, 8, 0, 0, 0, false, false, 0, ""}, 0xdd},    // 477
    {"sum of 16 bits", {PROFILE_SUM, 16, 0, 0, 0, false, false, 0, ""}, 0x01dd},
    {"xor", {PROFILE_XOR, 8, 0, 0, 0, false, false, 0, ""}, 0x31}, // 1^..^8 = 8 in the low bits
    {"LRC", {PROFILE_LRC, 8, 0, 0, 0, false, false, 0, ""}, 0x23},
};
enum { KNOWN = sizeof known / sizeof *known };

static void named_checksums_give_their_check_values(void **state)
{
    (void)state;
    for (int i = 0; i < KNOWN; i++) {
        const uint32_t got = checksum_of(&known[i].c, digits, 9);
        if (got != known[i].check)
            print_error("%s: got %x / expected %x\n", known[i].name, got, known[i].check);
        assert_int_equal(got, known[i].check);
    }
}

// Read input registers 9 to 9 of unit 17: address, function, data; 0x100 less their sum.
static void the_lrc_of_modbus_makes_the_sum_of_all_bytes_zero(void **state)
{
    static const unsigned char frame[] = {0x11, 0x04, 0x00, 0x08, 0x00, 0x01};
    const struct profile_checksum c = {.kind = PROFILE_LRC, .width = 8};
    (void)state;
    assert_int_equal(checksum_of(&c, frame, sizeof frame), 0xe2);
}

static void what_is_appended_is_taken_off_again_in_every_form(void **state)
{
    static const struct {
        int form;
        const char *before, *all;
        size_t size;
    } forms[] = {{PROFILE_HEX_UPPER, "*", "123456789*4B37", 14},
                 {PROFILE_HEX_LOWER, "", "1234567894b37", 13},
                 {PROFILE_RAW_HIGH, "", "123456789\x4b\x37", 11},
                 {PROFILE_RAW_LOW, " ", "123456789 \x37\x4b", 12}};
    (void)state;
    for (int i = 0; i < 4; i++) {
        struct profile_checksum c = known[4].c;
        char text[32];
        size_t size;
        c.form = forms[i].form;
        strcpy(c.before, forms[i].before);
        strcpy(text, digits);
        assert_int_equal(checksum_append(&c, text, 9, sizeof text, &size, NULL), 0);
        assert_int_equal(size, forms[i].size);
        assert_string_equal(text, forms[i].all);
        assert_int_equal(checksum_take(&c, text, size, &size, NULL), 0);
        assert_int_equal(size, 9);
        assert_string_equal(text, digits);
    }
}

static void a_checksum_of_zero_bytes_is_kept(void **state)
{
    struct profile_checksum c = {.kind = PROFILE_SUM, .width = 16, .form = PROFILE_RAW_HIGH};
    char text[8] = "\1";
    size_t size;
    (void)state;
    assert_int_equal(checksum_append(&c, text, 1, sizeof text, &size, NULL), 0);
    assert_int_equal(size, 3);
    assert_memory_equal(text, "\1\0\1", 4);
    assert_int_equal(checksum_take(&c, text, size, &size, NULL), 0);
    assert_int_equal(size, 1);
}

static void no_checksum_changes_nothing(void **state)
{
    struct profile_checksum c = {0};
    char text[4] = "abc";
    size_t size = 0;
    (void)state;
    assert_int_equal(checksum_append(&c, text, 3, sizeof text, &size, NULL), 0);
    assert_int_equal(size, 3);
    assert_int_equal(checksum_take(&c, text, 3, &size, NULL), 0);
    assert_string_equal(text, "abc");
}

static void a_wrong_or_missing_checksum_is_told(void **state)
{
    struct profile_checksum c = known[15].c;
    struct gon_error err;
    char text[32] = "123456789*DC", raw[8] = "1\x32";
    size_t size = 99;
    (void)state;
    strcpy(c.before, "*");
    assert_int_equal(checksum_take(&c, text, strlen(text), &size, &err), GON_E_LINK);
    assert_string_equal(err.text, "wrong checksum: got 'DC' / expected 'DD'");
    assert_int_equal(checksum_take(&c, text, 10, &size, &err), GON_E_LINK);
    assert_string_equal(err.text, "the checksum is missing behind '123456789*'");
    assert_int_equal(checksum_take(&c, text, 1, &size, NULL), GON_E_LINK);
    c.before[0] = 0;
    c.form = PROFILE_RAW_HIGH;
    assert_int_equal(checksum_take(&c, raw, 2, &size, &err), GON_E_LINK);
    assert_string_equal(err.text, "wrong checksum: got 32 / expected 31");
    assert_int_equal(size, 99);
    assert_string_equal(text, "123456789*DC");
}

static void without_room_nothing_is_appended(void **state)
{
    char text[12] = "123456789";
    struct gon_error err;
    size_t size = 99;
    (void)state;
    assert_int_equal(checksum_append(&known[4].c, text, 9, sizeof text, &size, &err), GON_E_INPUT);
    assert_string_equal(err.text, "no room for the checksum behind 9 bytes");
    assert_string_equal(text, "123456789");
    assert_int_equal(size, 99);
}

static void every_flipped_bit_is_seen(void **state)
{
    uint64_t seed = random_seed();
    (void)state;
    for (int round = 0; round < 2000; round++) {
        const struct profile_checksum *c = &known[random_next(&seed) % KNOWN].c;
        char text[64];
        size_t size = random_next(&seed) % 40 + 1;
        for (size_t i = 0; i < size; i++)
            text[i] = (char)random_next(&seed);
        assert_int_equal(checksum_append(c, text, size, sizeof text, &size, NULL), 0);
        text[random_next(&seed) % (size - (size_t)c->width / 4)] ^=
            (char)(1 << random_next(&seed) % 8);
        assert_int_equal(checksum_take(c, text, size, &size, NULL), GON_E_LINK);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(named_checksums_give_their_check_values),
        cmocka_unit_test(the_lrc_of_modbus_makes_the_sum_of_all_bytes_zero),
        cmocka_unit_test(what_is_appended_is_taken_off_again_in_every_form),
        cmocka_unit_test(a_checksum_of_zero_bytes_is_kept),
        cmocka_unit_test(no_checksum_changes_nothing),
        cmocka_unit_test(a_wrong_or_missing_checksum_is_told),
        cmocka_unit_test(without_room_nothing_is_appended),
        cmocka_unit_test(every_flipped_bit_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
