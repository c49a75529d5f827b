// SPDX-License-Identifier: MIT
// What the bench's suspenders see, and who interrupts a wait. Thread: instrument.
#pragma once
#include "daemon/instrument.h"

// Where "disk_free_mb" comes from; NAN: not known. NULL: nobody knows. It must be quick.
void instrument_disk(struct instrument *in, double (*free_mb)(void *ctx), void *ctx);
// The light is on, unfolded and warm: from the next sample on the monitor and the laser's power are
// judged. Or it is not, and they are not.
void instrument_steady(struct instrument *in, bool steady);

// Asks what is older than INSTRUMENT_LOOK_S, and no lost part; then judges. Nothing happens on a
// bench without suspenders.
#define INSTRUMENT_LOOK_S 0.5
void instrument_look_around(struct instrument *in);
// Whether one keeps a run from going on, as of the last look.
bool instrument_suspended(const struct instrument *in, struct suspender_state *ret_state);
void instrument_release(struct instrument *in); // as suspend_release

// Asked in the slices of instrument_wait, between the talks with devices, so that it may ask them:
// true ends the wait with GON_E_CANCELED. NULL: none.
void instrument_heed(struct instrument *in, bool (*heed)(void *ctx), void *ctx);
// For waits elsewhere: instrument_breathe, and what is heeded.
bool instrument_interrupted(struct instrument *in);
