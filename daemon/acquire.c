// SPDX-License-Identifier: MIT
#include "daemon/acquire.h"

#include "campaign/bench.h"
#include "campaign/plan.h"
#include "campaign/store.h"
#include "daemon/instrument_devices.h"

#include <math.h>

#define SATURATED 0.95  // of full scale
#define NEARLY_FULL 0.7 // of full scale: the next reading begins one range up
#define HEADROOM 2.0    // of a range chosen for a known signal
#define STEPS 30000.0   // a full scale has at least so many steps: what is below one is not known
#define SAMPLE_TRIES 3  // for one answer that is not a number
#define FALL_MOST 1e-5  // of a signal, that is waited out

void acquire_begin(struct acquire *a)
{
    a->least_range = 0;
    a->ups = 0;
}

static int change_range(struct instrument *in, struct acquire *a, struct gon_error *err)
{
    const int ranges = instrument_ranges(in);
    int rc = a->set_up ? instrument_set_up(in, err) : 0;
    if (rc < 0)
        return rc;
    a->set_up = false;
    if (a->range < 0 || a->range >= ranges)
        a->range = ranges - 1;
    if (instrument_range(in) == a->range)
        return 0;
    rc = instrument_set_range(in, a->range, err);
    a->range_ns = instrument_now_ns(in);
    return rc;
}

static int64_t settled_ns(struct instrument *in, int64_t since_ns, double residual)
{
    const int slope_db = instrument_bench(in)->detector.slope_db;
    return since_ns + CLK_S(detector_settle_s(instrument_time_constant_s(in), slope_db, residual));
}

// A monitor of its own sees no axis move, and may be slower than the detector.
static int64_t monitor_settled_ns(struct instrument *in, int64_t since_ns)
{
    const double time_constant_s = instrument_monitor_time_constant_s(in);
    const int slope_db = instrument_bench(in)->detector.slope_db;
    return since_ns + CLK_S(detector_settle_s(time_constant_s, slope_db, ACQUIRE_RESIDUAL));
}

static int settle(struct instrument *in, const struct acquire *a, const struct acquire_wish *wish,
                  const struct cancel *cancel, struct gon_error *err)
{
    const int64_t light_ns = settled_ns(in, wish->since_ns, ACQUIRE_RESIDUAL);
    const int64_t range_ns = settled_ns(in, a->range_ns, ACQUIRE_RESIDUAL);
    const int64_t monitor_ns = monitor_settled_ns(in, wish->source_ns);
    const int64_t both_ns = light_ns > range_ns ? light_ns : range_ns;
    if (instrument_wait(in, both_ns > monitor_ns ? both_ns : monitor_ns, cancel) < 0)
        return gon_fail(err, GON_E_CANCELED, "stopped while settling");
    return 0;
}

// An answer that is no number is never one: asked again, and after that an error. The value is that
// of the moment it was asked for.
static int sample(struct instrument *in, struct detector_sample *ret_sample, int64_t *ret_asked_ns,
                  struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; i < SAMPLE_TRIES; i++) {
        *ret_asked_ns = instrument_now_ns(in);
        rc = instrument_sample(in, ret_sample, err);
        if (rc != GON_E_LINK)
            break;
        instrument_breathe(in);
    }
    if (rc >= 0 && !isfinite(ret_sample->signal_v))
        return gon_fail(err, GON_E_LINK, "detector: answered something that is not a number");
    return rc;
}

// Welford's running mean and sum of squares.
struct tally {
    int n;
    double mean, squares;
};

static void add(struct tally *t, double x)
{
    const double d = x - t->mean;
    t->n++;
    t->mean += d / t->n;
    t->squares += d * (x - t->mean);
}

static double sd(const struct tally *t)
{
    return t->n > 1 ? sqrt(t->squares / (t->n - 1)) : 0.0;
}

// The first sample tells how far the signal fell: what is left of the old one has to be small
// against it.
static int first_sample(struct instrument *in, const struct acquire *a, int64_t since_ns,
                        const struct cancel *cancel, struct detector_sample *ret_sample,
                        int64_t *ret_asked_ns, struct gon_error *err)
{
    int rc = sample(in, ret_sample, ret_asked_ns, err);
    if (rc < 0)
        return rc;
    const double fall = fmax(fabs(ret_sample->signal_v) / a->last_signal_v, FALL_MOST);
    const int64_t until_ns = settled_ns(in, since_ns, ACQUIRE_RESIDUAL * fall);
    if (!(fall < 1.0) || until_ns <= instrument_now_ns(in))
        return 0;
    if (instrument_wait(in, until_ns, cancel) < 0)
        return gon_fail(err, GON_E_CANCELED, "stopped while settling");
    rc = instrument_clear(in, err); // the overload of the old signal
    return rc < 0 ? rc : sample(in, ret_sample, ret_asked_ns, err);
}

