// SPDX-License-Identifier: MIT
// The simulated world behind the drivers' contracts, in one process and in virtual time: axes,
// laser and detector that cost nothing to ask. Every call of theirs counts, and one call can be
// made to fail.
#pragma once
#include "base/clk.h"
#include "daemon/arm.h"
#include "daemon/instrument.h"
#include "drivers/axis.h"
#include "drivers/detector.h"
#include "drivers/laser.h"
#include "drivers/link_stats.h"
#include "sim/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// simconfig's axes are the world's, in its order.
#define PART_THETA_I ((enum instrument_part)WORLD_THETA_I)
#define PART_THETA_R ((enum instrument_part)WORLD_THETA_R)
#define PART_SAMPLE ((enum instrument_part)WORLD_SAMPLE)

enum simbench_device {
    SIMBENCH_AXES,
    SIMBENCH_LASER,
    SIMBENCH_DETECTOR,
    SIMBENCH_DEVICES,
    SIMBENCH_MONITOR = SIMBENCH_DEVICES, // these of tests/unit/simdevices.h
    SIMBENCH_SHUTTER,
    SIMBENCH_WHEEL,
    SIMBENCH_ALL
};

struct simbench;

struct simbench_axis {
    struct axis axis;
    struct simbench *bench;
    enum world_axis which;
    double steps_per_unit;
    int32_t target_steps;
    bool homed, homing;
    int alarm;
    int misses;   // the next moves end this number of times somewhere else
    bool frozen;  // never done
    bool swallow; // the next command is lost with its answer
    bool disabled; // since it restarted: nothing moves before it was identified
    int moves, stops;
};

struct simbench {
    struct clk_virtual clk;
    struct world world;
    struct simbench_axis axis[WORLD_AXES];
    struct laser laser;
    struct detector detector;
    struct link_stats bus; // as the axes' bus would keep it; the others have no link
    int range;
    double step_delay_s; // virtual time each call costs
    const char *laser_is, *detector_is; // what they say they are; NULL: no serial number in it

    // faults: the fail_at-th call from now on fails; or one call of a device
    long calls, fail_at;
    int fail_code;
    int64_t gone_until_ns[SIMBENCH_ALL]; // unplugged
    int64_t gone_for_ns;
    enum simbench_device failed; // who was hit
    bool hit_done;

    // what a test wants to know
    bool emitting_last;
    int ons, offs;
    bool no_monitor;
    bool unsettled; // somebody touched the detector's panel
    int setups;
    int nonsense; // detector answers that are not numbers, to come
};

static inline int64_t simbench_now_ns(struct simbench *b)
{
    if (b->step_delay_s > 0)
        clk_sleep(&b->clk.clk, CLK_S(b->step_delay_s), NULL);
    world_see(&b->world, b->clk.t_ns);
    return b->clk.t_ns;
}

// 0, or the failure that this call has; *ret_carried_out says whether the device did what was
// asked.
static inline int simbench_call(struct simbench *b, enum simbench_device device,
                                bool *ret_carried_out, struct gon_error *err)
{
    const int64_t now_ns = simbench_now_ns(b);
    *ret_carried_out = true;
    b->calls++;
    if (now_ns < b->gone_until_ns[device]) {
        *ret_carried_out = false;
        return gon_fail(err, GON_E_GONE, "hung up");
    }
    if (b->fail_at && b->calls == b->fail_at) {
        b->failed = device;
        b->hit_done = true;
        *ret_carried_out = b->fail_code == GON_E_LINK && b->calls % 2;
        if (b->fail_code == GON_E_GONE)
            b->gone_until_ns[device] = now_ns + b->gone_for_ns;
        return gon_fail(err, (enum gon_code)b->fail_code, "injected at call %ld", b->calls);
    }
    return 0;
}

// --- axes ---
static inline int simbench_axis_identify(struct axis *a, struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    bool done;
    int rc = simbench_call(s->bench, SIMBENCH_AXES, &done, err);
    if (done)
        s->disabled = false;
    return rc;
}

