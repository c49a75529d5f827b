// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
#include "daemon/acquire.h"

#include "base/units.h"
#include "campaign/plan.h"
#include "campaign/store.h"
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
    struct acquire a;
    struct cancel *cancel;
};

static void warm(struct world_spec *spec)
{
    spec->laser.temperatures_s = 0;
    spec->laser.warmup_s = 1;
    spec->laser.drift_rms = spec->laser.rin_rms = 0;
}

// A laser that is on, the axes at theta_i = theta_r = 30 deg.
static int set_up(void **state)
{
    struct setting *s = calloc(1, sizeof *s);
    simbench_init(&s->b, warm);
    simconfig_bench(&s->bench);
    struct instrument_parts parts = simbench_parts(&s->b);
    assert_int_equal(instrument_new(&s->bench, &parts, &s->b.clk.clk, &s->in, NULL), 0);
    motion_init(&s->b.world.axis[WORLD_THETA_I], -10, 95, 0, 30);
    motion_init(&s->b.world.axis[WORLD_THETA_R], -185, 185, 0, 30);
    sim_laser_start(&s->b.world.laser, true);
    s->b.world.laser.setpoint_w = 0.05;
    clk_sleep(&s->b.clk.clk, CLK_S(10), NULL);
    world_see(&s->b.world, s->b.clk.t_ns);
    s->a = (struct acquire){.range = -1};
    acquire_begin(&s->a);
    s->cancel = cancel_new();
    *state = s;
    return 0;
}

static int tear_down(void **state)
{
    struct setting *s = *state;
    instrument_free(s->in);
    cancel_free(s->cancel);
    free(s);
    return 0;
}

static struct acquire_reading attempt(struct setting *s, int64_t since_ns)
{
    const struct acquire_wish wish = {.count = 4, .since_ns = since_ns, .monitor_least_v = 0.5};
    struct acquire_reading r;
    assert_int_equal(acquire_attempt(s->in, &s->a, &wish, s->cancel, &r, NULL), 0);
    return r;
}

// Attempts until one is accepted; how many it took.
static int reading(struct setting *s, int64_t since_ns, struct acquire_reading *ret)
{
    acquire_begin(&s->a);
    for (int n = 1; n < 40; n++) {
        *ret = attempt(s, since_ns);
        if (ret->accepted)
            return n;
        assert_true(ret->again);
    }
    fail();
    return 0;
}

static void spacing_for_each_slope(void **state)
{
    (void)state;
    // roots of the correlations in acquire.h at 0.05; the first is ln 20
    assert_true(fabs(plan_spacing_s(1, 6) - 2.995732) < 1e-5);
    assert_true(fabs(plan_spacing_s(1, 12) - 4.743865) < 1e-5);
    assert_true(fabs(plan_spacing_s(0.1, 12) - 0.4743865) < 1e-6);
    assert_true(plan_spacing_s(1, 18) > 4.8 && plan_spacing_s(1, 24) > plan_spacing_s(1, 18));
}

// The simulated filter, which knows nothing of that formula: 20,000 samples, so the estimate of the
// correlation has a standard deviation of 0.007; 5 of them is one false alarm in two million.
static void samples_so_spaced_are_correlated_by_a_twentieth(void **state)
{
    (void)state;
    for (int poles = 1; poles <= 4; poles++) {
        struct lockin l;
        lockin_init(&l, 1e-6, 42);
        l.time_constant_s = 1;
        l.poles = poles;
        l.full_scale_v = 1e-5;
        const int steps = 40;
        const double dt_s = plan_spacing_s(1, 6 * poles) / steps;
        double before = 0, cross = 0, squares = 0;
        const int n = 20000;
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < steps; k++)
                lockin_step(&l, 0, dt_s);
            const double x = l.x[poles - 1];
            cross += x * before;
            squares += x * x;
            before = x;
        }
        assert_true(fabs(cross / squares - 0.05) < 0.035);
    }
}

static void saturated_attempts_are_flagged_and_the_steps_up_double(void **state)
{
    struct setting *s = *state;
    s->a.range = 0;
    acquire_begin(&s->a);
    static const int ranges[] = {0, 1, 3, 7};
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++) {
        const struct acquire_reading r = attempt(s, 0);
        assert_int_equal(r.range, ranges[i]);
        assert_true(r.flags & STORE_SATURATED);
        assert_false(r.accepted);
        assert_true(r.again);
        assert_int_equal(r.count, 1); // more of them would say nothing more
    }
}

static void a_signal_far_below_the_range_is_read_again_further_down(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r = attempt(s, 0);
    assert_int_equal(r.range, 26);
    assert_int_equal(r.flags, STORE_UNDER_RANGE);
    assert_true(reading(s, 0, &r) <= 3);
    const double full_v = simbench_full_scale_v(NULL, r.range);
    assert_true(r.signal_v > ACQUIRE_POOR * full_v && r.signal_v < 0.95 * full_v);
    const struct optics_spec *o = &s->b.world.spec.optics;
    const double truth_v = 2e-7 + 16 * 0.05 * optics_f_per_sr(o, 30, 30) *
                                      optics_solid_angle_sr(o) * cos(UNITS_PI / 6);
    assert_true(fabs(r.signal_v / truth_v - 1) < 3e-4); // settling 1e-4; noise of the mean 3e-5
    assert_int_equal(r.count, 4);
    assert_true(r.signal_sd_v > 0 && r.signal_sd_v < 5 * 4.5e-9);
}

