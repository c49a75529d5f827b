// SPDX-License-Identifier: MIT
#include "daemon/travel_inside.h"

#include <math.h>

#define STALL_NS CLK_S(1)    // a position that should change and does not
#define SLACK_NS CLK_MS(200) // of a profile: the controller may begin so much later
#define LOOK_NS CLK_MS(250)  // while waiting for the predicted arrival: for alarms
#define HALT_NS CLK_S(2)     // a stop that takes longer is a fault

// One axis on its way: beyond the target first when there is backlash to take up, then to the
// target.
struct leg {
    enum instrument_part part;
    double target, from, to;
    double low, high; // what it may pass until it is done
    bool last_leg, done;
    int reseeks;
    int64_t start_ns, arrival_ns, look_ns, deadline_ns, step_ns;
    double stood_at; // where it was seen to advance last, and when
    int64_t stood_ns;
};

static const char *axis_name(const struct instrument *in, enum instrument_part part)
{
    return instrument_axis(in, part)->name;
}

int travel_check(const struct instrument *in, enum instrument_part part, const struct axis_place *p,
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

    const double s = bench_axis_move_s(axis, from, t->to);
    const int64_t now_ns = instrument_now_ns(in);
    t->from = t->stood_at = from;
    t->start_ns = t->stood_ns = now_ns;
    t->arrival_ns = now_ns + CLK_S(s);
    t->deadline_ns = now_ns + CLK_S(2.0 * s + 2.0);
    t->step_ns = CLK_MS(fmin(fmax(100.0 * s, 1.0), 50.0));
    t->look_ns = t->arrival_ns < now_ns + LOOK_NS ? t->arrival_ns : now_ns + LOOK_NS;
    return 0;
}

int travel_halt(struct instrument *in, enum instrument_part part, const struct cancel *cancel,
                struct axis_place *place, struct gon_error *err)
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

// From the approach's side straight to the target; from the other, or with the play not taken up,
// first beyond it.
static void choose_leg(struct instrument *in, struct leg *t, double from)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    const double sign = axis->approach == BENCH_FROM_ABOVE ? -1 : 1;
    const double off = axis->backlash + bench_axis_tolerance(axis);
    const double beyond = fmin(fmax(t->target - sign * off, axis->min), axis->max);
    const bool direct = sign * (t->target - from) >= 0 &&
                        (instrument_engaged(in, t->part) || sign * (beyond - from) >= 0);
    t->last_leg = axis->backlash <= 0 || direct;
    t->to = t->last_leg ? t->target : instrument_rounded(in, t->part, beyond);
    bench_axis_span(axis, from, t->target, &t->low, &t->high);
}

// Where it is, which way round it goes, and off.
static int set_out(struct instrument *in, struct leg *t, const struct cancel *cancel,
                   struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    struct axis_place p;
    int rc = instrument_place_recent(in, t->part, &p, err);
    if (rc >= 0)
        rc = travel_check(in, t->part, &p, err);
    if (rc >= 0 && p.moving)
        rc = travel_halt(in, t->part, cancel, &p, err);
    if (rc < 0)
        return rc;

    const double half_step = 0.5 / fabs(axis->steps_per_unit);
    t->target = instrument_rounded(in, t->part, t->target);
    t->low = t->high = p.position;
    if (fabs(p.position - t->target) <= bench_axis_tolerance(axis) &&
        fabs(p.target - t->target) < half_step && instrument_engaged(in, t->part)) {
        t->done = true;
        return 0;
    }
    choose_leg(in, t, p.position);
    return start_leg(in, t, p.position, err);
}

// Whether what moves is where its profile may have brought it by now.
static int check_way(struct instrument *in, struct leg *t, const struct axis_place *p,
                     struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    const int64_t now_ns = instrument_now_ns(in);
    const double after_s = (double)(now_ns - t->start_ns) * 1e-9;
    const double now = bench_axis_on_way(axis, t->from, t->to, after_s);
    const double late = bench_axis_on_way(axis, t->from, t->to, after_s - (double)SLACK_NS * 1e-9);
    const double off = fmax(fmin(now, late) - p->position, p->position - fmax(now, late));
    if (axis->following_error > 0 && off > axis->following_error)
        return gon_fail(err, GON_E_DEVICE,
                        "axis %s: at %.4f %s it is %.4f off its way (following_error %.4g): too "
                        "fast, too heavy or slipping; look at it, then: gonio resume",
                        axis->name, p->position, axis->unit_name, off, axis->following_error);
    const double then =
        bench_axis_on_way(axis, t->from, t->to, (double)(t->stood_ns - t->start_ns) * 1e-9);
    const double tolerance = bench_axis_tolerance(axis);
    if (fabs(p->position - t->stood_at) > tolerance || fabs(now - then) <= 2 * tolerance) {
        t->stood_at = p->position;
        t->stood_ns = now_ns;
    }
    if (now_ns - t->stood_ns > STALL_NS)
        return gon_fail(err, GON_E_DEVICE,
                        "axis %s: says that it moves but has stood at %.4f %s for %.1f s: blocked, "
                        "or its encoder is dead; look at it, then: gonio resume",
                        axis->name, p->position, axis->unit_name,
                        (double)(now_ns - t->stood_ns) * 1e-9);
    return 0;
}

