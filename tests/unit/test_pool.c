// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/pool.h"
#include "fit/passes.h"
#include "fit/rng.h"
#include "tests/unit/readings.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <cmocka.h>

enum { TASKS = 500 };

struct job {
    atomic_int calls[TASKS];
    atomic_int strangers; // tasks on other threads than the caller
    pthread_t caller;
    int cancel_at; // the task that says so; -1: none
};

static bool count_calls(void *ctx, int index, struct fit_control *control)
{
    struct job *j = ctx;
    atomic_fetch_add(&j->calls[index], 1);
    atomic_fetch_add(&j->strangers, !pthread_equal(pthread_self(), j->caller));
    control_spend(control, 10);
    return index != j->cancel_at && control->pool == NULL;
}

// However many threads, also when they outnumber the processors or the tasks.
static void every_task_runs_once(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 64; threads *= 2) {
        struct fit_control control = {.pool = pool_new(threads)};
        for (int count = 0; count <= TASKS; count += 125) {
            struct job j = {.caller = pthread_self(), .cancel_at = -1};
            control.points = 0;
            assert_true(pool_run(&control, count, count_calls, &j));
            for (int i = 0; i < TASKS; i++)
                assert_int_equal(j.calls[i], i < count);
            assert_near(control.points, 10.0 * count, 0);
        }
        pool_free(control.pool);
    }
}

struct meeting {
    atomic_int present;
};

// Ends only when two are in it at the same time.
static bool meet(void *ctx, int index, struct fit_control *control)
{
    struct meeting *m = ctx;
    (void)index;
    atomic_fetch_add(&m->present, 1);
    while (atomic_load(&m->present) < 2)
        sched_yield();
    return !control->stop;
}

static void two_threads_work_at_the_same_time(void **state)
{
    (void)state;
    struct fit_control control = {.pool = pool_new(2)};
    struct meeting m = {0};
    assert_non_null(control.pool);
    assert_true(pool_run(&control, 2, meet, &m));
    pool_free(control.pool);
}

static bool at_once(void *ctx)
{
    (void)ctx;
    return true;
}

static bool wait_for_cancel(void *ctx, int index, struct fit_control *control)
{
    (void)ctx;
    (void)index;
    while (!control_ask(control))
        sched_yield();
    return false;
}

// The caller asks; the others learn it from the caller, also while it only waits for them.
static void all_threads_hear_of_a_cancel(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 8; threads *= 2) {
        struct fit_control control = {.canceled = at_once, .pool = pool_new(threads)};
        assert_false(pool_run(&control, TASKS, wait_for_cancel, NULL));
        assert_true(control.stop);
        pool_free(control.pool);
    }
}

struct ranges {
    atomic_int covered[1000];
};

static bool cover(void *ctx, int part, size_t from, size_t to, struct fit_control *control)
{
    struct ranges *r = ctx;
    for (size_t i = from; i < to; i++)
        atomic_fetch_add(&r->covered[i], 1);
    return part < POOL_PARTS && !control->stop;
}

static void ranges_cover_an_array_once(void **state)
{
    (void)state;
    struct fit_control control = {.pool = pool_new(3)};
    for (size_t count = 1; count <= 1000; count = count * 3 + 1)
        for (size_t least = 1; least <= 100; least *= 10) {
            struct ranges r = {.covered = {0}};
            assert_true(pool_ranges(&control, count, least, cover, &r));
            for (size_t i = 0; i < 1000; i++)
                assert_int_equal(r.covered[i], i < count);
        }
    pool_free(control.pool);
}

// 1 to 70 000 readings, so that there are one and many parts and a short one at the end.
static void passes_are_the_same_to_the_bit(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, 3);
    for (size_t count = 5; count < 80000; count *= 9) {
        struct readings r = readings_new(count);
        for (size_t i = 0; i < count; i++)
            readings_add(&r, 10.0 * (double)(i % 7), 170 * rng_uniform(&rng) - 85,
                         rng_uniform(&rng));
        struct fit_data data = readings_data(&r, false);
        struct fit_options o = fit_options_default();
        struct fit_set set;
        struct kernel_gram gram[2], moments[2];
        double x[FIT_PARAMS] = {1.5, 0.4, -1.5, 0.7, 0.1};
        for (int shared = 0; shared < 2; shared++) {
            struct fit_control control = {.pool = shared ? pool_new(3) : NULL};
            assert_int_equal(set_compile(&data, &o, &control, &set), 0);
            assert_true(passes_gram(&set, x, &control, &gram[shared]));
            assert_true(passes_moments(&set, x, &control, &moments[shared]));
            set_free(&set);
            pool_free(control.pool);
        }
        assert_memory_equal(&gram[0], &gram[1], sizeof gram[0]);
        for (int i = KERNEL_A; i < KERNEL_COLUMNS; i++)
            assert_memory_equal(&moments[0].m[i][KERNEL_A], &moments[1].m[i][KERNEL_A],
                                (KERNEL_COLUMNS - KERNEL_A) * sizeof(double));
        readings_free(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_task_runs_once),
        cmocka_unit_test(two_threads_work_at_the_same_time),
        cmocka_unit_test(all_threads_hear_of_a_cancel),
        cmocka_unit_test(ranges_cover_an_array_once),
        cmocka_unit_test(passes_are_the_same_to_the_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
