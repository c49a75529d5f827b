// SPDX-License-Identifier: MIT
#include "base/clk.h"

#include "base/cancel.h"
#include "base/err.h"

#include <poll.h>
#include <time.h>

static int64_t read_ns(clockid_t id)
{
    struct timespec ts;
    clock_gettime(id, &ts);
    return (int64_t)ts.tv_sec * 1000000000 + ts.tv_nsec;
}

static int64_t system_now_ns(const struct clk *clk)
{
    (void)clk;
    return read_ns(CLOCK_MONOTONIC);
}

static int64_t system_utc_ns(const struct clk *clk)
{
    (void)clk;
    return read_ns(CLOCK_REALTIME);
}

static void system_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    (void)clk;
    for (;;) {
        int64_t left_ns = t_ns - read_ns(CLOCK_MONOTONIC);
        if (left_ns <= 0)
            return;
        struct timespec ts = {left_ns / 1000000000, left_ns % 1000000000};
        struct pollfd p = {cancel_fd(cancel), POLLIN, 0};
        if (ppoll(&p, 1, &ts, NULL) > 0)
            return;
    }
}

struct clk *clk_system(void)
{
    static const struct clk_ops ops = {system_now_ns, system_utc_ns, system_sleep_until};
    static struct clk clk = {&ops};
    return &clk;
}

int clk_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    if (cancel_requested(cancel))
        return GON_E_CANCELED;
    clk->ops->sleep_until(clk, t_ns, cancel);
    return cancel_requested(cancel) ? GON_E_CANCELED : GON_OK;
}

int clk_sleep(struct clk *clk, int64_t duration_ns, const struct cancel *cancel)
{
    return clk_sleep_until(clk, clk_now_ns(clk) + duration_ns, cancel);
}

static int64_t virtual_now_ns(const struct clk *clk)
{
    return ((const struct clk_virtual *)clk)->t_ns;
}

static int64_t virtual_utc_ns(const struct clk *clk)
{
    const struct clk_virtual *v = (const struct clk_virtual *)clk;
    return v->t_ns + v->utc_offset_ns;
}

static void virtual_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    struct clk_virtual *v = (struct clk_virtual *)clk;
    (void)cancel;
    if (t_ns <= v->t_ns)
        return;
    v->t_ns = t_ns;
    if (v->on_advance)
        v->on_advance(v->ctx, t_ns);
}

struct clk *clk_virtual_init(struct clk_virtual *v, int64_t t_ns, int64_t utc_ns)
{
    static const struct clk_ops ops = {virtual_now_ns, virtual_utc_ns, virtual_sleep_until};
    *v = (struct clk_virtual){.clk = {&ops}, .t_ns = t_ns, .utc_offset_ns = utc_ns - t_ns};
    return &v->clk;
}
