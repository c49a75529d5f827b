// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
#include "daemon/instrument.h"
#include "tests/unit/simbench.h"
#include "tests/unit/simconfig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

struct setting {
    struct simbench b;
    struct bench_config bench;
    struct instrument *in;
    struct instrument_snapshot now;
    int watched;
    int64_t watched_ns, longest_ns;
};

static struct setting *begin(void)
{
    struct setting *s = calloc(1, sizeof *s);
    simbench_init(&s->b, NULL);
    simconfig_bench(&s->bench);
    return s;
}

static void make(struct setting *s)
{
    struct instrument_parts parts = simbench_parts(&s->b);
    assert_int_equal(instrument_new(&s->bench, &parts, &s->b.clk.clk, &s->in, NULL), 0);
    simbench_arm(s->in);
}

// Of a bench with the world's three axes.
static enum part_link expected(int part, enum part_link of_all)
{
    return part <= WORLD_SAMPLE || part == PART_LASER || part == PART_DETECTOR ? of_all
                                                                               : PART_ABSENT;
}

static void end(struct setting *s)
{
    instrument_free(s->in);
    free(s);
}

static void what_is_there_is_opened_and_the_laser_is_off_first(void **state)
{
    (void)state;
    struct setting *s = begin();
    s->b.world.laser.state = SIM_LASER_COMPLETED;
    make(s);
    assert_int_equal(instrument_lost(s->in), PART_COUNT);
    assert_int_equal(instrument_tend(s->in), 0);
    instrument_snapshot(s->in, &s->now);
    for (int i = 0; i < PART_COUNT; i++)
        assert_int_equal(s->now.part[i].link, expected(i, PART_OK));
    assert_false(sim_laser_emits(&s->b.world.laser));
    assert_string_equal(s->now.part[PART_LASER].identity, "simulated laser");
    assert_string_equal(s->now.part[PART_DETECTOR].identity, "simulated lock-in");
    assert_string_equal(s->now.axis[PART_SAMPLE].unit, "mm");
    assert_true(fabs(s->now.axis[PART_THETA_R].position - -7.5) < 1e-9);
    assert_true(isfinite(s->now.signal_v) && s->now.range == -1);
    assert_true(s->b.axis[PART_THETA_I].stops > 0);
    end(s);
}

static void what_is_not_there_is_lost_by_name_and_comes_back(void **state)
{
    (void)state;
    struct setting *s = begin();
    for (int i = 0; i < SIMBENCH_DEVICES; i++)
        s->b.gone_until_ns[i] = s->b.clk.t_ns + CLK_S(5);
    make(s);
    assert_int_equal(instrument_lost(s->in), PART_THETA_I);
    instrument_snapshot(s->in, &s->now);
    static const char *const problems[PART_COUNT] = {[PART_THETA_I] = "axis theta_i: hung up",
                                                     [PART_THETA_R] = "axis theta_r: hung up",
                                                     [PART_SAMPLE] = "axis sample: hung up",
                                                     [PART_LASER] = "laser: hung up",
                                                     [PART_DETECTOR] = "detector: hung up"};
    for (int i = 0; i < PART_COUNT; i++) {
        if (expected(i, PART_OK) == PART_ABSENT)
            continue;
        assert_int_equal(s->now.part[i].link, PART_LOST);
        assert_string_equal(s->now.part[i].problem, problems[i]);
    }
    struct gon_error err;
    struct detector_sample sample;
    assert_int_equal(instrument_sample(s->in, &sample, &err), GON_E_GONE);
    assert_string_equal(err.text, "detector: hung up");
    while (s->b.clk.t_ns < CLK_S(20) && instrument_tend(s->in) > 0)
        clk_sleep(&s->b.clk.clk, CLK_MS(100), NULL);
    assert_true(s->b.clk.t_ns < CLK_S(6 + 5.2)); // tried at most 5 s apart
    instrument_snapshot(s->in, &s->now);
    for (int i = 0; i < PART_COUNT; i++) {
        if (expected(i, PART_OK) == PART_ABSENT)
            continue;
        assert_int_equal(s->now.part[i].link, PART_OK);
        assert_int_equal(s->now.part[i].returns, 1);
        assert_string_equal(s->now.part[i].problem, "");
    }
    end(s);
}

