// SPDX-License-Identifier: MIT
// Devices beside simbench's world, in virtual time: a power meter as monitor, a shutter that cuts
// its light and a filter wheel before its detector. Each call counts, and each can be unplugged,
// stuck or turned by hand. Include after simbench.h.
#pragma once
#include "drivers/selector.h"
#include "tests/unit/simbench.h"

#include <stdarg.h>
#include <stddef.h>

#define SIMMONITOR_W_PER_V 1e-3 // the world's monitor in volts as watts

struct simmonitor {
    struct detector detector;
    struct simbench *bench;
    int range; // decades from 1 uW
    bool clipped;
    double wavelength_nm;
    int samples, setups, range_changes;
    int nonsense; // answers that are not numbers, to come
    double times; // the light is so much stronger than it should be; 1
    int restarts; // conditions "unsettled", to come
};

enum { SIMSELECTOR_POSITIONS = 3 };

struct simselector {
    struct selector selector;
    struct simbench *bench;
    const char *names[SIMSELECTOR_POSITIONS];
    double passes[SIMSELECTOR_POSITIONS];
    bool is_shutter; // passes says what comes through at all; else what the detector gets of it
    int at, safe;
    bool stuck;
    bool slips; // is one further each time it is looked at
    double travel_s;
    int looks, moves;
};

struct simdevices {
    struct simmonitor monitor;
    struct simselector shutter, wheel;
};

// --- monitor ---
static inline struct simmonitor *simmonitor_of(struct detector *d, struct gon_error *err, int *rc)
{
    struct simmonitor *m = (struct simmonitor *)d;
    bool done;
    *rc = simbench_call(m->bench, SIMBENCH_MONITOR, &done, err);
    return m;
}

static inline int simmonitor_identify(struct detector *d, char *text, size_t size,
                                      struct gon_error *err)
{
    int rc;
    simmonitor_of(d, err, &rc);
    if (rc >= 0)
        snprintf(text, size, "simulated power meter");
    return rc;
}

static inline int simmonitor_setup(struct detector *d, const struct detector_setup *s,
                                   double *ret_time_constant_s, struct gon_error *err)
{
    int rc;
    struct simmonitor *m = simmonitor_of(d, err, &rc);
    if (rc < 0)
        return rc;
    m->setups++;
    m->wavelength_nm = s->wavelength_nm;
    *ret_time_constant_s = 0.05;
    return 0;
}

static inline int simmonitor_ranges(struct detector *d)
{
    (void)d;
    return 7; // 1 uW to 1 W
}

static inline double simmonitor_full_scale(struct detector *d, int range)
{
    (void)d;
    return pow(10, range - 6);
}

static inline int simmonitor_set_range(struct detector *d, int range, struct gon_error *err)
{
    int rc;
    struct simmonitor *m = simmonitor_of(d, err, &rc);
    if (rc < 0)
        return rc;
    m->range_changes++;
    m->range = range;
    return 0;
}

static inline int simmonitor_sample(struct detector *d, struct detector_sample *ret,
                                    struct gon_error *err)
{
    int rc;
    struct simmonitor *m = simmonitor_of(d, err, &rc);
    if (rc < 0)
        return rc;
    m->samples++;
    if (m->nonsense > 0) {
        m->nonsense--;
        return gon_fail(err, GON_E_LINK, "answered that it has no measurement");
    }
    const double full = simmonitor_full_scale(d, m->range);
    double power_w = m->times * SIMMONITOR_W_PER_V * world_aux_v(&m->bench->world, 1);
    if (power_w > full) {
        m->clipped = true;
        power_w = full;
    }
    *ret = (struct detector_sample){power_w, (double)NAN, (double)NAN};
    return 0;
}

static inline int simmonitor_condition(struct detector *d, unsigned *ret, struct gon_error *err)
{
    int rc;
    struct simmonitor *m = simmonitor_of(d, err, &rc);
    if (rc < 0)
        return rc;
    *ret = (m->clipped ? (unsigned)DETECTOR_SATURATED : 0) |
           (m->restarts > 0 ? (unsigned)DETECTOR_UNSETTLED : 0);
    m->clipped = false;
    m->restarts -= m->restarts > 0;
    return 0;
}

static inline int simmonitor_clear(struct detector *d, struct gon_error *err)
{
    int rc;
    struct simmonitor *m = simmonitor_of(d, err, &rc);
    m->clipped = false;
    return rc;
}

static inline int simmonitor_reopen(struct detector *d, struct gon_error *err)
{
    int rc;
    simmonitor_of(d, err, &rc);
    return rc;
}

static inline void simmonitor_free(struct detector *d)
{
    (void)d;
}

// --- selectors ---
static inline struct simselector *simselector_of(struct selector *z)
{
    return (struct simselector *)z;
}

static inline int simselector_call(struct simselector *s, bool *ret_carried_out,
                                   struct gon_error *err)
{
    return simbench_call(s->bench, s->is_shutter ? SIMBENCH_SHUTTER : SIMBENCH_WHEEL,
                         ret_carried_out, err);
}

