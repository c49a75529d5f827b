// SPDX-License-Identifier: MIT
// The simulated bench of `goniod --sim`: a goniosim process with a private run directory, which
// ends with the daemon, however that ends. Thread: main; a few calls that block are made before and
// after the loop.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct simulator;

struct simulator_options {
    bool fast; // axes, filters and warm-up made quick: the demonstration
    long seed; // -1: goniosim's own default
};

// Starts goniosim (beside this program, in ../bin, or on PATH) and waits until it says that it is
// ready.
int simulator_start(const struct simulator_options *options, struct simulator **ret_simulator,
                    struct gon_error *err);
void simulator_stop(struct simulator *s); // and removes its run directory
const char *simulator_config(const struct simulator *s); // the bench file it wrote
const char *simulator_folder(const struct simulator *s); // its run directory, with control.sock
int simulator_fd(const struct simulator *s);             // readable when the process has ended