static void tries_to_reconnect_are_paced(void **state)
{
    (void)state;
    struct setting *s = begin();
    make(s);
    s->b.gone_until_ns[SIMBENCH_DETECTOR] = INT64_MAX;
    instrument_tend(s->in);
    const long calls = s->b.calls;
    for (int i = 0; i < 2000; i++) { // 20 s
        instrument_reconnect(s->in);
        clk_sleep(&s->b.clk.clk, CLK_MS(10), NULL);
    }
    const long tries = s->b.calls - calls; // 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5, 5 s
    assert_true(tries >= 8 && tries <= 9);
    end(s);
}

static void a_laser_that_lights_by_itself_is_switched_off(void **state)
{
    (void)state;
    struct setting *s = begin();
    make(s);
    s->b.world.laser.state = SIM_LASER_COMPLETED;
    instrument_tend(s->in);
    assert_false(sim_laser_emits(&s->b.world.laser));
    end(s);
}

static void an_off_that_was_not_confirmed_is_repeated_when_idle(void **state)
{
    (void)state;
    struct setting *s = begin();
    make(s);
    instrument_permit(s->in, true);
    assert_int_equal(instrument_emission_on(s->in, NULL), 0);
    s->b.gone_until_ns[SIMBENCH_LASER] = s->b.clk.t_ns + CLK_S(5);
    assert_int_equal(instrument_emission_off(s->in, NULL), GON_E_GONE);
    instrument_snapshot(s->in, &s->now);
    assert_true(s->now.off_unconfirmed && s->now.emission);
    for (int i = 0; i < 10; i++) {
        instrument_tend(s->in);
        clk_sleep(&s->b.clk.clk, CLK_S(1), NULL);
    }
    instrument_snapshot(s->in, &s->now);
    assert_false(s->now.off_unconfirmed || s->now.emission);
    assert_false(sim_laser_emits(&s->b.world.laser));
    end(s);
}

// Unplugged for a second.
static void replug(struct setting *s, enum simbench_device device)
{
    s->b.gone_until_ns[device] = s->b.clk.t_ns + CLK_S(1);
    instrument_tend(s->in);
    clk_sleep(&s->b.clk.clk, CLK_S(6), NULL);
}

static void another_detector_is_not_used(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct detector_sample sample;
    struct gon_error err;
    s->b.detector_is = "maker,lock-in,A1,1.0";
    make(s);
    replug(s, SIMBENCH_DETECTOR);
    s->b.detector_is = "maker,lock-in,B2,1.0";
    const int setups = s->b.setups;
    assert_int_equal(instrument_connect(s->in, PART_DETECTOR, &err), GON_E_DEVICE);
    assert_string_equal(err.text, "detector: another device answers here: serial number A1 before, "
                                  "B2 now; plug the former one in again, or restart goniod when "
                                  "the exchange is meant");
    assert_int_equal(s->b.setups, setups);
    assert_int_equal(instrument_sample(s->in, &sample, &err), GON_E_GONE);
    assert_non_null(strstr(err.text, "serial number A1 before"));
    assert_int_equal(instrument_set_up(s->in, NULL), GON_E_GONE);
    assert_int_equal(instrument_tend(s->in), 1);
    instrument_snapshot(s->in, &s->now);
    assert_string_equal(s->now.part[PART_DETECTOR].identity, "maker,lock-in,A1,1.0");
    assert_true(s->now.part[PART_DETECTOR].refused);

    s->b.detector_is = "maker,lock-in,A1,1.1";
    clk_sleep(&s->b.clk.clk, CLK_S(6), NULL);
    assert_int_equal(instrument_tend(s->in), 0);
    assert_int_equal(instrument_sample(s->in, &sample, &err), 0);
    instrument_snapshot(s->in, &s->now);
    assert_string_equal(s->now.part[PART_DETECTOR].identity, "maker,lock-in,A1,1.1");
    assert_false(s->now.part[PART_DETECTOR].refused);
    end(s);
}

