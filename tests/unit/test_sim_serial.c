// SPDX-License-Identifier: MIT
// uses: sim model base
// The laser's and the lock-in's languages, as bytes in virtual time.
#include "sim/bench.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS(ms) ((int64_t)((ms)*1e6))

struct rig {
    struct bench bench;
    int64_t t_ns;
    char text[2000];
};

static struct rig *rig(void)
{
    struct rig *r = calloc(1, sizeof *r);
    struct bench_spec spec;
    bench_defaults(&spec);
    spec.world.laser.temperatures_s = 2;
    spec.world.laser.warmup_s = 10;
    spec.laser_reply_s = spec.detector_reply_s = 0;
    bench_init(&r->bench, &spec, 0);
    return r;
}

static const char *say(struct rig *r, enum bench_port which, const char *text)
{
    uint8_t out[PORT_REPLY_MOST + 1];
    struct port *p = bench_port(&r->bench, which);
    size_t n;
    port_feed(p, (const uint8_t *)text, strlen(text), r->t_ns);
    *r->text = 0;
    while ((n = port_take(p, r->t_ns, out, NULL)) > 0) {
        out[n] = 0;
        strcat(r->text, (char *)out);
    }
    return r->text;
}

static const char *laser(struct rig *r, const char *command)
{
    r->t_ns += MS(100);
    return say(r, BENCH_LASER, command);
}

static const char *lockin(struct rig *r, const char *command)
{
    return say(r, BENCH_DETECTOR, command);
}

// --- Cobolt --------------------------------------------------------------------------------------

static void the_laser_answers_lines(void **state)
{
    (void)state;
    struct rig *r = rig();
    assert_string_equal(laser(r, "?\r"), "OK\r\n");
    assert_string_equal(laser(r, "gom?\r"), "0\r\n");
    assert_string_equal(laser(r, "l?\r"), "0\r\n");
    assert_string_equal(laser(r, "ilk?\r"), "0\r\n"); // closed
    assert_string_equal(laser(r, "f?\r"), "0\r\n");
    assert_string_equal(laser(r, "p 0.0421\r"), "OK\r\n");
    assert_string_equal(laser(r, "p?\r"), "0.0421\r\n");
    assert_string_equal(laser(r, "p?\r\n"), "0.0421\r\n"); // the line feed is nothing
    assert_string_equal(laser(r, "pa?\r"), "0.00000\r\n");
    assert_memory_equal(laser(r, "laser on please\r"), "Syntax error", 12);
    assert_memory_equal(laser(r, "p 0.2\r"), "Error", 5); // above the most
    assert_memory_equal(laser(r, "p x\r"), "Syntax error", 12);
    assert_string_equal(laser(r, "p?\r"), "0.0421\r\n");
    for (const char *const *q =
             (const char *const[]){"sn?", "gsn?", "glm?", "gfv?", "hrs?", "i?", "gam?", NULL};
         *q; q++) {
        char line[16];
        snprintf(line, sizeof line, "%s\r", *q);
        assert_null(strstr(laser(r, line), "rror"));
        assert_non_null(strstr(r->text, "\r\n"));
    }
    free(r);
}

static void a_command_that_comes_too_early_is_ignored(void **state)
{
    (void)state;
    struct rig *r = rig();
    assert_string_equal(laser(r, "p 0.02\r"), "OK\r\n");
    r->t_ns += MS(99);
    assert_string_equal(say(r, BENCH_LASER, "p 0.03\r"), "");
    assert_string_equal(say(r, BENCH_LASER_TCP, "p 0.03\r"), ""); // the same laser
    r->t_ns += MS(1);
    assert_string_equal(say(r, BENCH_LASER, "p?\r"), "0.0200\r\n");
    assert_int_equal(r->bench.laser.too_early, 2);
    int too_early = 0; // all that came over the wire is remembered with its time
    for (uint64_t i = 0; i < r->bench.laser.heard_count; i++) {
        too_early += r->bench.laser.heard[i].too_early;
        assert_true(i == 0 || r->bench.laser.heard[i].t_ns >= r->bench.laser.heard[i - 1].t_ns);
    }
    assert_int_equal(too_early, 2);
    r->t_ns += MS(100);
    assert_string_equal(say(r, BENCH_LASER, "?\r?\r"), "OK\r\n"); // the second came at once
    free(r);
}

