// SPDX-License-Identifier: MIT
// uses: drivers base
#include "drivers/blocks.h"

#include "drivers/registers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

static struct profile profile;
static struct block_plan plan;
static struct profile_asks asks;

static int set_up(void **state)
{
    (void)state;
    memset(&profile, 0, sizeof profile);
    memset(&asks, 0, sizeof asks);
    profile.protocol = PROFILE_MODBUS;
    profile.registers.block_most = 125;
    profile.registers.gap_most = 8;
    return 0;
}

static struct profile_value *add(const char *name, uint32_t address, int format)
{
    struct profile_value *v = &profile.values[profile.values_count++];
    snprintf(v->name, sizeof v->name, "%s", name);
    v->address = address;
    v->format = format;
    v->access = PROFILE_READ;
    return v;
}

static void ask(const char *name)
{
    snprintf(asks.name[asks.count++], sizeof asks.name[0], "%s", name);
}

static struct profile_value *add_asked(const char *name, uint32_t address, int format)
{
    ask(name);
    return add(name, address, format);
}

static void make_plan(void)
{
    struct gon_error err;
    if (blocks_plan(&profile, &asks, &plan, &err) < 0)
        fail_msg("%s", err.text);
}

static void check_block(int i, int address, int count)
{
    assert_true(i < plan.count);
    assert_int_equal(plan.block[i].address, address);
    assert_int_equal(plan.block[i].count, count);
}

static void neighbours_are_read_together(void **state)
{
    (void)state;
    add_asked("output", 0x7e, PROFILE_U32);
    add_asked("alarm", 0x80, PROFILE_U32);
    add_asked("command", 0xc6, PROFILE_S32);
    add_asked("position", 0xcc, PROFILE_S32);
    make_plan();
    assert_int_equal(plan.count, 2);
    check_block(0, 0x7e, 4);
    check_block(1, 0xc6, 8);
    assert_int_equal(plan.ask[1].block, 0);
    assert_int_equal(plan.ask[1].at, 2);
    assert_int_equal(plan.ask[3].block, 1);
    assert_int_equal(plan.ask[3].at, 6);
    assert_int_equal(plan.alike, -1);
}

static void the_order_asked_is_the_order_read(void **state)
{
    (void)state;
    add_asked("position", 0xcc, PROFILE_S32);
    add_asked("output", 0x7e, PROFILE_U16);
    make_plan();
    check_block(0, 0xcc, 2);
    check_block(1, 0x7e, 1);
}

static void a_wide_gap_or_a_long_block_is_not_merged(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U32);
    add_asked("b", 10, PROFILE_U32); // 8 registers between
    add_asked("c", 21, PROFILE_U16); // 9
    make_plan();
    assert_int_equal(plan.count, 2);
    check_block(0, 0, 12);
    check_block(1, 21, 1);
    profile.registers.block_most = 11;
    make_plan();
    assert_int_equal(plan.count, 3);
}

static void what_must_not_be_read_is_not_read_along(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16);
    add_asked("b", 4, PROFILE_U32);
    add("trigger", 2, PROFILE_U16)->access = PROFILE_WRITE;
    make_plan();
    assert_int_equal(plan.count, 2);
    profile.values[2].access = PROFILE_READ;
    make_plan();
    assert_int_equal(plan.count, 1);
    profile.values[2].alone = true;
    make_plan();
    assert_int_equal(plan.count, 2);
}

static void a_value_alone_stays_alone(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16);
    add_asked("b", 1, PROFILE_U32)->alone = true;
    add_asked("c", 3, PROFILE_U16);
    make_plan();
    assert_int_equal(plan.count, 3);
    check_block(1, 1, 2);
    assert_int_equal(plan.ask[1].block, 1);
}

static void tables_are_kept_apart(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16);
    add_asked("b", 1, PROFILE_U16)->table = PROFILE_INPUT;
    add_asked("c", 0, PROFILE_U16)->table = PROFILE_DISCRETE;
    add_asked("d", 6, PROFILE_U16)->table = PROFILE_DISCRETE;
    make_plan();
    assert_int_equal(plan.count, 3);
    check_block(2, 0, 7);
    assert_int_equal(plan.alike, -1); // the function tells them apart
}

