// SPDX-License-Identifier: MIT
#include "campaign/bench_devices.h"

#include "base/options.h"
#include "campaign/bench.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

const char *const bench_uses[] = {"shutter", "filter", "chopper", "other", "inputs", NULL};

#define TEXT(s, n, member, def, text)                                                              \
    {                                                                                              \
        .name = n, .type = CFG_STRING, .offset = offsetof(struct s, member),                       \
        .size = sizeof((struct s *)0)->member, .fallback = def, .help = text                       \
    }

const struct cfg_row bench_monitor_rows[] = {
    TEXT(bench_monitor, "driver", driver, "",
         "The profile of a detector: its name (\"thorlabs-pm100\") or a path with a slash in it."),
    TEXT(bench_monitor, "link", link, "",
         "\"serial:/dev/ttyUSB3?baud=115200\", \"tcp:host:port\" or \"usbtmc:vid:pid:serial\"."),
    {.name = "full_scale",
     .type = CFG_REAL,
     .offset = offsetof(struct bench_monitor, full_scale),
     .min = 0,
     .max = 1e6,
     .fallback = "0",
     .help = "The most it will see, in its own unit: it stands on its most sensitive range that "
             "holds this. 0: the range is found when the laser is warm, and kept for the run."},
    {0}};

const struct cfg_row bench_device_rows[] = {
    TEXT(bench_device, "name", name, NULL, "Free; no axis and no other device has it."),
    TEXT(bench_device, "driver", driver, NULL,
         "The device's profile: its name (\"thorlabs-sc10\") or a path with a slash in it."),
    TEXT(bench_device, "link", link, "",
         "\"serial:/dev/ttyUSB4?baud=9600\", \"tcp:host:port\" or \"usbtmc:vid:pid:serial\"; only "
         "inputs may be on a bus instead."),
    TEXT(bench_device, "bus", bus, "", "Of inputs on a bus: the name of one of the buses."),
    {.name = "unit",
     .type = CFG_INT,
     .offset = offsetof(struct bench_device, unit),
     .min = 0,
     .max = 247,
     .fallback = "0",
     .help = "Its address on that bus, 1..247."},
    {.name = "use",
     .type = CFG_CHOICE,
     .offset = offsetof(struct bench_device, use),
     .choices = bench_uses,
     .help = "What it is for; inputs are only read."},
    TEXT(bench_device, "position", position, "",
         "Where it stands while something is measured, in its profile's words (\"open\", \"1\", "
         "\"running\"); not of inputs."),
    TEXT(bench_device, "safe", safe, "",
         "Where it goes when a run pauses or ends; left out, a shutter goes where its profile says "
         "that it is safe, others stay."),
    {.name = "darks",
     .type = CFG_BOOL,
     .offset = offsetof(struct bench_device, darks),
     .fallback = "false",
     .help = "Whether this shutter, closed, makes the darks while the laser stays on; the monitor "
             "then stands behind it. Otherwise the laser is switched off for them."},
    {0}};

const struct cfg_row bench_place_rows[] = {
    TEXT(bench_place, "name", name, NULL, "The name of one of the devices."),
    TEXT(bench_place, "position", position, NULL, "Where it stands at the station."),
    {.name = "transmission",
     .type = CFG_REAL,
     .offset = offsetof(struct bench_place, transmission),
     .min = 0,
     .max = 1e6,
     .fallback = "0",
     .help = "Of a filter at the beam: what it passes there, over what it passes where it stands "
             "on the sample; 1 when the monitor stands behind it."},
    {.name = "u_transmission",
     .type = CFG_REAL,
     .offset = offsetof(struct bench_place, u_transmission),
     .min = 0,
     .max = 1e6,
     .fallback = "0",
     .help = "Its standard uncertainty."},
    {0}};

// --- finding -------------------------------------------------------------------------------------

int bench_device_index(const struct bench_config *b, const char *name)
{
    for (int i = 0; i < b->devices_count; i++)
        if (!strcmp(b->devices[i].name, name))
            return i;
    return -1;
}

int bench_dark_shutter(const struct bench_config *b)
{
    for (int i = 0; i < b->devices_count; i++)
        if (b->devices[i].darks)
            return i;
    return -1;
}

