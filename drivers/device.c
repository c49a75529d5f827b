// SPDX-License-Identifier: MIT
#include "drivers/device.h"

#include "drivers/axis.h"
#include "drivers/detector.h"
#include "drivers/laser.h"

#include <string.h>

static int unknown(const char *kind, const char *driver, struct gon_error *err)
{
    return gon_fail(err, GON_E_INPUT, "no driver '%s' for %s; see: man goniod.cfg", driver, kind);
}

int device_open_laser(const char *driver, const char *link, struct clk *clk,
                      const struct cancel *cancel, struct laser **ret_laser, struct gon_error *err)
{
    if (strcmp(driver, "cobolt-05") == 0)
        return laser_cobolt_open(link, clk, cancel, ret_laser, err);
    return unknown("a laser", driver, err);
}

int device_open_detector(const char *driver, const char *link, struct clk *clk,
                         const struct cancel *cancel, struct detector **ret_detector,
                         struct gon_error *err)
{
    if (strcmp(driver, "sr830") == 0)
        return detector_sr830_open(link, clk, cancel, ret_detector, err);
    return unknown("a detector", driver, err);
}

int device_new_axis(const char *driver, struct bus *bus, int unit, struct axis **ret_axis,
                    struct gon_error *err)
{
    if (strcmp(driver, "oriental-az") != 0)
        return unknown("an axis", driver, err);
    *ret_axis = axis_az_new(bus, unit);
    return *ret_axis ? 0 : gon_fail(err, GON_E_SYSTEM, "out of memory");
}
