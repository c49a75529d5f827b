// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The Leadshine profile over the unmodified libmodbus against the simulated drive, in virtual time.
#include "drivers/axis.h"
#include "drivers/blocks.h"
#include "drivers/bus.h"
#include "drivers/by_profile.h"
#include "drivers/session.h"
#include "sim/leadshine.h"
#include "sim/modbus.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

// Two drives on a line that writes down the frames it passes on.
static struct world world;
static struct sim_leadshine drive[2]; // units 1 and 2
static struct sim_modbus slaves;
static struct {
    struct noisy line; // first
    uint8_t frame[8][64];
    size_t size[8];
    int frames;
} tap;
static struct bus *bus;
static const struct profile *leadshine;

static void feed_tapped(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    if (tap.frames < 8 && size <= sizeof tap.frame[0]) {
        memcpy(tap.frame[tap.frames], bytes, size);
        tap.size[tap.frames] = size;
    }
    tap.frames++;
    noisy_feed(p, bytes, size, t_ns);
}

static void power_up(void)
{
    struct world_spec spec;
    const struct sim_leadshine_spec of = {.steps_per_unit = 1000,
                                          .home_speed = 10,
                                          .home_acceleration = 60,
                                          .start_s = 0.002,
                                          .homed = true};
    world_defaults(&spec);
    world_init(&world, &spec, CLK_S(1));
    sim_modbus_init(&slaves, false, 0, MS(1));
    for (int i = 0; i < 2; i++) {
        sim_leadshine_init(&drive[i], &world, (enum world_axis)i, &of);
        sim_modbus_add(&slaves, (struct sim_modbus_unit){.id = i + 1,
                                                         .read = sim_leadshine_read,
                                                         .write = sim_leadshine_write,
                                                         .ctx = &drive[i]});
    }
}