double bench_beam_passes(const struct bench_config *b, double *ret_u_rel)
{
    const struct bench_station *s = bench_find_station(b, "beam");
    double passes = 1;
    *ret_u_rel = 0;
    for (int k = 0; s && k < s->places_count; k++)
        if (s->places[k].transmission > 0) {
            passes *= s->places[k].transmission;
            *ret_u_rel = hypot(*ret_u_rel, s->places[k].u_transmission / s->places[k].transmission);
        }
    return passes;
}

// --- another day ---------------------------------------------------------------------------------

static const char *place_of(const struct bench_station *s, const struct bench_device *d)
{
    for (int k = 0; s && k < s->places_count; k++)
        if (!strcmp(s->places[k].name, d->name))
            return s->places[k].position;
    return d->position;
}

// The device that stands elsewhere now; NULL: none. New ones may stand anywhere.
static const struct bench_device *moved(const struct bench_config *then,
                                        const struct bench_config *now)
{
    for (int i = 0; i < then->devices_count; i++) {
        const struct bench_device *d = &then->devices[i];
        const int j = bench_device_index(now, d->name);
        if (d->use == BENCH_INPUTS)
            continue;
        if (j < 0 || strcmp(d->position, now->devices[j].position) ||
            strcmp(place_of(bench_find_station(then, "beam"), d),
                   place_of(bench_find_station(now, "beam"), &now->devices[j])))
            return d;
    }
    return NULL;
}

int bench_same_devices(const struct bench_config *then, const struct bench_config *now,
                       struct gon_error *err)
{
    double u;
    const struct bench_device *d = moved(then, now);
    if (strcmp(then->monitor.driver, now->monitor.driver))
        return gon_fail(err, GON_E_REFUSED,
                        "the campaign was begun with %s%s as monitor, the bench has %s%s; go on "
                        "with that bench",
                        *then->monitor.driver ? "a " : "no instrument", then->monitor.driver,
                        *now->monitor.driver ? "a " : "none", now->monitor.driver);
    if (d)
        return gon_fail(err, GON_E_REFUSED,
                        "the campaign was begun with %s at '%s', which the bench has elsewhere or "
                        "not at all; go on with that bench",
                        d->name, d->position);
    if (bench_beam_passes(then, &u) != bench_beam_passes(now, &u))
        return gon_fail(err, GON_E_REFUSED,
                        "the campaign was begun with a filter in the beam that passes %g, the "
                        "bench's passes %g; go on with that bench",
                        bench_beam_passes(then, &u), bench_beam_passes(now, &u));
    return 0;
}

// --- checks across settings ----------------------------------------------------------------------

static int complain(struct cfg_file *f, int i, const char *member, const char *text)
{
    char path[60];
    snprintf(path, sizeof path, "devices[%d].%s", i, member);
    return cfg_complain(f, path, "%s", text);
}

static bool is_text_link(const char *link)
{
    return !strncmp(link, "serial:", 7) || !strncmp(link, "tcp:", 4) ||
           !strncmp(link, "usbtmc:", 7);
}

#define LINKS "allowed serial:PORT, tcp:HOST:PORT or usbtmc:VID:PID:SERIAL"

static int check_monitor(struct cfg_file *f, const struct bench_config *b)
{
    const struct bench_monitor *m = &b->monitor;
    if (!*m->driver)
        return *m->link || m->full_scale > 0 ? cfg_complain(f, "monitor.driver", "is missing") : 0;
    int mistakes = 0;
    if (!is_text_link(m->link))
        mistakes += cfg_complain(f, "monitor.link", LINKS);
    if (b->detector.monitor_aux)
        mistakes += cfg_complain(f, "detector.monitor_aux",
                                 "the bench has a monitor of its own in group monitor; one or the "
                                 "other, write 0");
    return mistakes;
}