static inline int simbench_axis_status(struct axis *a, struct axis_status *ret,
                                       struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    bool done;
    int rc = simbench_call(s->bench, SIMBENCH_AXES, &done, err);
    if (rc < 0)
        return rc;
    struct motion_state m = motion_at(&s->bench->world.axis[s->which], s->bench->clk.t_ns);
    if (s->homing && !m.moving)
        s->homed = true, s->homing = false;
    const bool moving = m.moving || s->frozen;
    *ret = (struct axis_status){
        .position_steps = (int32_t)lround(m.motor * s->steps_per_unit),
        .target_steps = s->target_steps,
        .moving = moving,
        .in_position = !moving,
        .ready = !moving && !s->alarm,
        .homed = s->homed,
        .alarm = s->alarm != 0,
        .alarm_code = s->alarm,
    };
    return 0;
}

static inline int simbench_axis_move(struct axis *a, int32_t position, int32_t speed,
                                     int32_t acceleration, struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    struct simbench *b = s->bench;
    bool done;
    int rc = simbench_call(b, SIMBENCH_AXES, &done, err);
    if (s->swallow) {
        s->swallow = done = false;
        rc = gon_fail(err, GON_E_LINK, "no answer");
    }
    if (!done || s->alarm || s->disabled)
        return rc;
    s->moves++;
    s->target_steps = position;
    double to = position / s->steps_per_unit;
    if (s->misses > 0) {
        s->misses--;
        to += 0.05;
    }
    motion_go(&b->world.axis[s->which], to, speed / s->steps_per_unit,
              acceleration / s->steps_per_unit, acceleration / s->steps_per_unit, b->clk.t_ns);
    return rc;
}

static inline int simbench_axis_stop(struct axis *a, struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    bool done;
    int rc = simbench_call(s->bench, SIMBENCH_AXES, &done, err);
    if (done) {
        s->stops++;
        motion_stop(&s->bench->world.axis[s->which], 1000.0, s->bench->clk.t_ns);
    }
    return rc;
}

static inline int simbench_axis_home(struct axis *a, struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    bool done;
    int rc = simbench_call(s->bench, SIMBENCH_AXES, &done, err);
    if (done && !s->disabled) {
        s->homing = true;
        motion_go(&s->bench->world.axis[s->which], 0.0, 10.0, 50.0, 50.0, s->bench->clk.t_ns);
    }
    return rc;
}

static inline int simbench_axis_reset(struct axis *a, struct gon_error *err)
{
    struct simbench_axis *s = (struct simbench_axis *)a;
    bool done;
    int rc = simbench_call(s->bench, SIMBENCH_AXES, &done, err);
    if (done)
        s->alarm = 0;
    return rc;
}

static inline const char *simbench_alarm_text(const struct axis *a, int code)
{
    (void)a;
    return code == 0x30 ? "overload" : "";
}

static inline const struct link_stats *simbench_axis_stats(const struct axis *a)
{
    return &((const struct simbench_axis *)a)->bench->bus;
}

static inline void simbench_axis_free(struct axis *a)
{
    (void)a;
}

// --- laser ---
static inline struct simbench *simbench_of_laser(struct laser *l)
{
    return (struct simbench *)((char *)l - offsetof(struct simbench, laser));
}

static inline int simbench_laser_identify(struct laser *l, char *text, size_t size,
                                          struct gon_error *err)
{
    bool done;
    struct simbench *b = simbench_of_laser(l);
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (rc >= 0)
        snprintf(text, size, "%s", b->laser_is ? b->laser_is : "simulated laser");
    return rc;
}

static inline int simbench_laser_status(struct laser *l, struct laser_status *ret,
                                        struct gon_error *err)
{
    struct simbench *b = simbench_of_laser(l);
    bool done;
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (rc < 0)
        return rc;
    const struct sim_laser *s = &b->world.laser;
    *ret = (struct laser_status){
        .state = s->state == SIM_LASER_OFF || s->state == SIM_LASER_ABORTED ? LASER_OFF
                 : !s->interlock_closed                                     ? LASER_INTERLOCK
                 : s->fault                                                 ? LASER_FAULT
                 : s->state == SIM_LASER_KEY                                ? LASER_NEEDS_KEY
                 : s->state == SIM_LASER_COMPLETED                          ? LASER_EMITTING
                                                                            : LASER_WARMING,
        .emission = sim_laser_emits(s),
        .interlock_closed = s->interlock_closed,
        .power_w = sim_laser_power_w(s),
        .setpoint_w = s->setpoint_w,
        .fault_code = s->fault,
    };
    return 0;
}

