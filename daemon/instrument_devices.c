// SPDX-License-Identifier: MIT
#include "daemon/instrument_devices.h"

#include "daemon/instrument_inside.h"
#include "drivers/bus.h"
#include "drivers/device.h"
#include "drivers/inputs.h"
#include "drivers/profile.h"
#include "drivers/selector.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LOOK_NS CLK_S(1) // how often inputs are read, at most

static struct companion *of(struct instrument *in, enum instrument_part part)
{
    return &in->companion[part - PART_DEVICES];
}

static const struct companion *seen(const struct instrument *in, enum instrument_part part)
{
    return &in->companion[part - PART_DEVICES];
}

const struct bench_device *instrument_device(const struct instrument *in, enum instrument_part part)
{
    return instrument_has(in, part) ? seen(in, part)->config : NULL;
}

bool instrument_is_selector(const struct instrument *in, enum instrument_part part)
{
    const struct bench_device *d = instrument_device(in, part);
    return d && d->use != BENCH_INPUTS;
}

bool instrument_device_there(const struct instrument *in, enum instrument_part part)
{
    return seen(in, part)->selector || seen(in, part)->inputs;
}

// --- first contact ----------------------------------------------------------------------------

// Every position that the bench file names must be one.
static int check_position(const struct companion *c, const char *position, struct gon_error *err)
{
    char all[300] = "";
    if (!*position || selector_find(c->selector, position) >= 0)
        return 0;
    for (int i = 0; i < c->selector->ops->positions(c->selector); i++) {
        const size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%s'%s'", used ? ", " : "",
                 c->selector->ops->name(c->selector, i));
    }
    return gon_fail(err, GON_E_INPUT, "has no position '%s'; it has %s", position, all);
}

static int check_positions(const struct instrument *in, const struct companion *c,
                           struct gon_error *err)
{
    int rc = check_position(c, c->config->position, err);
    if (rc >= 0)
        rc = check_position(c, c->config->safe, err);
    for (int i = 0; i < in->bench->stations_count; i++) {
        const struct bench_station *s = &in->bench->stations[i];
        for (int k = 0; k < s->places_count && rc >= 0; k++)
            if (!strcmp(s->places[k].name, c->config->name))
                rc = check_position(c, s->places[k].position, err);
    }
    if (rc >= 0 && c->config->darks && !*c->config->safe && c->selector->ops->safe(c->selector) < 0)
        return gon_fail(err, GON_E_INPUT,
                        "makes the darks: its position for that is missing, give "
                        "it as safe");
    return rc;
}

static int connect_selector(struct instrument *in, struct companion *c, struct part_state *p,
                            struct gon_error *err)
{
    int rc = c->selector
                 ? c->selector->ops->reopen(c->selector, err)
                 : device_open_selector(p->driver, in->bench->folder, &c->profile, p->address,
                                        &in->breathing.clk, NULL, &c->selector, err);
    if (rc >= 0)
        rc = check_positions(in, c, err);
    if (rc < 0)
        return rc;
    char identity[sizeof p->identity] = "";
    rc = c->selector->ops->identify(c->selector, identity, sizeof identity, err);
    rc = instrument_recognise(p, rc, identity, err);
    return rc < 0 ? rc : c->selector->ops->where(c->selector, &c->position, NULL, err);
}

// Every value that a suspender names must be one.
static int check_values(const struct instrument *in, const struct companion *c,
                        struct gon_error *err)
{
    struct inputs_value v;
    for (int i = 0; i < in->bench->suspenders_count; i++) {
        const struct bench_condition *when = &in->suspend.one[i].condition;
        for (int k = 0; k < when->terms; k++) {
            const char *name;
            const int device = bench_term_device(in->bench, &when->term[k], &name);
            if (device >= 0 && &in->bench->devices[device] == c->config &&
                !inputs_find(c->inputs, name, &v))
                return gon_fail(err, GON_E_INPUT, "has no value '%s', which suspender \"%s\" names",
                                name, in->bench->suspenders[i].name);
        }
    }
    return 0;
}

static int open_inputs(struct instrument *in, struct companion *c, const struct part_state *p,
                       struct gon_error *err)
{
    const char *folder = in->bench->folder;
    if (c->bus < 0)
        return device_open_inputs(p->driver, folder, &c->profile, p->address, &in->breathing.clk,
                                  NULL, &c->inputs, err);
    return device_new_inputs(p->driver, folder, &c->profile, in->bus[c->bus], c->config->unit,
                             &in->breathing.clk, &c->inputs, err);
}