// By hand, too.
static inline void simselector_turn(struct simselector *s, int position)
{
    world_see(&s->bench->world, s->bench->clk.t_ns);
    s->at = position;
    if (s->is_shutter)
        s->bench->world.lets_out = s->passes[position];
    else
        s->bench->world.lets_in = s->passes[position];
}

static inline int simselector_identify(struct selector *z, char *text, size_t size,
                                       struct gon_error *err)
{
    bool done;
    int rc = simselector_call(simselector_of(z), &done, err);
    if (rc >= 0)
        snprintf(text, size, "simulated selector");
    return rc;
}

static inline int simselector_positions(struct selector *z)
{
    int n = 0;
    while (n < SIMSELECTOR_POSITIONS && simselector_of(z)->names[n])
        n++;
    return n;
}

static inline const char *simselector_name(struct selector *z, int position)
{
    return simselector_of(z)->names[position];
}

static inline int simselector_safe(struct selector *z)
{
    return simselector_of(z)->safe;
}

static inline int simselector_where(struct selector *z, int *ret_position, bool *ret_moving,
                                    struct gon_error *err)
{
    struct simselector *s = simselector_of(z);
    bool done;
    int rc = simselector_call(s, &done, err);
    s->looks++;
    if (rc < 0)
        return rc;
    if (s->slips && s->at == 0)
        simselector_turn(s, 1);
    *ret_position = s->at;
    if (ret_moving)
        *ret_moving = false;
    return 0;
}

// Sleeps in slices as a driver's clock does, so that the lease is renewed.
static inline int simselector_go(struct selector *z, int position, struct gon_error *err)
{
    struct simselector *s = simselector_of(z);
    bool done;
    int rc = simselector_call(s, &done, err);
    if (!done || s->at == position)
        return rc;
    s->moves++;
    clk_sleep(&s->bench->clk.clk, CLK_S(s->travel_s), NULL);
    if (s->stuck)
        return gon_fail(err, GON_E_DEVICE, "does not go to '%s'; is it stuck?", s->names[position]);
    simselector_turn(s, position);
    return rc;
}

static inline int simselector_reopen(struct selector *z, struct gon_error *err)
{
    bool done;
    return simselector_call(simselector_of(z), &done, err);
}

static inline void simselector_free(struct selector *z)
{
    (void)z;
}

// --- all of them ---
static inline void simdevices_init(struct simdevices *d, struct simbench *b)
{
    static const struct detector_ops detector_ops = {.identify = simmonitor_identify,
                                                     .setup = simmonitor_setup,
                                                     .ranges = simmonitor_ranges,
                                                     .full_scale_v = simmonitor_full_scale,
                                                     .set_range = simmonitor_set_range,
                                                     .sample = simmonitor_sample,
                                                     .clear = simmonitor_clear,
                                                     .condition = simmonitor_condition,
                                                     .reopen = simmonitor_reopen,
                                                     .free = simmonitor_free};
    static const struct selector_ops selector_ops = {.identify = simselector_identify,
                                                     .positions = simselector_positions,
                                                     .name = simselector_name,
                                                     .safe = simselector_safe,
                                                     .where = simselector_where,
                                                     .go = simselector_go,
                                                     .reopen = simselector_reopen,
                                                     .free = simselector_free};
    d->monitor = (struct simmonitor){.detector = {&detector_ops}, .bench = b, .times = 1};
    d->shutter = (struct simselector){.selector = {&selector_ops},
                                      .bench = b,
                                      .names = {"open", "closed"},
                                      .passes = {1, 0},
                                      .is_shutter = true,
                                      .at = 1,
                                      .safe = 1,
                                      .travel_s = 0.05};
    d->wheel = (struct simselector){.selector = {&selector_ops},
                                    .bench = b,
                                    .names = {"1", "2", "3"},
                                    .passes = {1, 0.1, 0.01},
                                    .at = 2, // wherever it was left
                                    .safe = SELECTOR_ELSEWHERE,
                                    .travel_s = 0.15};
}

static inline void simdevices_monitor(struct bench_config *b)
{
    snprintf(b->monitor.driver, sizeof b->monitor.driver, "thorlabs-pm100");
    b->detector.monitor_aux = 0;
    b->wavelength_nm = 1064;
}

static inline struct bench_device *simdevices_add(struct bench_config *b, const char *name,
                                                  enum bench_use use, const char *position)
{
    struct bench_device *d = &b->devices[b->devices_count++];
    *d = (struct bench_device){.use = use};
    snprintf(d->name, sizeof d->name, "%s", name);
    snprintf(d->driver, sizeof d->driver, "thorlabs");
    snprintf(d->position, sizeof d->position, "%s", position);
    return d;
}

// Those that the bench has, in the order shutter, wheel.
static inline void simdevices_parts(struct simdevices *d, const struct bench_config *b,
                                    struct instrument_parts *parts)
{
    parts->monitor = *b->monitor.driver ? &d->monitor.detector : NULL;
    for (int i = 0; i < b->devices_count; i++) {
        struct simselector *s = b->devices[i].use == BENCH_SHUTTER ? &d->shutter : &d->wheel;
        simselector_turn(s, s->at);
        parts->selector[i] = &s->selector;
    }
}