static void a_readable_neighbour_makes_the_length_another(void **state)
{
    (void)state;
    add_asked("status", 0x1003, PROFILE_U16);
    add_asked("alarm", 0x2203, PROFILE_U16);
    add("far", 0x2203 + 10, PROFILE_U16);
    add("spare", 0x2201, PROFILE_U16);
    make_plan();
    check_block(0, 0x1003, 1);
    check_block(1, 0x2201, 3);
    assert_int_equal(plan.ask[1].at, 2);
    assert_int_equal(plan.alike, -1);
    profile.values[3].alone = true;
    make_plan();
    check_block(1, 0x2203, 1);
    assert_true(plan.alike >= 0);
}

static void the_first_one_is_lengthened_when_the_second_cannot_be(void **state)
{
    (void)state;
    add_asked("status", 0x1003, PROFILE_U16);
    add_asked("alarm", 0x2203, PROFILE_U16);
    add("spare", 0x1004, PROFILE_U32);
    make_plan();
    check_block(0, 0x1003, 3);
    check_block(1, 0x2203, 1);
    assert_int_equal(plan.alike, -1);
}

static void another_order_keeps_equal_lengths_apart(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16);
    add_asked("b", 100, PROFILE_U16);
    add_asked("c", 200, PROFILE_U32);
    add_asked("d", 300, PROFILE_U32);
    make_plan();
    assert_int_equal(plan.alike, -1);
    check_block(0, 0, 1);
    assert_int_equal(plan.block[1].count, 2);
    assert_int_equal(plan.block[2].count, 1);
    assert_int_equal(plan.block[plan.ask[3].block].address, 300);
}

static void what_cannot_be_avoided_is_said(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16);
    make_plan();
    assert_int_equal(plan.alike, -1);
    add_asked("b", 100, PROFILE_U16);
    make_plan();
    assert_int_equal(plan.alike, 0);
    add_asked("c", 200, PROFILE_U32); // 1 1 2, and round again
    make_plan();
    assert_true(plan.alike >= 0);
}

static int fails(const char *text)
{
    struct gon_error err;
    const int rc = blocks_plan(&profile, &asks, &plan, &err);
    assert_non_null(strstr(err.text, text));
    return rc;
}

static void what_cannot_be_asked_is_an_error(void **state)
{
    (void)state;
    add_asked("a", 0, PROFILE_U16)->access = PROFILE_WRITE;
    assert_int_equal(fails("a: can be written, not read"), GON_E_INPUT);
    profile.values[0].access = PROFILE_READ;
    profile.values[0].address = 70000;
    assert_int_equal(fails("a: address 70000"), GON_E_INPUT);
    profile.values[0].address = 0;
    ask("nothing");
    assert_int_equal(fails("no value \"nothing\""), GON_E_INPUT);
}

static void the_plan_can_be_printed(void **state)
{
    char text[1000] = "";
    FILE *out = fmemopen(text, sizeof text, "w");
    (void)state;
    add_asked("output", 0x7e, PROFILE_U32);
    add_asked("alarm", 0x80, PROFILE_U32);
    add_asked("door", 3, PROFILE_U16)->table = PROFILE_DISCRETE;
    profile.axis.status = asks;
    profile.inputs.status.count = 2;
    strcpy(profile.inputs.status.name[0], "near");
    strcpy(profile.inputs.status.name[1], "far");
    add("near", 500, PROFILE_U16);
    add("far", 600, PROFILE_U16);
    assert_int_equal(blocks_print(&profile, out), 1);
    fclose(out);
    assert_non_null(strstr(text, "axis.status: function 3, 007Eh, 4 registers: output, alarm\n"
                                 "axis.status: function 2, 0003h, 1 discrete input: door\n"
                                 "inputs.status: function 3, 01F4h, 1 register: near\n"));
    assert_non_null(strstr(text, "inputs.status: the requests for 01F4h and 0258h"));
}

static void lists_that_follow_each_other_are_compared(void **state)
{
    char text[1000] = "";
    FILE *out = fmemopen(text, sizeof text, "w");
    (void)state;
    add_asked("kind", 0, PROFILE_U16);
    profile.identify.asks = asks;
    asks.count = 0;
    add_asked("status", 100, PROFILE_U16);
    profile.axis.status = asks;
    assert_int_equal(blocks_print(&profile, out), 1);
    fclose(out);
    assert_non_null(strstr(text, "axis.status: the requests for 0000h and 0064h"));
    profile.axis.status = profile.identify.asks; // the very same question
    out = fmemopen(text, sizeof text, "w");
    assert_int_equal(blocks_print(&profile, out), 0);
    fclose(out);
}

