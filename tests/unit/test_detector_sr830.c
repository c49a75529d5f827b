// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The profile of an SR830 against the simulated instrument, in virtual time.
#include "drivers/detector.h"

#include "drivers/by_profile.h"
#include "drivers/link_stats.h"
#include "sim/bench.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

static struct bench bench;
static struct noisy line;
static const struct detector_setup setup = {
    .time_constant_s = 0.1, .slope_db = 12, .monitor_aux = 1};

static struct detector *open_on(struct port *port)
{
    struct detector *d;
    struct gon_error err;
    struct clk *clk = vline_begin(port);
    char link[128];
    snprintf(link, sizeof link, "%s?baud=9600", vline.link);
    if (detector_by_profile(profiles_get("sr830"), link, clk, NULL, &d, &err) < 0)
        fail_msg("%s", err.text);
    return d;
}

static struct detector *begin(void)
{
    struct bench_spec spec;
    bench_defaults(&spec);
    bench_init(&bench, &spec, CLK_S(1));
    noisy_init(&line, bench_port(&bench, BENCH_DETECTOR), 11, 0);
    return open_on(&line.port);
}

static struct detector *begin_ready(int range)
{
    struct gon_error err;
    double tc_s;
    char text[120];
    struct detector *d = begin();
    if (d->ops->identify(d, text, sizeof text, &err) < 0 ||
        d->ops->setup(d, &setup, &tc_s, &err) < 0 || d->ops->set_range(d, range, &err) < 0)
        fail_msg("%s", err.text);
    return d;
}

// The instrument answers on GPIB after power-up; the first command changes that.
static void the_first_command_asks_for_answers_here(void **state)
{
    char text[120] = "";
    (void)state;
    struct detector *d = begin();
    assert_true(bench.detector.setting[6] == 1); // OUTX: GPIB
    assert_int_equal(d->ops->identify(d, text, sizeof text, NULL), 0);
    assert_string_equal(text, "Stanford_Research_Systems,SR830,s/n43480,ver1.07");
    d->ops->free(d);
}

static void hear_another(struct scripted *s, const char *text, int64_t t_ns)
{
    (void)text;
    scripted_say(s, "Stanford_Research_Systems,SR850,s/n1,ver1.0\r", t_ns + MS(5));
}

static void another_instrument_is_refused(void **state)
{
    struct scripted s;
    struct gon_error err;
    char text[120];
    (void)state;
    scripted_init(&s, "\r", hear_another);
    struct detector *d = open_on(&s.port);
    assert_int_equal(d->ops->identify(d, text, sizeof text, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "not an SR830"));
    d->ops->free(d);
}

static void the_time_constant_is_the_next_that_is_not_shorter(void **state)
{
    static const struct {
        double asked_s, got_s;
    } rows[] = {{1e-6, 1e-5}, {0.1, 0.1}, {0.11, 0.3}, {0.3, 0.3}, {2, 3}, {30000, 30000}};
    (void)state;
    struct detector *d = begin_ready(26);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct detector_setup s = {.time_constant_s = rows[i].asked_s, .slope_db = 24};
        double tc_s = 0;
        assert_int_equal(d->ops->setup(d, &s, &tc_s, NULL), 0);
        assert_true(tc_s == rows[i].got_s);
        assert_true(bench.world.lockin.time_constant_s == rows[i].got_s);
        assert_int_equal(bench.world.lockin.poles, 4);
    }
    d->ops->free(d);
}

static void impossible_settings_are_refused(void **state)
{
    static const struct detector_setup bad[] = {{30001, 12, 1, 0}, {0, 12, 1, 0},   {-1, 12, 1, 0},
                                                {0.1, 13, 1, 0},   {0.1, 0, 1, 0},  {0.1, 30, 1, 0},
                                                {0.1, 12, 5, 0},   {0.1, 12, -1, 0}};
    struct gon_error err;
    (void)state;
    struct detector *d = begin_ready(26);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        double tc_s = 42;
        assert_int_equal(d->ops->setup(d, &bad[i], &tc_s, &err), GON_E_INPUT);
        assert_true(tc_s == 42);
    }
    d->ops->free(d);
}

