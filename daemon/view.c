// SPDX-License-Identifier: MIT
#include "daemon/view.h"

#include "campaign/bench.h"
#include "campaign/store.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { VIEW_QUEUE = 1000 };

json_t *view_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *view_run(const struct run *run, bool with_fit)
{
    json_t *o = json_pack("{s:i, s:s, s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:i, s:b}", "run", run->id,
                          "name", run->name, "sample", run->sample, "file", run->path, "state",
                          run_state_name(run->state), "text", run->text, "sweep", run->sweep,
                          "sweeps", run->sweeps, "done", run->done, "total", run->total, "emission",
                          run->light == SAFETY_LIGHT_MAYBE);
    json_object_set_new(o, "asks", *run->asks ? json_string(run->asks) : json_null());
    json_object_set_new(o, "theta_i_deg", view_number(run->theta_i_deg));
    json_object_set_new(o, "theta_r_deg", view_number(run->theta_r_deg));
    json_object_set_new(o, "f_r_per_sr", view_number(run->f_per_sr));
    json_object_set_new(o, "u_f_r_per_sr", view_number(run->u_per_sr));
    json_object_set_new(o, "flags", view_flags(run->flags));
    json_object_set_new(o, "left_s", view_number(run->left_s));
    if (with_fit) {
        json_t *fit = run->fit ? json_loads(run->fit, 0, NULL) : NULL;
        json_object_set_new(o, "fit", fit ? fit : json_null());
    }
    return o;
}

static json_t *entry_view(const struct queue_entry *e, size_t place)
{
    json_t *o = json_pack("{s:i, s:s, s:s, s:s, s:i, s:b, s:b}", "run", e->run->id, "name",
                          e->run->name, "sample", e->run->sample, "state",
                          run_state_name(e->run->state), "place", (int)place, "active", e->active,
                          "held", e->run->held);
    json_object_set_new(o, "left_s", view_number(e->run->left_s));
    return o;
}

json_t *view_queue(const struct queue *q)
{
    struct queue_entry entries[VIEW_QUEUE];
    const size_t count = queue_entries(q, entries, VIEW_QUEUE);
    const size_t first = count && entries[0].active ? 0 : 1; // place 0 has the bench
    double ready_s = 0.0;
    json_t *all = json_array();
    for (size_t i = 0; i < count; i++) {
        const bool waits = !entries[i].active && (queue_is_held(q) || entries[i].run->held);
        json_t *o = entry_view(&entries[i], first + i);
        if (!waits)
            ready_s += entries[i].run->left_s;
        json_object_set_new(o, "ready_s", waits ? json_null() : view_number(ready_s));
        json_array_append_new(all, o);
    }
    return json_pack("{s:b, s:o, s:o}", "held", queue_is_held(q), "left_s", view_number(ready_s),
                     "entries", all);
}

json_t *view_control(const struct control *c)
{
    if (!control_taken(c))
        return json_null();
    return json_pack("{s:s, s:s, s:I}", "name", c->name, "reason", c->reason, "since_utc_ms",
                     (json_int_t)c->since_utc_ms);
}

json_t *view_laser(const struct arming *a, const struct instrument_snapshot *s)
{
    const struct arm *arm = &a->seen;
    json_t *o = json_pack("{s:s, s:f, s:n}", "rule", a->rule->arm == BENCH_ARM_RUN ? "run" : "explicit",
                          "arm_h", a->rule->arm_h, "arm");
    const char *light = !s ? "unknown" : instrument_is_dark(s) ? "off"
                        : s->emission || s->laser.emission     ? "on" : "unknown";
    char text[400];
    arm_describe(arm, text, sizeof text);
    json_object_set_new(o, "text", json_string(text));
    json_object_set_new(o, "light", json_string(light));
    json_object_set_new(o, "ended", json_string(arm->end));
    if (arm->live)
        json_object_set_new(o, "arm",
                            json_pack("{s:s, s:s, s:I, s:I}", "name", arm->name, "reason",
                                      arm->reason, "since_utc_ms", (json_int_t)arm->since_utc_ms,
                                      "until_utc_ms", (json_int_t)arm->until_utc_ms));
    json_object_set_new(o, "align",
                        a->align.running
                            ? json_pack("{s:s, s:f, s:I}", "name", a->align.name, "power_w",
                                        a->align.power_w, "until_utc_ms",
                                        (json_int_t)a->align.until_utc_ms)
                            : json_null());
    return o;
}

json_t *view_flags(unsigned flags)
{
    char text[200], *rest = text, *name;
    json_t *all = json_array();
    store_flags_text(flags, text, sizeof text);
    while ((name = strsep(&rest, ",")))
        if (*(name += strspn(name, " ")))
            json_array_append_new(all, json_string(name));
    return all;
}