static inline int simbench_laser_emission(struct laser *l, bool *ret, struct gon_error *err)
{
    struct simbench *b = simbench_of_laser(l);
    bool done;
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (rc >= 0)
        *ret = sim_laser_emits(&b->world.laser);
    return rc;
}

static inline int simbench_laser_power(struct laser *l, double power_w, struct gon_error *err)
{
    struct simbench *b = simbench_of_laser(l);
    bool done;
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (done)
        b->world.laser.setpoint_w = power_w;
    return rc;
}

static inline int simbench_laser_on(struct laser *l, struct gon_error *err)
{
    struct simbench *b = simbench_of_laser(l);
    bool done;
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (done) {
        b->ons++;
        if (sim_laser_start(&b->world.laser, true) != SIM_LASER_ACCEPTED && rc >= 0)
            rc = gon_fail(err, GON_E_REFUSED, "refused");
    }
    return rc;
}

static inline int simbench_laser_off(struct laser *l, struct gon_error *err)
{
    struct simbench *b = simbench_of_laser(l);
    bool done;
    int rc = simbench_call(b, SIMBENCH_LASER, &done, err);
    if (done) {
        b->offs++;
        sim_laser_off(&b->world.laser);
        if (sim_laser_emits(&b->world.laser) && rc >= 0)
            rc = gon_fail(err, GON_E_DEVICE, "still emits after OFF");
    }
    return rc;
}

static inline int simbench_laser_reopen(struct laser *l, struct gon_error *err)
{
    bool done;
    return simbench_call(simbench_of_laser(l), SIMBENCH_LASER, &done, err);
}

static inline const char *simbench_fault_text(struct laser *l, int code)
{
    (void)l;
    return code == 3 ? "interlock" : "";
}

static inline void simbench_laser_free(struct laser *l)
{
    (void)l;
}

// --- detector ---
static inline struct simbench *simbench_of_detector(struct detector *d)
{
    return (struct simbench *)((char *)d - offsetof(struct simbench, detector));
}

static inline int simbench_detector_identify(struct detector *d, char *text, size_t size,
                                             struct gon_error *err)
{
    bool done;
    struct simbench *b = simbench_of_detector(d);
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc >= 0)
        snprintf(text, size, "%s", b->detector_is ? b->detector_is : "simulated lock-in");
    return rc;
}

static inline int simbench_detector_setup(struct detector *d, const struct detector_setup *s,
                                          double *ret_time_constant_s, struct gon_error *err)
{
    struct simbench *b = simbench_of_detector(d);
    bool done;
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc < 0)
        return rc;
    b->setups++;
    b->world.lockin.time_constant_s = s->time_constant_s;
    b->world.lockin.poles = s->slope_db / 6;
    *ret_time_constant_s = s->time_constant_s;
    return 0;
}

static inline int simbench_detector_ranges(struct detector *d)
{
    (void)d;
    return 27;
}

static inline double simbench_full_scale_v(struct detector *d, int range)
{
    static const double mantissa[3] = {2, 5, 10};
    (void)d;
    return mantissa[range % 3] * pow(10, range / 3 - 9); // 2 nV .. 1 V
}

static inline int simbench_detector_set_range(struct detector *d, int range, struct gon_error *err)
{
    struct simbench *b = simbench_of_detector(d);
    bool done;
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc >= 0) {
        b->range = range;
        b->world.lockin.full_scale_v = simbench_full_scale_v(d, range);
    }
    return rc;
}

static inline int simbench_detector_sample(struct detector *d, struct detector_sample *ret,
                                           struct gon_error *err)
{
    struct simbench *b = simbench_of_detector(d);
    bool done;
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc < 0)
        return rc;
    if (b->nonsense > 0) {
        b->nonsense--;
        return gon_fail(err, GON_E_LINK, "answered \"nan\"");
    }
    *ret =
        (struct detector_sample){lockin_x_v(&b->world.lockin),
                                 b->no_monitor ? (double)NAN : world_aux_v(&b->world, 1), 1000.0};
    return 0;
}