// Saturated samples end it: more of them say nothing more.
static int take_samples(struct instrument *in, const struct acquire *a,
                        const struct acquire_wish *wish, const struct cancel *cancel,
                        struct acquire_reading *r, struct gon_error *err)
{
    const double full_v = instrument_full_scale_v(in, a->range);
    const int64_t spacing_ns = CLK_S(
        plan_spacing_s(instrument_time_constant_s(in), instrument_bench(in)->detector.slope_db));
    struct tally signal = {0}, monitor = {0};
    int64_t next_ns = 0;
    for (int k = 0; k < wish->count && !(r->flags & STORE_SATURATED); k++) {
        struct detector_sample s;
        if (instrument_wait(in, next_ns, cancel) < 0)
            return gon_fail(err, GON_E_CANCELED, "stopped while reading");
        int64_t asked_ns;
        int rc = k ? sample(in, &s, &asked_ns, err)
                   : first_sample(in, a, wish->since_ns, cancel, &s, &asked_ns, err);
        if (rc < 0)
            return rc;
        if (k == 0)
            r->utc_ns = instrument_utc_ns(in);
        next_ns = asked_ns + spacing_ns;
        add(&signal, s.signal_v);
        add(&monitor, s.monitor_v);
        if (fabs(s.signal_v) >= SATURATED * full_v)
            r->flags |= STORE_SATURATED;
        if (s.monitor_v < wish->monitor_least_v)
            r->flags |= STORE_MONITOR_LOW;
    }
    r->count = signal.n;
    r->signal_v = signal.mean;
    r->signal_sd_v = sd(&signal);
    r->monitor_v = monitor.mean;
    r->monitor_sd_v = isnan(monitor.mean) ? monitor.mean : sd(&monitor);
    return 0;
}

static int fitting_range(struct instrument *in, const struct acquire *a,
                         const struct acquire_reading *r)
{
    const double step_v = instrument_full_scale_v(in, r->range) / STEPS;
    const double need_v = HEADROOM * (fabs(r->signal_v) + 3.0 * r->signal_sd_v + step_v);
    int range = a->least_range;
    while (range < r->range && instrument_full_scale_v(in, range) < need_v)
        range++;
    return range;
}

// What the reading says about the range of the next one, and whether it is itself good.
static void judge(struct instrument *in, struct acquire *a, struct acquire_reading *r)
{
    const double signal_v = fabs(r->signal_v) + 3.0 * r->signal_sd_v;
    const int top = instrument_ranges(in) - 1;
    a->last_signal_v = fabs(r->signal_v);
    if (r->flags & STORE_SATURATED) {
        a->last_signal_v = instrument_full_scale_v(in, r->range);
        r->again = r->range < top;
        a->least_range = r->range + 1 < top ? r->range + 1 : top;
        a->range = r->range + (1 << a->ups) < top ? r->range + (1 << a->ups) : top;
        a->ups += a->ups < 3;
    } else if (r->flags & (STORE_MONITOR_LOW)) {
        r->again = false; // the laser has to be looked at first
    } else if (r->flags & (STORE_UNLOCKED | STORE_UNSETTLED)) {
        r->again = true;
        a->set_up = (r->flags & STORE_UNSETTLED) != 0; // somebody changed it, or it restarted
    } else if (r->monitor_failed) {
        r->again = true;
    } else {
        r->accepted = true;
        if (r->range < top && signal_v > NEARLY_FULL * instrument_full_scale_v(in, r->range))
            a->range = r->range + 1;
        if (r->range > a->least_range &&
            signal_v < ACQUIRE_UNDER * instrument_full_scale_v(in, r->range - 1))
            a->range = fitting_range(in, a, r);
        if (a->range < r->range &&
            signal_v < ACQUIRE_POOR * instrument_full_scale_v(in, r->range)) {
            r->flags |= STORE_UNDER_RANGE;
            r->accepted = false;
            r->again = true;
        }
    }
}

static unsigned store_flags(unsigned condition)
{
    return (condition & DETECTOR_SATURATED ? STORE_SATURATED : 0) |
           (condition & DETECTOR_UNLOCKED ? STORE_UNLOCKED : 0) |
           (condition & DETECTOR_UNSETTLED ? STORE_UNSETTLED : 0);
}

int acquire_attempt(struct instrument *in, struct acquire *a, const struct acquire_wish *wish,
                    const struct cancel *cancel, struct acquire_reading *ret_reading,
                    struct gon_error *err)
{
    struct acquire_reading r = {0};
    unsigned condition = 0;
    int rc = change_range(in, a, err);
    r.range = a->range;
    if (rc >= 0)
        rc = settle(in, a, wish, cancel, err);
    if (rc >= 0) // what happened on the way
        rc = instrument_clear(in, err);
    if (rc >= 0)
        rc = take_samples(in, a, wish, cancel, &r, err);
    if (rc >= 0)
        rc = instrument_condition(in, &condition, err);
    if (rc >= 0)
        rc = instrument_monitor_failed(in, &r.monitor_failed, err);
    if (rc < 0)
        return rc;
    r.flags |= store_flags(condition) | (r.monitor_failed ? STORE_DISCARDED : 0);
    judge(in, a, &r);
    *ret_reading = r;
    return 0;
}