static void what_another_laser_says_of_off_is_not_believed(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct gon_error err;
    s->b.laser_is = "a laser, serial 7, firmware 1";
    make(s);
    instrument_permit(s->in, true);
    assert_int_equal(instrument_emission_on(s->in, NULL), 0);
    s->b.gone_until_ns[SIMBENCH_LASER] = s->b.clk.t_ns + CLK_S(1);
    assert_int_equal(instrument_emission_off(s->in, NULL), GON_E_GONE);
    clk_sleep(&s->b.clk.clk, CLK_S(1), NULL);
    s->b.laser_is = "a laser, serial 8, firmware 1";
    for (int i = 0; i < 2; i++) {
        assert_int_equal(instrument_connect(s->in, PART_LASER, &err), GON_E_DEVICE);
        assert_non_null(strstr(err.text, "serial number 7 before, 8 now"));
        assert_int_equal(instrument_light_left(s->in), SAFETY_LIGHT_MAYBE);
        instrument_snapshot(s->in, &s->now);
        assert_true(s->now.emission && s->now.off_unconfirmed);
        assert_int_equal(instrument_emission_on(s->in, NULL), GON_E_GONE);
    }
    s->b.laser_is = "a laser, serial 7, firmware 1";
    assert_int_equal(instrument_connect(s->in, PART_LASER, NULL), 0);
    assert_int_equal(instrument_light_left(s->in), SAFETY_LIGHT_OFF);
    instrument_snapshot(s->in, &s->now);
    assert_false(s->now.emission || s->now.off_unconfirmed);
    end(s);
}

static void an_off_that_another_laser_confirmed_is_none_at_the_end(void **state)
{
    (void)state;
    struct setting *s = begin();
    s->b.laser_is = "a laser, serial 7";
    make(s);
    instrument_permit(s->in, true);
    assert_int_equal(instrument_emission_on(s->in, NULL), 0);
    s->b.gone_until_ns[SIMBENCH_LASER] = s->b.clk.t_ns + CLK_S(1);
    assert_int_equal(instrument_emission_off(s->in, NULL), GON_E_GONE);
    clk_sleep(&s->b.clk.clk, CLK_S(1), NULL);
    s->b.laser_is = "a laser, serial 8";
    assert_int_equal(instrument_connect(s->in, PART_LASER, NULL), GON_E_DEVICE);
    assert_false(instrument_free(s->in));
    free(s);
}

static void a_snapshot_tells_what_the_links_have_seen(void **state)
{
    (void)state;
    struct setting *s = begin();
    make(s);
    link_stats_answer(&s->b.bus, CLK_MS(3));
    s->b.bus.errors[LINK_GARBLED] = 2;
    s->b.fail_at = s->b.calls + 1;
    s->b.fail_code = GON_E_LINK;
    instrument_tend(s->in);
    instrument_snapshot(s->in, &s->now);
    for (int i = 0; i < instrument_bench(s->in)->axes_count; i++) {
        assert_string_equal(s->now.part[i].driver, "oriental-az");
        assert_int_equal(s->now.part[i].stats.errors[LINK_GARBLED], 2);
        assert_int_equal(link_stats_answers(&s->now.part[i].stats), 1);
    }
    assert_int_equal(link_stats_answers(&s->now.part[PART_LASER].stats), 0);
    assert_string_equal(s->now.part[PART_LASER].driver, "cobolt-05");
    assert_string_equal(s->now.part[PART_DETECTOR].driver, "sr830");
    // It is there again, and what was wrong is remembered with its time.
    assert_int_equal(s->now.part[PART_THETA_I].link, PART_OK);
    assert_string_equal(s->now.part[PART_THETA_I].problem, "");
    assert_non_null(strstr(s->now.part[PART_THETA_I].last_error, "axis theta_i: injected"));
    assert_int_equal(s->now.part[PART_THETA_I].last_error_ns, s->now.t_ns);
    assert_string_equal(s->now.part[PART_THETA_R].last_error, "");
    end(s);
}

static void watcher(void *ctx)
{
    struct setting *s = ctx;
    if (s->watched++ > 0 && s->b.clk.t_ns - s->watched_ns > s->longest_ns)
        s->longest_ns = s->b.clk.t_ns - s->watched_ns;
    s->watched_ns = s->b.clk.t_ns;
}

static void waiting_renews_the_lease_every_100_ms(void **state)
{
    (void)state;
    struct setting *s = begin();
    make(s);
    instrument_watch(s->in, watcher, s);
    instrument_permit(s->in, true);
    assert_int_equal(instrument_emission_on(s->in, NULL), 0);
    assert_int_equal(instrument_wait(s->in, s->b.clk.t_ns + CLK_S(10), NULL), 0);
    assert_int_equal(s->watched, 101);
    assert_true(s->longest_ns == CLK_MS(100));
    assert_true(safety_worst_gap_ns(instrument_safety(s->in)) == CLK_MS(100));
    end(s);
}

