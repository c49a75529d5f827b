// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// Shutter and filter wheel in a run: set, read back, stuck, turned by hand, unplugged.
#include "daemon/instrument_devices.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "tests/unit/simrun.h"

#define PART_SHUTTER PART_DEVICES
#define PART_WHEEL (PART_DEVICES + 1)

static struct bench_device *device_of(struct run *r, int i)
{
    return &r->bench.devices[i];
}

static struct run *begin_with(void (*tune)(struct bench_config *b))
{
    struct world_spec spec;
    struct bench_config bench;
    world_defaults(&spec);
    quick_laser(&spec);
    simconfig_bench(&bench);
    simdevices_add(&bench, "shutter", BENCH_SHUTTER, "open");
    simdevices_add(&bench, "nd", BENCH_FILTER, "1");
    if (tune)
        tune(&bench);
    bench.laser.warmup_s = 5;
    struct run *r = begin_on(&spec, &bench);
    small_plan(r);
    return r;
}

static int flagged(const struct run *r, unsigned flag)
{
    int n = 0;
    for (int i = 0; i < r->rows; i++)
        n += (r->row[i].flags & flag) != 0;
    return n;
}

static bool last_is(const struct run *r, int sweep, int point)
{
    const struct store_reading *row = &r->row[r->rows - 1];
    return row->sweep == sweep && row->point == point && is_accepted(row);
}

static void assert_values(const struct run *r)
{
    for (int i = 0; i < r->plan.count; i++)
        if (r->points[i].kind == PLAN_SAMPLE)
            assert_true(fabs(r->f_per_sr[i] / f_of(r, &r->points[i]) - 1) < 0.01);
}

// --- setting ----------------------------------------------------------------------------------

static void each_stands_where_it_measures_and_the_shutter_closes_at_the_end(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    assert_int_equal(r->devices.shutter.at, 1); // nothing moves before there is a run
    assert_int_equal(r->devices.wheel.at, 2);
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 0);
    assert_int_equal(r->devices.shutter.at, 1);
    assert_int_equal(r->devices.shutter.moves, 2);
    assert_int_equal(r->devices.wheel.at, 0);
    assert_int_equal(r->devices.wheel.moves, 1);
    assert_true(r->devices.wheel.looks > r->rows); // after each attempt
    end(r);
}

static bool dark_with_laser_on;

static void watch_darks(struct run *r)
{
    const struct plan_point *p = point_of(r, r->row[r->rows - 1].sweep, r->row[r->rows - 1].point);
    if (p->kind == PLAN_DARK && emits(r))
        dark_with_laser_on = true;
    if (p->kind == PLAN_DARK && r->b.world.lets_out > 0)
        violate(r, "a dark with the shutter open");
}

static void darks(struct bench_config *b)
{
    b->devices[0].darks = true;
}

static void with_darks_the_shutter_makes_them_and_the_laser_stays_on(void **state)
{
    (void)state;
    struct run *r = begin_with(darks);
    r->on_row = watch_darks;
    dark_with_laser_on = false;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_true(dark_with_laser_on); // the last one
    assert_int_equal(r->b.ons, 1);
    assert_int_equal(r->pauses_count, 0);
    end(r);
}

static void a_dark_between_the_sweeps_costs_no_warm_up(void **state)
{
    (void)state;
    struct run *r = begin_with(darks);
    r->plan.count = 0;
    r->plan.sweeps = 2;
    add_point(r, 0, 1, PLAN_DARK, 0, 0);
    add_point(r, 0, 2, PLAN_BEAM, 0, 180);
    add_point(r, 1, 1, PLAN_SAMPLE, 10, 20);
    add_point(r, 1, 2, PLAN_DARK, 0, 0);
    add_point(r, 2, 1, PLAN_SAMPLE, 10, 40);
    r->on_row = watch_darks;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->b.ons, 1);
    end(r);
}

// --- stations ---------------------------------------------------------------------------------

static void filtered_beam(struct bench_config *b)
{
    struct bench_place *p = &b->stations[0].places[b->stations[0].places_count++];
    snprintf(p->name, sizeof p->name, "nd");
    snprintf(p->position, sizeof p->position, "2");
    p->transmission = 0.1; // simdevices.h
}

static void before_the_monitor(struct bench_config *b)
{
    b->devices[0] = b->devices[1]; // no shutter
    b->devices_count = 1;
    filtered_beam(b);
    b->stations[0].places[0].transmission = 1;
}

