// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit model base
// The queue's ports write what they are asked for into a line of text.
#include "daemon/queue.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static char said[2000];

__attribute__((format(printf, 1, 2))) static void say(const char *fmt, ...)
{
    va_list ap;
    size_t n = strlen(said);
    va_start(ap, fmt);
    vsnprintf(said + n, sizeof said - n, fmt, ap);
    va_end(ap);
}

static void open_run(void *ctx, const struct run *run)
{
    (void)ctx;
    say("open %d; ", run->id);
}

static void start_run(void *ctx, const struct run *run, void *material)
{
    (void)ctx;
    say("start %d %s; ", run->id, (const char *)material);
}

static void fit_run_(void *ctx, const struct run *run, int sweep, bool last)
{
    (void)ctx;
    say("fit %d/%d%s; ", run->id, sweep, last ? " last" : "");
}

static void close_run(void *ctx, const struct run *run, enum run_state as)
{
    (void)ctx;
    say("close %d %d%s%s; ", run->id, as == RUN_DONE, *run->text ? ":" : "", run->text);
}

static void cancel(void *ctx)
{
    (void)ctx;
    say("cancel; ");
}

static void rearm(void *ctx)
{
    (void)ctx;
    say("rearm; ");
}

static void changed(void *ctx, const struct run *run)
{
    (void)ctx;
    static const char *const names[] = {"queued",   "preparing", "running", "paused",
                                        "stopping", "stopped",   "done",    "failed"};
    say("%d=%s%s%s; ", run->id, names[run->state], *run->text ? ":" : "", run->text);
}

static char kept[200]; // the queue as it was last kept

static void keep(void *ctx)
{
    struct queue **q = ctx;
    struct queue_entry e[8];
    const size_t count = queue_entries(*q, e, 8);
    size_t n = 0;
    *kept = 0;
    for (size_t i = 0; i < count; i++)
        n += (size_t)snprintf(kept + n, sizeof kept - n, "%s%d%s", e[i].active ? "*" : "",
                              e[i].run->id, e[i].run->held ? "h " : " ");
}

static struct queue *make(int runs)
{
    static struct queue *made;
    struct queue_ports ports = {&made,  open_run, start_run, fit_run_, close_run,
                                cancel, rearm,    changed,   keep};
    struct queue *q = made = queue_new(&ports);
    for (int id = runs; id >= 1; id--)
        queue_know(q, &(struct run){.id = id, .state = RUN_STOPPED, .left_s = (double)NAN});
    *said = 0;
    return q;
}

#define EXPECT(text) (assert_string_equal(said, text), *said = 0)

static void event(struct queue *q, int id, enum run_state state, const char *text)
{
    queue_engine_event(q, id,
                       &(struct engine_event){.kind = ENGINE_STATE, .state = state, .text = text});
}

static void measure(struct queue *q, int id)
{
    assert_int_equal(queue_submit(q, id, NULL), 0);
    queue_opened(q, id, (void *)"plan", NULL);
    event(q, id, RUN_RUNNING, NULL);
    *said = 0;
}

static void a_run_is_done_after_its_last_fit_is_stored(void **state)
{
    (void)state;
    struct queue *q = make(3);
    assert_int_equal(queue_submit(q, 2, NULL), 0);
    EXPECT("2=queued; open 2; ");
    queue_opened(q, 2, (void *)"plan", NULL);
    EXPECT("start 2 plan; ");
    event(q, 2, RUN_RUNNING, NULL);
    queue_fit_asked(q, 2, 1, false);
    queue_fit_asked(q, 2, 2, true);
    EXPECT("2=running; fit 2/1; fit 2/2 last; ");
    queue_fitted(q, 2, "{}", NULL);
    event(q, 2, RUN_DONE, NULL);
    queue_ended(q, 2, RUN_DONE, NULL);
    EXPECT(""); // the last fit is not there yet
    queue_fitted(q, 2, "{\"delta\":1}", NULL);
    EXPECT("close 2 1; ");
    queue_closed(q, 2, NULL);
    EXPECT("2=done; ");
    assert_string_equal(queue_run(q, 2)->fit, "{\"delta\":1}");
    assert_true(queue_idle(q));
    queue_free(q);
}

