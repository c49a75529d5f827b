// SPDX-License-Identifier: MIT
// A fit that is told to stop by another thread, some time after it began, and when that was: for
// the test and the bench of how long it takes to obey.
#pragma once
#include "fit/fit.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

struct stopper {
    double after_ms;
    clockid_t processor;    // which processor time is read
    double wall_ms, cpu_ms; // when the stop was asked for
    atomic_bool raised;
    pthread_t thread;
};

static inline double stopper_clock_ms(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static inline bool stopper_canceled(void *ctx)
{
    struct stopper *s = ctx;
    return atomic_load(&s->raised);
}

static inline void *stopper_wait(void *ctx)
{
    struct stopper *s = ctx;
    struct timespec t = {(time_t)(s->after_ms / 1e3), (long)(fmod(s->after_ms, 1e3) * 1e6)};
    nanosleep(&t, NULL);
    s->wall_ms = stopper_clock_ms(CLOCK_MONOTONIC);
    s->cpu_ms = stopper_clock_ms(s->processor);
    atomic_store(&s->raised, true);
    return NULL;
}

// Fits; returns fit_run's answer. *ret_wall_ms, *ret_cpu_ms: from the stop to the end, negative
// when the fit ended before.
static inline int stopper_fit(struct stopper *s, const struct fit_data *data,
                              struct fit_options *o, struct fit_result *result,
                              double *ret_wall_ms, double *ret_cpu_ms)
{
    o->canceled = stopper_canceled;
    o->cancel_ctx = s;
    *ret_wall_ms = *ret_cpu_ms = 0;
    if (pthread_create(&s->thread, NULL, stopper_wait, s))
        return FIT_E_MEMORY;
    const int rc = fit_run(data, o, result);
    const double wall_ms = stopper_clock_ms(CLOCK_MONOTONIC);
    const double cpu_ms = stopper_clock_ms(s->processor);
    pthread_join(s->thread, NULL);
    *ret_wall_ms = wall_ms - s->wall_ms;
    *ret_cpu_ms = cpu_ms - s->cpu_ms;
    return rc;
}
