// SPDX-License-Identifier: MIT
#include "drivers/device.h"

#include "drivers/by_profile.h"
#include "drivers/inputs.h"
#include "drivers/profile.h"

static int need(const char *driver, const char *folder, struct profile **profile,
                struct gon_error *err)
{
    return *profile ? 0 : profile_open(driver, folder, profile, err);
}

int device_open_laser(const char *driver, const char *folder, struct profile **profile,
                      const char *link, struct clk *clk, const struct cancel *cancel,
                      struct laser **ret_laser, struct gon_error *err)
{
    int rc = need(driver, folder, profile, err);
    return rc < 0 ? rc : laser_by_profile(*profile, link, clk, cancel, ret_laser, err);
}

int device_open_detector(const char *driver, const char *folder, struct profile **profile,
                         const char *link, struct clk *clk, const struct cancel *cancel,
                         struct detector **ret_detector, struct gon_error *err)
{
    int rc = need(driver, folder, profile, err);
    return rc < 0 ? rc : detector_by_profile(*profile, link, clk, cancel, ret_detector, err);
}

int device_open_selector(const char *driver, const char *folder, struct profile **profile,
                         const char *link, struct clk *clk, const struct cancel *cancel,
                         struct selector **ret_selector, struct gon_error *err)
{
    int rc = need(driver, folder, profile, err);
    return rc < 0 ? rc : selector_by_profile(*profile, link, clk, cancel, ret_selector, err);
}

static int need_inputs(const char *driver, const char *folder, struct profile **profile,
                       int protocol, const char *on, struct gon_error *err)
{
    int rc = need(driver, folder, profile, err);
    if (rc == 0 && ((*profile)->role != PROFILE_INPUTS || (*profile)->protocol != protocol))
        rc = gon_fail(err, GON_E_INPUT, "the profile '%s' is not one of inputs on %s", driver, on);
    return rc;
}

int device_open_inputs(const char *driver, const char *folder, struct profile **profile,
                       const char *link, struct clk *clk, const struct cancel *cancel,
                       struct inputs **ret_inputs, struct gon_error *err)
{
    int rc = need_inputs(driver, folder, profile, PROFILE_MESSAGE, "a link of its own", err);
    return rc < 0 ? rc : inputs_open(*profile, link, clk, cancel, ret_inputs, err);
}

int device_new_inputs(const char *driver, const char *folder, struct profile **profile,
                      struct bus *bus, int unit, struct clk *clk, struct inputs **ret_inputs,
                      struct gon_error *err)
{
    int rc = need_inputs(driver, folder, profile, PROFILE_MODBUS, "a Modbus bus", err);
    if (rc < 0)
        return rc;
    *ret_inputs = inputs_on_bus(*profile, bus, unit, clk);
    return *ret_inputs ? 0 : gon_fail(err, GON_E_SYSTEM, "out of memory");
}

int device_new_axis(const char *driver, const char *folder, struct profile **profile,
                    struct bus *bus, int unit, struct axis **ret_axis, struct gon_error *err)
{
    int rc = need(driver, folder, profile, err);
    if (rc == 0 && ((*profile)->role != PROFILE_AXIS || (*profile)->protocol != PROFILE_MODBUS))
        rc = gon_fail(err, GON_E_INPUT, "the profile '%s' is not one of an axis on a Modbus bus",
                      driver);
    if (rc < 0)
        return rc;
    *ret_axis = axis_by_profile(*profile, bus, unit);
    return *ret_axis ? 0 : gon_fail(err, GON_E_SYSTEM, "out of memory");
}