// Parts of the instrument share one list of names.
static int check_name(struct cfg_file *f, const struct bench_config *b, int i)
{
    const char *name = b->devices[i].name;
    int mistakes = 0;
    if (!*name || name[strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-")] ||
        !strcmp(name, "laser") || !strcmp(name, "detector") || !strcmp(name, "monitor"))
        mistakes +=
            complain(f, i, "name", "allowed a-z, 0-9, _ and -, and not laser, detector or monitor");
    if (bench_find_axis(b, name))
        mistakes += complain(f, i, "name", "is the name of an axis too");
    if (bench_device_index(b, name) < i)
        mistakes += complain(f, i, "name", "is the name of another device too");
    return mistakes;
}

static bool is_taken(const struct bench_config *b, int i)
{
    const struct bench_device *d = &b->devices[i];
    for (int j = 0; j < b->axes_count; j++)
        if (!strcmp(b->axes[j].bus, d->bus) && b->axes[j].unit == d->unit)
            return true;
    for (int j = 0; j < i; j++)
        if (!strcmp(b->devices[j].bus, d->bus) && b->devices[j].unit == d->unit)
            return true;
    return false;
}

static int check_bus(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_device *d = &b->devices[i];
    int mistakes = 0, bus = 0;
    while (bus < b->buses_count && strcmp(b->buses[bus].name, d->bus))
        bus++;
    if (bus == b->buses_count)
        mistakes += complain(f, i, "bus", "no bus of that name in buses");
    if (d->unit < 1)
        mistakes += complain(f, i, "unit", "its address on the bus is missing; allowed 1..247");
    else if (is_taken(b, i))
        mistakes += complain(f, i, "unit", "is the unit of another device on that bus too");
    return mistakes;
}

static int check_selector(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_device *d = &b->devices[i];
    int mistakes = 0;
    if (*d->bus)
        mistakes += complain(f, i, "bus", "only inputs may be on a bus; give a link");
    else if (!is_text_link(d->link))
        mistakes += complain(f, i, "link", LINKS);
    if (!*d->position)
        mistakes += complain(f, i, "position", "where it stands while measuring is missing");
    if (d->darks && d->use != BENCH_SHUTTER)
        mistakes += complain(f, i, "darks", "only a shutter can make darks");
    if (d->darks && bench_dark_shutter(b) < i)
        mistakes += complain(f, i, "darks", "another shutter makes the darks already");
    return mistakes;
}

static int check_inputs(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_device *d = &b->devices[i];
    int mistakes = 0;
    if (*d->position || *d->safe || d->darks)
        mistakes += complain(f, i,
                             *d->position ? "position"
                             : *d->safe   ? "safe"
                                          : "darks",
                             "inputs are only read");
    if (*d->bus && *d->link)
        mistakes += complain(f, i, "link", "a link or a bus, not both");
    else if (*d->bus)
        mistakes += check_bus(f, b, i);
    else if (!is_text_link(d->link))
        mistakes += complain(f, i, "link", LINKS "; or give bus and unit");
    return mistakes;
}

static int check_place(struct cfg_file *f, const struct bench_config *b, int station, int k)
{
    const struct bench_station *s = &b->stations[station];
    const int device = bench_device_index(b, s->places[k].name);
    char path[60];
    snprintf(path, sizeof path, "stations[%d].devices[%d].name", station, k);
    if (device < 0) {
        const char *names[BENCH_DEVICES + 1] = {NULL};
        for (int i = 0; i < b->devices_count; i++)
            names[i] = b->devices[i].name;
        const char *meant = options_suggest(s->places[k].name, names);
        return cfg_complain(f, path, "no device of that name in devices%s%s%s",
                            meant ? "; did you mean '" : "", meant ? meant : "", meant ? "'?" : "");
    }
    if (b->devices[device].use == BENCH_INPUTS)
        return cfg_complain(f, path, "has no positions: it is only read");
    const struct bench_device *d = &b->devices[device];
    const bool filters = !strcmp(s->name, "beam") && d->use == BENCH_FILTER &&
                         strcmp(d->position, s->places[k].position);
    if (filters && !(s->places[k].transmission > 0)) {
        snprintf(path, sizeof path, "stations[%d].devices[%d].transmission", station, k);
        return cfg_complain(f, path,
                            "%s filters the beam: what it passes of it, over what it passes at "
                            "\"%s\", is missing; 1 when it stands before the monitor",
                            d->name, d->position);
    }
    for (int j = 0; j < k; j++)
        if (!strcmp(s->places[j].name, s->places[k].name))
            return cfg_complain(f, path, "is placed twice at one station");
    return 0;
}

int bench_devices_check(struct cfg_file *f, const struct bench_config *b)
{
    int mistakes = check_monitor(f, b);
    for (int i = 0; i < b->devices_count; i++) {
        mistakes += check_name(f, b, i);
        mistakes +=
            b->devices[i].use == BENCH_INPUTS ? check_inputs(f, b, i) : check_selector(f, b, i);
    }
    for (int i = 0; i < b->stations_count; i++)
        for (int k = 0; k < b->stations[i].places_count; k++)
            mistakes += check_place(f, b, i, k);
    return mistakes;
}
