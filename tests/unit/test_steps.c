// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// What a person does on the way: in the plan, and what a run does about it in virtual time.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "campaign/plan_steps.h"
#include "tests/unit/simrun.h"

#define OUT "take the sample out"
#define IN "put the sample in"
#define TURN "turn the sample"
#define START "clean the mirror"

static char asked[20][200]; // in order
static int asked_count;
static int64_t asked_ns;
static double patience_s; // of the person
static bool lit_meanwhile;
static char said[40][400];
static int said_count;

static int keep_event(void *ctx, const char *level, const char *source, const char *text,
                      struct gon_error *err)
{
    (void)ctx, (void)level, (void)source, (void)err;
    if (strstr(text, "acknowledged by"))
        snprintf(said[said_count++], sizeof said[0], "%s", text);
    return 0;
}

static void watch(struct run *r)
{
    if (asked_ns && emits(r))
        lit_meanwhile = true;
}

static void note_asked(struct run *r)
{
    if (strncmp(r->pauses[r->pauses_count - 1], "operator: ", 10))
        return;
    if (!strstr(r->pauses[r->pauses_count - 1], "not acknowledged"))
        snprintf(asked[asked_count++], sizeof asked[0], "%s", r->pauses[r->pauses_count - 1]);
    if (!asked_ns)
        asked_ns = r->b.clk.t_ns;
}

static bool acknowledge(void *ctx, char *ret_by, size_t size)
{
    struct run *r = ctx;
    if (!asked_ns || r->b.clk.t_ns < asked_ns + CLK_S(patience_s))
        return false;
    asked_ns = 0;
    snprintf(ret_by, size, " anna (uid 1000): done");
    return true;
}

static struct run *begin_stepped(void)
{
    struct world_spec spec;
    struct bench_config bench;
    world_defaults(&spec);
    quick_laser(&spec);
    simconfig_bench(&bench);
    bench.laser.warmup_s = 5;
    bench.step_limit_s = 600;
    snprintf(bench.stations[0].arrive, BENCH_STEP, OUT); // the beam
    snprintf(bench.stations[0].leave, BENCH_STEP, IN);
    struct run *r = begin_on(&spec, &bench);
    small_plan(r);
    r->config.steps[r->config.steps_count++] = (struct campaign_step){2, TURN};
    r->config.steps[r->config.steps_count++] = (struct campaign_step){0, START};
    r->ports.store_event = keep_event;
    r->ports.take_ack = acknowledge;
    r->on_pause = note_asked;
    r->on_time = watch;
    r->auto_resume = false;
    asked_count = said_count = 0;
    asked_ns = 0;
    patience_s = 60;
    lit_meanwhile = false;
    return r;
}

static void assert_asked(const char *const *texts)
{
    int n = 0;
    for (; texts[n]; n++) {
        char whole[300];
        snprintf(whole, sizeof whole, "operator: %s, then: gonio ack", texts[n]);
        assert_true(n < asked_count);
        assert_string_equal(asked[n], whole);
    }
    assert_int_equal(asked_count, n);
}

static void a_run_waits_for_each_and_is_dark_meanwhile(void **state)
{
    (void)state;
    struct run *r = begin_stepped();
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_asked(
        (const char *const[]){START, OUT, IN, TURN, OUT, IN, NULL}); // the last dark is at "park"
    assert_false(lit_meanwhile);
    assert_int_equal(said_count, 6);
    assert_string_equal(said[3],
                        "running: acknowledged by the operator anna (uid 1000): done (" TURN ")");
    for (int i = 0; i < r->plan.count; i++) // no gap: nothing again
        assert_int_equal(accepted_of(r, &r->points[i]), 1);
    end(r);
}

static void the_plan_has_them_in_the_same_order(void **state)
{
    (void)state;
    struct run *r = begin_stepped();
    struct plan *p = &r->plan;
    assert_int_equal(plan_add_steps(&r->config, &r->bench, p, NULL), 0);
    static const struct plan_step steps[] = {{0, 0, START}, {1, 0, OUT},  {2, 1, IN},
                                             {7, 2, TURN},  {12, 3, OUT}, {13, 3, IN}};
    assert_int_equal(p->steps_count, 6);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(p->steps[i].before, steps[i].before);
        assert_int_equal(p->steps[i].sweep, steps[i].sweep);
        assert_string_equal(p->steps[i].text, steps[i].text);
    }
    free(p->steps);
    end(r);
}

static void one_that_nobody_acknowledges_is_told_once_more_and_stays(void **state)
{
    (void)state;
    struct run *r = begin_stepped();
    patience_s = 1e9;
    r->cancel_at_ns = CLK_S(5000);
    assert_int_equal(go(r), RUN_STOPPED);
    assert_int_equal(r->pauses_count, 2);
    assert_string_equal(r->pauses[1],
                        "operator: " START ", then: gonio ack (not acknowledged for 600 s)");
    assert_false(lit_meanwhile);
    assert_int_equal(r->b.ons, 0);
    end(r);
}

static void pause_at_turn(struct run *r)
{
    note_asked(r);
    if (asked_count == 4 && said_count == 3 && !r->want_pause && r->pauses_count == 4)
        r->want_pause = true;
    else if (strstr(r->pauses[r->pauses_count - 1], "by the operator"))
        r->want_resume = true;
}

// A pause is not an acknowledgement, nor is a resume.
static void it_is_asked_again_after_a_pause(void **state)
{
    (void)state;
    struct run *r = begin_stepped();
    r->on_pause = pause_at_turn;
    r->on_time = NULL;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_string_equal(asked[3], asked[4]);
    assert_int_equal(asked_count, 7);
    assert_int_equal(said_count, 6);
    end(r);
}

static void unplug_at_row(struct run *r)
{
    if (r->row[r->rows - 1].sweep == 2 && r->row[r->rows - 1].point == 2 && !r->want_pause &&
        !r->b.gone_until_ns[SIMBENCH_DETECTOR])
        r->b.gone_until_ns[SIMBENCH_DETECTOR] = r->b.clk.t_ns + CLK_S(5);
}

// The references after a gap want the sample out and in again, and no sweep's step.
static void a_gap_asks_for_what_its_references_need(void **state)
{
    (void)state;
    struct run *r = begin_stepped();
    r->on_row = unplug_at_row;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_asked((const char *const[]){START, OUT, IN, TURN, OUT, IN, OUT, IN, NULL});
    end(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_run_waits_for_each_and_is_dark_meanwhile),
        cmocka_unit_test(the_plan_has_them_in_the_same_order),
        cmocka_unit_test(one_that_nobody_acknowledges_is_told_once_more_and_stays),
        cmocka_unit_test(it_is_asked_again_after_a_pause),
        cmocka_unit_test(a_gap_asks_for_what_its_references_need),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