// The monitor falls to a tenth at the beam: that is not the light lost.
static void a_filter_before_the_monitor_takes_nothing_from_the_value(void **state)
{
    (void)state;
    struct run *r = begin_with(before_the_monitor);
    r->devices.wheel.is_shutter = true; // it cuts the source's light
    r->b.world.lets_in = 1;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 0);
    end(r);
}

// Warm before the filter came in.
static void a_filter_before_the_monitor_is_no_light_lost(void **state)
{
    (void)state;
    struct run *r = begin_with(before_the_monitor);
    r->devices.wheel.is_shutter = true;
    r->b.world.lets_in = 1;
    r->plan.count = 0;
    r->plan.sweeps = 1;
    add_point(r, 0, 1, PLAN_DARK, 0, 0);
    add_point(r, 1, 1, PLAN_SAMPLE, 10, 20);
    add_point(r, 2, 1, PLAN_BEAM, 0, 180);
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 0);
    end(r);
}

// Says that it is open, and is not: the monitor knows.
static void lie(struct run *r)
{
    if (last_is(r, 1, 2)) // a dark
        r->devices.shutter.passes[0] = 0.2;
}

static void mend_shutter(struct run *r)
{
    r->devices.shutter.passes[0] = 1;
    simselector_turn(&r->devices.shutter, r->devices.shutter.at);
}

static void a_shutter_that_only_says_open_is_light_lost(void **state)
{
    (void)state;
    struct run *r = begin_with(darks);
    r->plan.count = 0;
    r->plan.sweeps = 2;
    add_point(r, 0, 1, PLAN_DARK, 0, 0);
    add_point(r, 0, 2, PLAN_BEAM, 0, 180);
    add_point(r, 1, 1, PLAN_SAMPLE, 10, 20);
    add_point(r, 1, 2, PLAN_DARK, 0, 0);
    add_point(r, 2, 1, PLAN_SAMPLE, 10, 40);
    r->on_row = lie;
    r->on_pause = mend_shutter;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "the monitor fell"));
    end(r);
}

// The detector sees the beam only with the filter in.
static void watch_beam(struct run *r)
{
    const double theta_r = motion_at(&r->b.world.axis[WORLD_THETA_R], r->b.clk.t_ns).load;
    if (fabs(fabs(theta_r) - 180) < 2 && is_lit(r) && r->devices.wheel.at != 1)
        violate(r, "the beam without its filter");
}

static void a_station_has_its_filter_before_the_axes_come_and_until_they_left(void **state)
{
    (void)state;
    struct run *r = begin_with(filtered_beam);
    r->on_time = watch_beam;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->devices.wheel.at, 0);
    assert_int_equal(r->devices.wheel.moves, 5); // 1, 2 beam, 1, 2 beam, 1
    assert_values(r);                            // the beam was a tenth
    end(r);
}

static void pause_at_the_beam(struct run *r)
{
    if (last_is(r, 0, 2) && r->pauses_count == 0)
        r->want_pause = true;
}

static void after_a_pause_at_the_beam_the_light_waits_until_they_left(void **state)
{
    (void)state;
    struct run *r = begin_with(filtered_beam);
    r->on_time = watch_beam;
    r->on_row = pause_at_the_beam;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    end(r);
}

// --- what goes wrong --------------------------------------------------------------------------

static void turn_wheel(struct run *r)
{
    if (last_is(r, 1, 2))
        simselector_turn(&r->devices.wheel, 1);
}

static void a_wheel_turned_by_hand_costs_an_attempt_and_no_value(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->on_row = turn_wheel;
    r->devices.wheel.passes[1] = 0.7; // so that no change of range makes it settle
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(flagged(r, STORE_DISCARDED), 1);
    assert_int_equal(r->pauses_count, 0);
    assert_int_equal(r->devices.wheel.at, 0);
    end(r);
}

static void keep_turning_wheel(struct run *r)
{
    if (r->row[r->rows - 1].sweep == 1 && r->pauses_count == 0)
        r->devices.wheel.slips = true;
}

static void operator_mends(struct run *r)
{
    r->devices.wheel.slips = r->devices.wheel.stuck = r->devices.shutter.stuck = false;
    if (!r->devices.shutter.is_shutter || emits(r))
        violate(r, "light in a pause");
}

