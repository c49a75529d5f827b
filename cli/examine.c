// SPDX-License-Identifier: MIT
#include "cli/examine.h"

#include "campaign/bench.h"
#include "cli/examine_inside.h"
#include "cli/ports.h"
#include "drivers/axis.h"
#include "drivers/bus.h"
#include "drivers/detector.h"
#include "drivers/device.h"
#include "drivers/laser.h"
#include "drivers/transport_adapter.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAY_BE_ON "LASER MAY BE ON" // in the text of an OFF that was not confirmed
#define QUIET_MS 100 // the slowest answer of a unit that is to be drained after an error

enum { IDENTITY = 128 };

void examine_tell(const struct examine *e, struct finding *f, const char *fmt, ...)
{
    va_list who;
    va_start(who, fmt);
    vsnprintf(f->who, sizeof f->who, fmt, who);
    va_end(who);
    e->found(e->ctx, f);
}

static struct link taken_apart(const char *text, enum link_use use)
{
    struct link l = {0};
    link_parse(text, use, &l, NULL); // well-formed: it was checked
    return l;
}

void examine_tell_open(const struct examine *e, const char *who, const char *text,
                       enum link_use use, const struct gon_error *err)
{
    struct finding f;
    char ports[600];
    struct adapter adapters[ADAPTERS_MOST];
    const struct link l = taken_apart(text, use);
    ports_text(e->by_id, adapters, transport_adapters(adapters), ports, sizeof ports);
    explain_open(&f, err, &l, ports);
    examine_tell(e, &f, "%s", who);
}

// --- first contact -------------------------------------------------------------------------------

static int meet_laser(const struct examine *e, const char *link, struct profile **ret_profile,
                      struct laser **ret_laser, char ret_identity[IDENTITY], bool *ret_opened,
                      struct gon_error *err)
{
    const char *driver = e->bench->laser.driver;
    struct laser *l;
    int rc = device_open_laser(driver, e->bench->folder, ret_profile, link, e->clk, NULL, &l, err);
    *ret_opened = rc >= 0;
    if (rc < 0)
        return rc;
    rc = l->ops->off(l, err);
    if (rc >= 0)
        rc = l->ops->identify(l, ret_identity, IDENTITY, err);
    if (rc < 0)
        l->ops->free(l);
    else
        *ret_laser = l;
    return rc;
}

static int meet_detector(const struct examine *e, const char *link, struct profile **ret_profile,
                         struct detector **ret_detector, char ret_identity[IDENTITY],
                         bool *ret_opened, struct gon_error *err)
{
    const char *driver = e->bench->detector.driver;
    struct detector *d;
    int rc =
        device_open_detector(driver, e->bench->folder, ret_profile, link, e->clk, NULL, &d, err);
    *ret_opened = rc >= 0;
    if (rc < 0)
        return rc;
    rc = d->ops->identify(d, ret_identity, IDENTITY, err);
    if (rc < 0)
        d->ops->free(d);
    else
        *ret_detector = d;
    return rc;
}

// --- who else may be on a port -------------------------------------------------------------------

// A port as a text link with the settings of another: a serial port is opened at that one's baud.
static void text_port(const char *port, const char *settings, char *ret_link, size_t size)
{
    const char *place = strchr(port, ':') + 1, *set = strchr(settings, '?');
    if (strncmp(port, "serial:", 7) == 0 || strncmp(port, "modbus-rtu:", 11) == 0)
        snprintf(ret_link, size, "serial:%.*s%s", (int)strcspn(place, "?"), place, set ? set : "");
    else if (strncmp(port, "modbus-tcp:", 11) == 0)
        snprintf(ret_link, size, "tcp:%s", place);
    else
        snprintf(ret_link, size, "%s", port);
}

static bool is_detector(const struct examine *e, const char *port, char ret_identity[IDENTITY])
{
    char link[BENCH_LINK + 64];
    struct profile *profile = NULL;
    struct detector *d;
    bool opened;
    text_port(port, e->bench->detector.link, link, sizeof link);
    const bool is = meet_detector(e, link, &profile, &d, ret_identity, &opened, NULL) >= 0;
    if (is)
        d->ops->free(d);
    free(profile);
    return is;
}

static bool is_laser(const struct examine *e, const char *port, char ret_identity[IDENTITY],
                     struct gon_error *err)
{
    char link[BENCH_LINK + 64];
    struct profile *profile = NULL;
    struct laser *l;
    bool opened;
    text_port(port, e->bench->laser.link, link, sizeof link);
    const bool is = meet_laser(e, link, &profile, &l, ret_identity, &opened, err) >= 0;
    if (is)
        l->ops->free(l);
    free(profile);
    return is;
}