static void user_units_have_zero_and_direction(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct axis_place p;
    struct gon_error err;
    s->bench.axes[0].zero = 1.5;            // position at step 0
    s->bench.axes[1].steps_per_unit = -500; // the motor is mounted the other way round
    make(s);
    assert_int_equal(instrument_go(s->in, PART_THETA_I, 11.5, &err), 0);
    assert_int_equal(s->b.axis[PART_THETA_I].target_steps, 10000);
    assert_int_equal(instrument_go(s->in, PART_THETA_R, 20.0, &err), 0);
    assert_int_equal(s->b.axis[PART_THETA_R].target_steps, -10000);
    clk_sleep(&s->b.clk.clk, CLK_S(20), NULL);
    assert_int_equal(instrument_place(s->in, PART_THETA_I, &p, &err), 0);
    assert_true(fabs(p.position - 11.5) < 1e-9);
    assert_int_equal(instrument_place(s->in, PART_THETA_R, &p, &err), 0);
    assert_true(fabs(p.position - 20.0) < 1e-9);
    assert_true(fabs(instrument_rounded(s->in, PART_THETA_R, 20.0009) - 20.0) < 1e-9);
    instrument_snapshot(s->in, &s->now);
    assert_true(fabs(s->now.axis[PART_THETA_I].position - 11.5) < 1e-9);
    assert_true(fabs(s->now.axis[PART_THETA_I].dial - 10.0) < 1e-9);
    assert_true(s->now.axis[PART_THETA_I].raw_steps == 10000 &&
                s->now.axis[PART_THETA_R].raw_steps == -10000);
    assert_int_equal(instrument_go(s->in, PART_THETA_R, -181, &err), GON_E_INPUT);
    assert_int_equal(instrument_go(s->in, PART_THETA_R, (double)NAN, &err), GON_E_INPUT);
    end(s);
}

// raw / |steps_per_unit| = dial, and user = its sign times dial + zero; an encoder of 4 steps to
// the motor's one.
static void three_scales_of_one_axis(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct axis_place p;
    s->bench.axes[1].steps_per_unit = -500;
    s->bench.axes[1].zero = 1.5;
    s->bench.axes[1].encoder_steps = 4;
    make(s);
    assert_int_equal(instrument_go(s->in, PART_THETA_R, 21.5, NULL), 0);
    assert_int_equal(s->b.axis[PART_THETA_R].target_steps, -10000); // of the motor
    clk_sleep(&s->b.clk.clk, CLK_S(20), NULL);
    s->b.axis[PART_THETA_R].steps_per_unit *= 4; // what the encoder counts
    assert_int_equal(instrument_place(s->in, PART_THETA_R, &p, NULL), 0);
    assert_true(fabs(p.position - 21.5) < 1e-9 && fabs(p.dial + 20) < 1e-9 &&
                fabs(p.raw_steps + 10000) < 1e-9);
    instrument_snapshot(s->in, &s->now);
    assert_true(s->now.axis[PART_THETA_R].dial == p.dial &&
                s->now.axis[PART_THETA_R].raw_steps == p.raw_steps);
    assert_true(isnan(s->now.axis[WORLD_AXES].raw_steps));
    end(s);
}

static void axes_have_the_names_and_the_order_of_the_file(void **state)
{
    (void)state;
    struct setting *s = begin();
    s->bench.axes_count = 4;
    simconfig_axis(&s->bench.axes[3], "polariser", "deg", 0, 360);
    make(s);
    instrument_snapshot(s->in, &s->now);
    assert_string_equal(s->now.part[1].name, "theta_r");
    assert_string_equal(s->now.part[3].name, "polariser");
    assert_string_equal(s->now.part[4].name, "");
    assert_int_equal(s->now.part[3].link, PART_ABSENT); // nothing was given for it
    assert_int_equal(s->now.part[4].link, PART_ABSENT);
    assert_string_equal(s->now.part[PART_LASER].name, "laser");
    end(s);
}

static void a_bench_without_a_sample_stage_has_none(void **state)
{
    (void)state;
    struct setting *s = begin();
    s->bench.axes_count = 2;
    struct instrument_parts parts = simbench_parts(&s->b);
    parts.axis[PART_SAMPLE] = NULL;
    assert_int_equal(instrument_new(&s->bench, &parts, &s->b.clk.clk, &s->in, NULL), 0);
    simbench_arm(s->in);
    assert_false(instrument_has(s->in, PART_SAMPLE));
    assert_int_equal(instrument_tend(s->in), 0);
    end(s);
}

// Real drivers, ports that do not exist: the daemon starts nevertheless and says what is missing.
static void use_profiles(struct bench_config *bench)
{
    snprintf(bench->laser.driver, sizeof bench->laser.driver, "configs/profiles/cobolt-05.cfg");
    snprintf(bench->detector.driver, sizeof bench->detector.driver, "configs/profiles/sr830.cfg");
}