// A sweep of it was to be measured again after the engine had its plan.
static void a_run_that_is_open_again_comes_first(void **state)
{
    (void)state;
    struct queue *q = make(3);
    measure(q, 2);
    assert_int_equal(queue_submit(q, 3, NULL), 0);
    queue_ended(q, 2, RUN_DONE, NULL);
    EXPECT("3=queued; close 2 1; ");
    queue_reopened(q, 2);
    EXPECT("2=queued; open 2; ");
    assert_string_equal(kept, "*2 3 ");
    queue_opened(q, 2, (void *)"rest", NULL);
    queue_ended(q, 2, RUN_DONE, NULL);
    queue_closed(q, 2, NULL);
    EXPECT("start 2 rest; close 2 1; 2=done; open 3; ");
    queue_free(q);
}

static void a_run_that_is_open_again_waits_in_a_held_queue(void **state)
{
    (void)state;
    struct queue *q = make(3);
    measure(q, 2);
    assert_int_equal(queue_hold(q, 0, true, NULL), 0);
    queue_ended(q, 2, RUN_DONE, NULL);
    *said = 0;
    queue_reopened(q, 2);
    EXPECT("2=queued; ");
    assert_true(queue_idle(q));
    queue_free(q);
}

static void a_stop_is_stronger_than_what_is_to_be_measured_again(void **state)
{
    (void)state;
    struct queue *q = make(3);
    measure(q, 2);
    queue_fit_asked(q, 2, 1, true);
    queue_ended(q, 2, RUN_DONE, NULL);
    assert_true(queue_stop(q, "by hand"));
    queue_fitted(q, 2, "{}", NULL);
    *said = 0;
    queue_reopened(q, 2);
    assert_non_null(strstr(said, "2=stopped"));
    assert_null(strstr(said, "open 2"));
    assert_true(queue_idle(q));
    queue_free(q);
}

static void runs_wait_for_each_other(void **state)
{
    (void)state;
    struct queue *q = make(3);
    measure(q, 3);
    assert_int_equal(queue_submit(q, 1, NULL), 0);
    assert_int_equal(queue_submit(q, 2, NULL), 0);
    EXPECT("1=queued; 2=queued; ");
    queue_ended(q, 3, RUN_DONE, NULL);
    queue_closed(q, 3, NULL);
    EXPECT("close 3 1; 3=done; open 1; ");
    assert_int_equal(queue_active(q)->id, 1);
    queue_free(q);
}

static void what_cannot_be_queued_is_refused(void **state)
{
    (void)state;
    struct gon_error err;
    struct queue *q = make(2);
    assert_int_equal(queue_submit(q, 9, &err), GON_E_INPUT);
    measure(q, 1);
    assert_int_equal(queue_submit(q, 1, &err), GON_E_REFUSED);
    queue_submit(q, 2, &err);
    assert_int_equal(queue_submit(q, 2, &err), GON_E_REFUSED);
    queue_ended(q, 1, RUN_DONE, NULL);
    queue_closed(q, 1, NULL);
    assert_int_equal(queue_submit(q, 1, &err), GON_E_REFUSED);
    assert_string_equal(err.text, "run 1 is done; see: gonio show 1");
    queue_end(q);
    queue_submit(q, 1, &err);
    assert_string_equal(err.text, "the daemon is ending; start it again");
    queue_free(q);
}

static void a_stop_empties_the_queue_and_waits_for_the_workers(void **state)
{
    (void)state;
    struct queue *q = make(2);
    measure(q, 1);
    queue_submit(q, 2, NULL);
    queue_fit_asked(q, 1, 1, false);
    *said = 0;
    assert_true(queue_stop(q, "stopped by uid 0"));
    assert_true(queue_stop(q, "again"));
    EXPECT("2=stopped:stopped by uid 0; cancel; 1=stopping:stopped by uid 0; ");
    event(q, 1, RUN_PAUSED, "laser: unplugged"); // too late to matter
    queue_ended(q, 1, RUN_STOPPED, NULL);
    EXPECT("");
    queue_fitted(q, 1, NULL, &(struct gon_error){GON_E_CANCELED, "canceled"});
    EXPECT("close 1 0:stopped by uid 0; ");
    queue_closed(q, 1, NULL);
    EXPECT("rearm; 1=stopped:stopped by uid 0; ");
    assert_false(queue_stop(q, "nothing"));
    assert_int_equal(queue_submit(q, 1, NULL), 0); // and can go on later
    EXPECT("1=queued; open 1; ");
    queue_free(q);
}

