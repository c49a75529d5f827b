// SPDX-License-Identifier: MIT
// What the daemon knows, as JSON: the resources of /api/v1 and the events of its stream share
// these. A number that is not known is null. The caller owns what is returned; NULL without memory.
#pragma once
#include "daemon/arming.h"
#include "daemon/control.h"
#include "daemon/instrument.h"
#include "daemon/queue.h"

#include <jansson.h>

json_t *view_number(double value); // null unless finite

// {"run", "name", "sample", "file", "state", "text", "asks", "sweep", "sweeps", "done", "total",
//  "theta_i_deg", "theta_r_deg", "f_r_per_sr", "u_f_r_per_sr", "flags", "left_s", "emission"};
// with_fit adds "fit".
json_t *view_run(const struct run *run, bool with_fit);

// {"held", "left_s", "entries": [{"run", "name", "sample", "place", "active", "held", "left_s",
// "ready_s"}]}: place 0 is the run that has the bench; ready_s: until it is done, by the estimates
// and the order, null of one that is held or when it is not known.
json_t *view_queue(const struct queue *q);

// {"name", "reason", "since_utc_ms"}; null: nobody has control
json_t *view_control(const struct control *c);

// {"rule": "run" | "explicit", "arm_h", "arm": {"name", "reason", "since_utc_ms", "until_utc_ms"} or
// null, "ended": why the last one did, "text": all of that, "light": "off" (read back), "on" (or may
// be), "unknown", "align": {"name", "power_w", "until_utc_ms"} or null}; s NULL: not looked at yet
json_t *view_laser(const struct arming *a, const struct instrument_snapshot *s);

// "axis", "laser", "detector", "monitor"; of a device its use: "shutter", "inputs", ...
const char *view_kind(const struct instrument_snapshot *s, int part);
// [{"name", "kind", "link", "address", "identity", "problem", "errors", "returns", then what
// belongs to it}]; of an axis "unit", "position", "target" (user), "dial", "raw_steps", "moving",
// "homed", "alarm", "alarm_code"; of a monitor "range", "unit", "full_scale", "value"; of a
// selector "position" (null: at none) and "measures_at"; of inputs "values": [{"name", "unit",
// "value"}]
json_t *view_devices(const struct instrument_snapshot *s);
// [{"name", "resume", "holds", "keeps", "waits", "left_s", "text"}], as daemon/suspend.h
json_t *view_suspenders(const struct instrument_snapshot *s);
json_t *view_part(const struct instrument_snapshot *s, int part); // what belongs to it alone

json_t *view_flags(unsigned flags); // ["saturated", ...]
char *view_text(json_t *o);         // one line, malloc'ed; takes the object