static void ports_that_are_not_there_do_not_stop_the_daemon(void **state)
{
    (void)state;
    struct setting *s = begin();
    use_profiles(&s->bench);
    s->bench.buses_count = 1;
    snprintf(s->bench.buses[0].name, sizeof s->bench.buses[0].name, "axes");
    snprintf(s->bench.buses[0].link, sizeof s->bench.buses[0].link,
             "modbus-rtu:/nowhere/axes?baud=115200");
    s->bench.buses[0].timeout_ms = 100;
    for (int i = 0; i < 3; i++) {
        snprintf(s->bench.axes[i].bus, sizeof s->bench.axes[i].bus, "axes");
        s->bench.axes[i].unit = i + 1;
    }
    snprintf(s->bench.laser.link, sizeof s->bench.laser.link, "serial:/nowhere/laser?baud=115200");
    snprintf(s->bench.detector.link, sizeof s->bench.detector.link,
             "serial:/nowhere/detector?baud=9600");
    struct gon_error err;
    assert_int_equal(instrument_open(&s->bench, NULL, &s->b.clk.clk, &s->in, &err), 0);
    instrument_snapshot(s->in, &s->now);
    for (int i = 0; i < PART_COUNT; i++) {
        if (expected(i, PART_OK) == PART_ABSENT)
            continue;
        assert_int_equal(s->now.part[i].link, PART_LOST);
        assert_non_null(strstr(s->now.part[i].problem, "/nowhere/"));
        assert_non_null(strstr(s->now.part[i].address, "/nowhere/"));
    }
    assert_true(instrument_tend(s->in) > 0);
    assert_int_equal(instrument_emission_on(s->in, &err), GON_E_GONE);
    assert_non_null(strstr(err.text, "laser: not there (serial:/nowhere/laser"));
    end(s);
}

static void a_link_that_is_no_link_is_an_error_of_the_bench(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct gon_error err;
    use_profiles(&s->bench);
    s->bench.axes_count = 0;
    snprintf(s->bench.laser.link, sizeof s->bench.laser.link, "carrier-pigeon:laser");
    snprintf(s->bench.detector.link, sizeof s->bench.detector.link, "serial:/nowhere/detector");
    assert_int_equal(instrument_open(&s->bench, NULL, &s->b.clk.clk, &s->in, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "laser: "));
    assert_null(s->in);
    free(s);
}

static void a_profile_that_is_not_there_is_an_error_of_the_bench(void **state)
{
    (void)state;
    struct setting *s = begin();
    struct gon_error err;
    use_profiles(&s->bench);
    s->bench.axes_count = 0;
    snprintf(s->bench.laser.driver, sizeof s->bench.laser.driver, "cobolt-99");
    snprintf(s->bench.laser.link, sizeof s->bench.laser.link, "serial:/nowhere/laser");
    assert_int_equal(instrument_open(&s->bench, NULL, &s->b.clk.clk, &s->in, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no profile 'cobolt-99': looked for "));
    free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_there_is_opened_and_the_laser_is_off_first),
        cmocka_unit_test(what_is_not_there_is_lost_by_name_and_comes_back),
        cmocka_unit_test(tries_to_reconnect_are_paced),
        cmocka_unit_test(a_laser_that_lights_by_itself_is_switched_off),
        cmocka_unit_test(an_off_that_was_not_confirmed_is_repeated_when_idle),
        cmocka_unit_test(another_detector_is_not_used),
        cmocka_unit_test(what_another_laser_says_of_off_is_not_believed),
        cmocka_unit_test(an_off_that_another_laser_confirmed_is_none_at_the_end),
        cmocka_unit_test(a_snapshot_tells_what_the_links_have_seen),
        cmocka_unit_test(waiting_renews_the_lease_every_100_ms),
        cmocka_unit_test(user_units_have_zero_and_direction),
        cmocka_unit_test(three_scales_of_one_axis),
        cmocka_unit_test(axes_have_the_names_and_the_order_of_the_file),
        cmocka_unit_test(a_bench_without_a_sample_stage_has_none),
        cmocka_unit_test(ports_that_are_not_there_do_not_stop_the_daemon),
        cmocka_unit_test(a_link_that_is_no_link_is_an_error_of_the_bench),
        cmocka_unit_test(a_profile_that_is_not_there_is_an_error_of_the_bench),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