static void add_axis(json_t *o, const struct instrument_snapshot *s, int part)
{
    json_object_set_new(o, "unit", json_string(s->axis[part].unit));
    json_object_set_new(o, "position", view_number(s->axis[part].position));
    json_object_set_new(o, "target", view_number(s->axis[part].target));
    json_object_set_new(o, "dial", view_number(s->axis[part].dial));
    json_object_set_new(o, "raw_steps", view_number(s->axis[part].raw_steps));
    json_object_set_new(o, "moving", json_boolean(s->axis[part].moving));
    json_object_set_new(o, "homed", json_boolean(s->axis[part].homed));
    json_object_set_new(o, "alarm", json_boolean(s->axis[part].alarm));
    json_object_set_new(o, "alarm_code", json_integer(s->axis[part].alarm_code));
}

static void add_laser(json_t *o, const struct instrument_snapshot *s)
{
    json_object_set_new(o, "state", json_string(laser_state_name(s->laser.state)));
    json_object_set_new(o, "emission", json_boolean(s->emission));
    json_object_set_new(o, "emission_reported", json_boolean(s->laser.emission));
    json_object_set_new(o, "off_unconfirmed", json_boolean(s->off_unconfirmed));
    json_object_set_new(o, "interlock_closed", json_boolean(s->laser.interlock_closed));
    json_object_set_new(o, "power_w", view_number(s->laser.power_w));
    json_object_set_new(o, "setpoint_w", view_number(s->laser.setpoint_w));
    json_object_set_new(o, "fault_code", json_integer(s->laser.fault_code));
}

static void add_detector(json_t *o, const struct instrument_snapshot *s)
{
    json_object_set_new(o, "range", json_integer(s->range));
    json_object_set_new(o, "unit", json_string(s->detector_unit));
    json_object_set_new(o, "full_scale_v", view_number(s->full_scale_v));
    json_object_set_new(o, "signal_v", view_number(s->signal_v));
    json_object_set_new(o, "monitor_v", view_number(s->monitor_v));
    json_object_set_new(o, "time_constant_s", view_number(s->time_constant_s));
}

static void add_monitor(json_t *o, const struct instrument_snapshot *s)
{
    json_object_set_new(o, "range", json_integer(s->monitor_range));
    json_object_set_new(o, "unit", json_string(s->monitor_unit));
    json_object_set_new(o, "full_scale", view_number(s->monitor_full_scale));
    json_object_set_new(o, "value", view_number(s->monitor_v));
}

static void add_device(json_t *o, const struct device_state *d)
{
    json_t *values = json_array();
    if (d->use != BENCH_INPUTS) {
        json_object_set_new(o, "position", *d->position ? json_string(d->position) : json_null());
        json_object_set_new(o, "measures_at", json_string(d->wanted));
    }
    for (int i = 0; i < d->values; i++) {
        json_t *v = json_pack("{s:s, s:s}", "name", d->value[i].name, "unit", d->value[i].unit);
        json_object_set_new(v, "value", view_number(d->value[i].number));
        json_array_append_new(values, v);
    }
    if (d->use == BENCH_INPUTS)
        json_object_set_new(o, "values", values);
    else
        json_decref(values);
}

const char *view_kind(const struct instrument_snapshot *s, int part)
{
    return part < INSTRUMENT_AXES  ? "axis"
           : part == PART_LASER    ? "laser"
           : part == PART_DETECTOR ? "detector"
           : part == PART_MONITOR  ? "monitor"
                                   : bench_uses[s->device[part - PART_DEVICES].use];
}

json_t *view_part(const struct instrument_snapshot *s, int part)
{
    json_t *o = json_object();
    if (part < INSTRUMENT_AXES)
        add_axis(o, s, part);
    else if (part == PART_LASER)
        add_laser(o, s);
    else if (part == PART_DETECTOR)
        add_detector(o, s);
    else if (part == PART_MONITOR)
        add_monitor(o, s);
    else
        add_device(o, &s->device[part - PART_DEVICES]);
    return o;
}

json_t *view_devices(const struct instrument_snapshot *s)
{
    json_t *all = json_array();
    for (int i = 0; i < PART_COUNT; i++) {
        const struct part_state *p = &s->part[i];
        if (p->link == PART_ABSENT)
            continue;
        json_t *o = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:I, s:I}", "name", p->name, "kind",
                              view_kind(s, i), "link", p->link == PART_OK ? "ok" : "lost",
                              "address", p->address, "identity", p->identity, "problem", p->problem,
                              "errors", (json_int_t)p->errors, "returns", (json_int_t)p->returns);
        json_object_update_new(o, view_part(s, i));
        json_array_append_new(all, o);
    }
    return all;
}

json_t *view_suspenders(const struct instrument_snapshot *s)
{
    json_t *all = json_array();
    for (int i = 0; i < BENCH_SUSPENDERS && s->suspender[i].name; i++) {
        const struct suspender_state *one = &s->suspender[i];
        json_t *o = json_pack("{s:s, s:s, s:b, s:b, s:b, s:s}", "name", one->name, "resume",
                              one->manual ? "manual" : "automatic", "holds", one->holds, "keeps",
                              one->keeps, "waits", one->waits, "text", one->text);
        json_object_set_new(o, "left_s", view_number(one->left_s));
        json_array_append_new(all, o);
    }
    return all;
}

char *view_text(json_t *o)
{
    char *text = o ? json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(o);
    return text ? text : strdup("{}");
}