static void ranges_are_set_and_read_back(void **state)
{
    (void)state;
    struct detector *d = begin_ready(26);
    assert_int_equal(d->ops->ranges(d), 27);
    assert_true(d->ops->full_scale_v(d, 0) == 2e-9);
    assert_true(d->ops->full_scale_v(d, 26) == 1.0);
    for (int range = 26; range >= 0; range--) {
        assert_int_equal(d->ops->set_range(d, range, NULL), 0);
        assert_true(bench.world.lockin.full_scale_v == d->ops->full_scale_v(d, range));
        assert_true(range == 0 ||
                    d->ops->full_scale_v(d, range) > d->ops->full_scale_v(d, range - 1));
    }
    d->ops->free(d);
}

// Reads back another range than it was told.
static void hear_stubborn(struct scripted *s, const char *text, int64_t t_ns)
{
    if (strstr(text, "SENS"))
        scripted_say(s, "26\r", t_ns + MS(5));
    else if (strstr(text, "*IDN?"))
        scripted_say(s, "Stanford_Research_Systems,SR830,s/n1,ver1.0\r", t_ns + MS(5));
    else
        scripted_say(s, s->step ? "16\r" : "0\r", t_ns + MS(5)); // *ESR?
}

static void a_setting_that_does_not_take_is_an_error(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    scripted_init(&s, "\r", hear_stubborn);
    struct detector *d = open_on(&s.port);
    assert_int_equal(d->ops->set_range(d, 20, &err), GON_E_DEVICE);
    assert_non_null(
        strstr(err.text, "refuses 'SENS 20;SENS?' (full_scale reads back 1 V, esr is 0)"));
    s.step = 1; // reads back as told, but complains
    assert_int_equal(d->ops->set_range(d, 26, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "refuses 'SENS 26;SENS?' (esr is 16 (bad parameter))"));
    assert_int_equal(d->ops->stats(d)->errors[LINK_REFUSED], 2);
    d->ops->free(d);
}

static void a_sample_is_signal_frequency_and_monitor(void **state)
{
    struct detector_sample s;
    (void)state;
    struct detector *d = begin_ready(26);
    for (int i = 0; i < 4; i++) { // in both shapes
        assert_int_equal(d->ops->sample(d, &s, NULL), 0);
        assert_true(fabs(s.signal_v) < 0.1);
        assert_true(s.reference_hz == bench.world.spec.reference_hz);
        assert_true(fabs(s.monitor_v - bench.world.spec.monitor_dark_v) < 0.01);
    }
    struct detector_setup alone = setup;
    double tc_s;
    alone.monitor_aux = 0;
    assert_int_equal(d->ops->setup(d, &alone, &tc_s, NULL), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(d->ops->sample(d, &s, NULL), 0);
        assert_true(isnan(s.monitor_v));
        assert_true(s.reference_hz == bench.world.spec.reference_hz);
    }
    d->ops->free(d);
}

// Answers SNAP? with what a test wants, everything else well.
static const char *snap_answer;

static void hear_and_snap(struct scripted *s, const char *text, int64_t t_ns)
{
    if (strncmp(text, "SNAP", 4) == 0)
        scripted_say(s, snap_answer, t_ns + MS(5));
    else if (strstr(text, "*IDN?"))
        scripted_say(s, "Stanford_Research_Systems,SR830,s/n1,ver1.0\r", t_ns + MS(5));
    else
        scripted_say(s, strstr(text, "SENS") ? "20\r" : "0\r", t_ns + MS(5));
}

