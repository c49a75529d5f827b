// SPDX-License-Identifier: MIT
// Sleeping and clocks of libc over the virtual operating system.
#include "tests/dst/libc.h"

#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static int64_t ns_of(const struct timespec *t)
{
    return (int64_t)t->tv_sec * 1000000000 + t->tv_nsec;
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    if (!os.on)
        return REAL(nanosleep)(time, left);
    os_sleep(ns_of(time));
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time, struct timespec *left)
{
    if (!os.on)
        return REAL(clock_nanosleep)(clock, flags, time, left);
    os_sleep(flags & TIMER_ABSTIME ? ns_of(time) - os_monotonic_ns() : ns_of(time));
    return 0;
}

int usleep(useconds_t us)
{
    if (!os.on)
        return REAL(usleep)(us);
    os_sleep((int64_t)us * 1000);
    return 0;
}

unsigned sleep(unsigned s)
{
    if (!os.on)
        return REAL(sleep)(s);
    os_sleep((int64_t)s * 1000000000);
    return 0;
}

// --- clocks --------------------------------------------------------------------------------------

int clock_gettime(clockid_t clock, struct timespec *ret)
{
    if (!os.on)
        return REAL(clock_gettime)(clock, ret);
    const int64_t ns = clock == CLOCK_REALTIME   ? os_utc_ns()
                       : clock == CLOCK_BOOTTIME ? os_monotonic_ns() + os.asleep_ns
                                                 : os_monotonic_ns();
    *ret = (struct timespec){ns / 1000000000, ns % 1000000000};
    return 0;
}

int gettimeofday(struct timeval *restrict ret, void *restrict zone)
{
    if (!os.on)
        return REAL(gettimeofday)(ret, zone);
    const int64_t ns = os_utc_ns();
    *ret = (struct timeval){ns / 1000000000, ns % 1000000000 / 1000};
    return 0;
}

time_t time(time_t *ret)
{
    const time_t t = os.on ? os_utc_ns() / 1000000000 : REAL(time)(NULL);
    if (ret)
        *ret = t;
    return t;
}
