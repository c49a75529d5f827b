// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// Detectors by their profiles (the SR830 has tests of its own): SR860, Keithley 6485, PM100,
// against the instruments that the same profiles simulate, and on bad lines.
#include "drivers/detector.h"

#include "drivers/message.h"
#include "drivers/transport.h"
#include "tests/unit/profiled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static const struct detector_setup setup = {
    .time_constant_s = 0.1, .slope_db = 24, .monitor_aux = 0, .wavelength_nm = 1064};

static struct detector *open_it(const char *profile)
{
    struct detector *d;
    struct gon_error err;
    profiled_begin(profiles_get(profile));
    if (detector_by_profile(profiled.profile, vline.link, profiled.clk, NULL, &d, &err) < 0)
        fail_msg("%s", err.text);
    return d;
}

static struct detector *begin_with(const char *profile, const struct detector_setup *s)
{
    char text[160];
    double tc_s;
    struct gon_error err;
    struct detector *d = open_it(profile);
    if (d->ops->identify(d, text, sizeof text, &err) < 0 || d->ops->setup(d, s, &tc_s, &err) < 0)
        fail_msg("%s: %s", profile, err.text);
    return d;
}

static struct detector *begin(const char *profile)
{
    return begin_with(profile, &setup);
}

static struct detector_sample sampled(struct detector *d)
{
    struct detector_sample s;
    struct gon_error err;
    if (d->ops->sample(d, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static unsigned condition(struct detector *d)
{
    unsigned flags = 0;
    struct gon_error err;
    if (d->ops->condition(d, &flags, &err) < 0)
        fail_msg("%s", err.text);
    return flags;
}

static void they_say_who_they_are(void **state)
{
    static const struct {
        const char *profile, *says;
    } rows[] = {
        {"sr860", "Stanford_Research_Systems,SR865A,002725,V1.47"},
        {"keithley-6485", "KEITHLEY INSTRUMENTS INC. MODEL 6485, serial 1012345, firmware B03"},
        {"thorlabs-pm100", "Thorlabs PM100D, serial P0012345, head S132C 210101"}};
    char text[160];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct detector *d = open_it(rows[i].profile);
        assert_int_equal(profiled.device.port.frames_in, 0); // opening sends nothing
        assert_int_equal(d->ops->identify(d, text, sizeof text, NULL), 0);
        assert_string_equal(text, rows[i].says);
        d->ops->free(d);
    }
}

static void what_cannot_measure_is_refused(void **state)
{
    static const struct {
        const char *profile, *change, *says;
    } rows[] = {{"sr860", "model = SR844", "not an SR860"},
                {"keithley-6485", "model = 'MODEL 6517'", "not a 6485"},
                {"thorlabs-pm100", "head_flags = 2", "does not measure power"}};
    char text[160];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct gon_error err;
        struct detector *d = open_it(rows[i].profile);
        profiled_do(rows[i].change);
        assert_int_equal(d->ops->identify(d, text, sizeof text, &err), GON_E_DEVICE);
        assert_non_null(strstr(err.text, rows[i].says));
        d->ops->free(d);
    }
}

static void settings_arrive(void **state)
{
    double tc_s = 0;
    (void)state;
    struct detector *d = begin("sr860");
    assert_float_equal(profiled_number("time_constant_s"), 0.1, 0);
    assert_float_equal(profiled_number("slope_db"), 24, 0);
    struct detector_setup s = {.time_constant_s = 0.11, .slope_db = 6};
    assert_int_equal(d->ops->setup(d, &s, &tc_s, NULL), 0);
    assert_true(tc_s == 0.3);
    d->ops->free(d);
    d = begin("thorlabs-pm100");
    profiled_do("wavelength_nm = 633");
    assert_int_equal(d->ops->setup(d, &setup, &tc_s, NULL), 0);
    assert_float_equal(profiled_number("wavelength_nm"), 1064, 0);
    assert_true(tc_s == 0.05); // its own
    d->ops->free(d);
    d = begin("keithley-6485");
    assert_int_equal(d->ops->setup(d, &setup, &tc_s, NULL), 0);
    assert_true(tc_s == 0.02);
    d->ops->free(d);
}

static void settings_it_has_not_are_refused(void **state)
{
    static const struct {
        const char *profile;
        struct detector_setup setup;
    } rows[] = {{"sr860", {0.1, 13, 0, 0}},         {"sr860", {1e5, 12, 0, 0}},
                {"sr860", {0.1, 12, 5, 0}},         {"sr860", {0, 12, 0, 0}},
                {"keithley-6485", {0.1, 12, 1, 0}}, {"thorlabs-pm100", {0.1, 12, 0, 20}}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        double tc_s = 42;
        struct gon_error err;
        struct detector *d = open_it(rows[i].profile);
        assert_int_equal(d->ops->setup(d, &rows[i].setup, &tc_s, &err), GON_E_INPUT);
        assert_true(tc_s == 42);
        assert_int_equal(profiled.device.port.frames_in, 0);
        d->ops->free(d);
    }
}

static void ranges_go_from_the_most_sensitive_and_are_set(void **state)
{
    static const struct {
        const char *profile;
        int ranges;
        double least, most;
        const char *dark; // fits every range
    } rows[] = {{"sr860", 28, 1e-9, 1.0, "x = 0"},
                {"keithley-6485", 8, 2e-9, 2e-2, "current_a = 0"},
                {"thorlabs-pm100", 9, 1e-8, 1.0, "power_w = 0"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct gon_error err;
        struct detector *d = begin(rows[i].profile);
        const int count = d->ops->ranges(d);
        assert_int_equal(count, rows[i].ranges);
        assert_true(d->ops->full_scale_v(d, 0) == rows[i].least);
        assert_true(d->ops->full_scale_v(d, count - 1) == rows[i].most);
        profiled_do(rows[i].dark);
        condition(d);
        for (int range = 0; range < count; range++) {
            const double full = d->ops->full_scale_v(d, range);
            if (d->ops->set_range(d, range, &err) < 0)
                fail_msg("%s: %s", rows[i].profile, err.text);
            assert_true(fabs(profiled_number("full_scale") - full) <= 1e-9 * full);
            assert_int_equal(condition(d), 0);
        }
        d->ops->free(d);
    }
}

static void a_range_changed_at_the_front_panel_is_seen(void **state)
{
    static const struct {
        const char *profile, *change;
    } rows[] = {{"sr860", "full_scale = 0.5"},
                {"keithley-6485", "full_scale = 2e-6"},
                {"thorlabs-pm100", "range_w = 1e-5"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct detector *d = begin(rows[i].profile);
        assert_int_equal(d->ops->set_range(d, d->ops->ranges(d) - 1, NULL), 0);
        assert_int_equal(condition(d), 0);
        profiled_do(rows[i].change);
        assert_int_equal(condition(d), DETECTOR_UNSETTLED);
        assert_int_equal(condition(d), DETECTOR_UNSETTLED); // until it is set again
        d->ops->free(d);
    }
}

static void a_sample_is_what_it_says(void **state)
{
    (void)state;
    struct detector *d = begin("keithley-6485");
    assert_true(fabs(sampled(d).signal_v - 1.04e-6) < 1e-12);
    assert_true(isnan(sampled(d).monitor_v) && isnan(sampled(d).reference_hz));
    d->ops->free(d);
    d = begin("thorlabs-pm100");
    assert_true(fabs(sampled(d).signal_v - 1.23456789e-3) < 1e-12);
    d->ops->free(d);
    struct detector_setup with_monitor = setup;
    with_monitor.monitor_aux = 2;
    d = begin_with("sr860", &with_monitor);
    for (int i = 0; i < 4; i++) { // in both shapes
        const struct detector_sample s = sampled(d);
        assert_true(fabs(s.signal_v - 0.001) < 1e-9 && fabs(s.monitor_v - 0.5) < 1e-9);
        assert_true(s.reference_hz == 1000);
    }
    d->ops->free(d);
}

static void overloads_are_told_once(void **state)
{
    struct gon_error err;
    (void)state;
    struct detector *d = begin("sr860");
    assert_int_equal(d->ops->set_range(d, 27, NULL), 0);
    condition(d);
    profiled_do("lias.input = 1");
    assert_int_equal(condition(d), DETECTOR_SATURATED);
    assert_int_equal(condition(d), 0);
    profiled_do("lias.unlocked = 1");
    assert_int_equal(condition(d), DETECTOR_UNLOCKED);
    profiled_do("lias.input = 1");
    assert_int_equal(d->ops->clear(d, &err), 0);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

// Beyond its range there is no number; the full scale stands for it, flagged.
static void beyond_the_range_is_saturated_and_never_a_number(void **state)
{
    static const struct {
        const char *profile, *over, *invalid;
        int range;
        double full;
    } rows[] = {{"keithley-6485", "current_a = 9.9e37, status.overflow = 1", "current_a = 9.91e37",
                 3, 2e-6},
                {"thorlabs-pm100", "power_w = 9.9e37", "power_w = 9.91e37", 5, 1e-3}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct gon_error err;
        struct detector_sample s = {42, 42, 42};
        struct detector *d = begin(rows[i].profile);
        assert_int_equal(d->ops->set_range(d, rows[i].range, NULL), 0);
        condition(d);
        profiled_do(rows[i].over);
        s = sampled(d);
        assert_true(fabs(s.signal_v - rows[i].full) < 1e-9 * rows[i].full);
        assert_int_equal(condition(d), DETECTOR_SATURATED);
        assert_int_equal(condition(d), 0);
        profiled_do(rows[i].invalid);
        s.signal_v = 42;
        assert_int_equal(d->ops->sample(d, &s, &err), GON_E_LINK);
        assert_true(s.signal_v == 42);
        d->ops->free(d);
    }
}

static void bits_that_come_with_a_reading_are_told(void **state)
{
    (void)state;
    struct detector *d = begin("keithley-6485");
    assert_int_equal(d->ops->set_range(d, 7, NULL), 0);
    condition(d);
    profiled_do("status.zero_check = 1");
    sampled(d);
    profiled_do("status.zero_check = 0");
    sampled(d);
    assert_int_equal(condition(d), DETECTOR_UNSETTLED); // of one of the two
    sampled(d);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

static void a_range_settles_before_it_is_believed(void **state)
{
    (void)state;
    struct detector *d = begin("keithley-6485");
    assert_int_equal(d->ops->set_range(d, 3, NULL), 0);
    const int64_t set_ns = vline.clk.t_ns;
    sampled(d);
    assert_true(vline.clk.t_ns - set_ns >= CLK_MS(100));
    const int64_t next_ns = vline.clk.t_ns;
    sampled(d);
    assert_true(vline.clk.t_ns - next_ns < CLK_MS(50));
    d->ops->free(d);
}

// What it refuses stands in its error queue; the command's own answer does not say so.
static void a_refused_setting_is_named_by_the_error_queue(void **state)
{
    static const struct {
        const char *profile, *does, *says;
    } rows[] = {{"keithley-6485", "error = -222", "error is -222"},
                {"thorlabs-pm100", "error = 2", "(out of range)"},
                {"sr860", "esr.execution = 1", "(bad parameter)"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct gon_error err;
        struct detector *d = begin(rows[i].profile);
        profiled_do(rows[i].does);
        assert_int_equal(d->ops->set_range(d, 3, &err), GON_E_DEVICE);
        assert_non_null(strstr(err.text, rows[i].says));
        assert_non_null(strstr(err.text, "refuses '"));
        assert_int_equal(d->ops->set_range(d, 3, &err), 0); // the queue was emptied
        d->ops->free(d);
    }
}

static void a_restart_is_told_until_set_up_again(void **state)
{
    double tc_s;
    (void)state;
    struct detector *d = begin("sr860");
    assert_int_equal(d->ops->set_range(d, 27, NULL), 0);
    assert_int_equal(condition(d), 0);
    actor_power_cycle(&profiled.actor, vline.clk.t_ns);
    sampled(d);
    assert_int_equal(condition(d) & DETECTOR_UNSETTLED, DETECTOR_UNSETTLED);
    assert_int_equal(condition(d) & DETECTOR_UNSETTLED, DETECTOR_UNSETTLED);
    assert_int_equal(d->ops->setup(d, &setup, &tc_s, NULL), 0);
    assert_int_equal(d->ops->set_range(d, 27, NULL), 0);
    assert_int_equal(condition(d), 0);
    d->ops->free(d);
}

static void an_unplugged_one_comes_back(void **state)
{
    struct detector_sample s;
    char text[160];
    struct detector_setup with_monitor = setup;
    (void)state;
    with_monitor.monitor_aux = 2;
    struct detector *d = begin_with("sr860", &with_monitor);
    vline.hangup_ns = vline.clk.t_ns + CLK_MS(1);
    assert_int_equal(d->ops->sample(d, &s, NULL), GON_E_GONE);
    vline.hangup_ns = PORT_NEVER;
    assert_int_equal(d->ops->reopen(d, NULL), 0);
    assert_int_equal(d->ops->identify(d, text, sizeof text, NULL), 0);
    assert_true(fabs(sampled(d).monitor_v - 0.5) < 1e-9);
    d->ops->free(d);
}

// --- many readings under faults ------------------------------------------------------------------

// Each reading is another one: a value of its own for each question that asks for it.
struct counting {
    struct port port; // first
    int asked;
};

static struct counting counting;

static void counting_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    uint8_t reply[PORT_REPLY_MOST];
    int64_t due_ns = t_ns;
    const bool asks = memmem(bytes, size, "SNAP", 4) || memmem(bytes, size, "READ", 4);
    char text[80];
    if (asks) {
        counting.asked++;
        snprintf(text, sizeof text, "%s = %.4e",
                 profile_value(profiled.profile, "x") >= 0 ? "x" : "current_a",
                 1e-6 * (counting.asked % 9000));
        profiled_do(text);
    }
    port_feed(&profiled.device.port, bytes, size, t_ns);
    for (size_t n; (n = port_take(&profiled.device.port, PORT_NEVER - 1, reply, &due_ns)) > 0;)
        port_send(p, reply, n, due_ns > t_ns ? due_ns : t_ns);
}

static void count_on(const char *profile)
{
    static const struct port_ops ops = {counting_feed, scripted_nothing, scripted_hangup};
    memset(&counting, 0, sizeof counting);
    port_init(&counting.port, &ops);
    (void)profile;
    profiled.line.inner = &counting.port;
}

static void fail_often(void)
{
    profiled.line.one_in = 10;
    profiled.line.only = 1u << NOISY_LOST | 1u << NOISY_LATE | 1u << NOISY_DOUBLED |
                         1u << NOISY_SPLIT | 1u << NOISY_CUT | 1u << NOISY_BEFORE;
    profiled.line.late_most_ns = CLK_MS(340);
    profiled.line.double_most_ns = CLK_MS(340);
    print_message("seed %llu\n", (unsigned long long)profiled.line.dice);
}

// Without any protection: writes, and takes the first number of the next line.
static int ask_bluntly(struct transport *t, const char *query, char end, double *ret_value)
{
    char line[256];
    size_t have = 0;
    const int64_t deadline_ns = vline.clk.t_ns + CLK_MS(300);
    transport_write(t, query, strlen(query), deadline_ns, NULL);
    while (have < sizeof line - 1 && (have == 0 || line[have - 1] != end)) {
        int rc = transport_read(t, line + have, 1, deadline_ns, NULL);
        if (rc < 0)
            return rc;
        have++;
    }
    line[strcspn(line, "A,")] = 0;
    return message_number(line, ret_value, NULL);
}

static int wrong_bluntly(const char *query)
{
    struct transport *t;
    struct gon_error err;
    int wrong = 0;
    if (transport_open(vline.link, profiled.clk, NULL, &t, &err) < 0)
        fail_msg("%s", err.text);
    for (int i = 0; i < 5000; i++) {
        double value;
        if (ask_bluntly(t, query, '\n', &value) == 0)
            wrong += fabs(value - 1e-6 * (counting.asked % 9000)) > 1e-12;
    }
    transport_close(t);
    return wrong;
}

static void no_sample_is_another_ones(void **state)
{
    static const struct {
        const char *profile, *query;
    } rows[] = {{"sr860", "SNAP? 0,16\n"}, {"keithley-6485", "READ?\r"}};
    (void)state;
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        int good = 0, wrong = 0;
        struct detector *d = begin(rows[k].profile);
        assert_int_equal(d->ops->set_range(d, d->ops->ranges(d) - 1, NULL), 0);
        count_on(rows[k].profile);
        fail_often();
        for (int i = 0; i < 5000; i++) {
            struct detector_sample s;
            if (d->ops->sample(d, &s, NULL) < 0)
                continue;
            good++;
            wrong += fabs(s.signal_v - 1e-6 * (counting.asked % 9000)) > 1e-12;
        }
        d->ops->free(d);
        const int bluntly = wrong_bluntly(rows[k].query);
        print_message("%s, 5000 samples, %llu faults: %d answered, %d of another question; without "
                      "protection %d\n",
                      rows[k].profile, (unsigned long long)profiled.line.faults, good, wrong,
                      bluntly);
        assert_true(good > 4900);
        assert_int_equal(wrong, 0);
        assert_true(bluntly > 100);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(they_say_who_they_are),
        cmocka_unit_test(what_cannot_measure_is_refused),
        cmocka_unit_test(settings_arrive),
        cmocka_unit_test(settings_it_has_not_are_refused),
        cmocka_unit_test(ranges_go_from_the_most_sensitive_and_are_set),
        cmocka_unit_test(a_range_changed_at_the_front_panel_is_seen),
        cmocka_unit_test(a_sample_is_what_it_says),
        cmocka_unit_test(overloads_are_told_once),
        cmocka_unit_test(beyond_the_range_is_saturated_and_never_a_number),
        cmocka_unit_test(bits_that_come_with_a_reading_are_told),
        cmocka_unit_test(a_range_settles_before_it_is_believed),
        cmocka_unit_test(a_refused_setting_is_named_by_the_error_queue),
        cmocka_unit_test(a_restart_is_told_until_set_up_again),
        cmocka_unit_test(an_unplugged_one_comes_back),
        cmocka_unit_test(no_sample_is_another_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