static void what_is_no_reading_never_becomes_one(void **state)
{
    static const char *const bad[] = {
        "0.001\r",                  // one number
        "0.001,1000\r",             // no frequency or no monitor, depending on the question
        "0.001,1000,0.5,0.1,0.1\r", // too many
        "nan,1000,0.5\r",
        "OVLD,1000,0.5\r",
        "9.9e37,1000,0.5\r",
        "0,001,1000,0,5\r",
        "0.5,1000,0.5\r", // range 20 is 10 mV: impossible
        "0.001,-5,0.5\r",
        "0.001,200000,0.5\r",
        "0.001,1000,99\r",
        ",,\r",
        "\r"};
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct scripted s;
        struct gon_error err;
        struct detector_sample sample = {42, 42, 42};
        struct detector_setup with_monitor = setup;
        double tc_s;
        scripted_init(&s, "\r", hear_and_snap);
        struct detector *d = open_on(&s.port);
        assert_int_equal(d->ops->set_range(d, 20, &err), 0);
        with_monitor.time_constant_s = 1e-5; // OFLT 0, OFSL 0: as it answers
        with_monitor.slope_db = 6;
        assert_int_equal(d->ops->setup(d, &with_monitor, &tc_s, &err), 0);
        snap_answer = bad[i];
        for (int k = 0; k < 2; k++) // wide and narrow
            assert_int_equal(d->ops->sample(d, &sample, &err), GON_E_LINK);
        assert_true(sample.signal_v == 42);
        d->ops->free(d);
    }
}

static unsigned condition(struct detector *d)
{
    unsigned flags = 0;
    struct gon_error err;
    if (d->ops->condition(d, &flags, &err) < 0)
        fail_msg("%s", err.text);
    return flags;
}

