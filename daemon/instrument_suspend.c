// SPDX-License-Identifier: MIT
#include "daemon/instrument_suspend.h"

#include "daemon/instrument_devices.h"
#include "daemon/instrument_inside.h"

#include <math.h>
#include <string.h>

void instrument_disk(struct instrument *in, double (*free_mb)(void *ctx), void *ctx)
{
    in->free_mb = free_mb;
    in->free_mb_ctx = ctx;
}

void instrument_steady(struct instrument *in, bool steady)
{
    in->steady = steady;
    if (!steady)
        in->sampled_steady = false;
}

// --- what they see -------------------------------------------------------------------------------

static bool is_of_laser(const struct bench_term *t)
{
    return bench_term_is(t, "interlock_open") || bench_term_is(t, "laser_power_w");
}

static bool seen(void *ctx, const struct bench_term *t, double *ret_value)
{
    const struct instrument *in = ctx;
    const bool laser = in->part[PART_LASER].link == PART_OK;
    *ret_value = (double)NAN;
    if (bench_term_needs_light(t) && !in->sampled_steady)
        return false;
    if (bench_term_is(t, "monitor_v"))
        *ret_value = in->sample.monitor_v;
    else if (bench_term_is(t, "laser_power_w"))
        *ret_value = laser ? in->laser.power_w : (double)NAN;
    else if (bench_term_is(t, "interlock_open"))
        *ret_value = laser ? !in->laser.interlock_closed : (double)NAN;
    else if (bench_term_is(t, "disk_free_mb"))
        *ret_value = in->free_mb ? in->free_mb(in->free_mb_ctx) : (double)NAN;
    else if (!instrument_input(in, t->name, ret_value))
        *ret_value = (double)NAN;
    return true;
}

void instrument_look_around(struct instrument *in)
{
    struct laser_status status;
    const int64_t now_ns = instrument_now_ns(in);
    if (!in->bench->suspenders_count)
        return;
    if (in->looked_ns == INT64_MIN || now_ns - in->looked_ns >= CLK_S(INSTRUMENT_LOOK_S)) {
        in->looked_ns = now_ns;
        instrument_refresh_inputs(in);
        if (in->part[PART_LASER].link == PART_OK && suspend_uses(&in->suspend, is_of_laser))
            instrument_laser(in, &status, NULL);
    }
    const struct suspend_source source = {in, seen};
    suspend_look(&in->suspend, instrument_now_ns(in), &source);
}

bool instrument_suspended(const struct instrument *in, struct suspender_state *ret_state)
{
    const int first = suspend_first(&in->suspend, instrument_now_ns(in));
    if (first >= 0)
        *ret_state = suspend_state(&in->suspend, first, instrument_now_ns(in));
    return first >= 0;
}

void instrument_release(struct instrument *in)
{
    suspend_release(&in->suspend);
}

void instrument_show_suspenders(const struct instrument *in, struct instrument_snapshot *s)
{
    for (int i = 0; i < in->bench->suspenders_count; i++)
        s->suspender[i] = suspend_state(&in->suspend, i, instrument_now_ns(in));
}

// --- waits ---------------------------------------------------------------------------------------

void instrument_heed(struct instrument *in, bool (*heed)(void *ctx), void *ctx)
{
    in->heed = heed;
    in->heed_ctx = ctx;
}

bool instrument_interrupted(struct instrument *in)
{
    instrument_breathe(in);
    return in->heed && in->heed(in->heed_ctx);
}

int instrument_wait(struct instrument *in, int64_t until_ns, const struct cancel *cancel)
{
    for (;;) {
        const int64_t slice_ns = instrument_now_ns(in) + CLK_MS(100);
        const bool last = !in->heed || until_ns <= slice_ns;
        int rc = clk_sleep_until(&in->breathing.clk, last ? until_ns : slice_ns, cancel);
        if (rc < 0)
            return rc;
        if (in->heed && in->heed(in->heed_ctx))
            return GON_E_CANCELED;
        if (last)
            return 0;
    }
}
