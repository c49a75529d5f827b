// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// What a pause leaves behind: references measured again before the sample goes on, and a reduction
// that knows when it was.
#include "campaign/reduce.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "tests/unit/simrun.h"

#define GAP_S 1000.0
#define AFTERWARDS 0.8 // of the detector's sensitivity, after the gap

static int pause_row;      // pauses after that many rows
static int64_t resume_ns;  // and is resumed then
static char said[20][400]; // events about references
static int said_count;

static int keep_event(void *ctx, const char *level, const char *source, const char *text,
                      struct gon_error *err)
{
    (void)ctx, (void)level, (void)source, (void)err;
    if (strstr(text, "measured again"))
        snprintf(said[said_count++], sizeof said[0], "%s", text);
    return 0;
}

static void pause_then(struct run *r)
{
    if (r->rows != pause_row || r->pauses_count)
        return;
    r->want_pause = true;
    resume_ns = r->b.clk.t_ns + CLK_S(GAP_S);
}

static void lose_sensitivity(struct run *r)
{
    r->b.world.lets_in = AFTERWARDS;
}

static void resume_then(struct run *r)
{
    if (r->state == RUN_PAUSED && r->b.clk.t_ns >= resume_ns)
        r->want_resume = true;
}

static struct run *begin_paused(int row)
{
    struct run *r = begin(NULL);
    r->plan.samples = 10;
    r->auto_resume = false;
    r->ports.store_event = keep_event;
    r->on_row = pause_then;
    r->on_pause = lose_sensitivity;
    r->on_time = resume_then;
    pause_row = row;
    said_count = 0;
    return r;
}

static int rows_of(const struct run *r, enum plan_kind kind, int sweep)
{
    int n = 0;
    for (int i = 0; i < r->rows; i++)
        n += point_of(r, r->row[i].sweep, r->row[i].point)->kind == kind &&
             r->row[i].sweep == sweep && is_accepted(&r->row[i]);
    return n;
}

// The row of the first reading on the sample; the opening has attempts of its own.
static int first_sample(const struct run *r)
{
    int i = 0;
    while (r->row[i].sweep == 0)
        i++;
    return i;
}

static int opening_rows(void)
{
    struct run *r = begin(NULL);
    assert_int_equal(go(r), RUN_DONE);
    const int n = first_sample(r);
    end(r);
    return n;
}

static void dark_and_beam_are_measured_again_before_the_sample(void **state)
{
    (void)state;
    struct run *r = begin_paused(opening_rows() + 4);
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_int_equal(r->b.ons, 2);
    assert_int_equal(rows_of(r, PLAN_DARK, 0), 2);
    assert_int_equal(rows_of(r, PLAN_BEAM, 0), 2);
    int i = pause_row; // the next row is the dark, then the beam, then the sample
    assert_true(r->row[i].sweep == 0 && r->row[i].point == 1 && r->row[i].attempt > 1);
    while (r->row[i].point == 1)
        i++;
    assert_true(r->row[i].sweep == 0 && r->row[i].point == 2 && r->row[i].attempt > 1);
    while (r->row[i].sweep == 0)
        i++;
    assert_int_equal(r->row[i].sweep, r->row[pause_row - 1].sweep);
    assert_int_equal(said_count, 1);
    double gap_s, dark_v, change;
    print_message("%s\n", said[0]);
    assert_int_equal(
        sscanf(said[0],
               "references measured again after a gap of %lf s: dark %lf V, beam (%*[a-z]) "
               "%lf %%",
               &gap_s, &dark_v, &change),
        3);
    assert_true(gap_s > GAP_S - 2 && gap_s < GAP_S + 60);
    assert_true(fabs(change - 100 * (AFTERWARDS - 1)) < 0.1);
    for (int k = 0; k < r->plan.count; k++) // what was published meanwhile
        if (r->points[k].kind == PLAN_SAMPLE)
            assert_true(fabs(r->f_per_sr[k] / f_of(r, &r->points[k]) - 1) < 0.003);
    end(r);
}

// The disk is full once, after the dark of the gap.
static void fail_then(struct run *r)
{
    pause_then(r);
    if (r->rows > pause_row && is_accepted(&r->row[r->rows - 1]) && r->pauses_count == 1)
        r->store_fails = 3;
}

static void a_gap_in_the_references_makes_them_old_again(void **state)
{
    (void)state;
    struct run *r = begin_paused(opening_rows() + 4);
    r->on_row = fail_then;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 2);
    assert_int_equal(rows_of(r, PLAN_DARK, 0), 3);
    assert_true(rows_of(r, PLAN_BEAM, 0) >= 2);
    assert_int_equal(said_count, 1);
    end(r);
}

static void pause_at_the_end(struct run *r)
{
    pause_row = r->row[r->rows - 1].sweep == 3 ? r->rows : 0; // only references are left
    pause_then(r);
}

static void nothing_is_measured_again_without_need(void **state)
{
    (void)state;
    struct run *r = begin_paused(1); // the first row is of the dark: no beam yet
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(rows_of(r, PLAN_BEAM, 0), 1);
    assert_int_equal(said_count, 0);
    end(r);
    r = begin_paused(0);
    r->on_row = pause_at_the_end;
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(r->pauses_count, 1);
    assert_int_equal(rows_of(r, PLAN_BEAM, 0), 1);
    assert_int_equal(said_count, 0);
    end(r);
}

