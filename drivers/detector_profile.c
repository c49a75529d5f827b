// SPDX-License-Identifier: MIT
// A detector by its profile (struct profile_detector).
#include "drivers/by_profile.h"

#include "drivers/detector.h"
#include "drivers/message.h"
#include "drivers/profile_when.h"
#include "drivers/session.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ANOTHER_RANGE 0.1 // of full scale: some devices report a range with its 5 % of headroom

struct profiled_detector {
    struct detector detector; // first
    struct session *s;
    const struct profile_detector *is;
    struct detector_setup setup;       // as it was set up last
    double full_scale[PROFILE_LADDER]; // from the most sensitive one
    int ranges;
    int range;        // as it was set; -1: not known
    int64_t ready_ns; // after a change of range
    unsigned turn;    // of the ways to ask for a sample
    unsigned flags;   // of samples since the last condition
    bool restarted;   // since the last setup
    uint64_t strays;  // answers too many, of the link, at the last clear
};

static struct profiled_detector *detector_of(struct detector *d)
{
    return (struct profiled_detector *)d;
}

static struct transport *transport_of(const struct profiled_detector *z)
{
    return message_transport(session_message(z->s));
}

static int identify(struct detector *d, char *ret_text, size_t size, struct gon_error *err)
{
    return session_identify(detector_of(d)->s, ret_text, size, err);
}

static const struct link_stats *stats(const struct detector *d)
{
    return message_stats(session_message(((const struct profiled_detector *)d)->s));
}

// --- ranges --------------------------------------------------------------------------------------

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Those of the ladder, or of the list; without either one, as far as the signal goes.
static void find_ranges(struct profiled_detector *z, const struct profile *p)
{
    const int full = profile_value(p, z->is->full_scale);
    const int signal = profile_value(p, z->is->signal);
    const double *from = z->is->ranges;
    z->ranges = z->is->ranges_count;
    if (z->ranges == 0 && full >= 0) {
        from = p->values[full].ladder;
        z->ranges = p->values[full].ladder_count;
    }
    if (z->ranges == 0 && signal >= 0) {
        from = &p->values[signal].max;
        z->ranges = 1;
    }
    memcpy(z->full_scale, from, (size_t)z->ranges * sizeof *from);
    qsort(z->full_scale, (size_t)z->ranges, sizeof z->full_scale[0], by_size);
}

static bool is_range(const struct profiled_detector *z, int range, double full_scale)
{
    return fabs(full_scale - z->full_scale[range]) <= ANOTHER_RANGE * z->full_scale[range];
}

static int ranges(struct detector *d)
{
    return detector_of(d)->ranges;
}

static double full_scale(struct detector *d, int range)
{
    assert(range >= 0 && range < detector_of(d)->ranges);
    return detector_of(d)->full_scale[range];
}

static int set_range(struct detector *d, int range, struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    assert(range >= 0 && range < z->ranges);
    z->range = -1;
    session_put(z->s, z->is->full_scale, z->full_scale[range]);
    int rc = *z->is->set_range ? session_send(z->s, z->is->set_range, NULL, err) : 0;
    if (rc < 0)
        return rc;
    z->range = range;
    z->ready_ns = clk_now_ns(transport_clk(transport_of(z))) + CLK_S(z->is->range_settle_ms * 1e-3);
    return 0;
}

static int read_range(struct profiled_detector *z, struct gon_error *err)
{
    int rc = session_ask(z->s, &z->is->read_range, err);
    const double now = rc < 0 ? (double)NAN : session_number(z->s, z->is->full_scale);
    for (int i = 0; i < z->ranges; i++)
        if (is_range(z, i, now))
            z->range = i;
    return rc;
}

// --- setting up ----------------------------------------------------------------------------------

static int check_value(const struct profiled_detector *z, const char *name, double number,
                       struct gon_error *err)
{
    const struct profile *p = session_profile(z->s);
    const int i = profile_value(p, name);
    struct gon_error why = {0};
    double wire;
    if (i < 0 || profile_wire(&p->values[i], number, &wire, &why) == 0)
        return 0;
    return gon_fail(err, GON_E_INPUT, "%s: %s: %s", p->name, name, why.text);
}

