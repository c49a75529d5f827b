// SPDX-License-Identifier: MIT
// The injectable clock. Everything that waits or measures time does it through a struct clk, so
// that the engine runs unchanged in virtual time. Deadlines are absolute, monotonic and in
// nanoseconds; UTC is only ever stored, never compared.
#pragma once
#include <stdint.h>

struct cancel;
struct clk;

struct clk_ops {
    int64_t (*now_ns)(const struct clk *clk); // monotonic
    int64_t (*utc_ns)(const struct clk *clk); // since 1970-01-01
    void (*sleep_until)(struct clk *clk, int64_t t_ns, const struct cancel *cancel);
};

struct clk {
    const struct clk_ops *ops;
};

#define CLK_MS(ms) ((int64_t)((ms)*1000000.0))
#define CLK_S(s) ((int64_t)((s)*1e9))

struct clk *clk_system(void); // the machine's clocks; stateless, never freed, any thread

static inline int64_t clk_now_ns(const struct clk *clk)
{
    return clk->ops->now_ns(clk);
}

static inline int64_t clk_utc_ns(const struct clk *clk)
{
    return clk->ops->utc_ns(clk);
}

// Waits until t_ns, or until cancel (may be NULL) is requested: 0, or GON_E_CANCELED.
int clk_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel);
int clk_sleep(struct clk *clk, int64_t duration_ns, const struct cancel *cancel);

// Virtual time, for tests and simulation: sleeping is the only thing that moves it, and it costs
// nothing. One thread. The caller owns the struct; clk_virtual_init gives it a start.
struct clk_virtual {
    struct clk clk;
    int64_t t_ns;
    int64_t utc_offset_ns;
    void (*on_advance)(void *ctx, int64_t t_ns); // called after each step forward; may be NULL
    void *ctx;
};

struct clk *clk_virtual_init(struct clk_virtual *v, int64_t t_ns, int64_t utc_ns);
