// SPDX-License-Identifier: MIT
// uses: sim drivers model base
// Instruments made from profiles as a part of the simulated world: what a detector shows of it, the
// light of a laser, the place of an axis. In virtual time and without noise, where the answer is
// known.
#include "sim/actor_registers.h"
#include "sim/actor_world.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#define S(s) ((int64_t)((s)*1e9))
#define HEAD(role)                                                                                 \
    "profile: { name = \"p\"; title = \"t\"; role = \"" role "\"; source = \"this test\"; "        \
    "protocol = \"message\"; };\n"

static const char meter[] = HEAD(
    "detector") "values: ( { name = \"amps\"; unit = \"A\"; min = -0.0105; max = 0.0105; over = ( "
                "9e9 ); },\n"
                "  { name = \"volts\"; unit = \"V\"; },\n"
                "  { name = \"full_scale\"; type = \"int\"; ladder = ( 1e-2, 1e-3 ); },\n"
                "  { name = \"time_constant_s\"; max = 10; }, { name = \"slope_db\"; max = 24; },\n"
                "  { name = \"flag\"; type = \"int\"; max = 1; } );\n"
                "exchanges: ( { name = \"read\"; send = \"r?\"; answer = \"{amps},{volts}\"; },\n"
                "  { name = \"range\"; send = \"g?\"; answer = \"{full_scale}\"; },\n"
                "  { name = \"set\"; send = \"g {full_scale}\"; verify = \"range\"; } );\n"
                "framing: { end_out = \"\\r\"; end_in = \"\\r\"; };\n"
                "detector: { signal = \"amps\"; monitor = \"volts\"; full_scale = \"full_scale\";\n"
                "  sample = ( \"read\" ); read_range = ( \"range\" ); set_range = \"set\"; };\n"
                "simulate: { follows = ( { then = \"flag = 0\"; }, { when = \"amps = over\"; then "
                "= \"flag = 1\"; } );\n"
                "  drift = ( { value = \"amps\"; to = \"7\"; } );\n" // the world's word counts
                "  start = ( { value = \"full_scale\"; is = \"1e-2\"; }, { value = "
                "\"time_constant_s\"; is = "
                "\"0.1\"; },\n"
                "    { value = \"slope_db\"; is = \"6\"; } ); };\n";

static const char lamp[] =
    HEAD("laser") "values: ( { name = \"lit\"; type = \"int\"; max = 1; }, { name = \"shut\"; type "
                  "= \"int\"; max = 1; },\n"
                  "  { name = \"power_w\"; max = 1; }, { name = \"setpoint_w\"; max = 1; } );\n"
                  "exchanges: ( { name = \"lit\"; send = \"l?\"; answer = \"{lit}\"; },\n"
                  "  { name = \"power\"; send = \"p?\"; answer = \"{power_w}\"; },\n"
                  "  { name = \"on\"; send = \"on\"; then = \"lit = 1\"; }, { name = \"off\"; send "
                  "= \"off\"; then = \"lit "
                  "= 0\"; } );\n"
                  "framing: { end_out = \"\\r\"; end_in = \"\\r\"; };\n"
                  "laser: { status = ( \"lit\", \"power\" ); light = ( \"lit\" ); emitting = \"lit "
                  "= 1\"; power = \"power_w\";\n"
                  "  states = ( { when = \"lit = 1\"; is = \"emitting\"; }, { is = \"off\"; } ); "
                  "on = ( { send = \"on\"; } );\n"
                  "  off = ( \"\\roff\" ); off_asks = ( \"lit\" ); is_off = \"lit = 0\"; };\n"
                  "simulate: { shines = \"lit = 1 and shut = 0\"; start = ( { value = "
                  "\"setpoint_w\"; is = \"0.03\"; } );\n"
                  "  drift = ( { value = \"power_w\"; when = \"lit = 1\"; to = \"setpoint_w\"; "
                  "rate = 0.01; },\n"
                  "    { value = \"power_w\"; to = \"0\"; } ); };\n";

