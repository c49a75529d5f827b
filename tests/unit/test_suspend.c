// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// Suspenders: their conditions, their settle times and latches, and what they do to a run in
// virtual time.
#include "daemon/suspend.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "daemon/instrument_suspend.h"
#include "tests/unit/simrun.h"

// --- conditions --------------------------------------------------------------------------------

static void assert_wrong(const char *when, const char *says)
{
    struct bench_condition c;
    struct gon_error err = {0};
    assert_int_equal(bench_condition_parse(when, &c, &err), GON_E_INPUT);
    if (!strstr(err.text, says))
        fail_msg("'%s': %s", when, err.text);
}

static void conditions_are_read(void **state)
{
    (void)state;
    struct bench_condition c;
    assert_int_equal(bench_condition_parse(
                         " door.open and not room.ok and room.t_c>=-2.5 and a.b != 1e3", &c, NULL),
                     0);
    assert_int_equal(c.terms, 4);
    assert_string_equal(c.term[0].name, "door.open");
    assert_true(c.term[0].sign == BENCH_SET && c.term[1].sign == BENCH_NOT_SET);
    assert_true(c.term[2].sign == BENCH_MORE_EQUAL && c.term[2].limit == -2.5);
    assert_true(c.term[3].sign == BENCH_UNEQUAL && c.term[3].limit == 1000);
    assert_wrong("", "name is missing");
    assert_wrong("a.b and", "name is missing");
    assert_wrong("and", "name is missing");
    assert_wrong("a.b >", "no number");
    assert_wrong("a.b > x", "'x', which is no number");
    assert_wrong("a.b > nan", "no number");
    assert_wrong("a.b or c.d", "'and' is missing before 'or");
    assert_wrong("a.b < 1 2", "'and' is missing");
    assert_wrong("not a.b < 1", "behind not");
    assert_wrong("a and b and c and d and e", "more than 4 terms");
}

static bool holds_at(const char *when, double value)
{
    struct bench_condition c;
    assert_int_equal(bench_condition_parse(when, &c, NULL), 0);
    return bench_term_holds(&c.term[0], value);
}

static void terms_hold_at_their_limits_and_when_nothing_is_known(void **state)
{
    (void)state;
    static const struct {
        const char *when;
        bool below, at, above; // of 2
    } table[] = {
        {"x = 2", false, true, false}, {"x != 2", true, false, true}, {"x < 2", true, false, false},
        {"x <= 2", true, true, false}, {"x > 2", false, false, true}, {"x >= 2", false, true, true},
    };
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        assert_int_equal(holds_at(table[i].when, 1.9), table[i].below);
        assert_int_equal(holds_at(table[i].when, 2), table[i].at);
        assert_int_equal(holds_at(table[i].when, 2.1), table[i].above);
        assert_true(holds_at(table[i].when, (double)NAN));
    }
    assert_true(holds_at("x", 1) && holds_at("x", -1) && !holds_at("x", 0));
    assert_true(!holds_at("not x", 1) && holds_at("not x", 0));
    assert_true(holds_at("x", (double)NAN) && holds_at("not x", (double)NAN));
}

// --- the core ----------------------------------------------------------------------------------

static struct bench_suspender *add(struct bench_config *b, const char *name, const char *when,
                                   double settle_s, enum bench_resume resume)
{
    struct bench_suspender *s = &b->suspenders[b->suspenders_count++];
    *s = (struct bench_suspender){.settle_s = settle_s, .resume = (int)resume};
    snprintf(s->name, sizeof s->name, "%s", name);
    snprintf(s->when, sizeof s->when, "%s", when);
    return s;
}

struct bits { // values by the first letter of their name
    double value[128];
    bool dark; // nothing can be judged
};

static bool bit(void *ctx, const struct bench_term *t, double *ret_value)
{
    const struct bits *v = ctx;
    *ret_value = v->value[(int)t->name[0]];
    return !v->dark;
}

