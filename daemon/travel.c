// SPDX-License-Identifier: MIT
#include "daemon/travel.h"

#include "campaign/bench.h"

#include <math.h>
#include <string.h>

#define RESEEKS_MOST 2
#define LOOK_NS CLK_MS(250) // while waiting for the predicted arrival: for alarms
#define HALT_NS CLK_S(2)    // a stop that takes longer is a fault
#define HOME_LEAST_S 120.0

// One axis on its way: below the target first when there is backlash to take up, then to the
// target.
struct leg {
    enum instrument_part part;
    double target, to;
    bool last_leg, done;
    int reseeks;
    int64_t arrival_ns, look_ns, deadline_ns, step_ns;
};

double travel_time_s(double distance, double speed, double acceleration)
{
    distance = fabs(distance);
    if (distance * acceleration < speed * speed)
        return 2.0 * sqrt(distance / acceleration);
    return distance / speed + speed / acceleration;
}

static double tolerance(const struct bench_axis *axis)
{
    return fmax(axis->deadband, 0.5 / fabs(axis->steps_per_unit)) + 1e-9;
}

static const char *axis_name(const struct instrument *in, enum instrument_part part)
{
    return instrument_axis(in, part)->name;
}

static int check(const struct instrument *in, enum instrument_part part, const struct axis_place *p,
                 struct gon_error *err)
{
    if (p->alarm)
        return gon_fail(err, GON_E_DEVICE,
                        "axis %s: alarm %02Xh (%s); remove its cause, then: gonio resume",
                        axis_name(in, part), (unsigned)p->alarm_code,
                        p->alarm_text ? p->alarm_text : "no text for it");
    if (!p->homed)
        return gon_fail(err, GON_E_LINK, "axis %s: lost its home position (controller restarted?)",
                        axis_name(in, part));
    return 0;
}

// Sends the leg's command once. When its answer is lost the waiting below finds out what became of
// it.
static int start_leg(struct instrument *in, struct leg *t, double from, struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    int rc = instrument_go(in, t->part, t->to, err);
    if (rc < 0 && rc != GON_E_LINK)
        return rc;

    const double s = travel_time_s(t->to - from, axis->speed, axis->acceleration);
    const int64_t now_ns = instrument_now_ns(in);
    t->arrival_ns = now_ns + CLK_S(s);
    t->deadline_ns = now_ns + CLK_S(2.0 * s + 2.0);
    t->step_ns = CLK_MS(fmin(fmax(100.0 * s, 1.0), 50.0));
    t->look_ns = t->arrival_ns < now_ns + LOOK_NS ? t->arrival_ns : now_ns + LOOK_NS;
    return 0;
}

static int halt_and_wait(struct instrument *in, enum instrument_part part,
                         const struct cancel *cancel, struct axis_place *place,
                         struct gon_error *err)
{
    const int64_t until_ns = instrument_now_ns(in) + HALT_NS;
    int rc = instrument_halt(in, part, err);
    while (rc >= 0 && place->moving) {
        if (instrument_now_ns(in) > until_ns)
            return gon_fail(err, GON_E_DEVICE, "axis %s: still moves 2 s after a stop",
                            axis_name(in, part));
        rc = instrument_wait(in, instrument_now_ns(in) + CLK_MS(5), cancel);
        if (rc < 0)
            return gon_fail(err, rc, "stopped");
        rc = instrument_place(in, part, place, err);
    }
    return rc;
}

// From below straight to the target; from above, or with the play not taken up, first below it.
static void choose_leg(struct instrument *in, struct leg *t, double from)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    const double below = fmax(t->target - axis->backlash - tolerance(axis), axis->min);
    const bool upward = from <= t->target && (instrument_engaged(in, t->part) || from <= below);
    t->last_leg = axis->backlash <= 0 || upward;
    t->to = t->last_leg ? t->target : instrument_rounded(in, t->part, below);
}