static const char slide[] =
    "profile: { name = \"s\"; title = \"t\"; role = \"axis\"; source = \"this test\"; protocol = "
    "\"modbus\"; };\n"
    "values: ( { name = \"to\"; type = \"int\"; address = 0; format = \"s32\"; },\n"
    "  { name = \"speed\"; type = \"int\"; address = 2; format = \"s32\"; },\n"
    "  { name = \"go\"; type = \"int\"; address = 4; },\n"
    "  { name = \"moving\"; type = \"int\"; address = 5; access = \"r\"; },\n"
    "  { name = \"at\"; type = \"int\"; address = 6; format = \"s32\"; access = \"r\"; } );\n"
    "writes: ( { name = \"move\"; set = ( \"to = $position\", \"speed = $speed\", \"go = 1\" );\n"
    "    then = \"moving = 1\"; }, { name = \"stop\"; set = \"go = 2\"; then = \"moving = 0\"; } "
    ");\n"
    "axis: { status = ( \"moving\", \"at\" ); position = \"at\"; moving = \"moving = 1\";\n"
    "  in_position = \"moving = 0\"; move = \"move\"; stop = \"stop\"; };\n"
    "simulate: { drift = ( { value = \"at\"; when = \"moving = 1\"; to = \"to\"; rate_value = "
    "\"speed\";\n"
    "    then = \"moving = 0\"; } ); };\n";

static void say(void *ctx, const char *line)
{
    (void)ctx;
    print_message("%s\n", line);
}

// A bench that looks into its beam, with an instrument of each kind; axes: theta_r.
struct scene {
    struct profile *profile[3];
    struct world world;
    struct actor meter, lamp, slide;
    struct actor_world meters, lamps, slides;
};

static void begin(struct actor *a, struct profile **p, const char *text)
{
    struct gon_error err = {.text = ""};
    if (profile_parse(text, "test.cfg", (struct cfg_sink){say, NULL}, p))
        fail_msg("the profile cannot be read");
    if (actor_init(a, *p, 0, &err))
        fail_msg("%s", err.text);
}

static struct scene *scene(void)
{
    struct scene *s = calloc(1, sizeof *s);
    struct world_spec spec;
    world_defaults(&spec);
    spec.axis[WORLD_THETA_I].start = 0;
    spec.axis[WORLD_THETA_R].start = 180;
    spec.axis[WORLD_SAMPLE].start = 30;
    spec.laser.drift_rms = spec.laser.rin_rms = 0;
    spec.noise_v_per_rthz = spec.monitor_noise_v = spec.offset_v = 0;
    world_init(&s->world, &spec, 0);
    begin(&s->lamp, &s->profile[0], lamp);
    begin(&s->slide, &s->profile[1], slide);
    begin(&s->meter, &s->profile[2], meter);
    actor_world_laser(&s->lamps, &s->lamp, &s->world);
    actor_world_axis(&s->slides, &s->slide, &s->world, WORLD_THETA_R, 100);
    actor_world_detector(&s->meters, &s->meter, &s->world, 0);
    return s;
}

static void end(struct scene *s)
{
    for (int i = 0; i < 3; i++)
        free(s->profile[i]);
    free(s);
}

static double value(struct actor *a, const char *name, int64_t t_ns)
{
    actor_meet(a, t_ns);
    return a->now.number[actor_values_find(&a->now, name, strlen(name))];
}

static void set(struct actor *a, const char *assignments, int64_t t_ns)
{
    struct gon_error err = {.text = ""};
    if (actor_set(a, assignments, t_ns, &err))
        fail_msg("%s", err.text);
}

static void near(double got, double expected, double tolerance)
{
    if (!(fabs(got - expected) <= tolerance))
        fail_msg("%.12g is not %.12g within %.3g", got, expected, tolerance);
}

// 16 V/W, and the largest range, 10 mA, for 1 V.
#define A_PER_W (16 * 1e-2)

static void a_detector_shows_the_light_that_reaches_it(void **state)
{
    (void)state;
    struct scene *s = scene();
    set(&s->lamp, "lit = 1", 0);
    near(value(&s->meter, "amps", S(30)), 0.03 * A_PER_W,
         1e-2 / 65536); // its power is there after 3 s
    near(value(&s->meter, "volts", S(30)), 40 * 0.03 + 0.002, 1.0 / 3000);
    end(s);
}

