// SPDX-License-Identifier: MIT
// The instrument thread: it alone owns the bench. It runs queued campaigns (engine_run); while it
// has none it asks each device once a second how it is and brings back those that were lost. It
// tells the main thread what happens and waits for the store's acknowledgements, keeping the
// laser's lease meanwhile. The arm lives here (daemon/arm.h): whoever changes it writes a letter, and
// each change is told.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct bench_config;
struct cancel;
struct guard_host;
struct mail;
struct runner;

// All borrowed for the thread's life; bench is not changed by anybody.
struct runner_links {
    const struct bench_config *bench;
    const struct guard_host *guard; // of the process that holds the laser's port
    const struct cancel *cancel; // ends a run
    const char *directory;       // of the campaigns: its disk is watched
    struct mail *box;            // the thread's own
    struct mail *to_main, *to_store;
};

int runner_start(const struct runner_links *links, struct runner **ret_runner,
                 struct gon_error *err);
// After NOTE_QUIT; NULL is fine. True when the laser was not read back off: it may be on.
bool runner_join(struct runner *r);
