// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The AZ driver over the unmodified libmodbus against the simulated controller, in virtual time.
#include "drivers/axis.h"

#include "drivers/bus.h"
#include "drivers/by_profile.h"
#include "sim/bench.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

// A bench whose axes are reached through a port that writes down the frames it passes on.
static struct bench bench;
static struct {
    struct noisy line; // first
    uint8_t frame[8][64];
    size_t size[8];
    int frames;
} tap;
static struct bus *bus;
static const struct profile *az;

static void feed_tapped(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    if (tap.frames < 8 && size <= sizeof tap.frame[0]) {
        memcpy(tap.frame[tap.frames], bytes, size);
        tap.size[tap.frames] = size;
    }
    tap.frames++;
    noisy_feed(p, bytes, size, t_ns);
}

static struct axis *begin(int unit)
{
    static const struct port_ops ops = {feed_tapped, noisy_tick, noisy_hangup};
    struct bench_spec spec;
    struct gon_error err;
    bench_defaults(&spec);
    spec.homed = true;
    spec.axes_reply_s = 0.001;
    bench_init(&bench, &spec, CLK_S(1));
    memset(&tap, 0, sizeof tap);
    noisy_init(&tap.line, bench_port(&bench, BENCH_AXES_RTU), 7, 0);
    tap.line.port.ops = &ops;
    struct clk *clk = vline_begin(&tap.line.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    struct axis *a = axis_by_profile(az, bus, unit);
    assert_int_equal(a->ops->identify(a, &err), 0);
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

static void frames_are_those_of_the_register_map(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, -70000, 20000, 60000, NULL), 0);
    look(a);
    assert_int_equal(a->ops->stop(a, NULL), 0);
    check_frame(0, (const uint8_t[]){2,    16,   0x00, 0x58, 0, 16, 32,   0,
                                     0,    0,    0,    0,    0, 0,  1,          // number, absolute
                                     0xff, 0xfe, 0xee, 0x90, 0, 0,  0x4e, 0x20, // position, speed
                                     0,    0,    0xea, 0x60, 0, 0,  0xea, 0x60, // rates
                                     0,    0,    0x03, 0xe8, 0, 0,  0,    1},   // current, trigger
                39);
    check_frame(1, (const uint8_t[]){2, 3, 0x00, 0x7e, 0, 4}, 6);
    check_frame(2, (const uint8_t[]){2, 3, 0x00, 0xc6, 0, 8}, 6);
    check_frame(3, (const uint8_t[]){2, 16, 0x00, 0x7c, 0, 2, 4, 0, 0, 0, 0x20}, 11);
    check_frame(4, (const uint8_t[]){2, 16, 0x00, 0x7d, 0, 1, 2, 0, 0}, 9);
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

static void negative_positions_come_back_negative(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, -123456, 20000, 60000, NULL), 0);
    run_for(20);
    assert_int_equal(look(a).position_steps, -123456);
    end(a);
}

static void what_the_controller_cannot_do_is_not_sent(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    assert_int_equal(a->ops->move_abs(a, 0, 0, 60000, &err), GON_E_INPUT);
    assert_int_equal(a->ops->move_abs(a, 0, 4000001, 60000, &err), GON_E_INPUT);
    assert_int_equal(a->ops->move_abs(a, 0, 20000, 0, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "allowed"));
    assert_int_equal(tap.frames, 0);
    end(a);
}

static void a_move_whose_answer_was_lost_is_not_repeated(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    const uint64_t before = bench.az[1].moves;
    bench_port(&bench, BENCH_AXES_RTU)->drop = 1;
    assert_int_equal(a->ops->move_abs(a, 5000, 20000, 60000, &err), GON_E_LINK);
    assert_int_equal(tap.frames, 1);
    assert_int_equal(bench.az[1].moves, before + 1);
    run_for(2);
    assert_int_equal(look(a).target_steps, 5000); // the controller's own word for it
    end(a);
}

// The bit acts on its edge and holds while it is set: it is taken back although the answers are
// lost.
static void stop_stops_and_takes_its_bit_back(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    for (unsigned drop = 0; drop < 3; drop++) {
        assert_int_equal(a->ops->move_abs(a, drop % 2 ? -50000 : 50000, 20000, 60000, NULL), 0);
        run_for(0.5);
        bench_port(&bench, BENCH_AXES_RTU)->drop = drop;
        assert_int_equal(a->ops->stop(a, NULL), 0);
        assert_int_equal(bench.az[1].input, 0);
        run_for(1);
        struct axis_status s = look(a);
        assert_true(!s.moving && s.ready);
        assert_true(s.position_steps > -50000 && s.position_steps < 50000);
        assert_int_equal(s.target_steps, s.position_steps);
    }
    end(a);
}