static void conditions_are_told_once(void **state)
{
    (void)state;
    struct detector *d = begin_ready(26);
    condition(d);
    assert_int_equal(condition(d), 0);
    for (unsigned bit = 0; bit < 3; bit++) {
        bench.world.lockin.condition = 1u << bit;
        assert_int_equal(condition(d), DETECTOR_SATURATED);
        assert_int_equal(condition(d), 0);
    }
    bench.world.lockin.condition = 1 << 3;
    assert_int_equal(condition(d), DETECTOR_UNLOCKED);
    bench.world.lockin.condition = 1 << 4;
    assert_int_equal(condition(d), DETECTOR_UNSETTLED);
    bench.world.lockin.condition = 1 << 5;
    assert_int_equal(condition(d), DETECTOR_UNSETTLED);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

static void what_was_cleared_is_not_told(void **state)
{
    (void)state;
    struct gon_error err;
    struct detector *d = begin_ready(26);
    bench.world.lockin.condition = 1;
    assert_int_equal(d->ops->clear(d, &err), 0);
    assert_int_equal(condition(d), 0);
    bench.world.lockin.condition = 1;
    assert_int_equal(condition(d), DETECTOR_SATURATED);
    d->ops->free(d);
}

// Reading clears what it tells: when the answer is lost nobody knows what there was.
static void a_condition_whose_answer_was_lost_is_told_as_unsettled(void **state)
{
    (void)state;
    struct detector *d = begin_ready(26);
    condition(d);
    for (int nth = 1; nth <= 2; nth++) { // overloads, and the sign of a restart
        bench.world.lockin.condition = 1;
        line.lose_nth = nth;
        assert_int_equal(condition(d) & DETECTOR_UNSETTLED, DETECTOR_UNSETTLED);
        assert_int_equal(condition(d), 0);
    }
    d->ops->free(d);
}

// The answer before it may have been another question's, and this one its own.
static void an_answer_too_many_amid_a_reading_is_told_as_unsettled(void **state)
{
    (void)state;
    struct detector_sample s;
    struct detector *d = begin_ready(26);
    condition(d);
    assert_int_equal(d->ops->clear(d, NULL), 0);
    assert_int_equal(d->ops->sample(d, &s, NULL), 0);
    assert_int_equal(condition(d), 0);
    assert_int_equal(d->ops->clear(d, NULL), 0);
    assert_int_equal(d->ops->sample(d, &s, NULL), 0);
    port_send(&line.port, "0.5,1000.00\r", 12, vline.clk.t_ns);
    vline.clk.t_ns += MS(20);
    assert_int_equal(d->ops->sample(d, &s, NULL), 0);
    assert_int_equal(condition(d), DETECTOR_UNSETTLED);
    assert_int_equal(d->ops->clear(d, NULL), 0);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

static void a_range_changed_at_the_front_panel_is_seen(void **state)
{
    (void)state;
    struct detector *d = begin_ready(26);
    condition(d);
    bench.detector.setting[0] = 25; // SENS
    assert_int_equal(condition(d), DETECTOR_UNSETTLED);
    assert_int_equal(condition(d), DETECTOR_UNSETTLED); // until it is set again
    assert_int_equal(d->ops->set_range(d, 26, NULL), 0);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

// After a power cut it answers on GPIB, and its settings are not what they were.
static void a_restart_is_survived_and_told_until_set_up_again(void **state)
{
    struct detector_sample s;
    double tc_s;
    (void)state;
    struct detector *d = begin_ready(26);
    condition(d);
    sim_sr830_init(&bench.detector, &bench.world, MS(5));
    assert_int_equal(d->ops->sample(d, &s, NULL), 0); // by asking for answers here again
    assert_int_equal(condition(d) & DETECTOR_UNSETTLED, DETECTOR_UNSETTLED);
    assert_int_equal(condition(d) & DETECTOR_UNSETTLED, DETECTOR_UNSETTLED);
    assert_int_equal(d->ops->setup(d, &setup, &tc_s, NULL), 0);
    assert_int_equal(d->ops->set_range(d, 26, NULL), 0);
    assert_int_equal(condition(d) & DETECTOR_UNSETTLED, 0);
    d->ops->free(d);
}

static void a_sample_near_full_scale_counts_as_saturated(void **state)
{
    struct scripted s;
    struct detector_sample sample;
    (void)state;
    scripted_init(&s, "\r", hear_and_snap);
    struct detector *d = open_on(&s.port);
    assert_int_equal(d->ops->set_range(d, 20, NULL), 0);
    snap_answer = "-0.00951,1000,0\r"; // of 10 mV; without monitor the wide shape comes first
    assert_int_equal(d->ops->sample(d, &sample, NULL), 0);
    assert_true(sample.signal_v == -0.00951);
    assert_int_equal(condition(d), DETECTOR_SATURATED);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

static void an_unplugged_instrument_comes_back(void **state)
{
    struct detector_sample s;
    char text[120];
    (void)state;
    struct detector *d = begin_ready(26);
    vline.hangup_ns = vline.clk.t_ns + MS(2);
    assert_int_equal(d->ops->sample(d, &s, NULL), GON_E_GONE);
    assert_int_equal(d->ops->sample(d, &s, NULL), GON_E_GONE);
    vline.hangup_ns = PORT_NEVER;
    assert_int_equal(d->ops->reopen(d, NULL), 0);
    assert_int_equal(d->ops->identify(d, text, sizeof text, NULL), 0);
    assert_int_equal(d->ops->sample(d, &s, NULL), 0);
    d->ops->free(d);
}

// Each sample's monitor is another value, so that an answer to an earlier question shows.
static int asked;

static void hear_and_count(struct scripted *s, const char *text, int64_t t_ns)
{
    char answer[80];
    const bool snap = strncmp(text, "SNAP", 4) == 0;
    asked += snap;
    snprintf(answer, sizeof answer, "%.4f,1000.00,%.4f%s\r", 0.0001 * (asked % 90),
             0.001 * (asked % 5000), strstr(text, ",2") ? ",0.001" : "");
    if (snap)
        scripted_say(s, answer, t_ns + MS(5));
    else
        hear_and_snap(s, text, t_ns);
}

// Without changed digits: no line protocol without a checksum can see those.
static void no_sample_is_another_ones(void **state)
{
    struct scripted s;
    struct gon_error err;
    int good = 0, wrong = 0;
    double tc_s;
    (void)state;
    scripted_init(&s, "\r", hear_and_count);
    noisy_init(&line, &s.port, 20240917, 0);
    line.late_most_ns = MS(340);
    line.double_most_ns = MS(340);
    struct detector *d = open_on(&line.port);
    struct detector_setup with_monitor = {.time_constant_s = 1e-5, .slope_db = 6, .monitor_aux = 1};
    assert_int_equal(d->ops->set_range(d, 20, &err), 0);
    assert_int_equal(d->ops->setup(d, &with_monitor, &tc_s, &err), 0);
    line.one_in = 10;
    line.only = 1u << NOISY_LOST | 1u << NOISY_LATE | 1u << NOISY_DOUBLED | 1u << NOISY_SPLIT;
    for (int i = 0; i < 5000; i++) {
        struct detector_sample sample;
        if (d->ops->sample(d, &sample, NULL) < 0)
            continue;
        good++;
        wrong += fabs(sample.monitor_v - 0.001 * (asked % 5000)) > 1e-9;
    }
    print_message("5000 samples, %llu faults: %d answered, %d of another question\n",
                  (unsigned long long)line.faults, good, wrong);
    assert_true(good > 4900);
    assert_int_equal(wrong, 0);
    d->ops->free(d);
}

// Time constants until 1e-2 ... 1e-6 of a step is left, for 6, 12, 18, 24 dB per octave.
static void settling_times_are_those_of_equal_poles(void **state)
{
    static const double table[4][5] = {{4.6, 6.9, 9.2, 11.5, 13.8},
                                       {6.6, 9.2, 11.8, 14.2, 16.7},
                                       {8.4, 11.2, 13.9, 16.6, 19.1},
                                       {10.0, 13.1, 15.9, 18.7, 21.4}};
    (void)state;
    for (int poles = 1; poles <= 4; poles++)
        for (int k = 0; k < 5; k++) {
            const double s = detector_settle_s(0.3, 6 * poles, pow(10, -2 - k));
            assert_true(fabs(s / 0.3 - table[poles - 1][k]) <= 0.05001);
        }
    assert_true(fabs(detector_settle_s(1, 6, exp(-3)) - 3) < 1e-12);
    assert_true(detector_settle_s(1, 12, 1) == 0 && detector_settle_s(1, 12, 7) == 0);
    assert_true(isnan(detector_settle_s(1, 12, 0)) && isnan(detector_settle_s(1, 30, 0.1)));
    assert_true(isnan(detector_settle_s(1, 7, 0.1)) && isnan(detector_settle_s(1, 0, 0.1)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_command_asks_for_answers_here),
        cmocka_unit_test(another_instrument_is_refused),
        cmocka_unit_test(the_time_constant_is_the_next_that_is_not_shorter),
        cmocka_unit_test(impossible_settings_are_refused),
        cmocka_unit_test(ranges_are_set_and_read_back),
        cmocka_unit_test(a_setting_that_does_not_take_is_an_error),
        cmocka_unit_test(a_sample_is_signal_frequency_and_monitor),
        cmocka_unit_test(what_is_no_reading_never_becomes_one),
        cmocka_unit_test(conditions_are_told_once),
        cmocka_unit_test(what_was_cleared_is_not_told),
        cmocka_unit_test(a_range_changed_at_the_front_panel_is_seen),
        cmocka_unit_test(a_condition_whose_answer_was_lost_is_told_as_unsettled),
        cmocka_unit_test(an_answer_too_many_amid_a_reading_is_told_as_unsettled),
        cmocka_unit_test(a_restart_is_survived_and_told_until_set_up_again),
        cmocka_unit_test(a_sample_near_full_scale_counts_as_saturated),
        cmocka_unit_test(an_unplugged_instrument_comes_back),
        cmocka_unit_test(no_sample_is_another_ones),
        cmocka_unit_test(settling_times_are_those_of_equal_poles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
