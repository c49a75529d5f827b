// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// A detector of its own as monitor: read with each sample, its range, and what is wrong with it.
#include "daemon/acquire.h"
#include "daemon/instrument_devices.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "tests/unit/simrun.h"

static struct run *begin_monitored(double full_scale)
{
    struct world_spec spec;
    struct bench_config bench;
    world_defaults(&spec);
    quick_laser(&spec);
    simconfig_bench(&bench);
    simdevices_monitor(&bench);
    bench.monitor.full_scale = full_scale;
    bench.laser.warmup_s = 5;
    struct run *r = begin_on(&spec, &bench);
    tiny_plan(r);
    return r;
}

static const struct store_reading *row_of_kind(const struct run *r, enum plan_kind kind)
{
    for (int i = 0; i < r->rows; i++)
        if (is_accepted(&r->row[i]) && point_of(r, r->row[i].sweep, r->row[i].point)->kind == kind)
            return &r->row[i];
    fail_msg("no such row");
    return NULL;
}

static int attempts_with(const struct run *r, unsigned flag)
{
    int n = 0;
    for (int i = 0; i < r->rows; i++)
        n += (r->row[i].flags & flag) != 0;
    return n;
}

// After the opening beam.
static bool is_then(const struct run *r)
{
    return r->row[r->rows - 1].sweep == 0 && r->row[r->rows - 1].point == 2;
}

static void a_campaign_has_its_values_and_its_range_follows_the_light(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    const struct simmonitor *m = &r->devices.monitor;
    assert_true(m->wavelength_nm == 1064);
    assert_int_equal(m->range, 6); // the least sensitive until there is light
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 0);
    const double lit_w = SIMMONITOR_W_PER_V * r->b.world.spec.monitor_v_per_w * 0.05;
    assert_true(fabs(row_of_kind(r, PLAN_SAMPLE)->monitor_v - lit_w) < 0.02 * lit_w);
    assert_true(fabs(row_of_kind(r, PLAN_DARK)->monitor_v) < 2e-3 * lit_w);
    assert_true(simmonitor_full_scale(NULL, m->range) >= 2 * lit_w);
    assert_true(simmonitor_full_scale(NULL, m->range - 1) < 2 * lit_w);
    for (int i = 0; i < r->plan.count; i++)
        if (r->points[i].kind == PLAN_SAMPLE)
            assert_true(fabs(r->f_per_sr[i] / f_of(r, &r->points[i]) - 1) < 0.01);
    end(r);
}

static void pause_and_resume(struct run *r)
{
    if (!is_then(r) || r->pauses_count)
        return;
    r->want_pause = true;
    r->devices.monitor.times = 1.9; // 3.8 mW: another range, if it were chosen now
}

static void its_range_is_kept_when_the_laser_comes_on_again(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    r->devices.monitor.times = 2.6; // 5.2 mW do not fit twice into 10 mW
    r->on_row = pause_and_resume;
    assert_int_equal(go(r), RUN_DONE);
    assert_int_equal(r->pauses_count, 1);
    assert_int_equal(r->b.ons, 2);
    assert_int_equal(r->devices.monitor.range, 5); // 100 mW, as at first
    end(r);
}

static void with_a_full_scale_the_range_stands_from_the_start(void **state)
{
    (void)state;
    struct run *r = begin_monitored(5e-3);
    const struct simmonitor *m = &r->devices.monitor;
    assert_int_equal(m->range, 4); // 10 mW
    const int changes = m->range_changes;
    assert_int_equal(go(r), RUN_DONE);
    assert_int_equal(m->range, 4);
    assert_int_equal(m->range_changes, changes);
    end(r);
}

static void it_is_read_directly_after_the_detector(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    struct detector_sample s;
    r->b.step_delay_s = 0.001;
    const int samples = r->devices.monitor.samples;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(instrument_sample(r->in, &s, NULL), 0);
        assert_int_equal(r->devices.monitor.samples, samples + i + 1);
        assert_true(isfinite(s.monitor_v));
    }
    end(r);
}