static void one_that_strays_again_pauses_the_run(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->on_row = keep_turning_wheel;
    r->on_pause = operator_mends;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "nd: is at '2' and not at '1' again; look at it"));
    assert_int_equal(flagged(r, STORE_DISCARDED), 2);
    end(r);
}

static void turn_between_sweeps(struct run *r)
{
    if (last_is(r, 1, 5))
        simselector_turn(&r->devices.wheel, 2);
}

static void all_are_read_back_before_each_sweep(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->on_row = turn_between_sweeps;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(flagged(r, STORE_DISCARDED), 0);
    assert_int_equal(r->devices.wheel.moves, 2);
    end(r);
}

static void stuck_shutter_first(struct run *r)
{
    if (r->pauses_count)
        r->devices.shutter.stuck = false;
}

static void a_shutter_that_does_not_open_is_told_before_there_is_light(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->devices.shutter.stuck = true;
    r->on_pause = stuck_shutter_first;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "shutter: does not go to 'open'; is it stuck?; look"));
    assert_int_equal(r->b.ons, 1);
    end(r);
}

static void shut(struct run *r)
{
    if (last_is(r, 1, 2))
        simselector_turn(&r->devices.shutter, 1);
}

static void a_shutter_that_closes_by_itself_switches_off_and_pauses(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->on_row = shut;
    r->on_pause = operator_mends;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "shutter: is at 'closed' and not at 'open'; look"));
    assert_int_equal(r->b.ons, 2);
    end(r);
}

static void leaks(struct bench_config *b)
{
    darks(b);
}

static void leak(struct run *r)
{
    if (last_is(r, 3, 1)) // the beam before the last dark
        r->devices.shutter.passes[1] = 1;
    if (r->pauses_count)
        r->devices.shutter.passes[1] = 0;
}

static void seal(struct run *r)
{
    r->devices.shutter.passes[1] = 0;
    simselector_turn(&r->devices.shutter, r->devices.shutter.at);
}

static void light_behind_a_shutter_that_says_closed_is_no_dark(void **state)
{
    (void)state;
    struct run *r = begin_with(leaks);
    r->on_row = leak;
    r->on_pause = seal;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "shutter: says 'closed', but the monitor still sees"));
    end(r);
}

static void unplug_wheel(struct run *r)
{
    if (!last_is(r, 1, 2) || r->b.gone_until_ns[SIMBENCH_WHEEL])
        return;
    r->b.gone_until_ns[SIMBENCH_WHEEL] = r->b.clk.t_ns + CLK_S(20);
    simselector_turn(&r->devices.wheel, 2); // and comes back elsewhere
}

