// SPDX-License-Identifier: MIT
// Moving the bench: the axes start together and all of them are waited for. Thread: instrument.
//
// The wait sleeps to the arrival that a trapezoidal profile predicts and then polls, 1 ms apart for
// a short move and up to 50 ms for a long one; an alarm is seen within 250 ms. A move that is not
// done after twice the predicted time plus 2 s, an alarm, an axis that is not homed, or a position
// that two re-seeks do not bring within the deadband is GON_E_DEVICE; GON_E_LINK and GON_E_GONE
// come from the drivers. An axis with backlash is approached from below: from above it goes first
// to the target less the backlash. A command whose answer was lost is not repeated before the
// controller's own target and state were read. After an error the axes may still move: the caller
// stops them (travel_stop), and the light before them, as an axis that does not answer takes time.
#pragma once
#include "base/cancel.h"
#include "base/err.h"
#include "daemon/instrument.h"

// User units, indexed by part. NAN: leave that axis where it is.
struct travel_pose {
    double at[INSTRUMENT_AXES];
    int64_t still_ns; // where it is: since when at the latest all of them stand
};

// Moves, waits, and returns where the encoders say that the axes are (NAN for an axis the bench has
// not). Axes that need not move are asked at least each INSTRUMENT_FRESH_MS.
int travel_move(struct instrument *in, const struct travel_pose *target,
                const struct cancel *cancel, struct travel_pose *ret_actual, struct gon_error *err);
// The pose of a station by its name; GON_E_INPUT when the bench has none of that name.
int travel_station(const struct instrument *in, const char *name, struct travel_pose *ret_pose,
                   struct gon_error *err);
// Homes the axes that say they are not; others stay. An axis with an alarm is GON_E_DEVICE.
int travel_home(struct instrument *in, const struct cancel *cancel, struct gon_error *err);
int travel_stop(struct instrument *in, struct gon_error *err); // all of them; the first error
// Trapezoidal profile, triangular when short: distance and result without sign.
double travel_time_s(double distance, double speed, double acceleration);
