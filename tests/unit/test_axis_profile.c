// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// An axis that nobody makes, simulated from its own profile: a position in floating point among the
// input registers, low word first, a stop as a coil, a watchdog, and neither homing nor alarm
// reset.
#include "drivers/axis.h"
#include "drivers/bus.h"
#include "drivers/by_profile.h"
#include "sim/actor_registers.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

static const char text[] =
    "profile: { name = \"nobody\"; title = \"N\"; role = \"axis\"; source = \"this test\";"
    "  protocol = \"modbus\"; };\n"
    "registers: { base = 1; word_order = \"low-first\"; single = true; };\n"
    "values: (\n"
    "  { name = \"kind\"; type = \"int\"; address = 100; access = \"r\"; },\n"
    "  { name = \"at\"; unit = \"steps\"; scale = 100; table = \"input\"; address = 3;"
    "    format = \"f32\"; access = \"r\"; valid = \"fault != 9\"; },\n"
    "  { name = \"busy\"; type = \"int\"; table = \"discrete\"; address = 2; access = \"r\"; },\n"
    "  { name = \"fault\"; type = \"int\"; table = \"input\"; address = 9; access = \"r\"; },\n"
    "  { name = \"to\"; unit = \"steps\"; scale = 100; address = 11; format = \"f32\"; },\n"
    "  { name = \"speed\"; unit = \"steps/s\"; min = 1; max = 60000; address = 13; },\n"
    "  { name = \"halt\"; type = \"int\"; table = \"coil\"; address = 8; access = \"w\"; },\n"
    "  { name = \"alive\"; type = \"int\"; table = \"coil\"; address = 9; access = \"w\"; },\n"
    "  { name = \"kept\"; type = \"int\"; address = 60; access = \"r\"; }\n"
    ");\n"
    "writes: ( { name = \"move\"; set = \"to = $position, speed = $speed\"; then = \"busy = 1\"; "
    "},\n"
    "  { name = \"stop\"; set = \"halt = 1\"; repeat = true; then = \"busy = 0\"; },\n"
    "  { name = \"keep\"; set = \"alive = 1\"; then = \"kept = 1\"; } );\n"
    "identify: { asks = \"kind\"; refuse = ( { when = \"kind != 5\"; text = \"is another\"; } ); "
    "};\n"
    "axis: { status = ( \"at\", \"busy\", \"fault\" ); position = \"at\"; moving = \"busy = 1\";"
    "  homed = \"at known\"; alarm_code = \"fault\"; move = \"move\"; stop = \"stop\";"
    "  speed_most = 60000; watchdog = \"keep\"; watchdog_ms = 1000;"
    "  alarms = ( { code = 3; text = \"too hot\"; } ); };\n"
    "simulate: { start = ( { value = \"kind\"; is = \"5\"; } );"
    "  drift = ( { value = \"at\"; when = \"busy = 1\"; to = \"to\"; rate_value = \"speed\";"
    "    then = \"busy = 0\"; } ); };\n";

static const struct profile *profile;
static struct actor actor;
static struct sim_modbus slaves;
static struct bus *bus;

