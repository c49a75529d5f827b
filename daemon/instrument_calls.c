// SPDX-License-Identifier: MIT
#include "campaign/bench.h"
#include "daemon/instrument_inside.h"

#include <math.h>

// --- axes -------------------------------------------------------------------------------------

const struct bench_axis *instrument_axis(const struct instrument *in, enum instrument_part part)
{
    return in->motor[part].config;
}

static int32_t to_steps(const struct bench_axis *c, double position)
{
    return (int32_t)lround((position - c->zero) * c->steps_per_unit);
}

static double of_steps(const struct bench_axis *c, double steps)
{
    return steps / c->steps_per_unit + c->zero;
}

static double motor_steps(const struct bench_axis *c, int32_t encoder_steps)
{
    return c->encoder_steps > 0 ? encoder_steps / c->encoder_steps : encoder_steps;
}

double instrument_rounded(const struct instrument *in, enum instrument_part part, double position)
{
    const struct bench_axis *c = in->motor[part].config;
    return of_steps(c, to_steps(c, position));
}

bool instrument_engaged(const struct instrument *in, enum instrument_part part)
{
    return in->motor[part].engaged;
}

int instrument_place(struct instrument *in, enum instrument_part part, struct axis_place *ret_place,
                     struct gon_error *err)
{
    struct motor *m = &in->motor[part];
    struct gon_error own;
    struct axis_status s;
    err = err ? err : &own;
    int rc = instrument_need(in, part, err);
    if (rc < 0)
        return rc;
    rc = instrument_note(in, part, m->axis->ops->status(m->axis, &s, err), err);
    if (rc < 0)
        return rc;
    const double raw_steps = motor_steps(m->config, s.position_steps);
    m->place = (struct axis_place){
        .position = of_steps(m->config, raw_steps),
        .target = m->commanded,
        .dial = raw_steps / fabs(m->config->steps_per_unit),
        .raw_steps = raw_steps,
        .moving = s.moving,
        .in_position = s.in_position,
        .ready = s.ready,
        .homed = s.homed,
        .alarm = s.alarm,
        .alarm_code = s.alarm_code,
        .alarm_text = s.alarm ? m->axis->ops->alarm_text(m->axis, s.alarm_code) : "",
    };
    m->seen_ns = instrument_now_ns(in);
    *ret_place = m->place;
    return 0;
}

int instrument_place_recent(struct instrument *in, enum instrument_part part,
                            struct axis_place *ret_place, struct gon_error *err)
{
    const struct motor *m = &in->motor[part];
    const struct axis_place *p = &m->place;
    const bool stands = !p->moving && p->in_position && p->ready && p->homed && !p->alarm;
    if (!stands || m->seen_ns == INT64_MIN ||
        instrument_now_ns(in) - m->seen_ns > CLK_MS(INSTRUMENT_FRESH_MS))
        return instrument_place(in, part, ret_place, err);
    *ret_place = *p;
    return 0;
}

int instrument_go(struct instrument *in, enum instrument_part part, double position,
                  struct gon_error *err)
{
    struct motor *m = &in->motor[part];
    const struct bench_axis *c = m->config;
    struct gon_error own;
    err = err ? err : &own;
    if (!(position >= c->min - 1e-9 && position <= c->max + 1e-9))
        return gon_fail(err, GON_E_INPUT, "axis %s: %.4f %s is outside its travel %g..%g %s",
                        c->name, position, c->unit_name, c->min, c->max, c->unit_name);
    int rc = instrument_need(in, part, err);
    if (rc < 0)
        return rc;
    const double rise = (c->approach == BENCH_FROM_ABOVE ? -1 : 1) * (position - m->place.position);
    m->commanded = instrument_rounded(in, part, position);
    m->seen_ns = INT64_MIN;
    if (c->backlash > 0)
        m->engaged = rise >= 0 && (m->engaged || rise >= c->backlash);
    rc = m->axis->ops->move_abs(m->axis, to_steps(c, position),
                                (int32_t)lround(fabs(c->speed * c->steps_per_unit)),
                                (int32_t)lround(fabs(c->acceleration * c->steps_per_unit)), err);
    return instrument_note(in, part, rc, err);
}

static int command(struct instrument *in, enum instrument_part part,
                   int (*call)(struct axis *a, struct gon_error *err), struct gon_error *err)
{
    struct motor *m = &in->motor[part];
    m->engaged = m->config->backlash <= 0;
    m->commanded = (double)NAN;
    m->seen_ns = INT64_MIN;
    return instrument_note(in, part, call(m->axis, err), err);
}

int instrument_go_home(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, part, err);
    return rc < 0 ? rc : command(in, part, in->motor[part].axis->ops->home, err);
}

int instrument_halt(struct instrument *in, enum instrument_part part, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, part, err);
    return rc < 0 ? rc : command(in, part, in->motor[part].axis->ops->stop, err);
}

