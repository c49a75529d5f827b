// SPDX-License-Identifier: MIT
// The one place that knows which driver a name of the bench file stands for. Opening sends nothing;
// what comes first is the caller's to send: off to a laser, identify to the others. An unknown name
// is GON_E_INPUT; everything else as the driver's own open says (laser.h, detector.h, axis.h).
// Thread: the one that will use the device.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

struct axis;
struct bus;
struct detector;
struct laser;

int device_open_laser(const char *driver, const char *link, struct clk *clk,
                      const struct cancel *cancel, struct laser **ret_laser, struct gon_error *err);
int device_open_detector(const char *driver, const char *link, struct clk *clk,
                         const struct cancel *cancel, struct detector **ret_detector,
                         struct gon_error *err);
// The bus is borrowed.
int device_new_axis(const char *driver, struct bus *bus, int unit, struct axis **ret_axis,
                    struct gon_error *err);