static struct axis *begin_with(const struct profile *p)
{
    struct gon_error err;
    profile = p;
    if (actor_init(&actor, profile, CLK_S(1), &err) < 0)
        fail_msg("%s", err.text);
    sim_modbus_init(&slaves, false, 0, MS(1));
    sim_modbus_add(&slaves, actor_registers_unit(&actor, 5));
    struct clk *clk = vline_begin(&slaves.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    struct axis *a = axis_by_profile(profile, bus, 5);
    if (a->ops->identify(a, &err) < 0)
        fail_msg("%s", err.text);
    return a;
}

static struct axis *begin(void)
{
    return begin_with(profiles_parse(text));
}

static void leave(struct axis *a)
{
    a->ops->free(a);
    bus_close(bus);
}

static void end(struct axis *a)
{
    leave(a);
    free((void *)profile);
}

static struct axis_status look(struct axis *a)
{
    struct axis_status s;
    struct gon_error err;
    if (a->ops->status(a, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static void run_for(double s)
{
    clk_sleep(&vline.clk.clk, CLK_S(s), NULL);
}

static void set(const char *assignments)
{
    assert_int_equal(actor_set(&actor, assignments, vline.clk.t_ns, NULL), 0);
}

static void it_moves_and_stops(void **state)
{
    (void)state;
    struct axis *a = begin();
    assert_int_equal(a->ops->move_abs(a, -20000, 10000, 1, NULL), 0);
    run_for(1);
    struct axis_status s = look(a);
    assert_true(s.moving && !s.in_position && s.ready && s.homed);
    assert_true(s.position_steps < -9900 && s.position_steps > -10200);
    assert_int_equal(s.target_steps, -20000);
    assert_int_equal(a->ops->stop(a, NULL), 0);
    s = look(a);
    assert_true(!s.moving && s.in_position);
    assert_int_equal(s.target_steps, s.position_steps);
    assert_int_equal(a->ops->move_abs(a, 300, 60000, 1, NULL), 0);
    run_for(1);
    assert_int_equal(look(a).position_steps, 300);
    end(a);
}

static void an_alarm_has_its_text(void **state)
{
    (void)state;
    struct axis *a = begin();
    set("fault = 3");
    const struct axis_status s = look(a);
    assert_true(s.alarm && !s.ready);
    assert_int_equal(s.alarm_code, 3);
    assert_string_equal(a->ops->alarm_text(a, 3), "too hot");
    end(a);
}

static void what_it_cannot_do_is_said(void **state)
{
    struct gon_error err;
    (void)state;
    struct axis *a = begin();
    assert_int_equal(a->ops->home(a, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 5: cannot be homed from here"));
    assert_int_equal(a->ops->reset_alarm(a, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "switch it off and on"));
    end(a);
}

static void its_watchdog_is_kept_with_each_status(void **state)
{
    (void)state;
    struct axis *a = begin();
    int kept = 0;
    for (int i = 0; i < 100; i++) {
        set("kept = 0");
        look(a);
        kept += actor.now.number[profile_value(profile, "kept")] == 1;
        run_for(0.1);
    }
    assert_in_range(kept, 15, 20); // each half second of 11
    end(a);
}

static void a_position_that_is_none_is_an_error(void **state)
{
    struct gon_error err;
    struct axis_status s;
    (void)state;
    struct axis *a = begin();
    set("fault = 9"); // of its encoder: what it says of the position means nothing
    assert_int_equal(a->ops->status(a, &s, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "does not know its position"));
    end(a);
}

// --- the profiles that come with gonio, simulated from themselves --------------------------------

static void check_shipped(const char *name)
{
    struct axis *a = begin_with(profiles_get(name));
    struct axis_status s = look(a);
    assert_true(!s.moving && !s.homed && !s.alarm && s.ready && s.in_position);
    assert_int_equal(a->ops->home(a, NULL), 0);
    run_for(1);
    assert_true(look(a).homed);
    assert_int_equal(a->ops->move_abs(a, -20000, 10000, 60000, NULL), 0);
    run_for(1);
    s = look(a);
    assert_true(s.moving && !s.in_position && !s.ready);
    assert_true(s.position_steps < -9900 && s.position_steps > -10200);
    assert_int_equal(a->ops->stop(a, NULL), 0);
    s = look(a);
    assert_true(!s.moving && s.in_position && s.ready);
    assert_int_equal(s.target_steps, s.position_steps);
    assert_int_equal(a->ops->move_abs(a, 5000, 10000, 60000, NULL), 0);
    run_for(5);
    s = look(a);
    assert_true(!s.moving && s.ready);
    assert_int_equal(s.position_steps, 5000);
    set("alarm_code = 0x30");
    assert_int_equal(look(a).alarm_code, 0x30);
    assert_int_equal(a->ops->reset_alarm(a, NULL), 0);
    assert_false(look(a).alarm);
    leave(a);
}

static void shipped_profiles_move_what_they_simulate(void **state)
{
    (void)state;
    check_shipped("oriental-az");
    check_shipped("leadshine-pr");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_moves_and_stops),
        cmocka_unit_test(an_alarm_has_its_text),
        cmocka_unit_test(what_it_cannot_do_is_said),
        cmocka_unit_test(its_watchdog_is_kept_with_each_status),
        cmocka_unit_test(a_position_that_is_none_is_an_error),
        cmocka_unit_test(shipped_profiles_move_what_they_simulate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