static inline int simbench_detector_condition(struct detector *d, unsigned *ret,
                                              struct gon_error *err)
{
    struct simbench *b = simbench_of_detector(d);
    bool done;
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc < 0)
        return rc;
    const unsigned c = b->world.lockin.condition;
    *ret = (c & 7 ? (unsigned)DETECTOR_SATURATED : 0) |
           (c & LOCKIN_UNLOCKED ? (unsigned)DETECTOR_UNLOCKED : 0) |
           (b->unsettled ? (unsigned)DETECTOR_UNSETTLED : 0);
    b->unsettled = false;
    b->world.lockin.condition = 0;
    return 0;
}

static inline int simbench_detector_clear(struct detector *d, struct gon_error *err)
{
    struct simbench *b = simbench_of_detector(d);
    bool done;
    int rc = simbench_call(b, SIMBENCH_DETECTOR, &done, err);
    if (rc >= 0)
        b->world.lockin.condition = 0;
    return rc;
}

static inline int simbench_detector_reopen(struct detector *d, struct gon_error *err)
{
    bool done;
    return simbench_call(simbench_of_detector(d), SIMBENCH_DETECTOR, &done, err);
}

static inline void simbench_detector_free(struct detector *d)
{
    (void)d;
}

// A world with its devices, at t = 1 s.
static inline void simbench_init_world(struct simbench *b, const struct world_spec *spec)
{
    static const struct axis_ops axis_ops = {
        simbench_axis_identify, simbench_axis_status, simbench_axis_move,
        simbench_axis_stop,     simbench_axis_home,   simbench_axis_reset,
        simbench_alarm_text,    simbench_axis_stats,  simbench_axis_free};
    static const struct laser_ops laser_ops = {.identify = simbench_laser_identify,
                                               .status = simbench_laser_status,
                                               .emission = simbench_laser_emission,
                                               .set_power = simbench_laser_power,
                                               .on = simbench_laser_on,
                                               .off = simbench_laser_off,
                                               .reopen = simbench_laser_reopen,
                                               .fault_text = simbench_fault_text,
                                               .free = simbench_laser_free};
    static const struct detector_ops detector_ops = {.identify = simbench_detector_identify,
                                                     .setup = simbench_detector_setup,
                                                     .ranges = simbench_detector_ranges,
                                                     .full_scale_v = simbench_full_scale_v,
                                                     .set_range = simbench_detector_set_range,
                                                     .sample = simbench_detector_sample,
                                                     .clear = simbench_detector_clear,
                                                     .condition = simbench_detector_condition,
                                                     .reopen = simbench_detector_reopen,
                                                     .free = simbench_detector_free};
    *b = (struct simbench){
        .laser = {&laser_ops}, .detector = {&detector_ops}, .gone_for_ns = CLK_S(3)};
    clk_virtual_init(&b->clk, CLK_S(1), CLK_S(1700000000));
    world_init(&b->world, spec, b->clk.t_ns);
    for (int i = 0; i < WORLD_AXES; i++)
        b->axis[i] = (struct simbench_axis){
            .axis = {&axis_ops}, .bench = b, .which = (enum world_axis)i, .steps_per_unit = 1000.0};
}

// The same of the defaults, changed through tune (may be NULL).
static inline void simbench_init(struct simbench *b, void (*tune)(struct world_spec *spec))
{
    struct world_spec spec;
    world_defaults(&spec);
    if (tune)
        tune(&spec);
    simbench_init_world(b, &spec);
}

static inline struct instrument_parts simbench_parts(struct simbench *b)
{
    struct instrument_parts parts = {.laser = &b->laser, .detector = &b->detector};
    for (int i = 0; i < world_axes(&b->world.spec); i++)
        parts.axis[i] = &b->axis[i].axis;
    return parts;
}

// As a person's command does.
static inline void simbench_arm(struct instrument *in)
{
    (void)arm_set(instrument_arm(in), "anna", NULL, ARM_MOST_S, instrument_now_ns(in), 0, NULL);
}