static void half_a_command_is_ended_by_the_next_terminator(void **state)
{
    (void)state;
    struct rig *r = rig();
    laser(r, "@cob1\r");
    r->t_ns += MS(3000);
    assert_true(
        sim_laser_emits((sim_laser_step(&r->bench.world.laser, r->t_ns), &r->bench.world.laser)));
    laser(r, "p 0.0");
    assert_memory_equal(say(r, BENCH_LASER, "\rl0\r"), "OK\r\n",
                        4); // "p 0.0" was a command, l0 came too early
    assert_true(sim_laser_emits(&r->bench.world.laser));
    assert_string_equal(laser(r, "\rl0\r"), "OK\r\n"); // an empty line is nothing
    assert_false(sim_laser_emits(&r->bench.world.laser));
    free(r);
}

static void direct_on_is_refused_while_autostart_is_enabled(void **state)
{
    (void)state;
    struct rig *r = rig();
    assert_string_equal(laser(r, "@cobas?\r"), "1\r\n");
    assert_memory_equal(laser(r, "l1\r"), "Error", 5);
    r->t_ns += MS(60000);
    assert_string_equal(laser(r, "l?\r"), "0\r\n");
    assert_string_equal(laser(r, "@cobas 0\r"), "OK\r\n");
    assert_string_equal(laser(r, "l1\r"), "OK\r\n");
    assert_string_equal(laser(r, "gom?\r"), "1\r\n"); // accepted is not light
    assert_string_equal(laser(r, "l?\r"), "0\r\n");
    r->t_ns += MS(2000);
    assert_string_equal(laser(r, "gom?\r"), "3\r\n");
    assert_string_equal(laser(r, "l?\r"), "1\r\n");
    r->t_ns += MS(12000);
    assert_string_equal(laser(r, "gom?\r"), "4\r\n");
    assert_true(fabs(atof(laser(r, "pa?\r")) - 0.01) < 0.0002);
    assert_string_equal(laser(r, "l0\r"), "OK\r\n");
    assert_string_equal(laser(r, "l?\r"), "0\r\n");
    assert_string_equal(laser(r, "pa?\r"), "0.00000\r\n");
    free(r);
}

static void the_interlock_stops_the_laser_until_key_and_fault_are_cleared(void **state)
{
    (void)state;
    struct rig *r = rig();
    struct sim_laser *l = &r->bench.world.laser;
    laser(r, "@cobas 0\r");
    laser(r, "l1\r");
    r->t_ns += MS(5000);
    assert_string_equal(laser(r, "l?\r"), "1\r\n");
    sim_laser_set_interlock(l, false);
    assert_string_equal(laser(r, "l?\r"), "0\r\n");
    assert_string_equal(laser(r, "ilk?\r"), "1\r\n");
    assert_string_equal(laser(r, "f?\r"), "3\r\n");
    assert_string_equal(laser(r, "gom?\r"), "5\r\n");
    assert_non_null(strstr(laser(r, "l1\r"), "interlock"));
    sim_laser_set_interlock(l, true);
    assert_non_null(strstr(laser(r, "l1\r"), "fault"));
    laser(r, "cf\r");
    assert_non_null(strstr(laser(r, "l1\r"), "key"));
    sim_laser_set_key(l, false);
    assert_string_equal(laser(r, "@cobasks?\r"), "0\r\n");
    sim_laser_set_key(l, true);
    assert_string_equal(laser(r, "l1\r"), "OK\r\n");
    assert_string_equal(laser(r, "l?\r"), "1\r\n"); // temperatures are right already
    free(r);
}

