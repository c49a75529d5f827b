// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// A module with switches, thermometers and a relay that drops out, made from a profile and
// simulated from it, over the unmodified libmodbus in virtual time.
#include "drivers/inputs.h"

#include "drivers/blocks.h"
#include "drivers/bus.h"
#include "drivers/link_stats.h"
#include "sim/actor_registers.h"
#include "tests/unit/noisy.h"
#include "tests/unit/vline.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

#define MS(ms) CLK_MS(ms)

static const char text[] =
    "profile: { name = \"watch\"; title = \"I/O module\"; role = \"inputs\"; source = \"this "
    "test\";"
    "  protocol = \"modbus\"; };\n"
    "registers: { base = 1; single = true; };\n"
    "values: (\n"
    "  { name = \"kind\"; type = \"int\"; address = 100; access = \"r\"; },\n"
    "  { name = \"door\"; type = \"int\"; table = \"discrete\"; address = 1; access = \"r\"; },\n"
    "  { name = \"water\"; type = \"int\"; table = \"discrete\"; address = 3; access = \"r\"; },\n"
    "  { name = \"bench_c\"; unit = \"degC\"; table = \"input\"; address = 1; format = \"s16\";"
    "    scale = 0.1; min = -40; max = 150; invalid = ( 32767 ); access = \"r\"; },\n"
    "  { name = \"laser_c\"; unit = \"degC\"; table = \"input\"; address = 2; format = \"s16\";"
    "    scale = 0.1; min = -40; max = 150; invalid = ( 32767 ); access = \"r\"; },\n"
    "  { name = \"alive\"; type = \"int\"; table = \"coil\"; address = 6; access = \"rw\"; },\n"
    "  { name = \"relay\"; type = \"int\"; table = \"discrete\"; address = 9; access = \"r\"; },\n"
    "  { name = \"left_ms\"; address = 50; format = \"s16\"; access = \"r\"; }\n"
    ");\n"
    "writes: ( { name = \"keep\"; set = \"alive = 1\"; then = \"left_ms = 400, relay = 1\"; } );\n"
    "identify: { asks = \"kind\"; refuse = ( { when = \"kind != 4711\"; text = \"is no I/O "
    "module\"; "
    "} ); };\n"
    "inputs: { status = ( \"door\", \"water\", \"bench_c\", \"laser_c\", \"relay\" );"
    "  watchdog = \"keep\"; watchdog_ms = 400; };\n"
    "simulate: { start = ( { value = \"kind\"; is = \"4711\"; }, { value = \"bench_c\"; is = "
    "\"21.5\"; },"
    "    { value = \"laser_c\"; is = \"-3.2\"; }, { value = \"door\"; is = \"1\"; } );"
    "  drift = ( { value = \"left_ms\"; to = \"0\"; rate = 1000; then = \"relay = 0\"; } ); };\n";

static struct profile *profile;
static struct actor actor;
static struct sim_modbus slaves;
static struct noisy line;
static struct bus *bus;

static void say(void *ctx, const char *message)
{
    (void)ctx;
    print_error("%s\n", message);
}