// --- laser ------------------------------------------------------------------------------------

int instrument_laser(struct instrument *in, struct laser_status *ret_status, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_LASER, err);
    if (rc >= 0)
        rc = instrument_note(in, PART_LASER, safety_status(in->safety, &in->laser, err), err);
    if (rc >= 0)
        *ret_status = in->laser;
    return rc;
}

int instrument_light(struct instrument *in, bool *ret_emission, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_LASER, err);
    if (rc >= 0)
        rc =
            instrument_note(in, PART_LASER, safety_look(in->safety, &in->laser.emission, err), err);
    if (rc >= 0)
        *ret_emission = in->laser.emission;
    return rc;
}

int instrument_power(struct instrument *in, double power_w, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_LASER, err);
    return rc < 0
               ? rc
               : instrument_note(in, PART_LASER, safety_set_power(in->safety, power_w, err), err);
}

int instrument_emission_on(struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_LASER, err);
    return rc < 0 ? rc : instrument_note(in, PART_LASER, safety_on(in->safety, err), err);
}

int instrument_emission_off(struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_LASER, err);
    if (rc < 0)
        return rc;
    rc = instrument_note(in, PART_LASER, safety_off(in->safety, err), err);
    if (rc >= 0) { // power and faults are as of the next question
        in->laser.emission = false;
        in->laser.state = LASER_OFF;
        in->laser.power_w = (double)NAN;
    }
    return rc;
}

void instrument_permit(struct instrument *in, bool running)
{
    if (in->safety)
        safety_permit(in->safety, running);
}

struct arm *instrument_arm(struct instrument *in)
{
    return &in->arm;
}

void instrument_obey(struct instrument *in, const struct cancel *stop)
{
    in->stop = stop;
    if (in->safety)
        safety_obey(in->safety, stop);
}

int instrument_alarm(const struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = in->safety ? safety_alarm(in->safety, err) : 0;
    if (rc < 0)
        gon_prefix(err, "laser");
    return rc;
}

// A laser that was never reached was never told anything either, and one whose place another took
// is as it was left.
enum safety_light instrument_light_left(const struct instrument *in)
{
    const enum safety_light now = in->safety ? safety_light(in->safety) : SAFETY_LIGHT_UNCONFIRMED;
    return now > in->behind ? now : in->behind;
}

const struct safety *instrument_safety(const struct instrument *in)
{
    return in->safety;
}

// --- detector ---------------------------------------------------------------------------------

int instrument_ranges(const struct instrument *in)
{
    return in->detector ? in->detector->ops->ranges(in->detector) : 0;
}

double instrument_full_scale_v(const struct instrument *in, int range)
{
    return in->detector->ops->full_scale_v(in->detector, range);
}

int instrument_range(const struct instrument *in)
{
    return in->range;
}

int instrument_set_up(struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_DETECTOR, err);
    return rc < 0 ? rc : instrument_note(in, PART_DETECTOR, instrument_write_set_up(in, err), err);
}

int instrument_set_range(struct instrument *in, int range, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_DETECTOR, err);
    if (rc < 0)
        return rc;
    in->range = -1;
    rc = instrument_note(in, PART_DETECTOR, in->detector->ops->set_range(in->detector, range, err),
                         err);
    if (rc >= 0)
        in->range = range;
    return rc;
}

int instrument_sample_detector(struct instrument *in, struct gon_error *err)
{
    int rc = instrument_need(in, PART_DETECTOR, err);
    return rc < 0 ? rc
                  : instrument_note(in, PART_DETECTOR,
                                    in->detector->ops->sample(in->detector, &in->sample, err), err);
}

int instrument_sample(struct instrument *in, struct detector_sample *ret_sample,
                      struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_sample_detector(in, err);
    if (rc >= 0 && instrument_has(in, PART_MONITOR))
        rc = instrument_sample_monitor(in, &in->sample.monitor_v, err);
    if (rc < 0)
        return rc;
    in->sampled_steady = in->steady;
    *ret_sample = in->sample;
    return 0;
}

int instrument_clear(struct instrument *in, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_DETECTOR, err);
    if (rc >= 0)
        rc = instrument_note(in, PART_DETECTOR, in->detector->ops->clear(in->detector, err), err);
    return rc < 0 || !instrument_has(in, PART_MONITOR) ? rc : instrument_clear_monitor(in, err);
}

int instrument_condition(struct instrument *in, unsigned *ret_flags, struct gon_error *err)
{
    struct gon_error own;
    err = err ? err : &own;
    int rc = instrument_need(in, PART_DETECTOR, err);
    return rc < 0
               ? rc
               : instrument_note(in, PART_DETECTOR,
                                 in->detector->ops->condition(in->detector, ret_flags, err), err);
}

double instrument_time_constant_s(const struct instrument *in)
{
    return in->time_constant_s;
}
