// SPDX-License-Identifier: MIT
#include "daemon/instrument.h"

#include "campaign/bench.h"
#include "daemon/instrument_inside.h"
#include "daemon/instrument_suspend.h"
#include "drivers/bus.h"
#include "drivers/by_profile.h"
#include "drivers/device.h"
#include "drivers/identity.h"
#include "drivers/profile.h"
#include "drivers/safing.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SLICE_NS CLK_MS(100)
#define QUIET_MS 100 // the slowest answer of a unit that is to be drained after an error

// --- time -------------------------------------------------------------------------------------

static int64_t breathing_now_ns(const struct clk *clk)
{
    return clk_now_ns(((const struct breathing *)clk)->inner);
}

static int64_t breathing_utc_ns(const struct clk *clk)
{
    return clk_utc_ns(((const struct breathing *)clk)->inner);
}

static void breathing_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    struct breathing *b = (struct breathing *)clk;
    instrument_breathe(b->in);
    for (int64_t now_ns; (now_ns = clk_now_ns(b->inner)) < t_ns;) {
        const int64_t slice_ns = now_ns + SLICE_NS;
        if (clk_sleep_until(b->inner, t_ns < slice_ns ? t_ns : slice_ns, cancel) < 0)
            return;
        instrument_breathe(b->in);
    }
}

// Whatever switched the light off without being asked ends the arm, once for each alarm.
static void step_arm(struct instrument *in)
{
    struct gon_error why;
    const bool alarmed = instrument_alarm(in, &why) < 0;
    arm_tick(&in->arm, instrument_now_ns(in));
    if (alarmed && !in->alarmed)
        arm_end(&in->arm, why.text);
    in->alarmed = alarmed;
}

void instrument_breathe(struct instrument *in)
{
    step_arm(in);
    const int talking = in->talking; // a driver that waits in the middle of its talk
    if (in->safety && safety_tick(in->safety))
        instrument_emission_off(in, NULL);
    in->talking = talking;
    instrument_keep_relays(in);
    if (in->watcher)
        in->watcher(in->watcher_ctx);
}

int64_t instrument_now_ns(const struct instrument *in)
{
    return clk_now_ns(in->breathing.inner);
}

int64_t instrument_utc_ns(const struct instrument *in)
{
    return clk_utc_ns(in->breathing.inner);
}

void instrument_watch(struct instrument *in, void (*watcher)(void *ctx), void *ctx)
{
    in->watcher = watcher;
    in->watcher_ctx = ctx;
}

// --- links ------------------------------------------------------------------------------------

int instrument_note(struct instrument *in, enum instrument_part part, int rc, struct gon_error *err)
{
    struct part_state *p = &in->part[part];
    in->talking = PART_COUNT;
    if (rc >= 0) {
        if (p->link == PART_LOST)
            p->returns++;
        p->link = PART_OK;
        p->problem[0] = 0;
        backoff_reset(&in->retry[part]);
        return rc;
    }
    p->errors++;
    err->code = (enum gon_code)rc;
    gon_prefix(err, "%s%s", part < INSTRUMENT_AXES ? "axis " : "", p->name);
    snprintf(p->last_error, sizeof p->last_error, "%.*s", (int)sizeof p->last_error - 1, err->text);
    p->last_error_ns = instrument_now_ns(in);
    if (rc == GON_E_LINK || rc == GON_E_GONE) {
        p->link = PART_LOST;
        snprintf(p->problem, sizeof p->problem, "%.*s", (int)sizeof p->problem - 1, err->text);
    }
    return rc;
}

bool instrument_is_there(const struct instrument *in, enum instrument_part part)
{
    return part < INSTRUMENT_AXES  ? in->motor[part].axis != NULL
           : part == PART_LASER    ? in->safety != NULL
           : part == PART_DETECTOR ? in->detector != NULL
           : part == PART_MONITOR  ? in->monitor.detector != NULL
                                   : instrument_device_there(in, part);
}

int instrument_need(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    assert(in->part[part].link != PART_ABSENT);
    in->talking = (int)part;
    if (in->part[part].refused)
        return gon_fail(err, GON_E_GONE, "%s", in->part[part].problem);
    if (instrument_is_there(in, part))
        return 0;
    return instrument_note(
        in, part, gon_fail(err, GON_E_GONE, "not there (%s)", in->part[part].address), err);
}

bool instrument_has(const struct instrument *in, enum instrument_part part)
{
    return in->part[part].link != PART_ABSENT;
}

enum instrument_part instrument_lost(const struct instrument *in)
{
    enum instrument_part part = 0;
    while (part < PART_COUNT && in->part[part].link != PART_LOST)
        part++;
    return part;
}

