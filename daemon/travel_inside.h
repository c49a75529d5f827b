// SPDX-License-Identifier: MIT
// What travel.c (whereto, and which way) and travel_ride.c (a stage of the way) share; nobody else
// includes it.
#pragma once
#include "campaign/keepout.h"
#include "daemon/travel.h"

// Alarms are GON_E_DEVICE, a lost home position is GON_E_LINK.
int travel_check(const struct instrument *in, enum instrument_part part, const struct axis_place *p,
                 struct gon_error *err);
// Stops an axis that was found moving, and waits for it; place is where it stands then.
int travel_halt(struct instrument *in, enum instrument_part part, const struct cancel *cancel,
                struct axis_place *place, struct gon_error *err);
// Moves the stage's axes to their places and waits until they stand there. at: where all axes stand
// that the angles depend on, for the keep-outs.
int travel_ride(struct instrument *in, const struct keepout_stage *stage,
                const double at[INSTRUMENT_AXES], const struct cancel *cancel,
                struct gon_error *err);