// True when another device of the bench was found on the expected one's port, and told.
static bool tell_instead(const struct examine *e, const char *who, const char *expected,
                         const char *port)
{
    struct finding f;
    struct gon_error err = {0};
    char identity[IDENTITY];
    const char *is = NULL;
    if (strcmp(expected, "detector") != 0 && is_detector(e, port, identity))
        is = "detector";
    else if (strcmp(expected, "laser") != 0 && is_laser(e, port, identity, &err))
        is = "laser";
    if (is)
        explain_instead(&f, identity, is, expected, port);
    else if (strstr(err.text, MAY_BE_ON))
        explain_emission(&f);
    else
        return false;
    examine_tell(e, &f, "%s", who);
    return true;
}

void examine_tell_talk(const struct examine *e, const char *part, const char *port,
                       const char *driver, const struct gon_error *err)
{
    struct finding f;
    const struct link l = taken_apart(port, LINK_TEXT);
    if (err->code != GON_E_GONE && tell_instead(e, part, part, port))
        return;
    explain_talk(&f, err, &l, driver);
    examine_tell(e, &f, "%s", part);
}

// --- laser ---------------------------------------------------------------------------------------

static void tell_laser(const struct examine *e, struct laser *l, const char *identity)
{
    struct finding f;
    struct laser_status s;
    struct gon_error err = {0};
    const char *link = e->bench->laser.link;
    int rc = l->ops->status(l, &s, &err);
    if (rc >= 0 && s.emission && (rc = l->ops->off(l, &err)) >= 0) { // it lit after it was off
        explain_relit(&f);
        examine_tell(e, &f, "laser");
        rc = l->ops->status(l, &s, &err);
    }
    if (rc < 0) {
        examine_tell_talk(e, "laser", link, e->bench->laser.driver, &err);
        return;
    }
    if (!explain_laser(&f, &s, l->ops->fault_text(l, s.fault_code)))
        explain_well(&f, "%s: told OFF first, reads back off; interlock closed", identity);
    examine_tell(e, &f, "laser");
}

static void examine_laser(const struct examine *e)
{
    const struct bench_laser *config = &e->bench->laser;
    struct finding f;
    struct laser *l;
    struct gon_error err = {0};
    char identity[IDENTITY];
    bool opened;
    if (e->held(e->ctx, "laser", config->link))
        return;
    struct profile *profile = NULL;
    int rc = meet_laser(e, config->link, &profile, &l, identity, &opened, &err);
    if (rc >= 0) {
        tell_laser(e, l, identity);
        l->ops->free(l);
    } else if (!opened) {
        examine_tell_open(e, "laser", config->link, LINK_TEXT, &err);
    } else if (strstr(err.text, MAY_BE_ON)) {
        explain_emission(&f);
        examine_tell(e, &f, "laser");
    } else {
        examine_tell_talk(e, "laser", config->link, config->driver, &err);
    }
    free(profile);
}

// --- detector ------------------------------------------------------------------------------------

static void tell_detector(const struct examine *e, struct detector *d, const char *identity)
{
    struct finding f;
    struct gon_error err = {0};
    unsigned flags = 0;
    int rc = d->ops->clear(d, &err);
    if (rc >= 0)
        rc = d->ops->condition(d, &flags, &err);
    if (rc < 0) {
        examine_tell_talk(e, "detector", e->bench->detector.link, e->bench->detector.driver, &err);
        return;
    }
    if (flags & DETECTOR_UNLOCKED)
        explain_no_reference(&f);
    else
        explain_well(&f, "%s", identity);
    examine_tell(e, &f, "detector");
}

static void examine_detector(const struct examine *e)
{
    const struct bench_detector *config = &e->bench->detector;
    struct detector *d;
    struct gon_error err = {0};
    char identity[IDENTITY];
    bool opened;
    if (e->held(e->ctx, "detector", config->link))
        return;
    struct profile *profile = NULL;
    int rc = meet_detector(e, config->link, &profile, &d, identity, &opened, &err);
    if (rc >= 0) {
        tell_detector(e, d, identity);
        d->ops->free(d);
    } else if (!opened) {
        examine_tell_open(e, "detector", config->link, LINK_TEXT, &err);
    } else {
        examine_tell_talk(e, "detector", config->link, config->driver, &err);
    }
    free(profile);
}

// --- axes ----------------------------------------------------------------------------------------

struct look { // at one axis
    const struct bench_axis *config;
    struct axis_status status;
    char alarm[120];
    int rc;
    struct gon_error err;
};

