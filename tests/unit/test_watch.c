// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// Inputs on a bus as a part of the instrument: a simulated module, over the unmodified libmodbus in
// virtual time. The other parts of this bench are not there.
#include "daemon/instrument_devices.h"
#include "daemon/instrument_inside.h"
#include "drivers/bus.h"
#include "sim/actor_registers.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/simconfig.h"
#include "tests/unit/vline.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <unistd.h>

#define PART_DOOR PART_DEVICES

static const char text[] =
    "profile: { name = \"watch\"; title = \"I/O module\"; role = \"inputs\"; source = \"this "
    "test\"; protocol = \"modbus\"; };\n"
    "registers: { base = 1; single = true; };\n"
    "values: (\n"
    "  { name = \"kind\"; type = \"int\"; address = 100; access = \"r\"; },\n"
    "  { name = \"open\"; type = \"int\"; table = \"discrete\"; address = 1; access = \"r\"; },\n"
    "  { name = \"bench_c\"; unit = \"degC\"; table = \"input\"; address = 1; format = \"s16\";"
    "    scale = 0.1; min = -40; max = 150; invalid = ( 32767 ); access = \"r\"; },\n"
    "  { name = \"alive\"; type = \"int\"; table = \"coil\"; address = 6; access = \"rw\"; },\n"
    "  { name = \"relay\"; type = \"int\"; table = \"discrete\"; address = 9; access = \"r\"; },\n"
    "  { name = \"left_ms\"; address = 50; format = \"s16\"; access = \"r\"; }\n"
    ");\n"
    "writes: ( { name = \"keep\"; set = \"alive = 1\"; then = \"left_ms = 1000, relay = 1\"; } "
    ");\n"
    "identify: { asks = \"kind\"; refuse = ( { when = \"kind != 4711\"; text = \"is no I/O "
    "module\"; } ); };\n"
    "inputs: { status = ( \"open\", \"bench_c\", \"relay\" ); watchdog = \"keep\";"
    "  watchdog_ms = 1000; };\n"
    "simulate: { start = ( { value = \"kind\"; is = \"4711\"; },"
    "    { value = \"bench_c\"; is = \"21.5\"; } );"
    "  drift = ( { value = \"left_ms\"; to = \"0\"; rate = 1000; then = \"relay = 0\"; } ); };\n";

struct setting {
    struct profile *profile;
    struct actor actor;
    struct sim_modbus slaves;
    struct noisy line;
    struct bench_config bench;
    struct instrument *in;
    struct instrument_snapshot now;
    char path[64];
};

// A bench whose axes are on the same bus and do not answer.
static void describe(struct setting *s)
{
    simconfig_bench(&s->bench);
    s->bench.buses_count = 1;
    snprintf(s->bench.buses[0].name, sizeof s->bench.buses[0].name, "axes");
    snprintf(s->bench.buses[0].link, sizeof s->bench.buses[0].link, "%s", vline.bus);
    s->bench.buses[0].timeout_ms = 50;
    for (int i = 0; i < 3; i++) {
        snprintf(s->bench.axes[i].bus, sizeof s->bench.axes[i].bus, "axes");
        snprintf(s->bench.axes[i].driver, sizeof s->bench.axes[i].driver,
                 "configs/profiles/oriental-az.cfg");
        s->bench.axes[i].unit = i + 1;
    }
    snprintf(s->bench.laser.driver, sizeof s->bench.laser.driver, "configs/profiles/cobolt-05.cfg");
    snprintf(s->bench.laser.link, sizeof s->bench.laser.link, "serial:/nowhere/laser?baud=115200");
    snprintf(s->bench.detector.driver, sizeof s->bench.detector.driver,
             "configs/profiles/sr830.cfg");
    snprintf(s->bench.detector.link, sizeof s->bench.detector.link, "serial:/nowhere/lockin");
    s->bench.devices_count = 1;
    s->bench.devices[0] =
        (struct bench_device){.name = "door", .bus = "axes", .unit = 5, .use = BENCH_INPUTS};
    snprintf(s->bench.devices[0].driver, sizeof s->bench.devices[0].driver, "%s", s->path);
}

static int begin(void **state)
{
    struct setting *s = calloc(1, sizeof *s);
    struct gon_error err;
    snprintf(s->path, sizeof s->path, "/tmp/test_watch_XXXXXX.cfg");
    const int fd = mkstemps(s->path, 4);
    if (fd < 0 || write(fd, text, sizeof text - 1) != (ssize_t)sizeof text - 1 || close(fd))
        return -1;
    s->profile = profiles_parse(text);
    if (actor_init(&s->actor, s->profile, CLK_S(1), &err) < 0)
        fail_msg("%s", err.text);
    sim_modbus_init(&s->slaves, false, 0, CLK_MS(1));
    sim_modbus_add(&s->slaves, actor_registers_unit(&s->actor, 5));
    noisy_init(&s->line, &s->slaves.port, 11, 0);
    struct clk *clk = vline_begin(&s->line.port);
    describe(s);
    if (instrument_open(&s->bench, NULL, clk, &s->in, &err) < 0)
        fail_msg("%s", err.text);
    *state = s;
    return 0;
}

static int end(void **state)
{
    struct setting *s = *state;
    instrument_free(s->in);
    unlink(s->path);
    free(s->profile);
    free(s);
    return 0;
}

static void set(struct setting *s, const char *assignments)
{
    assert_int_equal(actor_set(&s->actor, assignments, vline.clk.t_ns, NULL), 0);
}

static bool relay_now(struct setting *s)
{
    actor_step(&s->actor, vline.clk.t_ns);
    return s->actor.now.number[profile_value(s->profile, "relay")] != 0;
}

