// SPDX-License-Identifier: MIT
// A device by the name of its profile, as bench files give it. Opening sends nothing; what comes
// first is the caller's to send: off to a laser, identify to the others. Names are looked up as
// profile_find does, from folder (NULL: here).
//
// profile: where the caller keeps it: NULL there is loaded into, something there is used again; to
// be freed by the caller after the device. GON_E_INPUT: no such profile, a mistake in it, or one of
// another role; everything else as the driver's own open says (by_profile.h). Thread: the one that
// will use the device.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

struct axis;
struct bus;
struct detector;
struct inputs;
struct laser;
struct profile;
struct selector;

int device_open_laser(const char *driver, const char *folder, struct profile **profile,
                      const char *link, struct clk *clk, const struct cancel *cancel,
                      struct laser **ret_laser, struct gon_error *err);
int device_open_detector(const char *driver, const char *folder, struct profile **profile,
                         const char *link, struct clk *clk, const struct cancel *cancel,
                         struct detector **ret_detector, struct gon_error *err);
int device_open_selector(const char *driver, const char *folder, struct profile **profile,
                         const char *link, struct clk *clk, const struct cancel *cancel,
                         struct selector **ret_selector, struct gon_error *err);
int device_open_inputs(const char *driver, const char *folder, struct profile **profile,
                       const char *link, struct clk *clk, const struct cancel *cancel,
                       struct inputs **ret_inputs, struct gon_error *err);
// The bus is borrowed.
int device_new_axis(const char *driver, const char *folder, struct profile **profile,
                    struct bus *bus, int unit, struct axis **ret_axis, struct gon_error *err);
int device_new_inputs(const char *driver, const char *folder, struct profile **profile,
                      struct bus *bus, int unit, struct clk *clk, struct inputs **ret_inputs,
                      struct gon_error *err);