static void look_at(const char *folder, struct bus *bus, struct look *k)
{
    struct profile *profile = NULL;
    struct axis *a;
    k->rc = device_new_axis(k->config->driver, folder, &profile, bus, k->config->unit, &a, &k->err);
    if (k->rc < 0) {
        free(profile);
        return;
    }
    k->rc = a->ops->identify(a, &k->err);
    if (k->rc >= 0)
        k->rc = a->ops->status(a, &k->status, &k->err);
    if (k->rc >= 0)
        snprintf(k->alarm, sizeof k->alarm, "%s", a->ops->alarm_text(a, k->status.alarm_code));
    a->ops->free(a);
    free(profile);
}

static void explain_axis(struct finding *f, const struct look *k)
{
    const struct bench_axis *c = k->config;
    const double encoder_steps = c->encoder_steps > 0 ? c->encoder_steps : 1.0;
    const double position =
        k->status.position_steps / (encoder_steps * c->steps_per_unit) + c->zero;
    if (k->status.alarm)
        explain_alarm(f, k->status.alarm_code, k->alarm);
    else if (k->status.moving)
        explain_look(f, "unit %d moves, at %.3f %s now: something else commands it", c->unit,
                     position, c->unit_name);
    else if (!k->status.homed)
        explain_home(f);
    else
        explain_well(f, "unit %d, at %.3f %s, homed", c->unit, position, c->unit_name);
}

static bool has_answered(const struct look *k)
{
    return k->rc >= 0 || k->rc == GON_E_DEVICE;
}

static bool was_silent(const struct look *k)
{
    return k->rc == GON_E_LINK;
}

// Their units as "1, 3".
static void units_text(const struct look *looks, int count, bool (*is_one)(const struct look *k),
                       char *text, size_t size)
{
    *text = 0;
    for (int i = 0; i < count; i++) {
        const size_t used = strlen(text);
        if (is_one(&looks[i]))
            snprintf(text + used, size - used, "%s%d", used ? ", " : "", looks[i].config->unit);
    }
}

static void tell_axes(const struct examine *e, const struct link *l, const struct look *looks,
                      int count, const char *answering)
{
    for (int i = 0; i < count; i++) {
        const struct look *k = &looks[i];
        struct finding f;
        if (k->rc >= 0)
            explain_axis(&f, k);
        else if (was_silent(k) && *answering)
            explain_unit(&f, k->config->unit, answering);
        else
            explain_talk(&f, &k->err, l, k->config->driver);
        examine_tell(e, &f, "axis %s", k->config->name);
    }
}

static void tell_bus(const struct examine *e, const struct bench_bus *bus, const struct look *looks,
                     int count)
{
    struct finding f;
    char answered[80], silent[80], who[64];
    const struct link l = taken_apart(bus->link, LINK_MODBUS);
    units_text(looks, count, has_answered, answered, sizeof answered);
    units_text(looks, count, was_silent, silent, sizeof silent);
    if (*answered || !*silent) {
        tell_axes(e, &l, looks, count, answered);
        return;
    }
    snprintf(who, sizeof who, "bus %s", bus->name);
    if (tell_instead(e, who, "axes", bus->link))
        return;
    explain_bus(&f, &l, bus->link, silent);
    examine_tell(e, &f, "%s", who);
}

static void examine_bus(const struct examine *e, const struct bench_bus *config)
{
    struct look looks[BENCH_AXES];
    struct bus *bus = NULL;
    struct gon_error err = {0};
    char who[64];
    int count = 0;
    for (int i = 0; i < e->bench->axes_count; i++) {
        const struct bench_axis *a = &e->bench->axes[i];
        if (!strcmp(a->bus, config->name) && !e->held(e->ctx, a->name, config->link))
            looks[count++] = (struct look){.config = a};
    }
    if (count == 0)
        return;
    snprintf(who, sizeof who, "bus %s", config->name);
    if (bus_open(config->link, config->timeout_ms, QUIET_MS, e->clk, NULL, &bus, &err) < 0) {
        examine_tell_open(e, who, config->link, LINK_MODBUS, &err);
        return;
    }
    for (int i = 0; i < count; i++)
        look_at(e->bench->folder, bus, &looks[i]);
    bus_close(bus); // its port may be somebody else's
    tell_bus(e, config, looks, count);
}

void examine_bench(const struct examine *e)
{
    examine_laser(e);
    for (int i = 0; i < e->bench->buses_count; i++)
        examine_bus(e, &e->bench->buses[i]);
    examine_detector(e);
    examine_devices(e);
}