static void one_that_holds_keeps_until_it_was_quiet_and_was_released(void **state)
{
    (void)state;
    struct bench_config b = {0};
    struct suspend s;
    struct bits v = {0};
    const struct suspend_source source = {&v, bit};
    add(&b, "warm", "t > 25", 60, BENCH_AUTOMATIC);
    add(&b, "door", "door.open", 10, BENCH_MANUAL);
    suspend_init(&s, &b);
    suspend_look(&s, CLK_S(1), &source);
    assert_int_equal(suspend_first(&s, CLK_S(1)), -1);

    v.value['t'] = 26;
    suspend_look(&s, CLK_S(2), &source);
    assert_int_equal(suspend_first(&s, CLK_S(2)), 0);
    struct suspender_state one = suspend_state(&s, 0, CLK_S(2));
    assert_true(one.holds && one.keeps && !one.manual && !one.waits && one.left_s == 60);
    assert_string_equal(one.text, "t = 26 > 25");
    v.value['t'] = 25;
    suspend_look(&s, CLK_S(10), &source);
    one = suspend_state(&s, 0, CLK_S(30));
    assert_true(!one.holds && one.keeps && one.left_s == 40);
    assert_int_equal(suspend_first(&s, CLK_S(69)), 0);
    assert_int_equal(suspend_first(&s, CLK_S(70)), -1);

    v.value['t'] = 26; // begins again
    suspend_look(&s, CLK_S(71), &source);
    v.value['t'] = 20;
    v.value['d'] = 1;
    suspend_look(&s, CLK_S(72), &source);
    assert_int_equal(suspend_first(&s, CLK_S(72)), 1); // what holds goes first
    suspend_release(&s);
    v.value['d'] = 0;
    suspend_look(&s, CLK_S(80), &source);
    one = suspend_state(&s, 1, CLK_S(1000));
    assert_true(one.waits && one.keeps && one.left_s == 0); // released while it held: no release
    suspend_release(&s);
    assert_int_equal(suspend_first(&s, CLK_S(1000)), -1);

    v.value['d'] = (double)NAN;
    suspend_look(&s, CLK_S(1001), &source);
    one = suspend_state(&s, 1, CLK_S(1001));
    assert_true(one.holds);
    assert_string_equal(one.text, "door.open is not known");
    v.dark = true;
    suspend_look(&s, CLK_S(1002), &source);
    assert_false(suspend_state(&s, 1, CLK_S(1002)).holds);
}

// --- runs --------------------------------------------------------------------------------------

struct scene {
    struct run *r;
    double free_mb;
    int64_t from_ns, to_ns; // when it is free_low
    int64_t dark_ns;        // when the light was off after from_ns; 0: not yet
    int ons;                // then
};

static struct scene scene;

static double free_mb(void *ctx)
{
    const struct scene *s = ctx;
    const int64_t now_ns = s->r->b.clk.t_ns;
    return now_ns >= s->from_ns && now_ns < s->to_ns ? s->free_mb : 1e6;
}

static void note_dark(struct run *r)
{
    if (r->b.clk.t_ns >= scene.from_ns && !scene.dark_ns && !emits(r)) {
        scene.dark_ns = r->b.clk.t_ns;
        scene.ons = r->b.ons;
    }
}

static struct run *begin_with(const char *name, const char *when, double settle_s,
                              enum bench_resume resume)
{
    struct world_spec spec;
    struct bench_config bench;
    world_defaults(&spec);
    quick_laser(&spec);
    simconfig_bench(&bench);
    bench.laser.warmup_s = 5;
    add(&bench, name, when, settle_s, resume);
    struct run *r = begin_on(&spec, &bench);
    small_plan(r);
    scene = (struct scene){.r = r, .from_ns = INT64_MAX};
    instrument_disk(r->in, free_mb, &scene);
    r->on_time = note_dark;
    r->auto_resume = false;
    return r;
}

static double length_s(const struct run *r)
{
    return (double)r->b.clk.t_ns * 1e-9;
}

// Of the same campaign without anything happening.
static double undisturbed_s(void)
{
    struct run *r = begin_with("disk", "disk_free_mb < 500", 20, BENCH_AUTOMATIC);
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 0);
    const double s = length_s(r);
    end(r);
    return s;
}

// Whenever it happens, the light is off within a second and the run goes on by itself.
static void it_pauses_within_a_second_and_goes_on_when_quiet(void **state)
{
    (void)state;
    const double all_s = undisturbed_s();
    int lit = 0;
    for (int k = 0; k < 40; k++) {
        struct run *r = begin_with("disk", "disk_free_mb < 500", 20, BENCH_AUTOMATIC);
        scene.free_mb = k % 2 ? 499 : (double)NAN;
        scene.from_ns = r->b.clk.t_ns + CLK_S(all_s * k / 40);
        scene.to_ns = scene.from_ns + CLK_S(7);
        const int ons = r->b.ons;
        assert_int_equal(go(r), RUN_DONE);
        assert_complete(r);
        assert_int_equal(r->pauses_count, 1);
        assert_string_equal(r->pauses[0],
                            k % 2 ? "suspended by \"disk\": disk_free_mb = 499 < 500; it goes on "
                                    "by itself once that has been quiet for 20 s"
                                  : "suspended by \"disk\": disk_free_mb is not known; it goes on "
                                    "by itself once that has been quiet for 20 s");
        assert_true(scene.dark_ns - scene.from_ns <= CLK_S(1));
        lit += scene.ons > ons;
        assert_true(length_s(r) > all_s + 20);
        end(r);
    }
    assert_true(lit > 20); // most of them while the laser was on
}

