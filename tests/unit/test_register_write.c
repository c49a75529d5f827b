// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/register_write.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static struct profile profile;
static struct profile_write wish;
static struct profile_data known;
static struct register_write sent;

static struct profile_value *add(const char *name, uint32_t address, int format)
{
    struct profile_value *v = &profile.values[profile.values_count++];
    *v = (struct profile_value){.type = PROFILE_INT,
                                .scale = 1,
                                .address = address,
                                .format = format,
                                .access = PROFILE_READ_WRITE};
    snprintf(v->name, sizeof v->name, "%s", name);
    return v;
}

static int set_up(void **state)
{
    (void)state;
    memset(&profile, 0, sizeof profile);
    memset(&wish, 0, sizeof wish);
    profile_data_clear(&known);
    add("kind", 10, PROFILE_U16);
    add("to", 11, PROFILE_S32);
    struct profile_value *speed = add("speed", 13, PROFILE_U16);
    speed->type = PROFILE_REAL;
    speed->scale = 0.5;
    speed->max = 1000;
    add("far", 20, PROFILE_U16);
    struct profile_value *input = add("input", 30, PROFILE_U32);
    input->bits_count = 1;
    input->bits[0] = (struct profile_bit){.name = "stop", .bit = 17};
    return 0;
}

static void wants(const char *text)
{
    snprintf(wish.set[wish.set_count++], sizeof wish.set[0], "%s", text);
}

static int make(struct gon_error *err)
{
    const struct profile_param params[] = {{"position", -2}, {"speed", 100.2}, {NULL, 0}};
    return register_write_set(&profile, &wish, params, &known, &sent, err);
}

static void check_refused(const char *text)
{
    struct gon_error err = {0};
    sent.count = -1;
    assert_int_equal(make(&err), GON_E_INPUT);
    assert_int_equal(sent.count, -1);
    if (!strstr(err.text, text))
        fail_msg("%s", err.text);
}

static void assignments_become_one_transaction_in_any_order(void **state)
{
    const uint16_t expected[] = {1, 0xffff, 0xfffe, 200};
    (void)state;
    wants("speed = $speed");
    wants("to = $position, kind = 1");
    assert_int_equal(make(NULL), 0);
    assert_int_equal(sent.address, 10);
    assert_int_equal(sent.count, 4);
    assert_memory_equal(sent.registers, expected, sizeof expected);
    assert_int_equal(sent.items, 3);
    assert_int_equal(sent.item[1].value, 1);
    assert_true(sent.item[1].number == -2);
}

static void a_name_alone_is_what_is_known(void **state)
{
    (void)state;
    wants("kind");
    check_refused("kind is not known");
    profile_data_set(&profile, &known, 0, 7);
    assert_int_equal(make(NULL), 0);
    assert_int_equal(sent.registers[0], 7);
}

static void a_gap_is_refused(void **state)
{
    (void)state;
    wants("kind = 1, far = 2");
    check_refused("far does not follow");
}

static void the_same_register_twice_is_refused(void **state)
{
    (void)state;
    wants("kind = 1, kind = 2");
    check_refused("kind does not follow");
}

static void what_cannot_be_written_is_refused(void **state)
{
    (void)state;
    wants("kind = 1");
    profile.values[0].access = PROFILE_READ;
    check_refused("kind can only be read");
    profile.values[0].access = PROFILE_WRITE;
    profile.values[0].table = PROFILE_INPUT;
    check_refused("kind can only be read");
    profile.values[0].table = PROFILE_COIL;
    assert_int_equal(make(NULL), 0);
    assert_int_equal(sent.table, PROFILE_COIL);
    wants("to = 1");
    check_refused("to does not follow");
}

static void numbers_beyond_their_range_are_refused(void **state)
{
    (void)state;
    wants("speed = 1000.5");
    check_refused("speed = 1000.5");
    wish.set_count = 0;
    wants("kind = 65536");
    check_refused("kind: 65536 does not fit");
    wish.set_count = 0;
    wants("kind = $nothing");
    check_refused("$nothing");
    wish.set_count = 0;
    wants("nothing = 1");
    check_refused("no value 'nothing'");
    wish.set_count = 0;
    check_refused("sets nothing");
}

static void an_edge_is_one_bit_of_a_value(void **state)
{
    int value;
    double number;
    (void)state;
    strcpy(wish.edge, "input.stop");
    assert_int_equal(register_write_edge(&profile, &wish, &value, &number, NULL), 0);
    assert_int_equal(value, 4);
    assert_true(number == 0x20000);
    assert_int_equal(register_write_one(&profile, value, number, &sent, NULL), 0);
    assert_int_equal(sent.count, 2);
    assert_int_equal(sent.registers[0], 2);
    assert_int_equal(sent.registers[1], 0);
    strcpy(wish.edge, "input.go");
    assert_int_equal(register_write_edge(&profile, &wish, &value, &number, NULL), GON_E_INPUT);
    strcpy(wish.edge, "input");
    assert_int_equal(register_write_edge(&profile, &wish, &value, &number, NULL), GON_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(assignments_become_one_transaction_in_any_order, set_up),
        cmocka_unit_test_setup(a_name_alone_is_what_is_known, set_up),
        cmocka_unit_test_setup(a_gap_is_refused, set_up),
        cmocka_unit_test_setup(the_same_register_twice_is_refused, set_up),
        cmocka_unit_test_setup(what_cannot_be_written_is_refused, set_up),
        cmocka_unit_test_setup(numbers_beyond_their_range_are_refused, set_up),
        cmocka_unit_test_setup(an_edge_is_one_bit_of_a_value, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