// Where it is, which way round it goes, and off.
static int set_out(struct instrument *in, struct leg *t, const struct cancel *cancel,
                   struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    struct axis_place p;
    int rc = instrument_place_recent(in, t->part, &p, err);
    if (rc >= 0)
        rc = check(in, t->part, &p, err);
    if (rc >= 0 && p.moving)
        rc = halt_and_wait(in, t->part, cancel, &p, err);
    if (rc < 0)
        return rc;

    const double half_step = 0.5 / fabs(axis->steps_per_unit);
    t->target = instrument_rounded(in, t->part, t->target);
    if (fabs(p.position - t->target) <= tolerance(axis) && fabs(p.target - t->target) < half_step &&
        instrument_engaged(in, t->part)) {
        t->done = true;
        return 0;
    }
    choose_leg(in, t, p.position);
    return start_leg(in, t, p.position, err);
}

static int look(struct instrument *in, struct leg *t, struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    struct axis_place p;
    int rc = instrument_place(in, t->part, &p, err);
    if (rc >= 0)
        rc = check(in, t->part, &p, err);
    if (rc < 0)
        return rc;

    const int64_t now_ns = instrument_now_ns(in);
    const bool there = fabs(p.position - t->to) <= tolerance(axis);
    const bool still = !p.moving && p.ready && (p.in_position || !there);
    if (!still || (!there && now_ns < t->arrival_ns)) {
        if (now_ns > t->deadline_ns)
            return gon_fail(err, GON_E_DEVICE,
                            "axis %s: still not at %.4f %s, twice the time it should take and 2 s "
                            "after its start (now %.4f); look at it, then: gonio resume",
                            axis->name, t->to, axis->unit_name, p.position);
        int64_t next_ns = now_ns < t->arrival_ns ? t->arrival_ns : now_ns + t->step_ns;
        t->look_ns = next_ns < now_ns + LOOK_NS ? next_ns : now_ns + LOOK_NS;
        return 0;
    }
    if (there && t->last_leg) {
        t->done = true;
        return 0;
    }
    if (there) {
        t->last_leg = true;
        t->to = t->target;
        return start_leg(in, t, p.position, err);
    }
    // It stands somewhere else: the command was lost, or it missed. Standing, it may be told again.
    if (t->reseeks++ >= RESEEKS_MOST)
        return gon_fail(
            err, GON_E_DEVICE,
            "axis %s: stands at %.4f %s instead of %.4f (deadband %.4f) after %d tries; "
            "look for a slipping or blocked axis, then: gonio resume",
            axis->name, p.position, axis->unit_name, t->to, axis->deadband, 1 + RESEEKS_MOST);
    choose_leg(in, t, p.position);
    return start_leg(in, t, p.position, err);
}

static int ride_all(struct instrument *in, struct leg *t, const struct cancel *cancel,
                    struct gon_error *err)
{
    for (;;) {
        int64_t next_ns = INT64_MAX;
        for (int i = 0; i < INSTRUMENT_AXES; i++)
            if (!t[i].done && t[i].look_ns < next_ns)
                next_ns = t[i].look_ns;
        if (next_ns == INT64_MAX)
            return 0;
        if (instrument_wait(in, next_ns, cancel) < 0)
            return gon_fail(err, GON_E_CANCELED, "stopped while moving");
        for (int i = 0; i < INSTRUMENT_AXES; i++) {
            if (t[i].done || t[i].look_ns > instrument_now_ns(in))
                continue;
            int rc = look(in, &t[i], err);
            if (rc < 0)
                return rc;
        }
    }
}