static int make_axis(struct instrument *in, struct motor *m, struct bus *bus, struct gon_error *err)
{
    return device_new_axis(m->config->driver, in->bench->folder, &m->profile, bus, m->config->unit,
                           &m->axis, err);
}

int instrument_open_bus(struct instrument *in, int bus, struct gon_error *err)
{
    const struct bench_bus *config = &in->bench->buses[bus];
    return in->bus[bus] ? bus_reopen(in->bus[bus], err)
                        : bus_open(config->link, config->timeout_ms, QUIET_MS, &in->breathing.clk,
                                   NULL, &in->bus[bus], err);
}

static int connect_bus(struct instrument *in, struct motor *m, struct gon_error *err)
{
    int rc = instrument_open_bus(in, m->bus, err);
    return rc >= 0 && !m->axis ? make_axis(in, m, in->bus[m->bus], err) : rc;
}

// Units share their bus: the bus is only reopened when the unit does not answer on it as it is.
static int connect_axis(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    struct motor *m = &in->motor[part];
    int rc = 0;
    if (!m->axis && m->bus >= 0 && in->bus[m->bus])
        rc = make_axis(in, m, in->bus[m->bus], err);
    if (rc < 0)
        return rc;
    rc = m->axis ? m->axis->ops->identify(m->axis, err) : GON_E_GONE;
    if (rc < 0 && m->bus >= 0) {
        rc = connect_bus(in, m, err);
        if (rc >= 0)
            rc = m->axis->ops->identify(m->axis, err);
    }
    if (rc < 0)
        return rc;
    struct part_state *p = &in->part[part];
    snprintf(p->identity, sizeof p->identity, "unit %d", m->config->unit);
    m->engaged = m->config->backlash <= 0;
    m->commanded = (double)NAN;
    m->seen_ns = INT64_MIN;
    return m->axis->ops->stop(m->axis, err);
}

// Its port is opened by the guard, to which its record goes first.
static int open_guarded(struct instrument *in, struct laser **ret_laser, struct gon_error *err)
{
    const struct part_state *p = &in->part[PART_LASER];
    struct guard_record record;
    struct transport *transport;
    int rc =
        in->laser_profile ? 0 : profile_open(p->driver, in->bench->folder, &in->laser_profile, err);
    rc = rc < 0 ? rc : safing_of(in->laser_profile, p->address, &record, err);
    if (rc < 0)
        return rc;
    if (!in->guard && !(in->guard = guard_link_new(&in->host, &record, &in->breathing.clk)))
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    rc = transport_open_guarded(in->guard, p->address, &in->breathing.clk, &transport, err);
    return rc < 0 ? rc : laser_over(in->laser_profile, transport, ret_laser, err);
}

int instrument_recognise(struct part_state *p, int rc, const char *identity, struct gon_error *err)
{
    if (rc >= 0)
        rc = identity_same(p->identity, identity, err);
    if (rc >= 0)
        snprintf(p->identity, sizeof p->identity, "%s", identity);
    p->refused |= rc == GON_E_DEVICE;
    return rc;
}

static int begin_laser(struct instrument *in, char *ret_identity, size_t size,
                       struct gon_error *err)
{
    const struct part_state *p = &in->part[PART_LASER];
    struct laser *laser;
    if (in->safety)
        return safety_reopen(in->safety, ret_identity, size, err);
    int rc = in->host.connect
                 ? open_guarded(in, &laser, err)
                 : device_open_laser(p->driver, in->bench->folder, &in->laser_profile, p->address,
                                     &in->breathing.clk, NULL, &laser, err);
    if (rc < 0)
        return rc;
    if (!(in->safety = safety_new(laser, &in->breathing.clk)))
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    safety_guard(in->safety, in->guard);
    safety_arm(in->safety, &in->arm);
    safety_obey(in->safety, in->stop);
    return safety_begin(in->safety, ret_identity, size, err);
}

// An OFF that is not confirmed is no matter of identity: it goes on being tried.
static int connect_laser(struct instrument *in, struct gon_error *err)
{
    struct part_state *p = &in->part[PART_LASER];
    const enum safety_light left = instrument_light_left(in);
    char identity[sizeof p->identity] = "";
    int rc = begin_laser(in, identity, sizeof identity, err);
    if (rc < 0 && (!in->safety || safety_pending(in->safety)))
        return rc;
    rc = instrument_recognise(p, rc, identity, err);
    in->behind = rc >= 0 ? SAFETY_LIGHT_OFF : left; // whoever confirmed OFF has to be the laser
    return rc;
}

int instrument_write_set_up(struct instrument *in, struct gon_error *err)
{
    const struct bench_detector *c = &in->bench->detector;
    const struct detector_setup setup = {c->time_constant_s, c->slope_db, c->monitor_aux,
                                         in->bench->wavelength_nm};
    in->range = -1;
    return in->detector->ops->setup(in->detector, &setup, &in->time_constant_s, err);
}