static struct inputs *begin(void)
{
    struct gon_error err;
    assert_int_equal(profile_parse(text, "watch.cfg", (struct cfg_sink){say, NULL}, &profile), 0);
    if (actor_init(&actor, profile, CLK_S(1), &err) < 0)
        fail_msg("%s", err.text);
    sim_modbus_init(&slaves, false, 0, MS(1));
    sim_modbus_add(&slaves, actor_registers_unit(&actor, 5));
    noisy_init(&line, &slaves.port, 11, 0);
    struct clk *clk = vline_begin(&line.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    return inputs_on_bus(profile, bus, 5, clk);
}

static void end(struct inputs *in)
{
    inputs_free(in);
    bus_close(bus);
    free(profile);
}

static void set(const char *assignments)
{
    assert_int_equal(actor_set(&actor, assignments, vline.clk.t_ns, NULL), 0);
}

static struct inputs_value find(const struct inputs *in, const char *name)
{
    struct inputs_value v;
    assert_true(inputs_find(in, name, &v));
    return v;
}

static void values_have_names_units_and_numbers(void **state)
{
    (void)state;
    struct inputs *in = begin();
    assert_int_equal(inputs_count(in), 5);
    assert_false(find(in, "door").known);
    assert_int_equal(inputs_read(in, NULL), 0);
    assert_int_equal(inputs_read_ns(in), vline.clk.t_ns);
    assert_true(find(in, "door").known);
    assert_true(find(in, "door").number == 1 && find(in, "water").number == 0);
    assert_true(fabs(find(in, "bench_c").number - 21.5) < 1e-9);
    assert_true(fabs(find(in, "laser_c").number + 3.2) < 1e-9);
    assert_string_equal(find(in, "laser_c").unit, "degC");
    assert_string_equal(inputs_at(in, 0).name, "door");
    struct inputs_value v;
    assert_false(inputs_find(in, "kind", &v));
    end(in);
}

static void it_is_asked_who_it_is(void **state)
{
    char who[100];
    struct gon_error err;
    (void)state;
    struct inputs *in = begin();
    assert_int_equal(inputs_identify(in, who, sizeof who, &err), 0);
    set("kind = 3");
    assert_int_equal(inputs_identify(in, who, sizeof who, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 5 is no I/O module"));
    end(in);
}

static void conditions_hold_over_them(void **state)
{
    (void)state;
    struct inputs *in = begin();
    assert_false(inputs_hold(in, "door = 1")); // not known yet
    assert_int_equal(inputs_read(in, NULL), 0);
    assert_true(inputs_hold(in, "door = 1 and laser_c < 30"));
    set("door = 0");
    assert_int_equal(inputs_read(in, NULL), 0);
    assert_false(inputs_hold(in, "door = 1"));
    end(in);
}

static void what_is_no_measurement_is_not_known(void **state)
{
    (void)state;
    struct inputs *in = begin();
    set("laser_c = 3276.7"); // its code for: no sensor
    assert_int_equal(inputs_read(in, NULL), 0);
    assert_false(find(in, "laser_c").known);
    assert_true(isnan(find(in, "laser_c").number));
    assert_true(find(in, "bench_c").known);
    end(in);
}

static void an_impossible_value_is_not_believed(void **state)
{
    struct gon_error err;
    (void)state;
    struct inputs *in = begin();
    assert_int_equal(inputs_read(in, NULL), 0);
    set("laser_c = 900");
    assert_int_equal(inputs_read(in, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "laser_c"));
    assert_false(find(in, "door").known);
    end(in);
}

static void after_a_failed_look_nothing_is_known(void **state)
{
    struct gon_error err;
    (void)state;
    struct inputs *in = begin();
    assert_int_equal(inputs_read(in, NULL), 0);
    const int64_t read_ns = inputs_read_ns(in);
    slaves.port.mute = true;
    assert_int_equal(inputs_read(in, &err), GON_E_LINK);
    for (int i = 0; i < inputs_count(in); i++)
        assert_false(inputs_at(in, i).known);
    assert_int_equal(inputs_read_ns(in), read_ns);
    end(in);
}

static bool relay_now(void)
{
    actor_step(&actor, vline.clk.t_ns);
    return actor.now.number[profile_value(profile, "relay")] != 0;
}

static void the_relay_stays_on_while_it_is_kept(void **state)
{
    (void)state;
    struct inputs *in = begin();
    int writes = 0;
    for (int i = 0; i < 100; i++) {
        const uint64_t before = bus_stats(bus)->requests;
        assert_int_equal(inputs_keep(in, NULL), 0);
        writes += bus_stats(bus)->requests > before;
        clk_sleep(&vline.clk.clk, MS(50), NULL);
        assert_true(relay_now());
    }
    assert_in_range(writes, 20, 26);          // each 200 ms of 5 s
    clk_sleep(&vline.clk.clk, MS(500), NULL); // nobody keeps it on: what a dead daemon does
    assert_false(relay_now());
    assert_int_equal(inputs_keep(in, NULL), 0);
    assert_true(relay_now());
    end(in);
}

// One lost answer is made up for in time.
static void a_lost_answer_does_not_drop_the_relay(void **state)
{
    struct gon_error err;
    (void)state;
    struct inputs *in = begin();
    for (int i = 0; i < 200; i++) {
        if (i % 10 == 5)
            slaves.port.drop = 1;
        inputs_keep(in, &err);
        clk_sleep(&vline.clk.clk, MS(50), NULL);
        assert_true(relay_now());
    }
    end(in);
}

static void no_wrong_value_under_faults(void **state)
{
    int good = 0, wrong = 0;
    (void)state;
    struct inputs *in = begin();
    line.one_in = 8;
    line.late_most_ns = MS(95);
    line.double_most_ns = MS(95);
    for (int i = 0; i < 3000; i++) {
        set(i % 2 ? "door = 1, water = 0, bench_c = 21.5" : "door = 0, water = 1, bench_c = 40.1");
        if (inputs_read(in, NULL) < 0)
            continue;
        good++;
        wrong += find(in, "door").number != i % 2 || find(in, "water").number != !(i % 2) ||
                 fabs(find(in, "bench_c").number - (i % 2 ? 21.5 : 40.1)) > 1e-9;
    }
    print_message("seed 11: 3000 looks, %llu faults: %d answered, %d wrong\n",
                  (unsigned long long)line.faults, good, wrong);
    assert_true(good > 2900);
    assert_int_equal(wrong, 0);
    end(in);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_have_names_units_and_numbers),
        cmocka_unit_test(it_is_asked_who_it_is),
        cmocka_unit_test(conditions_hold_over_them),
        cmocka_unit_test(what_is_no_measurement_is_not_known),
        cmocka_unit_test(an_impossible_value_is_not_believed),
        cmocka_unit_test(after_a_failed_look_nothing_is_known),
        cmocka_unit_test(the_relay_stays_on_while_it_is_kept),
        cmocka_unit_test(a_lost_answer_does_not_drop_the_relay),
        cmocka_unit_test(no_wrong_value_under_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