// --- any profile ---------------------------------------------------------------------------------

static void invent(void)
{
    set_up(NULL);
    profile.registers.block_most = 1 + rand() % 40;
    if (profile.registers.block_most < 2)
        profile.registers.block_most = 2;
    profile.registers.gap_most = rand() % 12;
    const int count = 1 + rand() % 24;
    for (int i = 0; i < count; i++) {
        char name[16];
        snprintf(name, sizeof name, "v%d", i);
        struct profile_value *v = add(name, (uint32_t)(rand() % 120), rand() % (PROFILE_F32 + 1));
        v->table = rand() % 3 ? PROFILE_HOLDING : rand() % 4;
        v->alone = rand() % 10 == 0;
        v->access = rand() % 8 == 0 ? PROFILE_WRITE : PROFILE_READ;
        if (v->access == PROFILE_READ && asks.count < PROFILE_ASKS && rand() % 2)
            ask(name);
    }
}

static void check_each_value_is_whole_in_its_block(void)
{
    for (int i = 0; i < plan.asks; i++) {
        const struct profile_value *v = &profile.values[plan.ask[i].value];
        const struct block *b = &plan.block[plan.ask[i].block];
        assert_string_equal(v->name, asks.name[i]);
        assert_int_equal(b->table, v->table);
        assert_int_equal(b->address + plan.ask[i].at, v->address);
        assert_true(plan.ask[i].at + registers_count(v) <= b->count);
        assert_true(!v->alone || b->count == registers_count(v));
    }
}

static void check_nothing_forbidden_is_read(void)
{
    for (int i = 0; i < plan.count; i++) {
        const struct block *b = &plan.block[i];
        assert_in_range(b->count, 1, profile.registers.block_most);
        for (int j = 0; j < profile.values_count; j++) {
            const struct profile_value *v = &profile.values[j];
            const int at = (int)v->address - b->address;
            const bool within =
                v->table == b->table && at + registers_count(v) > 0 && at < b->count;
            const bool forbidden = v->access == PROFILE_WRITE || v->alone;
            if (within && forbidden) // then it is one value that was asked for over these registers
                assert_true(b->count <= 2);
        }
    }
}

static void check_lengths_differ_or_it_is_said(void)
{
    bool alike = false;
    for (int i = 0; i < plan.count && plan.count > 1; i++) {
        const struct block *a = &plan.block[i], *b = &plan.block[(i + 1) % plan.count];
        const bool bits = a->table == PROFILE_COIL || a->table == PROFILE_DISCRETE;
        alike = alike || (a->table == b->table &&
                          (bits ? (a->count + 7) / 8 == (b->count + 7) / 8 : a->count == b->count));
    }
    assert_int_equal(alike, plan.alike >= 0);
}

static void any_profile_has_a_sound_plan(void **state)
{
    const unsigned seed = 4711;
    int said = 0;
    (void)state;
    srand(seed);
    for (int i = 0; i < 20000; i++) {
        invent();
        make_plan();
        check_each_value_is_whole_in_its_block();
        check_nothing_forbidden_is_read();
        check_lengths_differ_or_it_is_said();
        said += plan.alike >= 0;
    }
    print_message("seed %u: 20000 plans, %d with lengths that cannot differ\n", seed, said);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(neighbours_are_read_together, set_up),
        cmocka_unit_test_setup(the_order_asked_is_the_order_read, set_up),
        cmocka_unit_test_setup(a_wide_gap_or_a_long_block_is_not_merged, set_up),
        cmocka_unit_test_setup(what_must_not_be_read_is_not_read_along, set_up),
        cmocka_unit_test_setup(a_value_alone_stays_alone, set_up),
        cmocka_unit_test_setup(tables_are_kept_apart, set_up),
        cmocka_unit_test_setup(a_readable_neighbour_makes_the_length_another, set_up),
        cmocka_unit_test_setup(the_first_one_is_lengthened_when_the_second_cannot_be, set_up),
        cmocka_unit_test_setup(another_order_keeps_equal_lengths_apart, set_up),
        cmocka_unit_test_setup(what_cannot_be_avoided_is_said, set_up),
        cmocka_unit_test_setup(what_cannot_be_asked_is_an_error, set_up),
        cmocka_unit_test_setup(the_plan_can_be_printed, set_up),
        cmocka_unit_test_setup(lists_that_follow_each_other_are_compared, set_up),
        cmocka_unit_test_setup(any_profile_has_a_sound_plan, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