static void an_unplugged_wheel_pauses_the_run_and_is_set_again(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    struct instrument_snapshot s;
    r->auto_resume = false; // it goes on by itself
    r->on_row = unplug_wheel;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_values(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(strstr(r->pauses[0], "nd: unplugged; waiting for it to come back"));
    assert_int_equal(r->devices.wheel.at, 0);
    instrument_snapshot(r->in, &s);
    assert_int_equal(s.part[PART_WHEEL].returns, 1);
    assert_int_equal(s.part[PART_SHUTTER].errors, 0);
    assert_string_equal(s.device[1].position, "1");
    end(r);
}

// Monitor, shutter that makes the darks, and a filter in the beam: each call of any device fails
// once, every stride-th in turn.
static void everything(struct bench_config *b)
{
    simdevices_monitor(b);
    b->monitor.full_scale = 5e-3;
    darks(b);
    filtered_beam(b);
}

static void every_call_may_fail(int code, long first, long stride)
{
    for (long n = first;; n += stride) {
        struct run *r = begin_with(everything);
        r->plan.count = 0;
        tiny_plan(r);
        r->bench.laser.warmup_s = 0.5;
        r->on_time = watch_beam;
        r->b.fail_at = r->b.calls + n;
        r->b.fail_code = code;
        const enum run_state s = go(r);
        const bool hit = r->b.hit_done;
        if (s != RUN_DONE || r->violations)
            print_error("call %ld with %s: %s\n", n, gon_code_name((enum gon_code)code),
                        run_state_name(s));
        assert_int_equal(s, RUN_DONE);
        assert_complete(r);
        assert_values(r);
        end(r);
        if (!hit)
            break;
    }
}

static void any_call_may_find_no_answer(void **state)
{
    (void)state;
    every_call_may_fail(GON_E_LINK, 1, 2);
}

static void any_call_may_find_the_device_gone(void **state)
{
    (void)state;
    every_call_may_fail(GON_E_GONE, 1, 3);
}

static void any_call_may_find_a_fault(void **state)
{
    (void)state;
    every_call_may_fail(GON_E_DEVICE, 2, 3);
}

static void a_run_that_is_stopped_closes_the_shutter(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    r->cancel_at_ns = CLK_S(40);
    assert_int_equal(go(r), RUN_STOPPED);
    assert_true(r->devices.shutter.moves >= 2);
    assert_int_equal(r->devices.shutter.at, 1);
    end(r);
}

static void safe_wheel(struct bench_config *b)
{
    snprintf(b->devices[1].safe, sizeof b->devices[1].safe, "3");
}

static void any_with_a_safe_position_goes_there(void **state)
{
    (void)state;
    struct run *r = begin_with(safe_wheel);
    assert_int_equal(go(r), RUN_DONE);
    assert_int_equal(r->devices.wheel.at, 2);
    end(r);
}

// --- an instrument that runs nothing -------------------------------------------------------------

static void a_position_that_it_has_not_is_a_mistake_of_the_bench(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    struct instrument *in;
    struct gon_error err;
    struct instrument_parts parts = simbench_parts(&r->b);
    simdevices_parts(&r->devices, &r->bench, &parts);
    snprintf(device_of(r, 1)->position, BENCH_DEVICE_NAME, "7");
    assert_int_equal(instrument_new(&r->bench, &parts, &r->b.clk.clk, &in, &err), GON_E_INPUT);
    assert_string_equal(err.text, "nd: has no position '7'; it has '1', '2', '3'");
    snprintf(device_of(r, 1)->position, BENCH_DEVICE_NAME, "1");
    end(r);
}

static void looks_show_who_turned_it(void **state)
{
    (void)state;
    struct run *r = begin_with(NULL);
    struct instrument_snapshot s;
    instrument_snapshot(r->in, &s);
    assert_string_equal(s.part[PART_WHEEL].name, "nd");
    assert_string_equal(s.part[PART_WHEEL].identity, "simulated selector");
    assert_string_equal(s.device[1].position, "3");
    assert_string_equal(s.device[1].wanted, "1");
    assert_int_equal(s.part[PART_DEVICES + 2].link, PART_ABSENT);
    simselector_turn(&r->devices.wheel, 1);
    instrument_tend(r->in);
    instrument_snapshot(r->in, &s);
    assert_string_equal(s.device[1].position, "2");
    end(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_stands_where_it_measures_and_the_shutter_closes_at_the_end),
        cmocka_unit_test(with_darks_the_shutter_makes_them_and_the_laser_stays_on),
        cmocka_unit_test(a_dark_between_the_sweeps_costs_no_warm_up),
        cmocka_unit_test(a_station_has_its_filter_before_the_axes_come_and_until_they_left),
        cmocka_unit_test(a_filter_before_the_monitor_takes_nothing_from_the_value),
        cmocka_unit_test(a_filter_before_the_monitor_is_no_light_lost),
        cmocka_unit_test(a_shutter_that_only_says_open_is_light_lost),
        cmocka_unit_test(after_a_pause_at_the_beam_the_light_waits_until_they_left),
        cmocka_unit_test(a_wheel_turned_by_hand_costs_an_attempt_and_no_value),
        cmocka_unit_test(one_that_strays_again_pauses_the_run),
        cmocka_unit_test(all_are_read_back_before_each_sweep),
        cmocka_unit_test(a_shutter_that_does_not_open_is_told_before_there_is_light),
        cmocka_unit_test(a_shutter_that_closes_by_itself_switches_off_and_pauses),
        cmocka_unit_test(light_behind_a_shutter_that_says_closed_is_no_dark),
        cmocka_unit_test(an_unplugged_wheel_pauses_the_run_and_is_set_again),
        cmocka_unit_test(any_call_may_find_no_answer),
        cmocka_unit_test(any_call_may_find_the_device_gone),
        cmocka_unit_test(any_call_may_find_a_fault),
        cmocka_unit_test(a_run_that_is_stopped_closes_the_shutter),
        cmocka_unit_test(any_with_a_safe_position_goes_there),
        cmocka_unit_test(a_position_that_it_has_not_is_a_mistake_of_the_bench),
        cmocka_unit_test(looks_show_who_turned_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