static void one_that_holds_keeps_everything_still_from_the_start(void **state)
{
    (void)state;
    struct instrument_snapshot snapshot;
    struct run *r = begin_with("disk", "disk_free_mb < 500", 20, BENCH_AUTOMATIC);
    scene.free_mb = 1;
    scene.from_ns = 0;
    scene.to_ns = CLK_S(3600);
    r->cancel_at_ns = CLK_S(3610);
    assert_int_equal(go(r), RUN_STOPPED);
    assert_int_equal(r->b.ons, 0);
    assert_int_equal(r->rows, 0);
    assert_int_equal(r->pauses_count, 1);
    instrument_snapshot(r->in, &snapshot);
    assert_false(snapshot.axis[0].homed);
    end(r);
}

// Somebody resumes while it holds, which is not kept, and again long after it was quiet.
static void resume_at_10_and_100_s(struct run *r)
{
    const double after_s = (double)(r->b.clk.t_ns - scene.from_ns) * 1e-9;
    const int given = scene.ons;
    if ((given == 0 && after_s > 10) || (given == 1 && after_s > 100)) {
        r->want_resume = true;
        scene.ons++;
    }
}

static void a_manual_one_waits_for_somebody_and_not_for_who_came_too_early(void **state)
{
    (void)state;
    struct run *r = begin_with("disk", "disk_free_mb < 500", 5, BENCH_MANUAL);
    scene.from_ns = CLK_S(30);
    scene.to_ns = CLK_S(60);
    scene.free_mb = 499;
    r->on_time = resume_at_10_and_100_s;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 2);
    assert_string_equal(r->pauses[0], r->pauses[1]);
    assert_non_null(strstr(r->pauses[0], "mend it, then: gonio resume"));
    assert_true(length_s(r) > 130);
    end(r);
}

// --- the interlock -------------------------------------------------------------------------------

// The simulated laser then wants its key turned, too.
static void close_it_at_once(struct run *r)
{
    struct sim_laser *l = &r->b.world.laser;
    if (l->interlock_closed)
        return;
    sim_laser_set_interlock(l, true);
    sim_laser_set_key(l, false);
    sim_laser_set_key(l, true);
}

static void resume_after_1000_s(struct run *r)
{
    if (r->state == RUN_PAUSED && r->b.clk.t_ns > CLK_S(1000))
        r->want_resume = true;
}

static void an_interlock_never_resumes_by_itself(void **state)
{
    (void)state;
    struct run *r = begin_with("interlock", "interlock_open", 1, BENCH_MANUAL);
    sim_laser_set_interlock(&r->b.world.laser, false);
    r->on_pause = close_it_at_once;
    r->on_time = resume_after_1000_s;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_non_null(
        strstr(r->pauses[0], "suspended by \"interlock\": interlock_open = 1; mend it"));
    assert_true(length_s(r) > 1000);
    end(r);
}

static void axes_go_at_row_7(struct run *r)
{
    if (r->rows == 7)
        r->b.gone_until_ns[SIMBENCH_AXES] = r->b.clk.t_ns + CLK_S(20);
}

static void open_and_close_it_meanwhile(struct run *r)
{
    const int64_t back_ns = r->b.gone_until_ns[SIMBENCH_AXES];
    if (r->state == RUN_PAUSED && back_ns && r->b.clk.t_ns < back_ns - CLK_S(5))
        sim_laser_set_interlock(&r->b.world.laser, false);
    else
        close_it_at_once(r);
    resume_after_1000_s(r);
}

static void one_opened_while_a_device_is_away_is_not_forgotten(void **state)
{
    (void)state;
    struct run *r = begin_with("interlock", "interlock_open", 1, BENCH_MANUAL);
    r->on_row = axes_go_at_row_7;
    r->on_time = open_and_close_it_meanwhile;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 2);
    assert_non_null(strstr(r->pauses[0], "unplugged"));
    assert_non_null(strstr(r->pauses[1], "suspended by \"interlock\": interlock_open = 1 until"));
    assert_true(length_s(r) > 1000);
    end(r);
}

// --- the monitor ---------------------------------------------------------------------------------

static double weak_until_s;

static void weak_at_row_5(struct run *r)
{
    if (r->rows == 5)
        r->b.world.lets_out = 0.8;
}

