// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// What each fault of a Modbus line may do to an axis by profile, in virtual time, for each make of
// controller: positions that are told are true, also while it moves, and a move is carried out at
// most once for each time it is commanded.
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
#define SPEED 20000
#define ACCELERATION 600000
enum { MOVES = 120, SEED = 2026, MAKES = BENCH_LEADSHINE + 1 };

static const char *const fault_names[] = {"lost",  "late",           "doubled",       "cut",
                                          "split", "garbage before", "garbage after", "changed"};

static struct bench bench;
static struct noisy line;
static struct bus *bus;

static struct axis *begin(int make)
{
    struct bench_spec spec;
    struct gon_error err;
    bench_defaults(&spec);
    spec.homed = true;
    spec.controller = make;
    spec.axes_reply_s = 0.001;
    bench_init(&bench, &spec, CLK_S(1));
    noisy_init(&line, bench_port(&bench, BENCH_AXES_RTU), SEED, 0);
    struct clk *clk = vline_begin(&line.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    struct axis *a = axis_by_profile(profiles_get(bench_controllers[make]), bus, 2);
    if (a->ops->identify(a, &err) < 0)
        fail_msg("%s", err.text);
    line.late_most_ns = MS(95);
    line.double_most_ns = MS(95);
    return a;
}

static void end(struct axis *a)
{
    a->ops->free(a);
    bus_close(bus);
}

static struct bench_motor really(void)
{
    return bench_motor(&bench, WORLD_THETA_R, vline.clk.t_ns);
}

static void run_for(double s)
{
    clk_sleep(&vline.clk.clk, CLK_S(s), NULL);
}

// A status, and whether what it says was so at some moment since it was asked. false: no answer.
static bool look(struct axis *a, struct axis_status *ret_status)
{
    const int32_t before = really().steps;
    if (a->ops->status(a, ret_status, NULL) < 0)
        return false;
    const int32_t after = really().steps, at = ret_status->position_steps;
    const int32_t low = before < after ? before : after, high = before < after ? after : before;
    if (at < low - 1 || at > high + 1)
        fail_msg("says %d, was between %d and %d", at, low, high);
    assert_true(ret_status->homed && !ret_status->alarm);
    return true;
}

// As the daemon goes about it: a command whose answer was lost is not repeated before the status
// was read, and only while the axis stands. Returns how often it was commanded.
static int go(struct axis *a, int32_t to, int64_t until_ns)
{
    struct axis_status s;
    for (int commands = 1;; commands++) {
        const int rc = a->ops->move_abs(a, to, SPEED, ACCELERATION, NULL);
        assert_true(rc == 0 || rc == GON_E_LINK);
        do {
            if (vline.clk.t_ns > until_ns)
                fail_msg("not at %d in time", to);
            run_for(0.02);
        } while (!look(a, &s) || s.moving || !s.ready);
        if (s.position_steps == to)
            return commands;
    }
}

static void check_fault(int make, unsigned only)
{
    struct axis *a = begin(make);
    uint64_t commanded = 0;
    const uint64_t before = really().moves;
    line.only = only;
    line.one_in = 4;
    for (int i = 0; i < MOVES; i++)
        commanded +=
            (uint64_t)go(a, i % 2 ? -3000 - 10 * i : 4000 + 10 * i, vline.clk.t_ns + CLK_S(60));
    const uint64_t moves = really().moves - before;
    print_message("%s, %s: %llu faults, %d moves, commanded %llu times, carried out %llu\n",
                  bench_controllers[make],
                  only == (1U << NOISY_FAULTS) - 1 ? "all" : fault_names[__builtin_ctz(only)],
                  (unsigned long long)line.faults, MOVES, (unsigned long long)commanded,
                  (unsigned long long)moves);
    assert_true(line.faults > 20);
    assert_true(moves >= MOVES && moves <= commanded);
    end(a);
}

static void positions_are_true_and_moves_single_under_each_fault(void **state)
{
    (void)state;
    print_message("seed %d\n", SEED);
    for (int make = 0; make < MAKES; make++) {
        for (int fault = 0; fault < NOISY_FAULTS; fault++)
            check_fault(make, 1U << fault);
        check_fault(make, (1U << NOISY_FAULTS) - 1);
    }
}

// The bits of a command are taken back, and the motor stands.
static void a_stop_that_is_acknowledged_has_stopped(void **state)
{
    (void)state;
    for (int make = 0; make < MAKES; make++) {
        struct axis *a = begin(make);
        int stopped = 0;
        for (int i = 0; i < 60; i++) {
            line.one_in = 0;
            assert_int_equal(a->ops->move_abs(a, i % 2 ? -60000 : 60000, SPEED, ACCELERATION, NULL),
                             0);
            run_for(0.5);
            line.one_in = 3;
            if (a->ops->stop(a, NULL) < 0)
                continue;
            stopped++;
            run_for(0.2);
            const int32_t at = really().steps;
            run_for(0.2);
            assert_int_equal(really().steps, at);
            assert_int_equal(bench.az[1].input, 0);
        }
        assert_true(stopped > 50);
        end(a);
    }
}

static void a_restart_in_the_middle_of_a_move_is_seen(void **state)
{
    struct axis_status s;
    (void)state;
    for (int make = 0; make < MAKES; make++) {
        struct axis *a = begin(make);
        assert_int_equal(a->ops->move_abs(a, 60000, SPEED, ACCELERATION, NULL), 0);
        run_for(0.5);
        bench_power_cycle(&bench, WORLD_THETA_R, vline.clk.t_ns);
        assert_int_equal(a->ops->status(a, &s, NULL), 0);
        assert_true(!s.homed && !s.moving);
        assert_int_equal(s.position_steps, 0);
        end(a);
    }
}

static void an_alarm_ends_a_move_and_is_seen(void **state)
{
    struct axis_status s;
    (void)state;
    for (int make = 0; make < MAKES; make++) {
        struct axis *a = begin(make);
        assert_int_equal(a->ops->move_abs(a, 60000, SPEED, ACCELERATION, NULL), 0);
        run_for(0.5);
        bench_raise(&bench, WORLD_THETA_R, 0x30, vline.clk.t_ns);
        assert_int_equal(a->ops->status(a, &s, NULL), 0);
        assert_true(s.alarm && !s.ready && !s.moving);
        assert_int_equal(s.alarm_code, 0x30);
        const uint64_t moves = really().moves;
        assert_int_equal(a->ops->move_abs(a, 0, SPEED, ACCELERATION, NULL), 0); // echoed, ignored
        assert_int_equal(really().moves, moves);
        end(a);
    }
}

static void a_limit_and_a_following_error_are_told_apart(void **state)
{
    struct axis_status s;
    (void)state;
    struct axis *a = begin(BENCH_AZ);
    assert_int_equal(a->ops->status(a, &s, NULL), 0);
    assert_true(!s.limit && !s.following);
    bench_raise(&bench, WORLD_THETA_R, SIM_AZ_OVERTRAVEL, vline.clk.t_ns);
    assert_int_equal(a->ops->status(a, &s, NULL), 0);
    assert_true(s.limit && !s.following);
    bench_raise(&bench, WORLD_THETA_R, SIM_AZ_DEVIATION, vline.clk.t_ns);
    assert_int_equal(a->ops->status(a, &s, NULL), 0);
    assert_true(!s.limit && s.following);
    end(a);
}

static void a_pulled_plug_is_gone_and_comes_back(void **state)
{
    struct axis_status s;
    (void)state;
    for (int make = 0; make < MAKES; make++) {
        struct axis *a = begin(make);
        vline.hangup_ns = vline.clk.t_ns;
        assert_int_equal(a->ops->status(a, &s, NULL), GON_E_GONE);
        assert_int_equal(a->ops->stop(a, NULL), GON_E_GONE);
        vline.hangup_ns = PORT_NEVER;
        assert_int_equal(bus_reopen(bus, NULL), 0);
        assert_int_equal(a->ops->identify(a, NULL), 0);
        assert_int_equal(a->ops->move_abs(a, 1000, SPEED, ACCELERATION, NULL), 0);
        run_for(1);
        assert_true(look(a, &s));
        assert_int_equal(s.position_steps, 1000);
        end(a);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(positions_are_true_and_moves_single_under_each_fault),
        cmocka_unit_test(a_stop_that_is_acknowledged_has_stopped),
        cmocka_unit_test(a_restart_in_the_middle_of_a_move_is_seen),
        cmocka_unit_test(an_alarm_ends_a_move_and_is_seen),
        cmocka_unit_test(a_limit_and_a_following_error_are_told_apart),
        cmocka_unit_test(a_pulled_plug_is_gone_and_comes_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
