// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/registers.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

static struct profile profile;

static int set_up(void **state)
{
    (void)state;
    memset(&profile, 0, sizeof profile);
    return 0;
}

static struct profile_value value(int format)
{
    return (struct profile_value){.name = "x", .format = format, .scale = 1};
}

static double wire(struct profile_value v, uint16_t first, uint16_t second)
{
    return registers_wire(&profile, &v, (const uint16_t[]){first, second});
}

static void check_both_ways(struct profile_value v, double number, uint16_t first, uint16_t second)
{
    uint16_t r[2] = {0xdead, 0xdead};
    assert_true(wire(v, first, second) == number);
    assert_int_equal(registers_put(&profile, &v, number, r, NULL), 0);
    assert_int_equal(r[0], first);
    assert_int_equal(r[1], registers_count(&v) == 2 ? second : 0xdead);
}

static void every_format_has_its_numbers(void **state)
{
    (void)state;
    check_both_ways(value(PROFILE_U16), 0xfffe, 0xfffe, 0);
    check_both_ways(value(PROFILE_S16), -2, 0xfffe, 0);
    check_both_ways(value(PROFILE_U32), 4294897296.0, 0xfffe, 0xee90);
    check_both_ways(value(PROFILE_S32), -70000, 0xfffe, 0xee90);
    check_both_ways(value(PROFILE_S32), 0x00012345, 0x0001, 0x2345);
    check_both_ways(value(PROFILE_F32), 3.140625, 0x4049, 0x0000); // IEEE 754: 40490000
    check_both_ways(value(PROFILE_F32), -0.15625, 0xbe20, 0x0000);
}

static void words_and_bytes_have_orders_of_their_own(void **state)
{
    struct profile_value v = value(PROFILE_U32);
    (void)state;
    check_both_ways(v, 0x01020304, 0x0102, 0x0304);
    profile.registers.word_order = PROFILE_LOW_FIRST;
    check_both_ways(v, 0x01020304, 0x0304, 0x0102);
    profile.registers.byte_order = PROFILE_LOW_FIRST;
    check_both_ways(v, 0x01020304, 0x0403, 0x0201);
    profile.registers.word_order = PROFILE_HIGH_FIRST;
    check_both_ways(v, 0x01020304, 0x0201, 0x0403);
    check_both_ways(value(PROFILE_U16), 0x0102, 0x0201, 0);
}

static void a_value_may_have_an_order_unlike_the_others(void **state)
{
    struct profile_value v = value(PROFILE_U32);
    (void)state;
    v.word_order = 1 + PROFILE_LOW_FIRST;
    check_both_ways(v, 0x01020304, 0x0304, 0x0102);
    profile.registers.word_order = PROFILE_LOW_FIRST;
    v.word_order = 1 + PROFILE_HIGH_FIRST;
    check_both_ways(v, 0x01020304, 0x0102, 0x0304);
}

static void a_bit_is_a_bit_whatever_its_format(void **state)
{
    struct profile_value v = value(PROFILE_F32);
    (void)state;
    profile.registers.byte_order = PROFILE_LOW_FIRST;
    v.table = PROFILE_COIL;
    assert_int_equal(registers_count(&v), 1);
    check_both_ways(v, 1, 1, 0);
    check_both_ways(v, 0, 0, 0);
    v.table = PROFILE_DISCRETE;
    assert_true(wire(v, 7, 0) == 1.0);
}

static void what_is_no_measurement_is_no_number(void **state)
{
    (void)state;
    assert_true(isnan(wire(value(PROFILE_F32), 0x7fc0, 0)));
    assert_true(isnan(wire(value(PROFILE_F32), 0x7f80, 0)));
}