static void the_next_reading_begins_in_the_range_of_the_last(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    reading(s, 0, &r);
    assert_int_equal(reading(s, 0, &r), 1);
    const int64_t start_ns = s->b.clk.t_ns;
    assert_int_equal(reading(s, start_ns, &r), 1);
    const double s_taken = (double)(s->b.clk.t_ns - start_ns) * 1e-9;
    assert_true(fabs(s_taken - detector_settle_s(0.1, 12, 1e-4) - 3 * plan_spacing_s(0.1, 12)) <
                1e-6);
}

static void coming_down_a_steep_peak_is_waited_out(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    // in the beam, then at once on the sample: five orders of magnitude
    motion_init(&s->b.world.axis[WORLD_SAMPLE], -2, 35, 0, 30);
    motion_init(&s->b.world.axis[WORLD_THETA_I], -10, 95, 0, 0);
    motion_init(&s->b.world.axis[WORLD_THETA_R], -185, 185, 0, 180);
    clk_sleep(&s->b.clk.clk, CLK_S(10), NULL);
    reading(s, 0, &r);
    assert_true(r.signal_v > 0.5);
    world_see(&s->b.world, s->b.clk.t_ns);
    motion_init(&s->b.world.axis[WORLD_SAMPLE], -2, 35, 0, 0);
    motion_init(&s->b.world.axis[WORLD_THETA_I], -10, 95, 0, 30);
    motion_init(&s->b.world.axis[WORLD_THETA_R], -185, 185, 0, -70);
    s->a.range = 13; // 50 uV: nothing is to be learned on the way
    assert_int_equal(reading(s, s->b.clk.t_ns, &r), 1);
    const struct optics_spec *o = &s->b.world.spec.optics;
    const double truth_v = 2e-7 + 16 * 0.05 * optics_f_per_sr(o, 30, -70) *
                                      optics_solid_angle_sr(o) * cos(70 * UNITS_PI / 180);
    assert_true(truth_v < 2e-5);
    assert_true(fabs(r.signal_v - truth_v) < 5e-4 * truth_v + 5 * 2.3e-9);
}

static void a_lost_light_is_flagged_and_not_tried_again(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    reading(s, 0, &r);
    sim_laser_off(&s->b.world.laser);
    acquire_begin(&s->a);
    r = attempt(s, 0);
    assert_true(r.flags & STORE_MONITOR_LOW);
    assert_false(r.accepted || r.again);
}

static void unlock(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    (void)t_ns;
    s->b.world.lockin.condition |= LOCKIN_UNLOCKED;
}

static void a_lost_reference_is_tried_again(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    reading(s, 0, &r);
    acquire_begin(&s->a);
    s->b.clk.on_advance = unlock;
    s->b.clk.ctx = s;
    r = attempt(s, 0);
    s->b.clk.on_advance = NULL;
    assert_true(r.flags & STORE_UNLOCKED);
    assert_true(!r.accepted && r.again);
    r = attempt(s, 0); // the flag of before is sticky: it is cleared first
    assert_true(r.accepted);
}

static void unsettle(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    (void)t_ns;
    s->b.unsettled = true;
}

static void a_detector_that_somebody_touched_is_set_up_again(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    reading(s, 0, &r);
    acquire_begin(&s->a);
    const int setups = s->b.setups;
    s->b.clk.on_advance = unsettle;
    s->b.clk.ctx = s;
    r = attempt(s, 0);
    s->b.clk.on_advance = NULL;
    s->b.unsettled = false;
    assert_true(r.flags & STORE_UNSETTLED);
    assert_true(!r.accepted && r.again);
    r = attempt(s, 0);
    assert_true(r.accepted);
    assert_int_equal(s->b.setups, setups + 1);
}

// One sample has no scatter: 0. What was not measured has none either, and that is not 0.
static void one_sample_without_a_monitor_is_a_reading(void **state)
{
    struct setting *s = *state;
    s->b.no_monitor = true;
    const struct acquire_wish wish = {.count = 1, .monitor_least_v = (double)NAN};
    struct acquire_reading r;
    assert_int_equal(acquire_attempt(s->in, &s->a, &wish, s->cancel, &r, NULL), 0);
    assert_int_equal(r.count, 1);
    assert_true(r.signal_sd_v == 0 && isfinite(r.signal_v));
    assert_true(isnan(r.monitor_v) && isnan(r.monitor_sd_v));
}

static void a_cancel_ends_it(void **state)
{
    struct setting *s = *state;
    struct acquire_reading r;
    struct gon_error err;
    const struct acquire_wish wish = {.count = 4, .monitor_least_v = (double)NAN};
    cancel_request(s->cancel);
    assert_int_equal(acquire_attempt(s->in, &s->a, &wish, s->cancel, &r, &err), GON_E_CANCELED);
}

int main(void)
{
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spacing_for_each_slope),
        cmocka_unit_test(samples_so_spaced_are_correlated_by_a_twentieth),
        T(saturated_attempts_are_flagged_and_the_steps_up_double),
        T(a_signal_far_below_the_range_is_read_again_further_down),
        T(the_next_reading_begins_in_the_range_of_the_last),
        T(coming_down_a_steep_peak_is_waited_out),
        T(a_lost_light_is_flagged_and_not_tried_again),
        T(a_lost_reference_is_tried_again),
        T(a_detector_that_somebody_touched_is_set_up_again),
        T(one_sample_without_a_monitor_is_a_reading),
        T(a_cancel_ends_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
