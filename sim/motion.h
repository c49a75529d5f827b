// SPDX-License-Identifier: MIT
// The mechanics of one axis: a motor that follows trapezoidal speed profiles between hard limits,
// and a load that it drives through backlash. A plan is made when the motor is commanded; where
// things are is then a pure function of time, so that nobody has to step it. Units are the axis'
// own (deg or mm) and seconds; times t_ns are the simulation's. Commands must come in the order of
// time. Thread: one.
//
// Backlash: motor <= load <= motor + backlash. Moving up, load = motor (the scale was adjusted so);
// after a reversal the load stays until the backlash is taken up, then follows backlash above.
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum { MOTION_LEGS = 8 };

struct motion_leg {
    double duration_s, speed0, acceleration; // signed
};

struct motion {
    uint64_t plan;   // its number: nothing changes at rest while it stays
    double min, max; // where the motor meets the hard limits
    double backlash; // >= 0
    // the plan
    int64_t start_ns;
    double motor0, load0;
    int legs;
    struct motion_leg leg[MOTION_LEGS];
    double end; // exact position after the last leg; NAN: where the legs lead
};

struct motion_state {
    double motor, load, speed;
    bool moving;
    int limit; // -1, +1: stopped by that hard limit; 0: not
};

void motion_init(struct motion *m, double min, double max, double backlash, double at);
struct motion_state motion_at(const struct motion *m, int64_t t_ns);

// From where it is and as fast as it is at t_ns (0 and at rest before start_ns' plan), to target.
// Speed, acceleration and deceleration > 0. A target behind or too near is reached by stopping and
// coming back.
void motion_go(struct motion *m, double target, double speed, double acceleration,
               double deceleration, int64_t t_ns);
void motion_stop(struct motion *m, double deceleration, int64_t t_ns);
void motion_halt(struct motion *m, int64_t t_ns); // at once: no current, or a limit was met
void motion_put(struct motion *m, double at, int64_t t_ns); // something else has moved it there
double motion_left_s(const struct motion *m, int64_t t_ns); // until the plan ends; 0 when it has