static void the_world_knows_when_off_was_said(void **state)
{
    (void)state;
    struct rig *r = rig();
    assert_true(r->bench.world.laser.last_off_ns == INT64_MIN);
    laser(r, "l0\r");
    assert_true(r->bench.world.laser.last_off_ns == r->t_ns);
    assert_int_equal(r->bench.world.laser.offs, 1);
    free(r);
}

static void an_echo_comes_before_the_answer(void **state)
{
    (void)state;
    struct rig *r = rig();
    r->bench.laser.echo = true;
    assert_string_equal(laser(r, "p?\r"), "p?\r\n0.0100\r\n");
    free(r);
}

// --- SR830 ---------------------------------------------------------------------------------------

static struct rig *listening(void)
{
    struct rig *r = rig();
    lockin(r, "OUTX 0\r*CLS\r");
    return r;
}

static void nothing_is_heard_before_outx(void **state)
{
    (void)state;
    struct rig *r = rig();
    assert_string_equal(lockin(r, "*IDN?\r"), "");
    assert_string_equal(lockin(r, "OUTX 0\r"), "");
    assert_string_equal(lockin(r, "*IDN?\r"),
                        "Stanford_Research_Systems,SR830,s/n43480,ver1.07 \r");
    assert_string_equal(lockin(r, "*ESR?\n"), "128\r"); // powered on; a line feed will do
    assert_string_equal(lockin(r, "*RST;OUTX?\r"), "0\r");
    free(r);
}

static void each_answer_on_a_line_has_its_own_terminator(void **state)
{
    (void)state;
    struct rig *r = listening();
    assert_string_equal(lockin(r, "SENS?;OFLT?;ofsl?;SYNC?;RMOD?;FREQ?\r"),
                        "26\r8\r1\r0\r1\r1000.00\r");
    assert_string_equal(lockin(r, "SENS 12;OFLT 4 ; OFSL 3\r"), "");
    assert_string_equal(lockin(r, "SENS?;OFLT?;OFSL?\r"), "12\r4\r3\r");
    assert_true(r->bench.world.lockin.full_scale_v == 2e-5);
    assert_true(r->bench.world.lockin.time_constant_s == 1e-3);
    assert_int_equal(r->bench.world.lockin.poles, 4);
    free(r);
}

static void mistakes_say_nothing_and_set_a_bit(void **state)
{
    (void)state;
    struct rig *r = listening();
    assert_string_equal(lockin(r, "XYZZ?\r"), "");
    assert_string_equal(lockin(r, "*ESR?\r"), "32\r");
    assert_string_equal(lockin(r, "*ESR?\r"), "0\r"); // reading cleared it
    assert_string_equal(lockin(r, "SENS 27\r"), "");
    assert_string_equal(lockin(r, "OFLT 1.5;OUTP? 9;SNAP? 1\r"), "");
    assert_string_equal(lockin(r, "*ESR? 4\r"), "1\r");
    assert_string_equal(lockin(r, "*ESR? 5\r"), "0\r");
    assert_string_equal(lockin(r, "SENS?;OFLT?\r"), "26\r8\r");
    char longer[400];
    memset(longer, 'A', sizeof longer);
    strcpy(longer + 390, "\r");
    assert_string_equal(lockin(r, longer), "");
    assert_string_equal(lockin(r, "*ESR?\r"), "1\r"); // input queue overflow
    free(r);
}

static void exponents_have_three_digits(void **state)
{
    (void)state;
    struct rig *r = listening();
    r->bench.world.spec.offset_v = 6.1e-5;
    r->bench.world.spec.noise_v_per_rthz = r->bench.world.lockin.noise_v_per_rthz = 0;
    r->t_ns += MS(10000);
    assert_string_equal(lockin(r, "OUTP? 1\r"), "6.10352e-005\r");      // 4/65536 of 1 V
    assert_string_equal(lockin(r, "SENS 13;OUTP? 1\r"), "5.45e-005\r"); // 109 % of 50 uV
    free(r);
}

