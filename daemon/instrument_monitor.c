// SPDX-License-Identifier: MIT
#include "daemon/instrument_devices.h"
#include "daemon/instrument_inside.h"
#include "drivers/device.h"
#include "drivers/profile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define HEADROOM 2.0    // of the range that is chosen for the light
#define STEP_MOST 2     // ranges at a time on the way to it
#define KEEP_LEAST 0.02 // of full scale: a range on which the light is between these is kept when
#define KEEP_MOST 0.8   // the laser comes on again, as another one has another gain

static double full_scale(const struct monitor *m, int range)
{
    return m->detector->ops->full_scale_v(m->detector, range);
}

static int set_range(struct monitor *m, int range, struct gon_error *err)
{
    m->range = -1;
    int rc = m->detector->ops->set_range(m->detector, range, err);
    if (rc >= 0)
        m->range = range;
    return rc;
}

static int top_range(const struct monitor *m)
{
    return m->detector->ops->ranges(m->detector) - 1;
}

// The most sensitive that holds it, or the least sensitive.
static int range_for(const struct monitor *m, double most)
{
    int range = 0;
    while (range < top_range(m) && full_scale(m, range) < most)
        range++;
    return range;
}

// The settings, and the range it had: one that was chosen for the light outlives a lost link.
static int set_up(struct instrument *in, struct gon_error *err)
{
    struct monitor *m = &in->monitor;
    const struct bench_detector *c = &in->bench->detector;
    const struct detector_setup setup = {c->time_constant_s, c->slope_db, 0,
                                         in->bench->wavelength_nm};
    const double most = in->bench->monitor.full_scale;
    const int range = m->range >= 0 ? m->range : most > 0 ? range_for(m, most) : top_range(m);
    int rc = m->detector->ops->setup(m->detector, &setup, &m->time_constant_s, err);
    if (rc >= 0)
        rc = set_range(m, range, err);
    if (rc < 0)
        m->range = range; // for the next try
    return rc;
}

int instrument_connect_monitor(struct instrument *in, struct gon_error *err)
{
    struct monitor *m = &in->monitor;
    struct part_state *p = &in->part[PART_MONITOR];
    int rc = m->detector
                 ? m->detector->ops->reopen(m->detector, err)
                 : device_open_detector(p->driver, in->bench->folder, &m->profile, p->address,
                                        &in->breathing.clk, NULL, &m->detector, err);
    if (rc < 0)
        return rc;
    char identity[sizeof p->identity] = "";
    rc = m->detector->ops->identify(m->detector, identity, sizeof identity, err);
    rc = instrument_recognise(p, rc, identity, err);
    return rc < 0 ? rc : set_up(in, err);
}

static const char *unit_of_signal(const struct profile *p)
{
    const int signal = p ? profile_value(p, p->detector.signal) : -1;
    return signal >= 0 ? p->values[signal].unit : "V";
}

const char *instrument_monitor_unit(const struct instrument *in)
{
    return unit_of_signal(in->monitor.profile);
}

const char *instrument_detector_unit(const struct instrument *in)
{
    return unit_of_signal(in->detector_profile);
}

double instrument_monitor_time_constant_s(const struct instrument *in)
{
    return in->monitor.time_constant_s;
}

int instrument_sample_monitor(struct instrument *in, double *ret_value, struct gon_error *err)
{
    struct gon_error own;
    struct detector_sample s;
    struct detector *d = in->monitor.detector;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_MONITOR, err);
    if (rc < 0)
        return rc;
    rc = d->ops->sample(d, &s, err);
    if (rc >= 0 && !isfinite(s.signal_v))
        rc = gon_fail(err, GON_E_LINK, "answered something that is not a number");
    rc = instrument_note(in, PART_MONITOR, rc, err);
    if (rc >= 0)
        *ret_value = s.signal_v;
    return rc;
}

static int take_range(struct instrument *in, int range, struct gon_error *err)
{
    int rc = instrument_need(in, PART_MONITOR, err);
    return rc < 0 ? rc
                  : instrument_note(in, PART_MONITOR, set_range(&in->monitor, range, err), err);
}

// The next range on the way down to the wanted one: what little a range sees of a light far below
// it says only that it is below.
static int below(int range, int wanted)
{
    return wanted < range - STEP_MOST ? range - STEP_MOST : wanted < range ? wanted : range;
}

static bool keeps(const struct monitor *m, double light)
{
    return m->range >= 0 && light >= KEEP_LEAST * full_scale(m, m->range) &&
           light <= KEEP_MOST * full_scale(m, m->range);
}

int instrument_fit_monitor(struct instrument *in, struct gon_error *err)
{
    struct monitor *m = &in->monitor;
    struct gon_error own;
    err = err ? err : &own;
    if (!instrument_has(in, PART_MONITOR) || in->bench->monitor.full_scale > 0)
        return 0;
    double light;
    int rc = instrument_sample_monitor(in, &light, err);
    if (rc < 0 || keeps(m, fabs(light)))
        return rc;
    int range = top_range(m);
    for (int before = -1; rc >= 0 && range != before;) {
        before = range;
        rc = take_range(in, range, err);
        if (rc >= 0)
            rc = instrument_sample_monitor(in, &light, err);
        if (rc >= 0)
            range = below(range, range_for(m, HEADROOM * fabs(light)));
    }
    return rc;
}

int instrument_clear_monitor(struct instrument *in, struct gon_error *err)
{
    struct detector *d = in->monitor.detector;
    int rc = instrument_need(in, PART_MONITOR, err);
    return rc < 0 ? rc : instrument_note(in, PART_MONITOR, d->ops->clear(d, err), err);
}

static int mend(struct instrument *in, unsigned flags, struct gon_error *err)
{
    struct monitor *m = &in->monitor;
    if (flags & (DETECTOR_UNSETTLED | DETECTOR_UNLOCKED))
        return set_up(in, err);
    return m->range < top_range(m) ? set_range(m, m->range + 1, err) : 0;
}

int instrument_monitor_failed(struct instrument *in, bool *ret_failed, struct gon_error *err)
{
    struct gon_error own;
    struct detector *d = in->monitor.detector;
    unsigned flags = 0;
    err = err ? err : &own;
    if (!instrument_has(in, PART_MONITOR)) {
        *ret_failed = false;
        return 0;
    }
    int rc = instrument_need(in, PART_MONITOR, err);
    if (rc < 0)
        return rc;
    rc = d->ops->condition(d, &flags, err);
    if (rc >= 0 && flags)
        rc = mend(in, flags, err);
    rc = instrument_note(in, PART_MONITOR, rc, err);
    if (rc >= 0)
        *ret_failed = flags != 0;
    return rc;
}

void instrument_show_monitor(const struct instrument *in, struct instrument_snapshot *s)
{
    const struct monitor *m = &in->monitor;
    const bool known = m->detector && m->range >= 0;
    snprintf(s->monitor_unit, sizeof s->monitor_unit, "%s", instrument_monitor_unit(in));
    s->monitor_range = known ? m->range : -1;
    s->monitor_full_scale = known ? full_scale(m, m->range) : (double)NAN;
}

void instrument_free_monitor(struct instrument *in)
{
    if (in->monitor.detector)
        in->monitor.detector->ops->free(in->monitor.detector);
    free(in->monitor.profile);
}
