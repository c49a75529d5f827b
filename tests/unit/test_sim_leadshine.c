// SPDX-License-Identifier: MIT
// uses: sim model base
// The simulated Leadshine drive, by bytes and by registers.
#include "sim/leadshine.h"
#include "sim/modbus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define S(s) ((int64_t)((s)*1e9))
enum { ENABLE = 0x0f, STATUS = 0x1003, WORD = 0x1801, ALARM = 0x2203, CONTROL = 0x6002 };
enum { MOTOR = 0x602c, PATH = 0x6200 };

static struct world world;
static struct sim_leadshine drive;

static int set_up(void **state)
{
    struct world_spec spec;
    const struct sim_leadshine_spec of = {
        .steps_per_unit = 1000, .home_speed = 10, .home_acceleration = 60, .start_s = 0.002};
    (void)state;
    world_defaults(&spec);
    world_init(&world, &spec, 0);
    sim_leadshine_init(&drive, &world, WORLD_THETA_R, &of);
    return 0;
}

static int read_one(int address, int64_t t_ns)
{
    uint16_t r;
    assert_int_equal(sim_leadshine_read(&drive, address, 1, &r, t_ns), 0);
    return r;
}

static int write_one(int address, uint16_t value, int64_t t_ns)
{
    return sim_leadshine_write(&drive, address, 1, &value, t_ns);
}

static int move(int16_t to, uint16_t rpm, int64_t t_ns)
{
    const uint16_t r[] = {1, to < 0 ? 0xffff : 0, (uint16_t)to, rpm, 100, 100, 0, 0x10};
    return sim_leadshine_write(&drive, PATH, 8, r, t_ns);
}

// The manual's example, request and answer.
static void the_manuals_frame_has_the_manuals_answer(void **state)
{
    static const uint8_t request[] = {0x07, 0x10, 0x62, 0x00, 0x00, 0x08, 0x10, 0x00, 0x01,
                                      0x00, 0x00, 0x27, 0x10, 0x00, 0x00, 0x27, 0x10, 0x27,
                                      0x10, 0x00, 0x00, 0x00, 0x10, 0x8d, 0x50};
    static const uint8_t answer[] = {0x07, 0x10, 0x62, 0x00, 0x00, 0x08, 0xde, 0x11};
    struct sim_modbus m;
    uint8_t got[PORT_REPLY_MOST];
    (void)state;
    sim_modbus_init(&m, false, 0, 0);
    sim_modbus_add(
        &m, (struct sim_modbus_unit){
                .id = 7, .read = sim_leadshine_read, .write = sim_leadshine_write, .ctx = &drive});
    port_feed(&m.port, request, sizeof request, S(1));
    assert_int_equal(port_take(&m.port, S(1), got, NULL), sizeof answer);
    assert_memory_equal(got, answer, sizeof answer);
    assert_int_equal(drive.ignored, 1); // it is not enabled, and the example's speed is 0
}

// What public code saw: 0006 while it moves, 0032 when it has stopped.
static void the_status_has_the_values_that_were_seen(void **state)
{
    (void)state;
    assert_int_equal(write_one(ENABLE, 1, S(1)), 0);
    assert_int_equal(read_one(STATUS, S(1)), 0x32);
    assert_int_equal(move(5000, 60, S(1)), 0);
    assert_int_equal(read_one(STATUS, S(1.001)), 0x06);
    assert_int_equal(read_one(CONTROL, S(1.1)), 0x0100);
    assert_int_equal(read_one(STATUS, S(3)), 0x32);
    assert_int_equal(read_one(CONTROL, S(3)), 0);
    assert_int_equal(read_one(MOTOR + 1, S(3)), 5000);
}

static void an_alarm_disables_until_it_is_reset(void **state)
{
    (void)state;
    write_one(ENABLE, 1, S(1));
    move(20000, 60, S(1));
    sim_leadshine_raise(&drive, 2, S(1.5));
    assert_int_equal(read_one(ALARM, S(1.5)), 2);
    assert_int_equal(read_one(STATUS, S(1.5)), 0x31);
    const int at = read_one(MOTOR + 1, S(1.5));
    assert_int_equal(move(0, 60, S(2)), 0); // echoed
    assert_int_equal(read_one(MOTOR + 1, S(3)), at);
    assert_int_equal(write_one(WORD, 0x1111, S(3)), 0);
    assert_int_equal(read_one(STATUS, S(3)), 0x32);
}

static void refusals_do_nothing(void **state)
{
    const uint16_t bad[] = {1, 0, 99, 60, 100, 100, 0, 0x13};
    (void)state;
    write_one(ENABLE, 1, S(1));
    assert_int_equal(sim_leadshine_write(&drive, PATH, 8, bad, S(1)), MODBUS_BAD_VALUE);
    assert_int_equal(drive.path[2], 0);
    assert_int_equal(write_one(0x5000, 1, S(1)), MODBUS_BAD_ADDRESS);
    assert_int_equal(write_one(STATUS, 1, S(1)), MODBUS_BAD_ADDRESS);
    uint16_t r;
    assert_int_equal(sim_leadshine_read(&drive, 0x5000, 1, &r, S(1)), MODBUS_BAD_ADDRESS);
    move(20000, 60, S(1));
    assert_int_equal(write_one(WORD, 0x2211, S(1.5)), MODBUS_FAILURE);
    assert_int_equal(write_one(CONTROL, 0x21, S(1.5)), MODBUS_FAILURE);
    assert_int_equal(write_one(WORD, 0x2211, S(9)), 0);
    assert_int_equal(move(0, 60, S(9.4)), MODBUS_BUSY);
    assert_int_equal(move(0, 60, S(9.6)), 0);
}

static void set_to_zero_the_position_jumps(void **state)
{
    (void)state;
    write_one(ENABLE, 1, S(1));
    move(5000, 60, S(1));
    assert_int_equal(write_one(CONTROL, 0x21, S(5)), 0);
    assert_int_equal(read_one(MOTOR + 1, S(5)), 0);
    assert_int_equal(read_one(STATUS, S(5)), 0x72);
    sim_leadshine_power_cycle(&drive, S(6)); // and is forgotten with the power
    assert_int_equal(read_one(STATUS, S(6)), 0x30);
}

static void a_relative_path_goes_from_where_it_was_commanded(void **state)
{
    const uint16_t r[] = {0x41, 0, 700, 60, 100, 100, 0, 0x10};
    (void)state;
    write_one(ENABLE, 1, S(1));
    for (int i = 1; i <= 3; i++) {
        assert_int_equal(sim_leadshine_write(&drive, PATH, 8, r, S(2 * i)), 0);
        assert_int_equal(read_one(MOTOR + 1, S(2 * i + 1)), 700 * i);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_manuals_frame_has_the_manuals_answer, set_up),
        cmocka_unit_test_setup(the_status_has_the_values_that_were_seen, set_up),
        cmocka_unit_test_setup(an_alarm_disables_until_it_is_reset, set_up),
        cmocka_unit_test_setup(refusals_do_nothing, set_up),
        cmocka_unit_test_setup(set_to_zero_the_position_jumps, set_up),
        cmocka_unit_test_setup(a_relative_path_goes_from_where_it_was_commanded, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