static int connect_detector(struct instrument *in, struct gon_error *err)
{
    struct part_state *p = &in->part[PART_DETECTOR];
    int rc = in->detector
                 ? in->detector->ops->reopen(in->detector, err)
                 : device_open_detector(p->driver, in->bench->folder, &in->detector_profile,
                                        p->address, &in->breathing.clk, NULL, &in->detector, err);
    if (rc < 0)
        return rc;
    char identity[sizeof p->identity] = "";
    rc = in->detector->ops->identify(in->detector, identity, sizeof identity, err);
    rc = instrument_recognise(p, rc, identity, err);
    return rc < 0 ? rc : instrument_write_set_up(in, err);
}

int instrument_connect(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    *err = (struct gon_error){0};
    in->talking = (int)part;
    int rc = part < INSTRUMENT_AXES  ? connect_axis(in, part, err)
             : part == PART_LASER    ? connect_laser(in, err)
             : part == PART_DETECTOR ? connect_detector(in, err)
             : part == PART_MONITOR  ? instrument_connect_monitor(in, err)
                                     : instrument_connect_device(in, part, err);
    rc = instrument_note(in, part, rc, err);
    if (rc >= 0) {
        in->part[part].refused = false;
        return 0;
    }
    // Whatever the reason was: it is not usable, and trying again may help.
    in->part[part].link = PART_LOST;
    snprintf(in->part[part].problem, sizeof in->part[part].problem, "%.*s",
             (int)sizeof in->part[part].problem - 1, err->text);
    return rc;
}

// --- construction -----------------------------------------------------------------------------

static int find_bus(const struct bench_config *bench, const char *name)
{
    for (int i = 0; i < bench->buses_count; i++)
        if (strcmp(bench->buses[i].name, name) == 0)
            return i;
    return -1;
}

static struct instrument *make(const struct bench_config *bench, struct clk *clk)
{
    static const struct clk_ops ops = {breathing_now_ns, breathing_utc_ns, breathing_sleep_until};
    struct instrument *in = calloc(1, sizeof *in);
    if (!in)
        return NULL;
    in->bench = bench;
    in->breathing = (struct breathing){{&ops}, clk, in};
    in->range = -1;
    in->time_constant_s = bench->detector.time_constant_s;
    in->sample = (struct detector_sample){(double)NAN, (double)NAN, (double)NAN};
    in->laser = (struct laser_status){.power_w = (double)NAN, .setpoint_w = (double)NAN};
    for (enum instrument_part part = 0; part < PART_COUNT; part++)
        in->part[part] =
            (struct part_state){.name = "", .link = PART_LOST, .driver = "", .address = ""};
    in->talking = PART_COUNT;
    instrument_make_devices(in);
    suspend_init(&in->suspend, bench);
    in->looked_ns = INT64_MIN;
    in->part[PART_LASER].name = "laser";
    in->part[PART_LASER].driver = bench->laser.driver;
    in->part[PART_DETECTOR].name = "detector";
    in->part[PART_DETECTOR].driver = bench->detector.driver;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        const bool there = (int)part < bench->axes_count;
        const double unknown = (double)NAN;
        in->motor[part] = (struct motor){
            .config = there ? &bench->axes[part] : NULL,
            .bus = -1,
            .commanded = unknown,
            .seen_ns = INT64_MIN,
            .place = {
                .position = unknown, .target = unknown, .dial = unknown, .raw_steps = unknown}};
        in->part[part].name = there ? bench->axes[part].name : "";
        in->part[part].driver = there ? bench->axes[part].driver : "";
        in->part[part].link = there ? PART_LOST : PART_ABSENT;
    }
    return in;
}

// A part that is not there yet is no error; what it says to a wrong bench file is.
static int connect_first(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    int rc = instrument_has(in, part) ? instrument_connect(in, part, err) : 0;
    in->part[part].returns = 0; // it was not away yet
    return rc == GON_E_INPUT || rc == GON_E_SYSTEM ? rc : 0;
}

// The laser first: its first bytes are OFF, and nothing moves before.
static int hand_over(struct instrument *in, struct instrument **ret_instrument,
                     struct gon_error *err)
{
    struct gon_error own;
    int rc = connect_first(in, PART_LASER, &own);
    for (enum instrument_part part = 0; part < PART_COUNT && rc >= 0; part++)
        if (part != PART_LASER)
            rc = connect_first(in, part, &own);
    if (rc >= 0)
        rc = bench_kinematics(in->bench, &in->kinematics, &own);
    if (rc < 0) {
        instrument_free(in);
        return gon_fail(err, (enum gon_code)rc, "%s", own.text);
    }
    *ret_instrument = in;
    return 0;
}