// In the file as on the screen.
static void a_laser_that_may_be_on_is_said_with_every_end(void **state)
{
    (void)state;
    static const enum run_state ends[] = {RUN_STOPPED, RUN_DONE};
    static const char *const why[] = {"; stopped by uid 0", ""};
    for (int i = 0; i < 2; i++) {
        char expected[300];
        struct queue *q = make(1);
        measure(q, 1);
        if (ends[i] == RUN_STOPPED)
            queue_stop(q, "stopped by uid 0");
        *said = 0;
        queue_engine_event(q, 1,
                           &(struct engine_event){.kind = ENGINE_STATE,
                                                  .state = ends[i],
                                                  .light = SAFETY_LIGHT_MAYBE,
                                                  .text = ""});
        queue_ended(q, 1, ends[i], NULL);
        queue_closed(q, 1, NULL);
        const char *warning = "LASER MAY BE ON: use its key or the interlock";
        snprintf(expected, sizeof expected, "close 1 %d:%s%s; %s1=%s:%s%s; ", ends[i] == RUN_DONE,
                 warning, why[i], i == 0 ? "rearm; " : "", run_state_name(ends[i]), warning,
                 why[i]);
        EXPECT(expected);
        queue_free(q);
    }
}

static void a_stop_while_the_file_is_opened_still_stops(void **state)
{
    (void)state;
    struct queue *q = make(1);
    queue_submit(q, 1, NULL);
    queue_stop(q, "why");
    queue_opened(q, 1, NULL, &(struct gon_error){GON_E_STORE, "disk"});
    EXPECT("1=queued; open 1; cancel; 1=stopping:why; rearm; 1=stopped:disk; ");
    queue_free(q);
}

static void failures_name_their_reason_and_the_next_run_begins(void **state)
{
    (void)state;
    struct queue *q = make(2);
    measure(q, 1);
    queue_submit(q, 2, NULL);
    *said = 0;
    queue_ended(q, 1, RUN_FAILED, &(struct gon_error){GON_E_DEVICE, "axis theta_r: alarm 30"});
    queue_closed(q, 1, NULL);
    EXPECT("close 1 0:axis theta_r: alarm 30; 1=failed:axis theta_r: alarm 30; open 2; ");
    queue_opened(q, 2, NULL, &(struct gon_error){GON_E_STORE, "in use by pid 7"});
    EXPECT("2=failed:in use by pid 7; ");
    queue_free(q);
}

static void a_failed_fit_is_remembered_until_a_later_one_succeeds(void **state)
{
    (void)state;
    struct queue *q = make(1);
    measure(q, 1);
    queue_fit_asked(q, 1, 1, false);
    queue_fitted(q, 1, NULL, &(struct gon_error){GON_E_INPUT, "too few points"});
    assert_true(queue_run(q, 1)->fit_failed);
    queue_fit_asked(q, 1, 2, true);
    queue_fitted(q, 1, "{}", NULL);
    assert_false(queue_run(q, 1)->fit_failed);
    queue_free(q);
}

#define KEPT(text) assert_string_equal(kept, text)

static void the_order_can_be_changed(void **state)
{
    (void)state;
    struct gon_error err;
    struct queue *q = make(5);
    measure(q, 3);
    for (int id = 1; id <= 5; id++)
        if (id != 3)
            assert_int_equal(queue_submit(q, id, NULL), 0);
    KEPT("*3 1 2 4 5 ");
    assert_int_equal(queue_move(q, 5, 1, NULL), 0);
    KEPT("*3 5 1 2 4 ");
    assert_int_equal(queue_move(q, 5, 4, NULL), 0);
    KEPT("*3 1 2 4 5 ");
    *said = 0;
    assert_int_equal(queue_remove(q, 2, "uid 7", NULL), 0);
    EXPECT("2=stopped:taken out of the queue by uid 7; ");
    KEPT("*3 1 4 5 ");
    assert_int_equal(queue_move(q, 5, 0, &err), GON_E_INPUT);
    assert_int_equal(queue_move(q, 5, 4, &err), GON_E_INPUT);
    assert_string_equal(err.text, "place 4: the queue has 1 to 3");
    assert_int_equal(queue_move(q, 3, 1, &err), GON_E_INPUT); // it has the bench
    assert_string_equal(err.text, "run 3 does not wait in the queue; see: gonio queue");
    assert_int_equal(queue_remove(q, 2, "x", &err), GON_E_INPUT);
    assert_int_equal(queue_hold(q, 3, true, &err), GON_E_INPUT);
    KEPT("*3 1 4 5 ");
    queue_free(q);
}