static void a_bit_left_behind_is_cleared_before_the_next_command(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    bench_port(&bench, BENCH_AXES_RTU)->mute = true;
    tap.line.one_in = 0;
    assert_int_equal(a->ops->stop(a, &err), GON_E_LINK);
    bench.az[1].input = 1 << 5; // as if only the setting had arrived
    bench_port(&bench, BENCH_AXES_RTU)->mute = false;
    const uint64_t before = bench.az[1].moves;
    assert_int_equal(a->ops->move_abs(a, 1000, 20000, 60000, &err), 0);
    assert_int_equal(bench.az[1].input, 0);
    assert_int_equal(bench.az[1].moves, before + 1);
    end(a);
}

static void homing_ends_homed_at_zero(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    sim_az_power_cycle(&bench.az[1], vline.clk.t_ns);
    assert_false(look(a).homed);
    assert_int_equal(a->ops->home(a, NULL), 0);
    assert_int_equal(bench.az[1].input, 0);
    run_for(60);
    struct axis_status s = look(a);
    assert_true(s.homed && !s.moving);
    assert_int_equal(s.position_steps, 0);
    end(a);
}

static void homing_is_commanded_once_whatever_happens(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin(2);
    const uint64_t before = bench.az[1].moves;
    bench_port(&bench, BENCH_AXES_RTU)->drop = 1;
    assert_int_equal(a->ops->home(a, &err), GON_E_LINK);
    assert_int_equal(bench.az[1].moves, before + 1);
    assert_int_equal(bench.az[1].input, 0);
    end(a);
}

static void an_alarm_has_a_code_and_a_text_and_can_be_reset(void **state)
{
    (void)state;
    struct axis *a = begin(2);
    sim_az_raise(&bench.az[1], 0x66, vline.clk.t_ns);
    struct axis_status s = look(a);
    assert_true(s.alarm && !s.ready);
    assert_int_equal(s.alarm_code, 0x66);
    assert_string_equal(a->ops->alarm_text(a, 0x66), "limit switch reached");
    assert_string_equal(a->ops->alarm_text(a, 0x99), "not in the list of alarms");
    assert_string_equal(a->ops->alarm_text(a, 0), "no alarm");
    assert_int_equal(a->ops->reset_alarm(a, NULL), 0);
    assert_false(look(a).alarm);
    sim_az_raise(&bench.az[1], 0x30, vline.clk.t_ns); // a second edge
    assert_int_equal(a->ops->reset_alarm(a, NULL), 0);
    assert_false(look(a).alarm);
    end(a);
}

static int read_other(void *ctx, int address, int count, uint16_t *ret, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    for (int i = 0; i < count; i++)
        ret[i] = (uint16_t)(address + i);
    return 0;
}

static int write_other(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    (void)address;
    (void)count;
    (void)values;
    (void)t_ns;
    ++*(int *)ctx;
    return 0;
}

static void another_kind_of_unit_is_refused_and_not_written_to(void **state)
{
    struct gon_error err;
    int writes = 0;
    (void)state;
    struct axis *a = begin(2), *other = axis_by_profile(az, bus, 9),
                *absent = axis_by_profile(az, bus, 10);
    sim_modbus_add(&bench.axes_port[0],
                   (struct sim_modbus_unit){
                       .id = 9, .read = read_other, .write = write_other, .ctx = &writes});
    assert_int_equal(other->ops->identify(other, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 9 does not look like an AZ driver"));
    assert_int_equal(writes, 0);
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
    struct axis *a = begin(1), *b = axis_by_profile(az, bus, 2);
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
    print_message("4000 positions, %llu faults: %d answered, %d wrong\n",
                  (unsigned long long)tap.line.faults, good, wrong);
    assert_true(good > 3900);
    assert_int_equal(wrong, 0);
    b->ops->free(b);
    end(a);
}

int main(void)
{
    az = profiles_get("oriental-az");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_those_of_the_register_map),
        cmocka_unit_test(a_move_arrives_and_says_so),
        cmocka_unit_test(negative_positions_come_back_negative),
        cmocka_unit_test(what_the_controller_cannot_do_is_not_sent),
        cmocka_unit_test(a_move_whose_answer_was_lost_is_not_repeated),
        cmocka_unit_test(stop_stops_and_takes_its_bit_back),
        cmocka_unit_test(a_bit_left_behind_is_cleared_before_the_next_command),
        cmocka_unit_test(homing_ends_homed_at_zero),
        cmocka_unit_test(homing_is_commanded_once_whatever_happens),
        cmocka_unit_test(an_alarm_has_a_code_and_a_text_and_can_be_reset),
        cmocka_unit_test(another_kind_of_unit_is_refused_and_not_written_to),
        cmocka_unit_test(no_wrong_position_under_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