static void strong_again(struct run *r)
{
    if (r->b.clk.t_ns > CLK_S(weak_until_s))
        r->b.world.lets_out = 1;
    if (r->state == RUN_PAUSED && r->b.clk.t_ns > CLK_S(5000))
        r->want_resume = true;
}

// Without light the monitor says nothing; it is tried with light after each quiet time, not for
// ever.
static void a_weak_monitor_is_tried_again_five_times(void **state)
{
    (void)state;
    static const struct {
        double until_s;
        int pauses;
    } cases[] = {{100, 0}, {4000, 6}};
    for (int k = 0; k < 2; k++) {
        struct run *r = begin_with("monitor", "monitor_v < 1.8", 30, BENCH_AUTOMATIC);
        weak_until_s = cases[k].until_s;
        r->on_row = weak_at_row_5;
        r->on_time = strong_again;
        assert_int_equal(go(r), RUN_DONE);
        assert_complete(r);
        assert_non_null(strstr(r->pauses[0], "suspended by \"monitor\": monitor_v = 1."));
        if (cases[k].pauses)
            assert_int_equal(r->pauses_count, cases[k].pauses);
        else
            assert_in_range(r->pauses_count, 1, 4);
        assert_int_equal(cases[k].pauses > 0, length_s(r) > 5000);
        for (int i = 0; i < r->rows; i++)
            if (is_accepted(&r->row[i]) &&
                point_of(r, r->row[i].sweep, r->row[i].point)->kind != PLAN_DARK)
                assert_true(r->row[i].monitor_v > 1.8);
        end(r);
    }
}

// --- an operator's pause -------------------------------------------------------------------------

static void resume_a_minute_later(struct run *r)
{
    if (r->state == RUN_PAUSED && r->b.clk.t_ns > scene.to_ns)
        r->want_resume = true;
    if (r->state != RUN_PAUSED)
        scene.to_ns = r->b.clk.t_ns + CLK_S(60);
    if (r->b.clk.t_ns >= scene.from_ns) {
        scene.from_ns = INT64_MAX;
        r->want_pause = true;
        scene.ons = r->rows;
    }
    if (r->state == RUN_PAUSED && !scene.dark_ns)
        scene.dark_ns = r->b.clk.t_ns;
}

static void pause_at(int64_t t_ns, bool now, int *ret_rows, double *ret_s)
{
    struct run *r = begin_with("disk", "disk_free_mb < 500", 5, BENCH_AUTOMATIC);
    scene.from_ns = t_ns;
    r->asked = (struct engine_asked){.now = now, .by = " anna (uid 1000): lunch"};
    r->on_time = resume_a_minute_later;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_string_equal(r->pauses[0],
                        "by the operator anna (uid 1000): lunch; go on with: gonio resume");
    int rows = 0;
    while (rows < r->rows && r->row[rows].t_utc_ms * 1000000 <
                                 clk_utc_ns(&r->b.clk.clk) - r->b.clk.t_ns + scene.dark_ns)
        rows++;
    *ret_rows = rows - scene.ons;
    *ret_s = (double)(scene.dark_ns - t_ns) * 1e-9;
    end(r);
}

// At the next point the reading under way is finished; now it is given up, at once.
static void now_gives_the_point_up_and_otherwise_it_is_finished(void **state)
{
    (void)state;
    int more = 0, rows;
    double longest_s = 0, s;
    for (int k = 0; k < 30; k++) {
        const int64_t t_ns = CLK_S(40) + CLK_MS(k * 137);
        pause_at(t_ns, true, &rows, &s);
        assert_int_equal(rows, 0);
        assert_true(s <= 0.5);
        pause_at(t_ns, false, &rows, &s);
        assert_in_range(rows, 0, 3);
        more += rows;
        longest_s = s > longest_s ? s : longest_s;
    }
    assert_true(more > 15);
    assert_true(longest_s > 0.5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(conditions_are_read),
        cmocka_unit_test(terms_hold_at_their_limits_and_when_nothing_is_known),
        cmocka_unit_test(one_that_holds_keeps_until_it_was_quiet_and_was_released),
        cmocka_unit_test(it_pauses_within_a_second_and_goes_on_when_quiet),
        cmocka_unit_test(one_that_holds_keeps_everything_still_from_the_start),
        cmocka_unit_test(a_manual_one_waits_for_somebody_and_not_for_who_came_too_early),
        cmocka_unit_test(an_interlock_never_resumes_by_itself),
        cmocka_unit_test(one_opened_while_a_device_is_away_is_not_forgotten),
        cmocka_unit_test(a_weak_monitor_is_tried_again_five_times),
        cmocka_unit_test(now_gives_the_point_up_and_otherwise_it_is_finished),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