// Before it is sought again from where it should not stand: whether a keep-out is in reach of that
// and of what the other axes are doing.
static int check_again(struct instrument *in, const struct leg *legs, struct gon_error *err)
{
    const struct bench_config *bench = instrument_bench(in);
    double low[BENCH_AXES], high[BENCH_AXES];
    for (int i = 0; i < INSTRUMENT_AXES; i++) {
        low[i] = legs[i].low;
        high[i] = legs[i].high;
    }
    const int hit = keepout_within(bench, instrument_kinematics(in), low, high);
    return hit < 0 ? 0
                   : gon_fail(err, GON_E_DEVICE,
                              "an axis missed its place and may not be sought again so near to "
                              "keep-out \"%s\"; move it away, then: gonio resume",
                              bench->keep_out[hit].name);
}

static int look(struct instrument *in, struct leg *legs, struct leg *t, struct gon_error *err)
{
    const struct bench_axis *axis = instrument_axis(in, t->part);
    struct axis_place p;
    int rc = instrument_place(in, t->part, &p, err);
    if (rc >= 0)
        rc = travel_check(in, t->part, &p, err);
    if (rc < 0)
        return rc;

    const int64_t now_ns = instrument_now_ns(in);
    const bool there = fabs(p.position - t->to) <= bench_axis_tolerance(axis);
    const bool still = !p.moving && p.ready && (p.in_position || !there);
    if (!still || (!there && now_ns < t->arrival_ns)) {
        if (now_ns > t->deadline_ns)
            return gon_fail(err, GON_E_DEVICE,
                            "axis %s: still not at %.4f %s, twice the time it should take and 2 s "
                            "after its start (now %.4f); look at it, then: gonio resume",
                            axis->name, t->to, axis->unit_name, p.position);
        if (p.moving && !there && (rc = check_way(in, t, &p, err)) < 0)
            return rc;
        int64_t next_ns = now_ns < t->arrival_ns ? t->arrival_ns : now_ns + t->step_ns;
        t->look_ns = next_ns < now_ns + LOOK_NS ? next_ns : now_ns + LOOK_NS;
        return 0;
    }
    if (there && t->last_leg) {
        t->done = true;
        t->low = t->high = p.position;
        return 0;
    }
    if (there) {
        t->last_leg = true;
        t->to = t->target;
        return start_leg(in, t, p.position, err);
    }
    // It stands somewhere else: the command was lost, or it missed. Standing, it may be told again.
    if (t->reseeks++ >= axis->retries)
        return gon_fail(
            err, GON_E_DEVICE,
            "axis %s: stands at %.4f %s instead of %.4f (deadband %.4f) after %d tries; "
            "look for a slipping or blocked axis, then: gonio resume",
            axis->name, p.position, axis->unit_name, t->to, axis->deadband, 1 + axis->retries);
    choose_leg(in, t, p.position);
    rc = check_again(in, legs, err);
    return rc < 0 ? rc : start_leg(in, t, p.position, err);
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
            int rc = look(in, t, &t[i], err);
            if (rc < 0)
                return rc;
        }
    }
}

int travel_ride(struct instrument *in, const struct keepout_stage *stage,
                const double at[INSTRUMENT_AXES], const struct cancel *cancel,
                struct gon_error *err)
{
    struct leg t[INSTRUMENT_AXES];
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        const bool asked =
            stage->axes >> part & 1 && instrument_has(in, part) && !isnan(stage->to[part]);
        t[part] = (struct leg){.part = part,
                               .target = stage->to[part],
                               .low = at[part],
                               .high = at[part],
                               .done = !asked};
    }
    int rc = 0;
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES && rc >= 0; part++)
        if (!t[part].done)
            rc = set_out(in, &t[part], cancel, err);
    return rc < 0 ? rc : ride_all(in, t, cancel, err);
}