static void snap_takes_signal_frequency_and_monitor_at_once(void **state)
{
    (void)state;
    struct rig *r = listening();
    double x, y, frequency, monitor;
    char end;
    r->t_ns += MS(1000);
    assert_int_equal(sscanf(lockin(r, "SNAP? 1,2,9,5\r"), "%lf,%lf,%lf,%lf%c", &x, &y, &frequency,
                            &monitor, &end),
                     5);
    assert_true(end == '\r' && frequency == 1000);
    assert_true(fabs(monitor - 0.002) < 0.0012);
    assert_true(fabs(x) < 1e-4 && fabs(y) < 1e-4);
    assert_true(fabs(atof(lockin(r, "OAUX? 1\r")) - 0.002) < 0.0012);
    lockin(r, "AUXV 2,-3.5\r");
    assert_string_equal(lockin(r, "AUXV? 2\r"), "-3.500\r");
    free(r);
}

static void overload_bits_stay_until_they_are_read(void **state)
{
    (void)state;
    struct rig *r = listening();
    lockin(r, "SENS 5\r"); // 100 nV; the dark signal is 200 nV
    r->t_ns += MS(5000);
    lockin(r, "OUTP? 1\r");
    lockin(r, "SENS 26\r");
    r->t_ns += MS(5000);
    assert_string_equal(lockin(r, "LIAS? 2\r"), "1\r");
    assert_string_equal(lockin(r, "LIAS?\r"), "0\r");
    lockin(r, "SENS 5\r");
    r->t_ns += MS(5000);
    assert_string_equal(lockin(r, "SENS 26;*CLS;LIAS?\r"), "0\r");
    r->bench.world.saturate = true;
    r->t_ns += MS(5000);
    assert_true(atoi(lockin(r, "LIAS?\r")) & 1);
    assert_string_equal(lockin(r, "OUTP? 1\r"), "1.09\r");
    free(r);
}

static void a_reading_after_a_change_of_light_lags_by_the_filter(void **state)
{
    (void)state;
    struct rig *r = listening();
    struct world *w = &r->bench.world;
    w->lockin.noise_v_per_rthz = 0;
    w->spec.offset_v = 0;
    lockin(r, "OFLT 8;OFSL 1;SENS 26\r"); // 100 ms, 12 dB
    r->t_ns += MS(5000);
    assert_true(fabs(atof(lockin(r, "OUTP? 1\r"))) < 2e-5);
    w->spec.offset_v = 0.5;
    r->t_ns += MS(100);
    double x = atof(lockin(r, "OUTP? 1\r")); // 1 - 2/e after one time constant
    assert_true(fabs(x / 0.5 - (1 - 2 * exp(-1))) < 1e-4);
    r->t_ns += MS(1081); // 11.8 in all: (1 + t) e^-t = 1e-4
    x = atof(lockin(r, "OUTP? 1\r"));
    assert_true(fabs(1 - x / 0.5 - 1e-4) < 4e-5);
    free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_laser_answers_lines),
        cmocka_unit_test(a_command_that_comes_too_early_is_ignored),
        cmocka_unit_test(half_a_command_is_ended_by_the_next_terminator),
        cmocka_unit_test(direct_on_is_refused_while_autostart_is_enabled),
        cmocka_unit_test(the_interlock_stops_the_laser_until_key_and_fault_are_cleared),
        cmocka_unit_test(the_world_knows_when_off_was_said),
        cmocka_unit_test(an_echo_comes_before_the_answer),
        cmocka_unit_test(nothing_is_heard_before_outx),
        cmocka_unit_test(each_answer_on_a_line_has_its_own_terminator),
        cmocka_unit_test(mistakes_say_nothing_and_set_a_bit),
        cmocka_unit_test(exponents_have_three_digits),
        cmocka_unit_test(snap_takes_signal_frequency_and_monitor_at_once),
        cmocka_unit_test(overload_bits_stay_until_they_are_read),
        cmocka_unit_test(a_reading_after_a_change_of_light_lags_by_the_filter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
