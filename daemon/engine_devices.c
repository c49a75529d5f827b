// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "campaign/bench.h"
#include "campaign/plan.h"
#include "campaign/store.h"
#include "daemon/instrument_devices.h"

#include <math.h>
#include <string.h>

#define SETTLE_NS                                                                                  \
    CLK_MS(200)       // of the monitor, before it is asked whether the light is there or gone
#define STILL_LIT 0.5 // of the monitor after warm-up: above it the light is not gone

static bool makes_darks(const struct engine *e, enum instrument_part part)
{
    return instrument_device(e->in, part)->darks;
}

// Where a station has it; NULL: as everywhere.
static const char *station_has(const struct engine *e, enum instrument_part part)
{
    const struct bench_station *s = bench_find_station(instrument_bench(e->in), e->point->station);
    for (int k = 0; s && k < s->places_count; k++)
        if (!strcmp(s->places[k].name, instrument_device(e->in, part)->name))
            return s->places[k].position;
    return NULL;
}

static const char *wanted(const struct engine *e, enum instrument_part part)
{
    if (e->point->kind == PLAN_DARK && makes_darks(e, part))
        return instrument_safe_position(e->in, part);
    const char *there = station_has(e, part);
    return there ? there : instrument_device(e->in, part)->position;
}

static bool stands(const struct engine *e, enum instrument_part part)
{
    return !strcmp(instrument_selected(e->in, part), wanted(e, part));
}

bool engine_station_places(const struct engine *e)
{
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++)
        if (instrument_is_selector(e->in, part) && station_has(e, part))
            return true;
    return false;
}

// What the detector has seen before says nothing any more.
static void light_changed(struct engine *e)
{
    e->light_ns = e->source_ns = clk_now_ns(e->ports->clk);
    e->acquire.range = -1;
}

static int select_it(struct engine *e, enum instrument_part part, const char *position)
{
    const bool moves = strcmp(instrument_selected(e->in, part), position) != 0;
    int rc = instrument_select(e->in, part, position, &e->why);
    if (rc == GON_E_DEVICE) {
        const struct gon_error why = e->why;
        gon_fail(&e->why, rc, "%.400s; look at it, then: gonio resume", why.text);
    }
    if (rc >= 0 && moves)
        light_changed(e);
    return rc;
}

// Read back; found elsewhere than it was left, it is told so once more, and that is told.
static int read_back(struct engine *e, enum instrument_part part)
{
    const bool stood = stands(e, part);
    bool there;
    int rc = instrument_look(e->in, part, wanted(e, part), &there, &e->why);
    if (rc >= 0 && stood && !there)
        engine_say(e, ENGINE_LOG, "warn", "%s: found at '%s', set to '%s' again",
                   instrument_device(e->in, part)->name, instrument_selected(e->in, part),
                   wanted(e, part));
    return rc;
}

int engine_look_at_devices(struct engine *e)
{
    int rc = 0;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT && rc >= 0; part++)
        if (instrument_is_selector(e->in, part))
            rc = read_back(e, part);
    return rc;
}

// With a filter before the monitor "lit" is another value of it; the laser itself says that it is
// on. Never of a shutter, which may be stuck.
static int learn_light(struct engine *e)
{
    struct detector_sample s;
    int rc = engine_check_laser(e);
    if (rc >= 0)
        rc = engine_nap(e, SETTLE_NS);
    if (rc >= 0)
        rc = instrument_sample(e->in, &s, &e->why);
    if (rc >= 0 && isfinite(s.monitor_v))
        e->monitor_lit_v = s.monitor_v;
    return rc;
}

int engine_place_devices(struct engine *e)
{
    bool filtered = false;
    const bool all = e->devices_sweep != e->point->sweep;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++) {
        if (!instrument_is_selector(e->in, part))
            continue;
        int rc = all ? read_back(e, part) : 0;
        if (rc >= 0 && !stands(e, part)) {
            rc = select_it(e, part, wanted(e, part));
            filtered = filtered || instrument_device(e->in, part)->use != BENCH_SHUTTER;
        }
        if (rc < 0)
            return rc;
    }
    e->devices_sweep = e->point->sweep;
    return filtered && e->lit && !e->dark ? learn_light(e) : 0;
}

// --- after a reading ---------------------------------------------------------------------------

int engine_confirm_devices(struct engine *e, struct acquire_reading *r)
{
    e->strayed = PART_COUNT;
    for (enum instrument_part part = PART_DEVICES; part < PART_COUNT; part++) {
        bool there = true;
        int rc = instrument_is_selector(e->in, part)
                     ? instrument_look(e->in, part, wanted(e, part), &there, &e->why)
                     : 0;
        if (rc < 0)
            return rc;
        if (!there && e->strayed == PART_COUNT)
            e->strayed = part;
    }
    if (e->strayed < PART_COUNT) {
        r->flags |= STORE_DISCARDED;
        r->accepted = false;
        r->again = true;
    }
    return 0;
}

// A shutter is not sought again: who closes it has a reason, or it is broken.
int engine_seek_device(struct engine *e)
{
    const enum instrument_part part = e->strayed;
    if (part == PART_COUNT)
        return 0;
    const struct bench_device *d = instrument_device(e->in, part);
    const char *found = instrument_selected(e->in, part);
    const unsigned bit = 1u << (part - PART_DEVICES);
    if (d->use == BENCH_SHUTTER || e->sought & bit)
        return gon_fail(&e->why, GON_E_DEVICE,
                        "%s: is at '%s' and not at '%s'%s; look at it, then: gonio resume", d->name,
                        found, wanted(e, part), e->sought & bit ? " again" : "");
    engine_say(e, ENGINE_LOG, "warn",
               "%s: at '%s' and not at '%s' after a reading, which is discarded; set again",
               d->name, found, wanted(e, part));
    e->sought |= bit;
    return select_it(e, part, wanted(e, part));
}

// --- darks by a shutter --------------------------------------------------------------------------

static enum instrument_part dark_shutter(const struct engine *e)
{
    const int i = bench_dark_shutter(instrument_bench(e->in));
    return i < 0 ? PART_COUNT : PART_DEVICES + (enum instrument_part)i;
}

// The monitor stands behind it.
static int light_is_gone(struct engine *e, enum instrument_part part)
{
    struct detector_sample s;
    const double dark_v = isfinite(e->monitor_dark_v) ? e->monitor_dark_v : 0.0;
    int rc = engine_nap(e, SETTLE_NS);
    if (rc >= 0)
        rc = instrument_sample(e->in, &s, &e->why);
    if (rc < 0 || !(s.monitor_v - dark_v > STILL_LIT * (e->monitor_lit_v - dark_v)))
        return rc;
    return gon_fail(
        &e->why, GON_E_DEVICE,
        "%s: says '%s', but the monitor still sees %.4g of %.4g %s; it is stuck, or the "
        "monitor stands before it (then darks = false), then: gonio resume",
        instrument_device(e->in, part)->name, instrument_selected(e->in, part), s.monitor_v,
        e->monitor_lit_v, instrument_monitor_unit(e->in));
}

int engine_shut(struct engine *e)
{
    const enum instrument_part part = dark_shutter(e);
    int rc = part < PART_COUNT ? select_it(e, part, instrument_safe_position(e->in, part)) : 0;
    return rc >= 0 && part < PART_COUNT && e->lit ? light_is_gone(e, part) : rc;
}

bool engine_shutter_darkens(const struct engine *e)
{
    return dark_shutter(e) < PART_COUNT;
}
