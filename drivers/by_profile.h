// SPDX-License-Identifier: MIT
// Lasers, detectors, axes and selectors made from profiles: what a laboratory connects by writing a
// text file. The profile is borrowed for the object's life and must have the role. Each opens its
// link only and sends nothing. Thread: instrument.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

struct axis;
struct bus;
struct detector;
struct laser;
struct profile;
struct selector;
struct transport;

// As laser.h. off goes out at once, whatever the gap, then after it and until it is read back.
int laser_by_profile(const struct profile *p, const char *link, struct clk *clk,
                     const struct cancel *cancel, struct laser **ret_laser, struct gon_error *err);
// The same over a transport that is open, which is taken over, also when it fails.
int laser_over(const struct profile *p, struct transport *transport, struct laser **ret_laser,
               struct gon_error *err);
// As detector.h; a monitor is one too.
int detector_by_profile(const struct profile *p, const char *link, struct clk *clk,
                        const struct cancel *cancel, struct detector **ret_detector,
                        struct gon_error *err);
// As axis.h; the bus is borrowed. NULL without memory.
struct axis *axis_by_profile(const struct profile *p, struct bus *bus, int unit);
// As selector.h.
int selector_by_profile(const struct profile *p, const char *link, struct clk *clk,
                        const struct cancel *cancel, struct selector **ret_selector,
                        struct gon_error *err);