// Before anything is sent. The time constant becomes one that the device has.
static int check_setup(const struct profiled_detector *z, struct detector_setup *s,
                       struct gon_error *err)
{
    const struct profile *p = session_profile(z->s);
    const int i = profile_value(p, "time_constant_s");
    struct gon_error why = {0};
    if (!(s->time_constant_s > 0))
        return gon_fail(err, GON_E_INPUT, "%s: time constant %g s; it must be above 0", p->name,
                        s->time_constant_s);
    if (i >= 0 &&
        profile_at_least(&p->values[i], s->time_constant_s, &s->time_constant_s, &why) < 0)
        return gon_fail(err, GON_E_INPUT, "%s: time constant: %s", p->name, why.text);
    if (s->monitor_aux < 0 || (s->monitor_aux > 0 && z->is->sample_monitor.count == 0))
        return gon_fail(err, GON_E_INPUT, "%s: monitor input %d; %s", p->name, s->monitor_aux,
                        z->is->sample_monitor.count ? "0 for none" : "it has none, say 0");
    int rc = check_value(z, "slope_db", s->slope_db, err);
    if (rc == 0 && s->monitor_aux > 0)
        rc = check_value(z, "monitor_aux", s->monitor_aux, err);
    if (rc == 0 && s->wavelength_nm > 0)
        rc = check_value(z, "wavelength_nm", s->wavelength_nm, err);
    return rc;
}

static void put_setup(struct profiled_detector *z)
{
    const struct detector_setup *s = &z->setup;
    if (s->time_constant_s > 0) {
        session_put(z->s, "time_constant_s", s->time_constant_s);
        session_put(z->s, "slope_db", s->slope_db);
    }
    if (s->monitor_aux > 0)
        session_put(z->s, "monitor_aux", s->monitor_aux);
    if (s->wavelength_nm > 0)
        session_put(z->s, "wavelength_nm", s->wavelength_nm);
}

static int send_setup(struct profiled_detector *z, struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; rc == 0 && i < z->is->setup.count; i++)
        if (session_holds(z->s, z->is->setup.rule[i].when))
            rc = session_send(z->s, z->is->setup.rule[i].send, NULL, err);
    return rc;
}

static int setup(struct detector *d, const struct detector_setup *s, double *ret_time_constant_s,
                 struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    struct detector_setup wanted = *s;
    int rc = check_setup(z, &wanted, err);
    if (rc < 0)
        return rc;
    z->setup = wanted;
    put_setup(z);
    rc = send_setup(z, err);
    if (rc == 0 && z->range < 0)
        rc = read_range(z, err);
    if (rc < 0)
        return rc;
    z->flags = 0;
    z->restarted = false;
    session_restarted(z->s);
    const double now_s = session_number(z->s, "time_constant_s");
    *ret_time_constant_s = isnan(now_s) ? z->is->settle_s : now_s;
    return 0;
}

// --- readings ------------------------------------------------------------------------------------

// The flags whose rules speak of what these asks brought.
static unsigned flags_of(const struct profiled_detector *z, const struct profile_asks *asks)
{
    const struct profile *p = session_profile(z->s);
    bool gives[PROFILE_VALUES] = {false};
    unsigned flags = 0;
    session_gives(p, asks, gives);
    for (int r = 0; r < z->is->flags.count; r++) {
        const struct profile_rule *rule = &z->is->flags.rule[r];
        bool uses[PROFILE_VALUES] = {false};
        bool concerned = false;
        profile_when_uses(p, rule->when, uses);
        for (int i = 0; i < p->values_count; i++)
            concerned = concerned || (uses[i] && gives[i]);
        if (concerned && session_holds(z->s, rule->when))
            flags |= 1u << rule->is;
    }
    return flags;
}

// Beyond the range is no number: the full scale stands for it, and the condition tells.
static int take_signal(struct profiled_detector *z, double *ret_signal, struct gon_error *err)
{
    double signal = session_number(z->s, z->is->signal);
    if (isnan(signal))
        return gon_fail(err, GON_E_LINK, "%s: answered that it has no measurement",
                        session_link(z->s));
    if (isinf(signal))
        signal = z->full_scale[z->range < 0 ? z->ranges - 1 : z->range];
    if (z->range >= 0 && fabs(signal) >= z->is->clipped * z->full_scale[z->range])
        z->flags |= DETECTOR_SATURATED;
    *ret_signal = signal;
    return 0;
}

static int wait_ready(const struct profiled_detector *z, struct gon_error *err)
{
    struct transport *t = transport_of(z);
    if (clk_sleep_until(transport_clk(t), z->ready_ns, transport_cancel(t)) < 0)
        return gon_fail(err, GON_E_CANCELED, "%s: stopped while the range settles",
                        session_link(z->s));
    return 0;
}

