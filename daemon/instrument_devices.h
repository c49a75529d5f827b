// SPDX-License-Identifier: MIT
// Calls to the bench's further devices: the monitor, selectors and inputs. Parts as in
// daemon/instrument.h, from PART_DEVICES on; errors name the device once. Thread: instrument.
#pragma once
#include "base/err.h"
#include "daemon/instrument.h"

#include <stdbool.h>

// --- monitor ----------------------------------------------------------------------------------
// Its range: the most sensitive that holds the full scale of the bench file; without one, the least
// sensitive until the laser is warm, then (instrument_fit_monitor) the most sensitive that holds
// twice the light, kept from there on. In both cases one up when a sample saturated.
int instrument_fit_monitor(struct instrument *in, struct gon_error *err); // 0 without a monitor
const char *instrument_monitor_unit(const struct instrument *in);         // "V", "W", "A"
const char *instrument_detector_unit(const struct instrument *in);        // of its signal, too
double instrument_monitor_time_constant_s(const struct instrument *in);   // 0 without one
// What happened to it since instrument_clear: true when its samples are of no use. Its range is
// then one up, or its settings are written again.
int instrument_monitor_failed(struct instrument *in, bool *ret_failed, struct gon_error *err);

// --- selectors --------------------------------------------------------------------------------
bool instrument_is_selector(const struct instrument *in, enum instrument_part part);
const struct bench_device *instrument_device(const struct instrument *in,
                                             enum instrument_part part); // NULL: none
// Read, told when it is elsewhere, and read back. GON_E_DEVICE: it does not go there.
int instrument_select(struct instrument *in, enum instrument_part part, const char *position,
                      struct gon_error *err);
// Asked now: whether it stands there.
int instrument_look(struct instrument *in, enum instrument_part part, const char *position,
                    bool *ret_there, struct gon_error *err);
// As it was seen last; "elsewhere" at none of its positions.
const char *instrument_selected(const struct instrument *in, enum instrument_part part);
// Where it goes when a run pauses or ends; NULL: it stays.
const char *instrument_safe_position(const struct instrument *in, enum instrument_part part);
// All that have a safe position and are there; the first error.
int instrument_devices_safe(struct instrument *in, struct gon_error *err);

// --- inputs -----------------------------------------------------------------------------------
// Reads those that were not read for a second.
int instrument_watch_inputs(struct instrument *in, struct gon_error *err);
// "door.open": the value of a device as of the last look. False: no such value, or not known.
bool instrument_input(const struct instrument *in, const char *name, double *ret_value);