// Nobody asks while the power rises: the filter has seen it as it was. One pole behind a ramp of
// rate r is r (t - tau (1 - exp(-t/tau))).
static void a_filter_sees_the_light_rise_whoever_asks(void **state)
{
    (void)state;
    for (int often = 0; often < 2; often++) {
        struct scene *s = scene();
        set(&s->lamp, "lit = 1", 0);
        for (int i = 1; i < 30 && often; i++)
            value(i % 2 ? &s->lamp : &s->slide, i % 2 ? "power_w" : "at", S(0.01 * i));
        double expected = 0.01 * (0.3 - 0.1 * (1 - exp(-3)));
        near(value(&s->meter, "amps", S(0.3)), expected * A_PER_W, 1e-2 / 65536 + 2e-6);
        end(s);
    }
}

static void a_range_ends_and_its_flag_follows(void **state)
{
    (void)state;
    struct scene *s = scene();
    set(&s->lamp, "setpoint_w = 0.0066, lit = 1", 0);
    near(value(&s->meter, "amps", S(30)), 0.0066 * A_PER_W, 1e-2 / 65536);
    set(&s->meter, "full_scale = 1e-3", S(30)); // 1.056 mA: above it and still shown
    near(value(&s->meter, "amps", S(31)), 0.0066 * A_PER_W, 1e-3 / 65536);
    near(value(&s->meter, "flag", S(31)), 0, 0);
    set(&s->lamp, "setpoint_w = 0.007", S(31)); // 1.12 mA
    assert_true(isinf(value(&s->meter, "amps", S(61))));
    near(value(&s->meter, "flag", S(61)), 1, 0);
    set(&s->meter, "full_scale = 1e-2", S(61));
    near(value(&s->meter, "amps", S(61)), 0.007 * A_PER_W, 1e-2 / 65536);
    near(value(&s->meter, "flag", S(61)), 0, 0);
    end(s);
}

static void what_a_detector_cannot_say_it_does_not_show(void **state)
{
    (void)state;
    struct scene *s = scene();
    set(&s->lamp, "setpoint_w = 0.0675, lit = 1", 0); // 10.8 mA, of 10 mA: says at most 10.5
    near(value(&s->meter, "amps", S(30)), 0.0105, 0);
    end(s);
}

static void light_needs_what_the_profile_says(void **state)
{
    (void)state;
    struct scene *s = scene();
    set(&s->lamp, "lit = 1, shut = 1", 0);
    value(&s->lamp, "power_w", S(10));
    assert_false(sim_laser_emits(&s->world.laser));
    set(&s->lamp, "shut = 0", S(10));
    near(sim_laser_power_w(&s->world.laser), 0.03, 1e-12);
    set(&s->lamp, "lit = 0", S(11));
    near(sim_laser_power_w(&s->world.laser), 0, 0);
    near(value(&s->meter, "amps", S(21)), 0, 1e-2 / 65536);
    end(s);
}

// 1 deg a second: after 10 s the beam, 0.9 deg wide, is left behind, which the detector sees though
// nobody asked the axis.
static void the_bench_stands_where_an_axis_is(void **state)
{
    (void)state;
    struct scene *s = scene();
    struct sim_modbus_unit unit = actor_registers_unit(&s->slide, 1);
    const uint16_t move[] = {0, 17000, 0, 100, 1};
    set(&s->lamp, "lit = 1", 0);
    near(value(&s->slide, "at", S(10)), 18000, 0);
    assert_int_equal(unit.write(unit.ctx, 0, 5, move, S(10)), 0);
    near(value(&s->meter, "amps", S(10.5)), 0.03 * A_PER_W, 1e-2 / 65536);
    near(value(&s->meter, "amps", S(14)), 0, 1e-2 / 65536);
    near(motion_at(&s->world.axis[WORLD_THETA_R], S(14)).motor, 176, 0.02);
    near(value(&s->slide, "at", S(30)), 17000, 0);
    // come from above, the load stands where its backlash lets it
    near(motion_at(&s->world.axis[WORLD_THETA_R], S(30)).load, 170.015, 1e-9);
    actor_world_power_cycle(&s->slides, S(31));
    near(value(&s->slide, "at", S(31)), 17000, 0);
    near(value(&s->slide, "moving", S(31)), 0, 0);
    end(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_detector_shows_the_light_that_reaches_it),
        cmocka_unit_test(a_filter_sees_the_light_rise_whoever_asks),
        cmocka_unit_test(a_range_ends_and_its_flag_follows),
        cmocka_unit_test(what_a_detector_cannot_say_it_does_not_show),
        cmocka_unit_test(light_needs_what_the_profile_says),
        cmocka_unit_test(the_bench_stands_where_an_axis_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