// 50 ms, 12 dB per octave: 11.8 time constants to 1e-4; the detector's 1 ms need 12 ms.
static void a_slow_one_settles_after_a_change_of_the_source_only(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    struct acquire a = {.range = -1};
    struct acquire_reading reading;
    r->bench.detector.time_constant_s = 0.001;
    assert_int_equal(instrument_set_up(r->in, NULL), 0);
    const int64_t before_ns = r->b.clk.t_ns;
    struct acquire_wish wish = {2, before_ns, before_ns, (double)NAN};
    assert_int_equal(acquire_attempt(r->in, &a, &wish, NULL, &reading, NULL), 0);
    assert_true(r->b.clk.t_ns - before_ns >= CLK_S(0.58));
    const int64_t then_ns = r->b.clk.t_ns;
    wish.since_ns = then_ns; // an axis came
    assert_int_equal(acquire_attempt(r->in, &a, &wish, NULL, &reading, NULL), 0);
    assert_true(r->b.clk.t_ns - then_ns < CLK_S(0.1));
    end(r);
}

static void brighten(struct run *r)
{
    if (is_then(r))
        r->devices.monitor.times = 20;
}

static void a_saturated_monitor_discards_the_attempt_and_goes_one_range_up(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    r->on_row = brighten;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 0);
    assert_int_equal(attempts_with(r, STORE_DISCARDED), 1);
    end(r);
}

static void one_that_lost_its_settings_is_set_up_again(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    const int setups = r->devices.monitor.setups;
    r->devices.monitor.restarts = 1;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(attempts_with(r, STORE_DISCARDED), 1);
    assert_int_equal(r->devices.monitor.setups, setups + 1);
    end(r);
}

static void saturate_for_good(struct run *r)
{
    if (is_then(r))
        r->devices.monitor.times = 1e9;
}

static void stop_there(struct run *r)
{
    cancel_request(r->cancel);
}

static void one_beyond_every_range_pauses_the_run(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    r->on_row = saturate_for_good;
    r->on_pause = stop_there;
    assert_int_equal(go(r), RUN_STOPPED);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "monitor: beyond its range"));
    assert_int_equal(accepted_of(r, &r->points[2]), 0);
    end(r);
}

static void one_that_sees_no_light_is_named_before_anything_is_measured(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    r->devices.monitor.times = 0;
    r->on_pause = stop_there;
    assert_int_equal(go(r), RUN_STOPPED);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "the monitor reads 0 V as in the dark"));
    assert_int_equal(accepted_of(r, &r->points[2]), 0);
    end(r);
}

static void what_is_no_number_is_asked_again_and_never_stored(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    r->devices.monitor.nonsense = 2;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    for (int i = 0; i < r->rows; i++)
        assert_true(isfinite(r->row[i].monitor_v));
    end(r);
}

static void unplug(struct run *r)
{
    if (is_then(r) && !r->pauses_count)
        r->b.gone_until_ns[SIMBENCH_MONITOR] = r->b.clk.t_ns + CLK_S(30);
}

static void an_unplugged_one_pauses_the_run_until_it_is_back(void **state)
{
    (void)state;
    struct run *r = begin_monitored(0);
    struct instrument_snapshot s;
    r->on_row = unplug;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "monitor"));
    instrument_snapshot(r->in, &s);
    assert_int_equal(s.part[PART_MONITOR].link, PART_OK);
    assert_int_equal(s.part[PART_MONITOR].returns, 1);
    assert_string_equal(s.part[PART_MONITOR].identity, "simulated power meter");
    assert_true(s.monitor_range >= 0 && s.monitor_full_scale > 0);
    end(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_campaign_has_its_values_and_its_range_follows_the_light),
        cmocka_unit_test(its_range_is_kept_when_the_laser_comes_on_again),
        cmocka_unit_test(with_a_full_scale_the_range_stands_from_the_start),
        cmocka_unit_test(it_is_read_directly_after_the_detector),
        cmocka_unit_test(a_slow_one_settles_after_a_change_of_the_source_only),
        cmocka_unit_test(a_saturated_monitor_discards_the_attempt_and_goes_one_range_up),
        cmocka_unit_test(one_that_lost_its_settings_is_set_up_again),
        cmocka_unit_test(one_beyond_every_range_pauses_the_run),
        cmocka_unit_test(one_that_sees_no_light_is_named_before_anything_is_measured),
        cmocka_unit_test(what_is_no_number_is_asked_again_and_never_stored),
        cmocka_unit_test(an_unplugged_one_pauses_the_run_until_it_is_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
