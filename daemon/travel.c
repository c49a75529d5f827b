// SPDX-License-Identifier: MIT
#include "daemon/travel.h"

#include "campaign/keepout.h"
#include "daemon/travel_inside.h"

#include <math.h>
#include <string.h>

#define HOME_LEAST_S 120.0
#define HOME_TRIES 3
#define HOME_STOOD_NS CLK_S(2) // neither moving nor homed: it does not home any more

static int moved_by_itself(const struct bench_axis *axis, double from, double to,
                           struct gon_error *err)
{
    return gon_fail(err, GON_E_DEVICE,
                    "axis %s: moved by itself from %.4f to %.4f %s; look at it, then: gonio resume",
                    axis->name, from, to, axis->unit_name);
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
                rc = travel_check(in, part, &p, err);
            if (rc < 0)
                return rc;
            const struct bench_axis *axis = instrument_axis(in, part);
            if (!isnan(target->at[part]) &&
                fabs(p.position - target->at[part]) > 2.0 * bench_axis_tolerance(axis))
                return moved_by_itself(axis, target->at[part], p.position, err);
        }
        pose.at[part] = p.position;
    }
    *ret_pose = pose;
    return 0;
}

// Where all axes stand that the angles depend on, so that a way can be found from there.
static int stand_still(struct instrument *in, const struct cancel *cancel,
                       double ret_at[INSTRUMENT_AXES], struct gon_error *err)
{
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        struct axis_place p;
        ret_at[part] = (double)NAN;
        if (!instrument_has(in, part) || !kinematics_steers(instrument_kinematics(in), (int)part))
            continue;
        int rc = instrument_place_recent(in, part, &p, err);
        if (rc >= 0)
            rc = travel_check(in, part, &p, err);
        if (rc >= 0 && p.moving)
            rc = travel_halt(in, part, cancel, &p, err);
        if (rc < 0)
            return rc;
        ret_at[part] = p.position;
    }
    return 0;
}

static int find_way(struct instrument *in, const struct travel_pose *target,
                    const struct cancel *cancel, double at[INSTRUMENT_AXES],
                    struct keepout_way *ret_way, struct gon_error *err)
{
    struct gon_error why;
    const struct bench_config *bench = instrument_bench(in);
    int rc = bench->keep_out_count ? stand_still(in, cancel, at, err) : 0;
    if (rc < 0)
        return rc;
    rc = keepout_find_way(bench, instrument_kinematics(in), at, target->at, ret_way, &why);
    return rc < 0 ? gon_fail(err, GON_E_DEVICE, "%s, then: gonio resume", why.text) : 0;
}

int travel_move(struct instrument *in, const struct travel_pose *target,
                const struct cancel *cancel, struct travel_pose *ret_actual, struct gon_error *err)
{
    double at[INSTRUMENT_AXES] = {0};
    struct keepout_way way;
    if (cancel_requested(cancel))
        return gon_fail(err, GON_E_CANCELED, "stopped before moving");
    int rc = find_way(in, target, cancel, at, &way, err);
    for (int n = 0; rc >= 0 && n < way.stages; n++) {
        const struct keepout_stage *stage = &way.stage[n];
        rc = travel_ride(in, stage, at, cancel, err);
        for (int i = 0; i < INSTRUMENT_AXES; i++)
            if (stage->axes >> i & 1 && !isnan(stage->to[i]))
                at[i] = stage->to[i];
    }
    return rc < 0 ? rc : where(in, target, ret_actual, err);
}

int travel_still(struct instrument *in, const struct travel_pose *at, struct gon_error *err)
{
    for (enum instrument_part part = 0; part < INSTRUMENT_AXES; part++) {
        struct axis_place p;
        if (!instrument_has(in, part))
            continue;
        int rc = instrument_place(in, part, &p, err);
        if (rc >= 0)
            rc = travel_check(in, part, &p, err);
        if (rc < 0)
            return rc;
        const struct bench_axis *axis = instrument_axis(in, part);
        if (isnan(at->at[part]))
            continue;
        if (p.moving || fabs(p.position - at->at[part]) > bench_axis_tolerance(axis))
            return moved_by_itself(axis, at->at[part], p.position, err);
    }
    return 0;
}

struct travel_pose travel_stay(void)
{
    struct travel_pose pose = {.still_ns = 0};
    for (int i = 0; i < INSTRUMENT_AXES; i++)
        pose.at[i] = (double)NAN;
    return pose;
}

int travel_to_sample(const struct instrument *in, double theta_i_deg, double theta_r_deg,
                     struct travel_pose *ret_pose, struct gon_error *err)
{
    const struct kinematics_pose geometry = {theta_i_deg, theta_r_deg, 0, (double)NAN, (double)NAN};
    const int sample = bench_axis_index(instrument_bench(in), "sample");
    struct travel_pose pose = travel_stay();
    int rc = kinematics_inverse(instrument_kinematics(in), &geometry, pose.at, err);
    if (rc < 0)
        return rc;
    if (sample >= 0)
        pose.at[sample] = 0.0;
    *ret_pose = pose;
    return 0;
}

int travel_station(const struct instrument *in, const char *name, struct travel_pose *ret_pose,
                   struct gon_error *err)
{
    const struct bench_config *bench = instrument_bench(in);
    const struct bench_station *s = bench_find_station(bench, name);
    struct travel_pose pose = travel_stay();
    if (!s)
        return gon_fail(err, GON_E_INPUT, "the bench has no station \"%s\": add it to stations",
                        name);
    int rc = bench_station_at(bench, instrument_kinematics(in), s, pose.at, err);
    if (rc >= 0)
        *ret_pose = pose;
    return rc;
}

// It may have restarted: what it has to be told first (an enable) went with its power.
static int begin_homing(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    int rc = instrument_connect(in, part, err);
    if (rc >= 0)
        rc = instrument_go_home(in, part, err);
    return rc == GON_E_LINK ? 0 : rc; // carried out or not: the status says
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
        return travel_check(in, part, &p, err);

    const double limit_s = fmax(HOME_LEAST_S, 4.0 * (axis->max - axis->min) / axis->speed);
    const int64_t until_ns = instrument_now_ns(in) + CLK_S(limit_s);
    int64_t moved_ns = 0;
    for (int begun = 0; rc >= 0;) {
        // It stands and is not homed: it was not told yet, or restarted on the way.
        if (begun == 0 ||
            (begun < HOME_TRIES && instrument_now_ns(in) - moved_ns > HOME_STOOD_NS)) {
            rc = begin_homing(in, part, err);
            moved_ns = instrument_now_ns(in);
            begun++;
        }
        if (rc >= 0 && instrument_wait(in, instrument_now_ns(in) + CLK_MS(50), cancel) < 0)
            return gon_fail(err, GON_E_CANCELED, "stopped while homing");
        if (rc >= 0)
            rc = instrument_place(in, part, &p, err);
        if (rc >= 0 && p.alarm)
            return travel_check(in, part, &p, err);
        if (rc >= 0 && p.homed && !p.moving)
            return 0;
        if (rc >= 0 && p.moving)
            moved_ns = instrument_now_ns(in);
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
