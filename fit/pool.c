// SPDX-License-Identifier: MIT
#include "fit/pool.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <time.h>

#define SPINS 1000          // of pause: some 20 us, more than lies between two passes of a polish
#define PATIENCE_NS 1000000 // between two questions whether the call is canceled, while waiting

struct pool {
    pthread_mutex_t lock;
    pthread_cond_t opened, left;
    pthread_t thread[POOL_MOST];
    int threads; // beside the caller
    // One run: written by the caller while it is closed, read by those who entered it.
    pool_task *task;
    void *ctx;
    int count;
    atomic_int next; // index
    atomic_bool stop;
    // Under the lock; the atomic ones are also looked at without it, to spare a sleep.
    atomic_uint run;
    atomic_int inside; // threads beside the caller
    atomic_bool quit;
    bool open;
    double points;
};

static inline void spin(void)
{
#if defined __x86_64__ || defined __i386__
    __builtin_ia32_pause();
#endif
}

static bool stopped(void *ctx)
{
    struct pool *p = ctx;
    return atomic_load_explicit(&p->stop, memory_order_relaxed);
}

static void work(struct pool *p, struct fit_control *control)
{
    int i;
    while (!control->stop && !stopped(p) && (i = atomic_fetch_add(&p->next, 1)) < p->count)
        if (!p->task(p->ctx, i, control))
            break;
}

// A run is entered only while it is open, so a thread that wakes late holds nobody up.
static void take_part(struct pool *p)
{
    struct fit_control control = {.canceled = stopped, .ctx = p};
    atomic_fetch_add(&p->inside, 1);
    pthread_mutex_unlock(&p->lock);
    work(p, &control);
    pthread_mutex_lock(&p->lock);
    p->points += control.points;
    if (atomic_fetch_sub(&p->inside, 1) == 1)
        pthread_cond_signal(&p->left);
}

static void *thread_main(void *ctx)
{
    struct pool *p = ctx;
    unsigned seen = 0;
    for (;;) {
        for (int i = 0; i < SPINS && atomic_load(&p->run) == seen && !atomic_load(&p->quit); i++)
            spin();
        pthread_mutex_lock(&p->lock);
        while (atomic_load(&p->run) == seen && !atomic_load(&p->quit))
            pthread_cond_wait(&p->opened, &p->lock);
        seen = atomic_load(&p->run);
        bool quit = atomic_load(&p->quit);
        if (!quit && p->open)
            take_part(p);
        pthread_mutex_unlock(&p->lock);
        if (quit)
            return NULL;
    }
}

static void open_run(struct pool *p, int count, pool_task *task, void *ctx)
{
    pthread_mutex_lock(&p->lock);
    p->task = task;
    p->ctx = ctx;
    p->count = count;
    p->points = 0;
    p->open = true;
    atomic_store(&p->next, 0);
    atomic_store(&p->stop, false);
    atomic_fetch_add(&p->run, 1);
    pthread_cond_broadcast(&p->opened);
    pthread_mutex_unlock(&p->lock);
}

static struct timespec soon(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    t.tv_nsec += PATIENCE_NS;
    t.tv_sec += t.tv_nsec / 1000000000;
    t.tv_nsec %= 1000000000;
    return t;
}

// Waits until the others have left, and goes on asking meanwhile.
static void close_run(struct pool *p, struct fit_control *control)
{
    if (control->stop)
        atomic_store(&p->stop, true);
    for (int i = 0; i < SPINS && atomic_load(&p->inside) > 0; i++)
        spin();
    pthread_mutex_lock(&p->lock);
    p->open = false;
    while (atomic_load(&p->inside) > 0) {
        struct timespec until = soon();
        if (pthread_cond_timedwait(&p->left, &p->lock, &until) == ETIMEDOUT && control_ask(control))
            atomic_store(&p->stop, true);
    }
    control->points += p->points;
    pthread_mutex_unlock(&p->lock);
}

bool pool_run(struct fit_control *control, int count, pool_task *task, void *ctx)
{
    struct pool *p = control->pool;
    if (!p || count < 2) {
        for (int i = 0; i < count; i++)
            if (!task(ctx, i, control))
                return false;
        return !control->stop;
    }
    control->pool = NULL;
    open_run(p, count, task, ctx);
    work(p, control);
    close_run(p, control);
    control->pool = p;
    return !control->stop;
}

struct ranges {
    size_t count, length;
    pool_range *task;
    void *ctx;
};

static bool run_range(void *ctx, int index, struct fit_control *control)
{
    struct ranges *r = ctx;
    size_t from = (size_t)index * r->length, left = r->count - from;
    size_t to = from + (left < r->length ? left : r->length);
    return !control_ask(control) && r->task(r->ctx, index, from, to, control);
}

size_t pool_range_length(size_t count, size_t least)
{
    size_t length = (count + POOL_PARTS - 1) / POOL_PARTS;
    return length > least ? length : least;
}

bool pool_ranges(struct fit_control *control, size_t count, size_t least, pool_range *task,
                 void *ctx)
{
    struct ranges r = {count, pool_range_length(count, least), task, ctx};
    return pool_run(control, (int)((count + r.length - 1) / r.length), run_range, &r);
}

struct pool *pool_new(int threads)
{
    struct pool *p = threads > 1 ? calloc(1, sizeof *p) : NULL;
    if (!p)
        return NULL;
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->opened, NULL);
    pthread_cond_init(&p->left, &monotonic);
    pthread_condattr_destroy(&monotonic);
    while (p->threads < threads - 1 && p->threads < POOL_MOST - 1 &&
           pthread_create(&p->thread[p->threads], NULL, thread_main, p) == 0)
        p->threads++;
    if (p->threads > 0)
        return p;
    pool_free(p);
    return NULL;
}

void pool_free(struct pool *p)
{
    if (!p)
        return;
    pthread_mutex_lock(&p->lock);
    atomic_store(&p->quit, true);
    pthread_cond_broadcast(&p->opened);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < p->threads; i++)
        pthread_join(p->thread[i], NULL);
    pthread_cond_destroy(&p->left);
    pthread_cond_destroy(&p->opened);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
