// SPDX-License-Identifier: MIT
#include "daemon/instrument_devices.h"
#include "daemon/instrument_inside.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const struct link_stats *stats_of(const struct instrument *in, enum instrument_part part)
{
    if (!instrument_is_there(in, part))
        return NULL;
    if (part == PART_LASER)
        return safety_stats(in->safety);
    if (part == PART_DETECTOR)
        return in->detector->ops->stats ? in->detector->ops->stats(in->detector) : NULL;
    if (part == PART_MONITOR)
        return in->monitor.detector->ops->stats
                   ? in->monitor.detector->ops->stats(in->monitor.detector)
                   : NULL;
    if (part >= PART_DEVICES)
        return instrument_device_stats(in, part);
    const struct axis *a = in->motor[part].axis;
    return a->ops->stats ? a->ops->stats(a) : NULL;
}

void instrument_snapshot(const struct instrument *in, struct instrument_snapshot *ret_snapshot)
{
    struct instrument_snapshot *s = ret_snapshot;
    *s = (struct instrument_snapshot){
        .t_ns = instrument_now_ns(in),
        .laser = in->laser,
        .emission = instrument_light_left(in) == SAFETY_LIGHT_MAYBE,
        .off_unconfirmed = in->safety && (safety_pending(in->safety) || in->behind),
        .range = in->range,
        .full_scale_v = in->range >= 0 ? instrument_full_scale_v(in, in->range) : (double)NAN,
        .signal_v = in->sample.signal_v,
        .monitor_v = in->sample.monitor_v,
        .time_constant_s = in->time_constant_s,
    };
    snprintf(s->detector_unit, sizeof s->detector_unit, "%s", instrument_detector_unit(in));
    instrument_show_monitor(in, s);
    instrument_show_devices(in, s);
    instrument_show_suspenders(in, s);
    memcpy(s->part, in->part, sizeof s->part);
    for (enum instrument_part part = 0; part < PART_COUNT; part++) {
        const struct link_stats *stats = stats_of(in, part);
        if (stats)
            s->part[part].stats = *stats;
    }
    for (int i = 0; i < INSTRUMENT_AXES; i++) {
        const struct motor *m = &in->motor[i];
        s->axis[i].unit = m->config ? m->config->unit_name : "";
        s->axis[i].position = m->place.position;
        s->axis[i].target = m->commanded;
        s->axis[i].dial = m->place.dial;
        s->axis[i].raw_steps = m->place.raw_steps;
        s->axis[i].moving = m->place.moving;
        s->axis[i].homed = m->place.homed;
        s->axis[i].alarm = m->place.alarm;
        s->axis[i].alarm_code = m->place.alarm_code;
    }
}

bool instrument_is_dark(const struct instrument_snapshot *s)
{
    return s->part[PART_LASER].link == PART_OK && !s->emission && !s->off_unconfirmed &&
           !s->laser.emission;
}