// Encoders of all axes, also of those that were not to move: an axis that strays is noticed here.
static int where(struct instrument *in, const struct travel_pose *target,
                 struct travel_pose *ret_pose, struct gon_error *err)
{
    struct travel_pose pose = {.still_ns = instrument_now_ns(in)};
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        struct axis_place p = {.position = (double)NAN};
        if (instrument_has(in, part)) {
            int rc = instrument_place_recent(in, part, &p, err);
            if (rc >= 0)
                rc = check(in, part, &p, err);
            if (rc < 0)
                return rc;
            const struct bench_axis *axis = instrument_axis(in, part);
            if (!isnan(target->at[part]) &&
                fabs(p.position - target->at[part]) > 2.0 * tolerance(axis))
                return gon_fail(err, GON_E_DEVICE,
                                "axis %s: moved by itself from %.4f to %.4f %s; look at it, then: "
                                "gonio resume",
                                axis->name, target->at[part], p.position, axis->unit_name);
        }
        pose.at[part] = p.position;
    }
    *ret_pose = pose;
    return 0;
}

int travel_move(struct instrument *in, const struct travel_pose *target,
                const struct cancel *cancel, struct travel_pose *ret_actual, struct gon_error *err)
{
    struct leg t[INSTRUMENT_AXES];
    int rc = cancel_requested(cancel) ? gon_fail(err, GON_E_CANCELED, "stopped before moving") : 0;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES && rc >= 0; part++) {
        const bool asked = instrument_has(in, part) && !isnan(target->at[part]);
        t[part] = (struct leg){.part = part, .target = target->at[part], .done = !asked};
        if (asked)
            rc = set_out(in, &t[part], cancel, err);
    }
    if (rc >= 0)
        rc = ride_all(in, t, cancel, err);
    if (rc >= 0)
        rc = where(in, target, ret_actual, err);
    return rc;
}

int travel_station(const struct instrument *in, const char *name, struct travel_pose *ret_pose,
                   struct gon_error *err)
{
    const struct bench_station *s = bench_find_station(instrument_bench(in), name);
    if (!s)
        return gon_fail(err, GON_E_INPUT, "the bench has no station \"%s\": add it to stations",
                        name);
    *ret_pose = (struct travel_pose){.at = {s->theta_i_deg, s->theta_r_deg, s->sample_mm}};
    return 0;
}

static int home_one(struct instrument *in, enum instrument_part part, const struct cancel *cancel,
                    struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, part);
    struct axis_place p;
    int rc = instrument_place(in, part, &p, err);
    if (rc < 0 || (p.homed && !p.alarm))
        return rc;
    if (p.alarm)
        return check(in, part, &p, err);

    const double limit_s = fmax(HOME_LEAST_S, 4.0 * (axis->max - axis->min) / axis->speed);
    const int64_t until_ns = instrument_now_ns(in) + CLK_S(limit_s);
    rc = instrument_go_home(in, part, err);
    if (rc == GON_E_LINK) // carried out or not: the status says
        rc = 0;
    while (rc >= 0) {
        if (instrument_wait(in, instrument_now_ns(in) + CLK_MS(50), cancel) < 0)
            return gon_fail(err, GON_E_CANCELED, "stopped while homing");
        rc = instrument_place(in, part, &p, err);
        if (rc >= 0 && p.alarm)
            return check(in, part, &p, err);
        if (rc >= 0 && p.homed && !p.moving)
            return 0;
        if (rc >= 0 && instrument_now_ns(in) > until_ns)
            return gon_fail(err, GON_E_DEVICE,
                            "axis %s: not homed after %.0f s; look at its home switch, then: gonio "
                            "resume",
                            axis->name, limit_s);
    }
    return rc;
}

int travel_home(struct instrument *in, const struct cancel *cancel, struct gon_error *err)
{
    int rc = 0;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES && rc >= 0; part++)
        if (instrument_has(in, part))
            rc = home_one(in, part, cancel, err);
    return rc;
}

int travel_stop(struct instrument *in, struct gon_error *err)
{
    int first = 0;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        struct gon_error why;
        int rc = instrument_has(in, part) ? instrument_halt(in, part, &why) : 0;
        if (rc < 0 && first >= 0) {
            first = rc;
            if (err)
                *err = why;
        }
    }
    return first;
}