static void what_is_held_is_passed(void **state)
{
    (void)state;
    struct queue *q = make(4);
    assert_int_equal(queue_hold(q, 0, true, NULL), 0);
    for (int id = 1; id <= 3; id++)
        queue_submit(q, id, NULL);
    EXPECT("1=queued; 2=queued; 3=queued; "); // nothing is opened
    assert_int_equal(queue_hold(q, 1, true, NULL), 0);
    KEPT("1h 2 3 ");
    assert_int_equal(queue_hold(q, 0, false, NULL), 0);
    EXPECT("open 2; ");
    KEPT("*2 1h 3 ");
    queue_opened(q, 2, NULL, NULL);
    EXPECT("2=failed; open 3; ");
    queue_opened(q, 3, NULL, NULL);
    EXPECT("3=failed; ");
    KEPT("1h ");
    assert_int_equal(queue_hold(q, 1, false, NULL), 0);
    EXPECT("open 1; ");
    queue_free(q);
}

static void the_queue_of_an_earlier_life_waits(void **state)
{
    (void)state;
    struct queue *q = make(4);
    queue_know(q, &(struct run){.id = 2, .state = RUN_DONE});
    *said = *kept = 0;
    queue_restore(q, 3, false); // had the bench
    queue_restore(q, 2, false); // was done before the daemon died
    queue_restore(q, 1, true);
    queue_restore(q, 9, false); // its file is gone
    EXPECT(""); // stopped, as they were
    assert_true(queue_is_held(q));
    assert_null(queue_active(q));
    queue_hold(q, 0, false, NULL);
    EXPECT("3=queued; 1=queued; open 3; ");
    KEPT("*3 1h ");
    queue_free(q);
}

static void the_end_of_the_daemon_leaves_the_queue_as_it_was(void **state)
{
    (void)state;
    struct queue *q = make(4);
    measure(q, 3);
    queue_submit(q, 1, NULL);
    KEPT("*3 1 ");
    queue_end(q);
    queue_ended(q, 3, RUN_STOPPED, NULL);
    queue_closed(q, 3, NULL);
    assert_true(queue_idle(q));
    KEPT("*3 1 ");
    queue_free(q);
    q = make(4);
    measure(q, 3);
    queue_stop(q, "stopped"); // but a stop is one
    KEPT("*3 ");
    queue_ended(q, 3, RUN_STOPPED, NULL);
    queue_closed(q, 3, NULL);
    KEPT("");
    queue_free(q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_order_can_be_changed),
        cmocka_unit_test(what_is_held_is_passed),
        cmocka_unit_test(the_queue_of_an_earlier_life_waits),
        cmocka_unit_test(the_end_of_the_daemon_leaves_the_queue_as_it_was),
        cmocka_unit_test(a_run_is_done_after_its_last_fit_is_stored),
        cmocka_unit_test(a_run_that_is_open_again_comes_first),
        cmocka_unit_test(a_run_that_is_open_again_waits_in_a_held_queue),
        cmocka_unit_test(a_stop_is_stronger_than_what_is_to_be_measured_again),
        cmocka_unit_test(runs_wait_for_each_other),
        cmocka_unit_test(what_cannot_be_queued_is_refused),
        cmocka_unit_test(a_stop_empties_the_queue_and_waits_for_the_workers),
        cmocka_unit_test(a_laser_that_may_be_on_is_said_with_every_end),
        cmocka_unit_test(a_stop_while_the_file_is_opened_still_stops),
        cmocka_unit_test(failures_name_their_reason_and_the_next_run_begins),
        cmocka_unit_test(a_failed_fit_is_remembered_until_a_later_one_succeeds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