// What the store gives a campaign that goes on.
static struct engine_opening opening_of(const struct run *r)
{
    const struct reduce_reference o = reduce_opening(&r->plan, r->row, r->rows);
    struct engine_opening opening = {.last_utc_ms = r->row[r->rows - 1].t_utc_ms,
                                     .dark_signal_v = o.dark_signal_v,
                                     .dark_monitor_v = o.dark_monitor_v};
    memcpy(opening.beam_signal_v, o.beam_signal_v, sizeof o.beam_signal_v);
    memcpy(opening.beam_monitor_v, o.beam_monitor_v, sizeof o.beam_monitor_v);
    return opening;
}

static void take_progress(struct run *r)
{
    for (int i = 0; i < r->plan.count; i++)
        for (int k = 0; k < r->rows; k++)
            if (r->row[k].sweep == r->points[i].sweep && r->row[k].point == r->points[i].point) {
                r->points[i].done |= is_accepted(&r->row[k]);
                r->points[i].attempts = r->row[k].attempt;
            }
}

static void stop_then(struct run *r)
{
    if (r->rows == pause_row)
        cancel_request(r->cancel);
}

static void a_campaign_that_goes_on_another_day_has_them_again(void **state)
{
    (void)state;
    struct run *r = begin_paused(opening_rows() + 4);
    r->on_row = stop_then;
    assert_int_equal(go(r), RUN_STOPPED);
    const int before = r->rows;
    take_progress(r);
    const struct engine_opening opening = opening_of(r);
    r->ports.opening = &opening;
    r->on_row = NULL;
    cancel_reset(r->cancel);
    r->b.clk.t_ns += CLK_S(86400);
    assert_int_equal(go(r), RUN_DONE);
    assert_complete(r);
    assert_int_equal(rows_of(r, PLAN_BEAM, 0), 2);
    assert_int_equal(r->row[before].sweep, 0);
    assert_int_equal(said_count, 1);
    assert_non_null(strstr(said[0], "after a gap of 864"));
    end(r);
}

// Sweep 1 is measured again another day: its references are open, too, and measured once, not once
// more as after a gap.
static void references_that_are_open_anyway_are_measured_once(void **state)
{
    (void)state;
    struct run *r = begin_paused(0);
    assert_int_equal(go(r), RUN_DONE);
    take_progress(r);
    const int before = r->rows;
    for (int i = 0; i < r->plan.count; i++)
        r->points[i].done = r->points[i].kind == PLAN_SAMPLE && r->points[i].sweep != 1;
    const struct engine_opening opening = opening_of(r);
    r->ports.opening = &opening;
    r->b.clk.t_ns += CLK_S(86400);
    assert_int_equal(go(r), RUN_DONE);
    assert_int_equal(rows_of(r, PLAN_DARK, 0), 2);
    assert_int_equal(rows_of(r, PLAN_BEAM, 0), 2);
    assert_int_equal(r->row[before].sweep, 0);
    assert_int_equal(said_count, 0);
    assert_int_equal(r->violations, 0);
    end(r);
}

// --- and the reduction ---------------------------------------------------------------------------

static int by_plan(const void *a, const void *b)
{
    const struct store_reading *x = a, *y = b;
    if (x->sweep != y->sweep)
        return x->sweep < y->sweep ? -1 : 1;
    if (x->point != y->point)
        return x->point < y->point ? -1 : 1;
    return x->attempt < y->attempt ? -1 : 1;
}

static void readings_are_reduced_with_the_references_around_them(void **state)
{
    (void)state;
    struct run *r = begin_paused(opening_rows() + 4);
    struct reduction result;
    assert_int_equal(go(r), RUN_DONE);
    const int64_t gap_ms = r->row[pause_row].t_utc_ms;
    qsort(r->row, (size_t)r->rows, sizeof *r->row, by_plan);
    assert_int_equal(reduce_run(&r->bench, &r->plan, r->row, r->rows, &result, NULL), 0);
    assert_int_equal(result.count, 10);
    int after = 0;
    for (int i = 0; i < result.count; i++) {
        const struct reduced_point *p = &result.points[i];
        const double truth = f_of(r, &r->points[p->index]);
        const double off = fabs(p->f_per_sr / truth - 1);
        int64_t t_ms = 0;
        for (int k = 0; k < r->rows; k++)
            if (r->row[k].sweep == p->sweep && r->row[k].point == p->point)
                t_ms = r->row[k].t_utc_ms;
        after += t_ms > gap_ms;
        // The sensitivity fell at the gap's begin; a line through the gap is off there by its share
        // of the time. u knows that.
        assert_true(off < (t_ms > gap_ms ? 0.003 : 0.03));
        assert_true(off * truth < 2 * hypot(p->u_a_per_sr, p->u_b_per_sr));
    }
    assert_true(after >= 5 && after < 10);
    assert_true(result.u_beam_rel > 0.09 && result.u_beam_rel < 0.15);
    reduction_clear(&result);
    end(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dark_and_beam_are_measured_again_before_the_sample),
        cmocka_unit_test(nothing_is_measured_again_without_need),
        cmocka_unit_test(a_campaign_that_goes_on_another_day_has_them_again),
        cmocka_unit_test(a_gap_in_the_references_makes_them_old_again),
        cmocka_unit_test(references_that_are_open_anyway_are_measured_once),
        cmocka_unit_test(readings_are_reduced_with_the_references_around_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