static struct axis *begin(int unit)
{
    static const struct port_ops ops = {feed_tapped, noisy_tick, noisy_hangup};
    struct gon_error err;
    power_up();
    memset(&tap, 0, sizeof tap);
    noisy_init(&tap.line, &slaves.port, 7, 0);
    tap.line.port.ops = &ops;
    struct clk *clk = vline_begin(&tap.line.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    struct axis *a = axis_by_profile(leadshine, bus, unit);
    if (a->ops->identify(a, &err) < 0)
        fail_msg("%s", err.text);
    tap.frames = 0;
    return a;
}

static void end(struct axis *a)
{
    a->ops->free(a);
    bus_close(bus);
}

static void run_for(double s)
{
    clk_sleep(&vline.clk.clk, CLK_S(s), NULL);
}

static struct axis_status look(struct axis *a)
{
    struct axis_status s;
    struct gon_error err;
    if (a->ops->status(a, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static void check_frame(int i, const uint8_t *bytes, size_t size)
{
    assert_true(tap.frames > i);
    assert_int_equal(tap.size[i], size + 2); // and its checksum
    assert_memory_equal(tap.frame[i], bytes, size);
}

// The manual's example, CRC included. The drive of the example has the address 7.
static void the_manuals_frame_is_the_profiles(void **state)
{
    const uint8_t shown[] = {0x07, 0x10, 0x62, 0x00, 0x00, 0x08, 0x10, 0x00, 0x01,
                             0x00, 0x00, 0x27, 0x10, 0x00, 0x00, 0x27, 0x10, 0x27,
                             0x10, 0x00, 0x00, 0x00, 0x10, 0x8d, 0x50};
    const struct profile_param params[] = {
        {"position", 10000}, {"speed", 0}, {"acceleration", 16666.6666667}, {NULL, 0}};
    (void)state;
    struct axis *a = begin(2);
    struct session *s = session_on_bus(leadshine, bus, 7);
    assert_int_equal(session_send(s, "move", params, NULL), GON_E_LINK); // no such drive here
    assert_int_equal(tap.size[0], sizeof shown);
    assert_memory_equal(tap.frame[0], shown, sizeof shown);
    session_free(s);
    end(a);
}

static void a_late_answer_to_one_poll_does_not_fit_another(void **state)
{
    char text[1000] = "";
    FILE *out = fmemopen(text, sizeof text, "w");
    (void)state;
    assert_int_equal(blocks_print(leadshine, out), 0);
    fclose(out);
    assert_non_null(strstr(text, "axis.status: function 3, 1003h, 1 register: motion\n"
                                 "axis.status: function 3, 2202h, 2 registers: alarm_code\n"
                                 "axis.status: function 3, 602Ah, 4 registers: command, position"));
}

static void frames_are_those_of_the_register_map(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, -70000, 20000, 60000, NULL), 0);
    look(a);
    assert_int_equal(a->ops->stop(a, NULL), 0);
    check_frame(0, (const uint8_t[]){2, 16,  0x62, 0x00, 0,    8,    16,
                                     0, 1,   0xff, 0xfe, 0xee, 0x90, // position
                                     0, 120, 0x0a, 0xda, 0x0a, 0xda, // rpm, ms per 1000 rpm
                                     0, 0,   0,    0x10},
                23);
    check_frame(1, (const uint8_t[]){2, 3, 0x10, 0x03, 0, 1}, 6);
    check_frame(2, (const uint8_t[]){2, 3, 0x22, 0x02, 0, 2}, 6);
    check_frame(3, (const uint8_t[]){2, 3, 0x60, 0x2a, 0, 4}, 6);
    check_frame(4, (const uint8_t[]){2, 6, 0x60, 0x02, 0, 0x40}, 6);
    assert_int_equal(tap.frames, 5);
    end(a);
}

static void a_move_arrives_and_says_so(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    const int32_t from = look(a).position_steps, to = from + 5000;
    assert_int_equal(a->ops->move_abs(a, to, 20000, 60000, NULL), 0);
    run_for(0.1);
    struct axis_status s = look(a);
    assert_true(s.moving && !s.in_position && !s.ready && s.homed && !s.alarm);
    assert_int_equal(s.target_steps, to);
    assert_in_range(s.position_steps - from, 1, 4999);
    run_for(2);
    s = look(a);
    assert_true(!s.moving && s.in_position && s.ready);
    assert_int_equal(s.position_steps, to);
    assert_int_equal(s.target_steps, to);
    end(a);
}

// The speed that arrives is the one asked, through rpm and ms per 1000 rpm.
static void speeds_and_rates_are_converted(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, -170000, 100000, 6000000, NULL), 0);
    run_for(10);
    assert_int_equal(a->ops->move_abs(a, 170000, 100000, 6000000, NULL), 0);
    run_for(1);
    const int32_t from = look(a).position_steps; // the last of its requests
    const int64_t from_ns = vline.clk.t_ns;
    run_for(1);
    const int32_t went = look(a).position_steps - from;
    const double s = (double)(vline.clk.t_ns - from_ns) * 1e-9;
    assert_true(fabs(went - 100000 * s) <= 1);
    end(a);
}

static void what_the_controller_cannot_do_is_not_sent(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, 0, 100, 60000, &err), GON_E_INPUT);
    assert_int_equal(a->ops->move_abs(a, 0, 500001, 60000, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "allowed: 167..500000 steps/s"));
    assert_int_equal(a->ops->move_abs(a, 0, 20000, 2000, &err), GON_E_INPUT);
    assert_int_equal(a->ops->move_abs(a, 0, 20000, 166666667, &err), GON_E_INPUT);
    assert_int_equal(tap.frames, 0);
    end(a);
}

static void a_move_whose_answer_was_lost_is_not_repeated(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    slaves.port.drop = 1;
    assert_int_equal(a->ops->move_abs(a, 5000, 20000, 60000, &err), GON_E_LINK);
    assert_int_equal(tap.frames, 1);
    assert_int_equal(drive[1].moves, 1);
    run_for(2);
    assert_int_equal(look(a).target_steps, 5000); // the drive's own word for it
    end(a);
}

