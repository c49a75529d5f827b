// SPDX-License-Identifier: MIT
#include "cli/examine_inside.h"

#include "campaign/bench.h"
#include "drivers/bus.h"
#include "drivers/detector.h"
#include "drivers/device.h"
#include "drivers/inputs.h"
#include "drivers/selector.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define QUIET_MS 100 // the slowest answer of a unit that is to be drained after an error

enum { IDENTITY = 128, SAID = 400 };

// One device and what came of it. rc < 0: opened says how far it got.
struct visit {
    const struct examine *e;
    const char *name, *driver, *link;
    struct profile *profile;
    bool opened;
    char said[SAID]; // who it is and how it is
    struct gon_error err;
};

static void tell(struct visit *v, int rc)
{
    struct finding f;
    if (rc >= 0) {
        explain_well(&f, "%s", v->said);
        examine_tell(v->e, &f, "%s", v->name);
    } else if (!v->opened) {
        examine_tell_open(v->e, v->name, v->link, LINK_TEXT, &v->err);
    } else {
        examine_tell_talk(v->e, v->name, v->link, v->driver, &v->err);
    }
}

// --- monitor -------------------------------------------------------------------------------------

static int visit_monitor(struct visit *v)
{
    struct detector *d;
    int rc = device_open_detector(v->driver, v->e->bench->folder, &v->profile, v->link, v->e->clk,
                                  NULL, &d, &v->err);
    v->opened = rc >= 0;
    if (rc < 0)
        return rc;
    rc = d->ops->identify(d, v->said, sizeof v->said, &v->err);
    d->ops->free(d);
    return rc;
}

// --- selectors -----------------------------------------------------------------------------------

static int visit_selector(struct visit *v)
{
    struct selector *z;
    char identity[IDENTITY];
    int there = SELECTOR_ELSEWHERE;
    int rc = device_open_selector(v->driver, v->e->bench->folder, &v->profile, v->link, v->e->clk,
                                  NULL, &z, &v->err);
    v->opened = rc >= 0;
    if (rc < 0)
        return rc;
    rc = z->ops->identify(z, identity, sizeof identity, &v->err);
    if (rc >= 0)
        rc = z->ops->where(z, &there, NULL, &v->err);
    if (rc >= 0 && there >= 0)
        snprintf(v->said, sizeof v->said, "%s, at '%s'", identity, z->ops->name(z, there));
    else if (rc >= 0)
        snprintf(v->said, sizeof v->said, "%s, at none of its positions", identity);
    z->ops->free(z);
    return rc;
}

// --- inputs --------------------------------------------------------------------------------------

static const struct bench_bus *bus_of(const struct examine *e, const struct bench_device *d)
{
    for (int i = 0; i < e->bench->buses_count; i++)
        if (!strcmp(e->bench->buses[i].name, d->bus))
            return &e->bench->buses[i];
    return NULL;
}

static void put_values(const struct inputs *in, char *text, size_t size)
{
    for (int i = 0; i < inputs_count(in); i++) {
        const struct inputs_value v = inputs_at(in, i);
        const size_t used = strlen(text);
        if (v.known)
            snprintf(text + used, size - used, "%s%s %.6g%s%s", used ? ", " : "", v.name, v.number,
                     *v.unit ? " " : "", v.unit);
    }
}

static int ask_inputs(struct visit *v, struct inputs *in)
{
    char identity[IDENTITY] = "";
    int rc = inputs_identify(in, identity, sizeof identity, &v->err);
    if (rc >= 0)
        rc = inputs_read(in, &v->err);
    if (rc >= 0) {
        snprintf(v->said, sizeof v->said, "%s", identity);
        put_values(in, v->said, sizeof v->said);
    }
    return rc;
}

static int visit_inputs(struct visit *v, const struct bench_device *d)
{
    struct bus *bus = NULL;
    struct inputs *in = NULL;
    const struct examine *e = v->e;
    const struct bench_bus *b = bus_of(e, d);
    int rc = b ? bus_open(b->link, b->timeout_ms, QUIET_MS, e->clk, NULL, &bus, &v->err) : 0;
    if (rc >= 0)
        rc = b ? device_new_inputs(v->driver, e->bench->folder, &v->profile, bus, d->unit, e->clk,
                                   &in, &v->err)
               : device_open_inputs(v->driver, e->bench->folder, &v->profile, v->link, e->clk, NULL,
                                    &in, &v->err);
    v->opened = rc >= 0;
    if (rc >= 0)
        rc = ask_inputs(v, in);
    inputs_free(in);
    bus_close(bus);
    return rc;
}

// On a bus nobody else is looked for: its axes were examined there.
static void tell_inputs(struct visit *v, const struct bench_device *d, int rc)
{
    struct finding f;
    struct link l = {0};
    if (rc >= 0 || !*d->bus) {
        tell(v, rc);
    } else if (!v->opened) {
        examine_tell_open(v->e, v->name, v->link, LINK_MODBUS, &v->err);
    } else {
        link_parse(v->link, LINK_MODBUS, &l, NULL);
        explain_talk(&f, &v->err, &l, v->driver);
        examine_tell(v->e, &f, "%s", v->name);
    }
}

// --- all of them ---------------------------------------------------------------------------------

static void examine_monitor(const struct examine *e)
{
    const struct bench_monitor *m = &e->bench->monitor;
    struct visit v = {.e = e, .name = "monitor", .driver = m->driver, .link = m->link};
    if (!*m->driver || e->held(e->ctx, v.name, v.link))
        return;
    tell(&v, visit_monitor(&v));
    free(v.profile);
}

static void examine_device(const struct examine *e, const struct bench_device *d)
{
    const struct bench_bus *b = bus_of(e, d);
    struct visit v = {.e = e, .name = d->name, .driver = d->driver, .link = b ? b->link : d->link};
    if (e->held(e->ctx, v.name, v.link))
        return;
    if (d->use == BENCH_INPUTS)
        tell_inputs(&v, d, visit_inputs(&v, d));
    else
        tell(&v, visit_selector(&v));
    free(v.profile);
}

void examine_devices(const struct examine *e)
{
    examine_monitor(e);
    for (int i = 0; i < e->bench->devices_count; i++)
        examine_device(e, &e->bench->devices[i]);
}