// A bus is shared: it is only reopened when the unit does not answer on it as it is.
static int connect_inputs(struct instrument *in, struct companion *c, struct part_state *p,
                          struct gon_error *err)
{
    int rc = 0;
    if (c->bus >= 0 && !in->bus[c->bus])
        rc = instrument_open_bus(in, c->bus, err);
    if (rc >= 0 && !c->inputs)
        rc = open_inputs(in, c, p, err);
    else if (rc >= 0 && c->bus < 0)
        rc = inputs_reopen(c->inputs, err);
    if (rc < 0)
        return rc;
    char identity[sizeof p->identity] = "";
    rc = inputs_identify(c->inputs, identity, sizeof identity, err);
    if ((rc == GON_E_LINK || rc == GON_E_GONE) && c->bus >= 0) {
        rc = instrument_open_bus(in, c->bus, err);
        if (rc >= 0)
            rc = inputs_identify(c->inputs, identity, sizeof identity, err);
    }
    rc = instrument_recognise(p, rc, identity, err);
    rc = rc < 0 ? rc : inputs_read(c->inputs, err);
    return rc < 0 ? rc : check_values(in, c, err);
}

int instrument_connect_device(struct instrument *in, enum instrument_part part,
                              struct gon_error *err)
{
    struct companion *c = of(in, part);
    struct part_state *p = &in->part[part];
    return c->config->use == BENCH_INPUTS ? connect_inputs(in, c, p, err)
                                          : connect_selector(in, c, p, err);
}

// --- selectors --------------------------------------------------------------------------------

int instrument_select(struct instrument *in, enum instrument_part part, const char *position,
                      struct gon_error *err)
{
    struct companion *c = of(in, part);
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, part, err);
    if (rc < 0)
        return rc;
    const int wanted = selector_find(c->selector, position);
    c->position = SELECTOR_ELSEWHERE;
    rc = wanted < 0 ? check_position(c, position, err)
                    : c->selector->ops->go(c->selector, wanted, err);
    if (rc >= 0)
        c->position = wanted;
    return instrument_note(in, part, rc, err);
}

static int look(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    struct companion *c = of(in, part);
    int rc = instrument_need(in, part, err);
    if (rc < 0)
        return rc;
    rc = c->selector->ops->where(c->selector, &c->position, NULL, err);
    if (rc < 0)
        c->position = SELECTOR_ELSEWHERE;
    return instrument_note(in, part, rc, err);
}

int instrument_look(struct instrument *in, enum instrument_part part, const char *position,
                    bool *ret_there, struct gon_error *err)
{
    struct gon_error own;
    int rc = look(in, part, err ? err : &own);
    if (rc >= 0)
        *ret_there = !strcmp(instrument_selected(in, part), position);
    return rc;
}

const char *instrument_selected(const struct instrument *in, enum instrument_part part)
{
    const struct companion *c = seen(in, part);
    return c->selector && c->position >= 0 ? c->selector->ops->name(c->selector, c->position)
                                           : "elsewhere";
}

const char *instrument_safe_position(const struct instrument *in, enum instrument_part part)
{
    const struct companion *c = seen(in, part);
    if (*c->config->safe)
        return c->config->safe;
    const bool own = c->config->use == BENCH_SHUTTER && c->selector;
    const int safe = own ? c->selector->ops->safe(c->selector) : SELECTOR_ELSEWHERE;
    return safe < 0 ? NULL : c->selector->ops->name(c->selector, safe);
}

int instrument_devices_safe(struct instrument *in, struct gon_error *err)
{
    int first = 0;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++) {
        struct gon_error why;
        if (!instrument_is_selector(in, part) || in->part[part].link != PART_OK)
            continue;
        const char *position = instrument_safe_position(in, part);
        int rc = position ? instrument_select(in, part, position, &why) : 0;
        if (rc < 0 && first >= 0) {
            first = rc;
            if (err)
                *err = why;
        }
    }
    return first;
}

// --- inputs -----------------------------------------------------------------------------------

static int read_inputs(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    int rc = instrument_need(in, part, err);
    if (rc < 0)
        return rc;
    rc = instrument_note(in, part, inputs_read(of(in, part)->inputs, err), err);
    of(in, part)->read_ns = instrument_now_ns(in);
    return rc;
}

int instrument_watch_inputs(struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    int rc = 0;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT && rc >= 0; part++) {
        const struct companion *c = seen(in, part);
        if (instrument_has(in, part) && c->config->use == BENCH_INPUTS &&
            (c->read_ns == INT64_MIN || instrument_now_ns(in) - c->read_ns >= LOOK_NS))
            rc = read_inputs(in, part, err ? err : &own);
    }
    return rc;
}

void instrument_refresh_inputs(struct instrument *in)
{
    struct gon_error err;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++)
        if (in->part[part].link == PART_OK && seen(in, part)->config->use == BENCH_INPUTS)
            read_inputs(in, part, &err);
}