static void stop_stops_although_answers_are_lost(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    for (unsigned drop = 0; drop < 3; drop++) {
        assert_int_equal(a->ops->move_abs(a, drop % 2 ? -50000 : 50000, 20000, 60000, NULL), 0);
        run_for(0.5);
        slaves.port.drop = drop;
        assert_int_equal(a->ops->stop(a, NULL), 0);
        run_for(1);
        const struct axis_status s = look(a);
        assert_true(!s.moving && s.ready);
        assert_true(s.position_steps > -50000 && s.position_steps < 50000);
        assert_int_equal(s.target_steps, s.position_steps);
    }
    end(a);
}

static void homing_ends_homed_at_zero(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, 3000, 20000, 60000, NULL), 0);
    run_for(1);
    sim_leadshine_power_cycle(&drive[1], vline.clk.t_ns);
    assert_false(look(a).homed);
    assert_int_equal(a->ops->identify(a, &err), 0);
    slaves.port.drop = 1;
    assert_int_equal(a->ops->home(a, &err), GON_E_LINK); // sent once
    assert_int_equal(drive[1].moves, 1);
    run_for(60);
    const struct axis_status s = look(a);
    assert_true(s.homed && !s.moving);
    assert_int_equal(s.position_steps, 0);
    end(a);
}

// After a power cycle the motor has no current until it is told: a move is echoed and ignored.
static void a_restarted_drive_is_enabled_when_it_is_identified(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(drive[1].enabled, 1);
    sim_leadshine_power_cycle(&drive[1], vline.clk.t_ns);
    const struct axis_status s = look(a);
    assert_true(!s.homed && !s.ready && !s.alarm);
    assert_int_equal(a->ops->move_abs(a, 1000, 20000, 60000, &err), 0);
    assert_int_equal(drive[1].ignored, 1);
    assert_int_equal(a->ops->identify(a, &err), 0);
    assert_true(look(a).ready);
    end(a);
}

static void an_alarm_is_latched_until_it_is_reset(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    sim_leadshine_raise(&drive[1], 0x80, vline.clk.t_ns);
    run_for(1);
    struct axis_status s = look(a);
    assert_true(s.alarm && !s.ready);
    assert_int_equal(s.alarm_code, 0x80);
    assert_non_null(strstr(a->ops->alarm_text(a, 0x80), "cannot be locked"));
    assert_int_equal(a->ops->reset_alarm(a, NULL), 0);
    s = look(a);
    assert_true(!s.alarm && s.ready);
    end(a);
}

// Storing its settings makes the drive busy for half a second: exception 6.
static void a_busy_drive_is_waited_for(void **state)
{
    struct gon_error err;
    uint16_t store = 0x2211;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(bus_write(bus, 2, 0x1801, 1, &store, &err), 0);
    assert_int_equal(a->ops->move_abs(a, 1000, 20000, 60000, &err), 0);
    assert_int_equal(drive[1].moves, 1);
    assert_int_equal(bus_write(bus, 2, 0x1801, 1, &store, &err), GON_E_DEVICE); // it moves
    assert_non_null(strstr(err.text, "exception 4"));
    assert_int_equal(bus_exception(bus), 4);
    end(a);
}

// What was written there is not what it reads: a state.
static void control_reads_its_state(void **state)
{
    uint16_t control;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, 10000, 20000, 60000, NULL), 0);
    assert_int_equal(bus_read(bus, 2, 0x6002, 1, &control, NULL), 0);
    assert_int_equal(control, 0x0100);
    run_for(3);
    assert_int_equal(bus_read(bus, 2, 0x6002, 1, &control, NULL), 0);
    assert_int_equal(control, 0);
    end(a);
}