static int sample(struct detector *d, struct detector_sample *ret_sample, struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    const bool monitor = z->setup.monitor_aux > 0;
    const struct profile_asks *ways = monitor ? &z->is->sample_monitor : &z->is->sample;
    struct profile_asks one = {.count = 1};
    double signal = 0;
    memcpy(one.name[0], ways->name[z->turn++ % (unsigned)ways->count], sizeof one.name[0]);
    int rc = wait_ready(z, err);
    if (rc == 0)
        rc = session_ask(z->s, &one, err);
    if (rc == 0)
        rc = take_signal(z, &signal, err);
    if (rc < 0)
        return rc;
    z->flags |= flags_of(z, &one);
    *ret_sample = (struct detector_sample){
        .signal_v = signal,
        .monitor_v = monitor ? session_number(z->s, z->is->monitor) : (double)NAN,
        .reference_hz = session_number(z->s, z->is->reference),
    };
    return 0;
}

static int clear(struct detector *d, struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    z->flags = 0;
    int rc = session_ask(z->s, &z->is->clear, err);
    z->strays = stats(d)->errors[LINK_STRAY];
    return rc;
}

static bool has_changed(struct profiled_detector *z, const struct profile_asks *asks)
{
    bool gives[PROFILE_VALUES] = {false};
    const int full = profile_value(session_profile(z->s), z->is->full_scale);
    session_gives(session_profile(z->s), asks, gives);
    return full >= 0 && gives[full] && z->range >= 0 &&
           !is_range(z, z->range, session_number(z->s, z->is->full_scale));
}

static int condition(struct detector *d, unsigned *ret_flags, struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    const struct link_stats *book = stats(d);
    const uint64_t resyncs = book->resyncs;
    int rc = session_ask(z->s, &z->is->condition, err);
    // Reading clears it: what a lost answer told is gone. And where an answer was too many, one
    // before it may have been an older question's.
    if (book->resyncs != resyncs || book->errors[LINK_STRAY] != z->strays)
        z->flags |= DETECTOR_UNSETTLED;
    z->strays = book->errors[LINK_STRAY];
    if (session_restarted(z->s))
        z->restarted = true;
    if (rc < 0)
        return rc;
    if (z->restarted || has_changed(z, &z->is->condition))
        z->flags |= DETECTOR_UNSETTLED;
    *ret_flags = z->flags | flags_of(z, &z->is->condition);
    z->flags = 0;
    return 0;
}

// --- life ----------------------------------------------------------------------------------------

static int reopen(struct detector *d, struct gon_error *err)
{
    struct profiled_detector *z = detector_of(d);
    z->range = -1;
    int rc = session_reopen(z->s, err);
    put_setup(z); // what samples are asked with
    return rc;
}

static void detector_free(struct detector *d)
{
    if (!d)
        return;
    session_free(detector_of(d)->s);
    free(d);
}

static int check_profile(const struct profile *p, struct gon_error *err)
{
    if (p->role != PROFILE_DETECTOR)
        return gon_fail(err, GON_E_INPUT, "profile %s is not of a detector", p->name);
    if (p->detector.sample.count == 0 || profile_value(p, p->detector.signal) < 0)
        return gon_fail(err, GON_E_INPUT, "profile %s does not say how to ask for a sample",
                        p->name);
    return 0;
}

int detector_by_profile(const struct profile *p, const char *link, struct clk *clk,
                        const struct cancel *cancel, struct detector **ret_detector,
                        struct gon_error *err)
{
    static const struct detector_ops ops = {
        .identify = identify,
        .setup = setup,
        .ranges = ranges,
        .full_scale_v = full_scale,
        .set_range = set_range,
        .sample = sample,
        .clear = clear,
        .condition = condition,
        .reopen = reopen,
        .stats = stats,
        .free = detector_free,
    };
    struct session *s;
    int rc = check_profile(p, err);
    if (rc == 0)
        rc = session_open(p, link, clk, cancel, &s, err);
    if (rc < 0)
        return rc;
    struct profiled_detector *z = calloc(1, sizeof *z);
    if (!z) {
        session_free(s);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    *z = (struct profiled_detector){.detector = {&ops}, .s = s, .is = &p->detector, .range = -1};
    find_ranges(z, p);
    *ret_detector = &z->detector;
    return 0;
}