static void it_is_identified_and_its_values_are_seen(void **state)
{
    struct setting *s = *state;
    double value;
    instrument_snapshot(s->in, &s->now);
    assert_int_equal(s->now.part[PART_DOOR].link, PART_OK);
    assert_string_equal(s->now.part[PART_DOOR].address, vline.bus);
    assert_true(s->now.part[PART_DOOR].stats.requests > 0);
    assert_int_equal(s->now.device[0].values, 3);
    assert_string_equal(s->now.device[0].value[1].name, "bench_c");
    assert_string_equal(s->now.device[0].value[1].unit, "degC");
    assert_true(fabs(s->now.device[0].value[1].number - 21.5) < 1e-9);
    assert_true(instrument_input(s->in, "door.open", &value) && value == 0);
    set(s, "open = 1, bench_c = 3276.7");
    clk_sleep(&vline.clk.clk, CLK_S(1), NULL);
    assert_int_equal(instrument_watch_inputs(s->in, NULL), 0);
    assert_true(instrument_input(s->in, "door.open", &value) && value == 1);
    assert_false(instrument_input(s->in, "door.bench_c", &value)); // its code for: no sensor
    assert_false(instrument_input(s->in, "door.kind", &value));
    assert_false(instrument_input(s->in, "gate.open", &value));
    assert_false(instrument_input(s->in, "door", &value));
}

static uint64_t requests(struct setting *s)
{
    return bus_stats(s->in->bus[0])->requests;
}

static void it_is_read_about_once_a_second(void **state)
{
    struct setting *s = *state;
    int looks = 0;
    for (int i = 0; i < 100; i++) { // 10 s
        const uint64_t before = requests(s);
        assert_int_equal(instrument_watch_inputs(s->in, NULL), 0);
        looks += requests(s) > before;
        clk_sleep(&vline.clk.clk, CLK_MS(100), NULL);
    }
    assert_in_range(looks, 9, 11);
}

static void its_relay_is_kept_by_every_wait(void **state)
{
    struct setting *s = *state;
    for (int i = 0; i < 20; i++) {
        instrument_wait(s->in, vline.clk.t_ns + CLK_S(3), NULL);
        assert_true(relay_now(s));
    }
    for (int i = 0; i < 100; i++) { // the store's acknowledgement is waited for elsewhere
        clk_sleep(&vline.clk.clk, CLK_MS(50), NULL);
        instrument_breathe(s->in);
        assert_true(relay_now(s));
    }
    clk_sleep(&vline.clk.clk, CLK_S(2), NULL);
    assert_false(relay_now(s));
}

static void it_is_not_kept_in_the_middle_of_other_talk_on_its_bus(void **state)
{
    struct setting *s = *state;
    clk_sleep(&vline.clk.clk, CLK_S(2), NULL); // it is time
    const uint64_t before = requests(s);
    for (int part = 0; part < 3; part++) { // the axes
        s->in->talking = part;
        instrument_keep_relays(s->in);
    }
    s->in->talking = PART_DOOR;
    instrument_keep_relays(s->in);
    assert_int_equal(requests(s), before);
    s->in->talking = PART_LASER; // which has its own link
    instrument_keep_relays(s->in);
    assert_int_equal(s->in->talking, PART_LASER);
    assert_true(requests(s) > before);
    assert_true(relay_now(s));
}

// The axes' reconnecting takes up most of the bus's time.
static void it_is_kept_while_others_are_looked_for(void **state)
{
    struct setting *s = *state;
    for (int i = 0; i < 600; i++) {
        instrument_tend(s->in);
        instrument_wait(s->in, vline.clk.t_ns + CLK_MS(50), NULL);
        assert_true(relay_now(s));
    }
}

static void one_that_falls_silent_is_lost_and_comes_back(void **state)
{
    struct setting *s = *state;
    double value;
    struct gon_error err;
    s->slaves.port.mute = true;
    clk_sleep(&vline.clk.clk, CLK_S(1), NULL);
    assert_int_equal(instrument_watch_inputs(s->in, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "door: "));
    assert_false(instrument_input(s->in, "door.open", &value));
    const uint64_t before = requests(s);
    instrument_wait(s->in, vline.clk.t_ns + CLK_S(3), NULL); // no relay of a lost one
    assert_int_equal(requests(s), before);
    s->slaves.port.mute = false;
    for (int i = 0; i < 200 && s->in->part[PART_DOOR].link != PART_OK; i++) {
        instrument_reconnect(s->in);
        clk_sleep(&vline.clk.clk, CLK_MS(100), NULL);
    }
    assert_int_equal(s->in->part[PART_DOOR].link, PART_OK);
    assert_int_equal(s->in->part[PART_DOOR].returns, 1);
    assert_true(instrument_input(s->in, "door.open", &value));
}

static void a_relay_that_cannot_be_kept_makes_it_lost(void **state)
{
    struct setting *s = *state;
    s->slaves.port.mute = true;
    instrument_wait(s->in, vline.clk.t_ns + CLK_S(2), NULL);
    assert_int_equal(s->in->part[PART_DOOR].link, PART_LOST);
    struct gon_error err;
    assert_true(instrument_watch_inputs(s->in, &err) < 0); // so that a run hears of it
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_is_identified_and_its_values_are_seen),
        TEST(it_is_read_about_once_a_second),
        TEST(its_relay_is_kept_by_every_wait),
        TEST(it_is_not_kept_in_the_middle_of_other_talk_on_its_bus),
        TEST(it_is_kept_while_others_are_looked_for),
        TEST(one_that_falls_silent_is_lost_and_comes_back),
        TEST(a_relay_that_cannot_be_kept_makes_it_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
