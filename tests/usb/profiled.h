// SPDX-License-Identifier: MIT
// The instrument that a profile describes, as `gonio profile sim` serves it (sim/actor.h), as a
// port to be plugged in over USB, with the numbers of the profile's own example of a link.
#pragma once
#include "drivers/profile.h"
#include "sim/actor_message.h"
#include "sim/usbtmc.h"

struct profiled {
    struct actor_message message; // first; its port is the instrument's
    struct profile *profile;
    struct actor actor;
    char serial[240];
    struct sim_usb_identity identity;
};

// By name or path. NULL: why is said on standard error.
struct profiled *profiled_new(const char *profile);
void profiled_free(struct profiled *p); // NULL is fine