static void a_position_is_read_in_one_request(void **state)
{
    uint16_t upper, lower;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, 140000, 40000, 600000, NULL), 0);
    run_for(65530 / 40000.0);
    int torn = 0;
    for (int i = 0; i < 60; i++) { // what two requests make of it, where the upper word changes
        const int32_t before = sim_leadshine_position_steps(&drive[1], vline.clk.t_ns);
        sim_leadshine_read(&drive[1], 0x602c, 1, &upper, vline.clk.t_ns);
        sim_leadshine_read(&drive[1], 0x602d, 1, &lower, vline.clk.t_ns + MS(12));
        torn += abs((int32_t)((uint32_t)upper << 16 | lower) - before) > 10000;
        const int32_t read = look(a).position_steps;
        assert_true(read >= before &&
                    read <= sim_leadshine_position_steps(&drive[1], vline.clk.t_ns));
        run_for(0.001);
    }
    assert_true(torn > 0);
    end(a);
}

static void another_kind_of_unit_is_refused_and_not_written_to(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2), *other = axis_by_profile(leadshine, bus, 1),
                *absent = axis_by_profile(leadshine, bus, 9);
    drive[0].pulses_per_turn = 6;
    assert_int_equal(other->ops->identify(other, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 1 is not set to 10000 pulses a turn"));
    assert_int_equal(drive[0].enabled, 0);
    assert_int_equal(absent->ops->identify(absent, &err), GON_E_LINK);
    absent->ops->free(absent);
    other->ops->free(other);
    end(a);
}

// Positions of two axes that stand still at different places, read alternately on a bad cable.
static void no_wrong_position_under_faults(void **state)
{
    int good = 0, wrong = 0;
    (void)state;
    struct axis *a = begin(1), *b = axis_by_profile(leadshine, bus, 2);
    assert_int_equal(b->ops->identify(b, NULL), 0);
    assert_int_equal(a->ops->move_abs(a, 1111, 20000, 60000, NULL), 0);
    assert_int_equal(b->ops->move_abs(b, -2222, 20000, 60000, NULL), 0);
    run_for(5);
    tap.line.one_in = 8;
    tap.line.late_most_ns = MS(95);
    tap.line.double_most_ns = MS(95);
    for (int i = 0; i < 4000; i++) {
        struct axis *which = i % 2 ? b : a;
        struct axis_status s;
        if (which->ops->status(which, &s, NULL) < 0)
            continue;
        good++;
        wrong += s.position_steps != (i % 2 ? -2222 : 1111) || s.moving || !s.homed || s.alarm;
    }
    print_message("seed 7: 4000 positions, %llu faults: %d answered, %d wrong\n",
                  (unsigned long long)tap.line.faults, good, wrong);
    assert_true(good > 3900);
    assert_int_equal(wrong, 0);
    b->ops->free(b);
    end(a);
}

int main(void)
{
    leadshine = profiles_get("leadshine-pr");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_manuals_frame_is_the_profiles),
        cmocka_unit_test(a_late_answer_to_one_poll_does_not_fit_another),
        cmocka_unit_test(frames_are_those_of_the_register_map),
        cmocka_unit_test(a_move_arrives_and_says_so),
        cmocka_unit_test(speeds_and_rates_are_converted),
        cmocka_unit_test(what_the_controller_cannot_do_is_not_sent),
        cmocka_unit_test(a_move_whose_answer_was_lost_is_not_repeated),
        cmocka_unit_test(stop_stops_although_answers_are_lost),
        cmocka_unit_test(homing_ends_homed_at_zero),
        cmocka_unit_test(a_restarted_drive_is_enabled_when_it_is_identified),
        cmocka_unit_test(an_alarm_is_latched_until_it_is_reset),
        cmocka_unit_test(a_busy_drive_is_waited_for),
        cmocka_unit_test(control_reads_its_state),
        cmocka_unit_test(a_position_is_read_in_one_request),
        cmocka_unit_test(another_kind_of_unit_is_refused_and_not_written_to),
        cmocka_unit_test(no_wrong_position_under_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