bool instrument_input(const struct instrument *in, const char *name, double *ret_value)
{
    const char *dot = strchr(name, '.');
    struct inputs_value v;
    for (int i = 0; dot && i < BENCH_DEVICES; i++) {
        const struct companion *c = &in->companion[i];
        if (!c->inputs || strlen(c->config->name) != (size_t)(dot - name) ||
            strncmp(c->config->name, name, (size_t)(dot - name)))
            continue;
        if (!inputs_find(c->inputs, dot + 1, &v) || !v.known || isnan(v.number))
            return false;
        *ret_value = v.number;
        return true;
    }
    return false;
}

static bool shares_link(const struct instrument *in, enum instrument_part part)
{
    return in->talking == (int)part ||
           (in->talking < PART_COUNT &&
            !strcmp(in->part[part].address, in->part[in->talking].address));
}

// One that cannot be kept is lost, and not tried again in every slice.
static void keep_relay(struct instrument *in, enum instrument_part part)
{
    struct gon_error err;
    const int talking = in->talking;
    in->talking = (int)part;
    const int rc = inputs_keep(of(in, part)->inputs, &err);
    if (rc < 0)
        instrument_note(in, part, rc, &err);
    in->talking = talking;
}

void instrument_keep_relays(struct instrument *in)
{
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++) {
        if (of(in, part)->inputs && in->part[part].link == PART_OK && !shares_link(in, part))
            keep_relay(in, part);
    }
}

// --- books ------------------------------------------------------------------------------------

static int find_bus(const struct bench_config *bench, const char *name)
{
    for (int i = 0; i < bench->buses_count; i++)
        if (*name && !strcmp(bench->buses[i].name, name))
            return i;
    return -1;
}

void instrument_make_devices(struct instrument *in)
{
    in->monitor.range = -1;
    in->part[PART_MONITOR].name = "monitor";
    in->part[PART_MONITOR].driver = in->bench->monitor.driver;
    in->part[PART_MONITOR].address = in->bench->monitor.link;
    in->part[PART_MONITOR].link = *in->bench->monitor.driver ? PART_LOST : PART_ABSENT;
    for (int i = 0; i < BENCH_DEVICES; i++) {
        const bool there = i < in->bench->devices_count;
        const struct bench_device *d = there ? &in->bench->devices[i] : NULL;
        struct companion *c = &in->companion[i];
        *c = (struct companion){.config = d,
                                .bus = d ? find_bus(in->bench, d->bus) : -1,
                                .position = SELECTOR_ELSEWHERE,
                                .read_ns = INT64_MIN};
        struct part_state *p = &in->part[PART_DEVICES + i];
        p->name = d ? d->name : "";
        p->driver = d ? d->driver : "";
        p->address = c->bus >= 0 ? in->bench->buses[c->bus].link : d ? d->link : "";
        p->link = d ? PART_LOST : PART_ABSENT;
    }
}

void instrument_ask_device(struct instrument *in, enum instrument_part part)
{
    struct gon_error err;
    if (of(in, part)->config->use == BENCH_INPUTS)
        read_inputs(in, part, &err);
    else
        look(in, part, &err);
}

const struct link_stats *instrument_device_stats(const struct instrument *in,
                                                 enum instrument_part part)
{
    const struct companion *c = seen(in, part);
    if (c->selector)
        return c->selector->ops->stats ? c->selector->ops->stats(c->selector) : NULL;
    if (c->bus >= 0)
        return in->bus[c->bus] ? bus_stats(in->bus[c->bus]) : NULL;
    return c->inputs ? inputs_stats(c->inputs) : NULL;
}

static void show_values(const struct companion *c, struct device_state *d)
{
    d->values = c->inputs ? inputs_count(c->inputs) : 0;
    if (d->values > INSTRUMENT_VALUES)
        d->values = INSTRUMENT_VALUES;
    for (int i = 0; i < d->values; i++) {
        const struct inputs_value v = inputs_at(c->inputs, i);
        snprintf(d->value[i].name, sizeof d->value[i].name, "%s", v.name);
        snprintf(d->value[i].unit, sizeof d->value[i].unit, "%s", v.unit);
        d->value[i].number = v.known ? v.number : (double)NAN;
    }
}

void instrument_show_devices(const struct instrument *in, struct instrument_snapshot *s)
{
    for (int i = 0; i < BENCH_DEVICES; i++) {
        const struct companion *c = &in->companion[i];
        struct device_state *d = &s->device[i];
        d->wanted = c->config ? c->config->position : "";
        if (!c->config)
            continue;
        d->use = (enum bench_use)c->config->use;
        if (c->selector && c->position >= 0)
            snprintf(d->position, sizeof d->position, "%s",
                     c->selector->ops->name(c->selector, c->position));
        show_values(c, d);
    }
}

void instrument_free_devices(struct instrument *in)
{
    for (int i = 0; i < BENCH_DEVICES; i++) {
        struct companion *c = &in->companion[i];
        if (c->selector)
            c->selector->ops->free(c->selector);
        inputs_free(c->inputs);
        free(c->profile);
    }
}