static int put(int format, double number)
{
    uint16_t r[2] = {7, 7};
    const struct profile_value v = value(format);
    const int rc = registers_put(&profile, &v, number, r, NULL);
    assert_true(rc == 0 || (r[0] == 7 && r[1] == 7));
    return rc;
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    assert_int_equal(put(PROFILE_U16, 65535.4), 0);
    assert_int_equal(put(PROFILE_U16, 65535.5), GON_E_INPUT);
    assert_int_equal(put(PROFILE_U16, -1), GON_E_INPUT);
    assert_int_equal(put(PROFILE_S16, 32768), GON_E_INPUT);
    assert_int_equal(put(PROFILE_U32, 4294967296.0), GON_E_INPUT);
    assert_int_equal(put(PROFILE_S32, -2147483649.0), GON_E_INPUT);
    assert_int_equal(put(PROFILE_S32, -2147483648.0), 0);
    assert_int_equal(put(PROFILE_F32, 1e39), GON_E_INPUT);
    assert_int_equal(put(PROFILE_F32, (double)NAN), GON_E_INPUT);
}

static int address(int base, int table, uint32_t manual)
{
    int at = -1;
    struct profile_value v = value(PROFILE_U16);
    v.table = table;
    v.address = manual;
    profile.registers.base = base;
    const int rc = registers_address(&profile, &v, &at, NULL);
    return rc < 0 ? rc : at;
}

static void the_manuals_base_is_subtracted(void **state)
{
    (void)state;
    assert_int_equal(address(0, PROFILE_HOLDING, 0x7e), 0x7e);
    assert_int_equal(address(1, PROFILE_HOLDING, 127), 126);
    assert_int_equal(address(1, PROFILE_COIL, 1), 0);
    assert_int_equal(address(40001, PROFILE_HOLDING, 40127), 126);
    assert_int_equal(address(40001, PROFILE_INPUT, 30011), 10);
    assert_int_equal(address(40001, PROFILE_DISCRETE, 10001), 0);
    assert_int_equal(address(40001, PROFILE_COIL, 5), 4);
    assert_int_equal(address(1, PROFILE_HOLDING, 0), GON_E_INPUT);
    assert_int_equal(address(40001, PROFILE_HOLDING, 126), GON_E_INPUT);
    assert_int_equal(address(0, PROFILE_HOLDING, 65535), 65535);
    assert_int_equal(address(0, PROFILE_HOLDING, 65536), GON_E_INPUT);
}

static void both_words_lie_in_the_table(void **state)
{
    int at;
    struct gon_error err;
    struct profile_value v = value(PROFILE_U32);
    (void)state;
    v.address = 65535;
    assert_int_equal(registers_address(&profile, &v, &at, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "x: address 65535 is not in its table"));
    v.table = PROFILE_NO_TABLE;
    assert_int_equal(registers_address(&profile, &v, &at, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no register"));
    v.table = PROFILE_HOLDING;
    v.type = PROFILE_STRING;
    v.address = 0;
    assert_int_equal(registers_address(&profile, &v, &at, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "text"));
}

// Whatever a format can hold comes back as it was, in each order.
static void random_numbers_come_back(void **state)
{
    const unsigned seed = 20261126;
    (void)state;
    srand(seed);
    for (int i = 0; i < 20000; i++) {
        struct profile_value v = value(rand() % (PROFILE_F32 + 1));
        profile.registers.word_order = rand() % 2;
        profile.registers.byte_order = rand() % 2;
        v.word_order = rand() % 3;
        const uint16_t first = (uint16_t)rand(), second = (uint16_t)rand();
        const double number = wire(v, first, second);
        if (!isnan(number))
            check_both_ways(v, number, first, second);
    }
    print_message("seed %u\n", seed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(every_format_has_its_numbers, set_up),
        cmocka_unit_test_setup(words_and_bytes_have_orders_of_their_own, set_up),
        cmocka_unit_test_setup(a_value_may_have_an_order_unlike_the_others, set_up),
        cmocka_unit_test_setup(a_bit_is_a_bit_whatever_its_format, set_up),
        cmocka_unit_test_setup(what_is_no_measurement_is_no_number, set_up),
        cmocka_unit_test_setup(what_does_not_fit_is_refused, set_up),
        cmocka_unit_test_setup(the_manuals_base_is_subtracted, set_up),
        cmocka_unit_test_setup(both_words_lie_in_the_table, set_up),
        cmocka_unit_test_setup(random_numbers_come_back, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
