// SPDX-License-Identifier: MIT
#include "sim/motion.h"

#include <assert.h>
#include <math.h>

static double clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

void motion_init(struct motion *m, double min, double max, double backlash, double at)
{
    assert(min < max && backlash >= 0);
    at = clamp(at, min, max);
    *m = (struct motion){.min = min,
                         .max = max,
                         .backlash = backlash,
                         .motor0 = at,
                         .load0 = at,
                         .end = (double)NAN};
}

// The load is dragged: each leg is monotonic, so its end points say all.
static void drag(const struct motion *m, struct motion_state *s)
{
    s->load = clamp(s->load, s->motor, s->motor + m->backlash);
}

struct motion_state motion_at(const struct motion *m, int64_t t_ns)
{
    struct motion_state s = {.motor = m->motor0, .load = m->load0};
    double left_s = (double)(t_ns - m->start_ns) * 1e-9;
    if (left_s < 0)
        return s; // commanded, not begun
    for (int i = 0; i < m->legs; i++) {
        const struct motion_leg *leg = &m->leg[i];
        bool within = left_s < leg->duration_s;
        double dt = within ? left_s : leg->duration_s;
        s.motor += leg->speed0 * dt + 0.5 * leg->acceleration * dt * dt;
        s.speed = leg->speed0 + leg->acceleration * dt;
        double free = s.motor;
        s.motor = clamp(free, m->min, m->max);
        drag(m, &s);
        if (free != s.motor) {
            s.limit = free > s.motor ? 1 : -1;
            s.speed = 0;
            return s;
        }
        if (within) {
            s.moving = true;
            return s;
        }
        left_s -= dt;
    }
    s.speed = 0;
    if (!isnan(m->end) && m->legs > 0) {
        s.motor = m->end; // what the sum above gives but for rounding
        drag(m, &s);
    }
    return s;
}

double motion_left_s(const struct motion *m, int64_t t_ns)
{
    double all = 0;
    for (int i = 0; i < m->legs; i++)
        all += m->leg[i].duration_s;
    double left = all - (double)(t_ns - m->start_ns) * 1e-9;
    return left > 0 && motion_at(m, t_ns).moving ? left : 0;
}

// Begins a plan at t_ns with the state that the old one has then.
static double begin(struct motion *m, int64_t t_ns)
{
    struct motion_state s = motion_at(m, t_ns);
    m->plan++;
    m->start_ns = t_ns;
    m->motor0 = s.motor;
    m->load0 = s.load;
    m->legs = 0;
    m->end = (double)NAN;
    return s.speed;
}

static void add(struct motion *m, double duration_s, double speed0, double acceleration)
{
    assert(m->legs < MOTION_LEGS);
    if (duration_s > 0)
        m->leg[m->legs++] = (struct motion_leg){duration_s, speed0, acceleration};
}

// Speed up from v0 (0 <= v0, in the direction of travel) to at most v, go on, slow down to rest
// after a distance d that is long enough to stop within.
static void trapezoid(struct motion *m, double sign, double d, double v0, double v, double a,
                      double dec)
{
    double peak = sqrt((d + v0 * v0 / (2 * a)) / (1 / (2 * a) + 1 / (2 * dec)));
    if (peak > v)
        peak = v;
    double cruise = d - (peak * peak - v0 * v0) / (2 * a) - peak * peak / (2 * dec);
    add(m, (peak - v0) / a, sign * v0, sign * a);
    if (peak > 0)
        add(m, cruise / peak, sign * peak, 0);
    add(m, peak / dec, sign * peak, -sign * dec);
}

void motion_go(struct motion *m, double target, double speed, double acceleration,
               double deceleration, int64_t t_ns)
{
    assert(speed > 0 && acceleration > 0 && deceleration > 0);
    double v0 = begin(m, t_ns);
    double x = m->motor0;
    double stop = v0 * fabs(v0) / (2 * deceleration); // signed distance to a standstill
    bool ahead = v0 == 0 || (target - x) * v0 > 0;
    if (!ahead || fabs(target - x) < fabs(stop)) {
        add(m, fabs(v0) / deceleration, v0, v0 > 0 ? -deceleration : deceleration);
        x += stop;
        v0 = 0;
    }
    double sign = target < x ? -1 : 1;
    v0 = fabs(v0);
    if (v0 > speed) { // it was faster than the new command allows
        add(m, (v0 - speed) / deceleration, sign * v0, -sign * deceleration);
        x += sign * (v0 * v0 - speed * speed) / (2 * deceleration);
        v0 = speed;
    }
    trapezoid(m, sign, fabs(target - x), v0, speed, acceleration, deceleration);
    if (m->legs > 0)
        m->end = target;
}

void motion_stop(struct motion *m, double deceleration, int64_t t_ns)
{
    assert(deceleration > 0);
    double v0 = begin(m, t_ns);
    add(m, fabs(v0) / deceleration, v0, v0 > 0 ? -deceleration : deceleration);
}

void motion_halt(struct motion *m, int64_t t_ns)
{
    begin(m, t_ns);
}

void motion_put(struct motion *m, double at, int64_t t_ns)
{
    at = clamp(at, m->min, m->max);
    if (at == motion_at(m, t_ns).motor)
        return;
    begin(m, t_ns);
    m->motor0 = at;
    m->load0 = clamp(m->load0, at, at + m->backlash);
}