int instrument_new(const struct bench_config *bench, const struct instrument_parts *parts,
                   struct clk *clk, struct instrument **ret_instrument, struct gon_error *err)
{
    struct instrument *in = make(bench, clk);
    if (!in)
        return gon_fail(err, GON_E_SYSTEM, "instrument: out of memory");
    for (int i = 0; i < INSTRUMENT_AXES; i++) {
        in->motor[i].axis = parts->axis[i];
        if (!parts->axis[i])
            in->part[i].link = PART_ABSENT;
    }
    in->detector = parts->detector;
    in->monitor.detector = parts->monitor;
    for (int i = 0; i < BENCH_DEVICES; i++) {
        in->companion[i].selector = parts->selector[i];
        in->companion[i].inputs = parts->inputs[i];
    }
    if (!(in->safety = safety_new(parts->laser, &in->breathing.clk))) {
        instrument_free(in);
        return gon_fail(err, GON_E_SYSTEM, "instrument: out of memory");
    }
    safety_arm(in->safety, &in->arm);
    return hand_over(in, ret_instrument, err);
}

int instrument_open(const struct bench_config *bench, const struct guard_host *guard,
                    struct clk *clk, struct instrument **ret_instrument, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    struct instrument *in = make(bench, clk);
    if (!in)
        return gon_fail(err, GON_E_SYSTEM, "instrument: out of memory");
    if (guard)
        in->host = *guard;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++)
        if (instrument_has(in, part)) {
            in->motor[part].bus = find_bus(bench, in->motor[part].config->bus);
            in->part[part].address = bench->buses[in->motor[part].bus].link;
        }
    in->part[PART_LASER].address = bench->laser.link;
    in->part[PART_DETECTOR].address = bench->detector.link;
    return hand_over(in, ret_instrument, err);
}

bool instrument_free(struct instrument *in)
{
    if (!in)
        return true;
    in->watcher = NULL;
    const bool dark = in->safety && safety_free(in->safety) && in->behind == SAFETY_LIGHT_OFF;
    in->safety = NULL;
    guard_link_free(in->guard);
    for (int i = 0; i < INSTRUMENT_AXES; i++)
        if (in->motor[i].axis) {
            in->motor[i].axis->ops->stop(in->motor[i].axis, NULL);
            in->motor[i].axis->ops->free(in->motor[i].axis);
        }
    for (int i = 0; i < INSTRUMENT_AXES; i++)
        free(in->motor[i].profile); // also of an axis that could not be made
    instrument_free_devices(in);
    for (int i = 0; i < BENCH_BUSES; i++)
        bus_close(in->bus[i]);
    if (in->detector)
        in->detector->ops->free(in->detector);
    instrument_free_monitor(in);
    free(in->laser_profile);
    free(in->detector_profile);
    free(in);
    return dark;
}

const struct bench_config *instrument_bench(const struct instrument *in)
{
    return in->bench;
}

const struct kinematics *instrument_kinematics(const struct instrument *in)
{
    return &in->kinematics;
}

// --- an instrument that runs nothing ----------------------------------------------------------

static void ask(struct instrument *in, enum instrument_part part)
{
    struct axis_place place;
    struct laser_status laser;
    struct gon_error err;
    if (part < INSTRUMENT_AXES)
        instrument_place(in, part, &place, NULL);
    else if (part >= PART_DEVICES)
        instrument_ask_device(in, part);
    else if (part == PART_MONITOR)
        instrument_sample_monitor(in, &in->sample.monitor_v, &err);
    else if (part == PART_DETECTOR)
        instrument_sample_detector(in, &err);
    else if (instrument_laser(in, &laser, NULL) >= 0 && laser.emission &&
             !safety_emission(in->safety))
        instrument_emission_off(in, NULL);
}

static void try_again(struct instrument *in, enum instrument_part part)
{
    if (backoff_due(&in->retry[part], instrument_now_ns(in)) &&
        instrument_connect(in, part, NULL) < 0)
        backoff_failed(&in->retry[part], instrument_now_ns(in));
}

int instrument_reconnect(struct instrument *in)
{
    int lost = 0;
    if (in->part[PART_LASER].link == PART_OK && safety_pending(in->safety))
        instrument_emission_off(in, NULL);
    for (enum instrument_part part = 0; part < PART_COUNT; part++) {
        if (in->part[part].link == PART_LOST)
            try_again(in, part);
        lost += in->part[part].link == PART_LOST;
    }
    return lost;
}

int instrument_tend(struct instrument *in)
{
    for (enum instrument_part part = 0; part < PART_COUNT; part++)
        if (in->part[part].link == PART_OK)
            ask(in, part);
    const int lost = instrument_reconnect(in);
    instrument_look_around(in);
    return lost;
}
