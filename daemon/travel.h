// SPDX-License-Identifier: MIT
// Moving the bench: the axes start together and all of them are waited for. Thread: instrument.
//
// The wait sleeps to the arrival that a trapezoidal profile predicts and then polls, 1 ms apart for
// a short move and up to 50 ms for a long one; an alarm is seen within 250 ms. GON_E_DEVICE: a move
// that is not done after twice the predicted time plus 2 s, an alarm, an axis that says it moves
// and does not, or is off its way by more than its following_error, or a position that its retries
// do not bring within the deadband. An axis that lost its home is GON_E_LINK; GON_E_LINK and
// GON_E_GONE come from the drivers too. An axis with backlash is approached from one side: from the
// other it goes first beyond the target by the backlash. A command whose answer was lost is not
// repeated before the controller's own target and state were read. After an error the axes may
// still move: the caller stops them (travel_stop), and the light before them, as an axis that does
// not answer takes time.
//
// Keep-outs (campaign/keepout.h): where the axes together might touch one they move one after the
// other, in an order that cannot; where no order is clear nothing moves and it is GON_E_DEVICE.
// Homing is the controllers' own and knows no keep-outs: axes home one by one, in the order of the
// bench file.
#pragma once
#include "base/cancel.h"
#include "base/err.h"
#include "daemon/instrument.h"

// User units, by part. NAN: leave that axis where it is.
struct travel_pose {
    double at[INSTRUMENT_AXES];
    int64_t still_ns; // where it is: since when at the latest all of them stand
};

// Moves, waits, and returns where the encoders say that the axes are (NAN for an axis the bench has
// not). Axes that need not move are asked at least each INSTRUMENT_FRESH_MS.
int travel_move(struct instrument *in, const struct travel_pose *target,
                const struct cancel *cancel, struct travel_pose *ret_actual, struct gon_error *err);
// Asks all axes: without alarm, homed, and still standing there within their deadbands (NAN:
// wherever it is). GON_E_DEVICE: one moved by itself, or has an alarm.
int travel_still(struct instrument *in, const struct travel_pose *at, struct gon_error *err);
struct travel_pose travel_stay(void); // all axes where they are
// The sample in, and the axes where kinematics puts that geometry; GON_E_INPUT when it cannot be.
int travel_to_sample(const struct instrument *in, double theta_i_deg, double theta_r_deg,
                     struct travel_pose *ret_pose, struct gon_error *err);
// The pose of a station by its name; GON_E_INPUT when the bench has none of that name.
int travel_station(const struct instrument *in, const char *name, struct travel_pose *ret_pose,
                   struct gon_error *err);
// Homes the axes that say they are not, each after it was identified again; others stay. One that
// for 2 s neither moves nor is homed (it restarted) is told again, twice at most. An axis with an
// alarm is GON_E_DEVICE.
int travel_home(struct instrument *in, const struct cancel *cancel, struct gon_error *err);
int travel_stop(struct instrument *in, struct gon_error *err); // all of them; the first error
