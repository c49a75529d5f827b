// SPDX-License-Identifier: MIT
// Following a run to its end: a live line on a terminal, a line a sweep otherwise, or with json
// each of the daemon's events as one line on stdout. Ctrl-C ends the following, never the run.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct client;

// Follows run from the events after last_id; file is where its readings go. Returns the exit
// status: of the run when it ended, 130 after Ctrl-C, 3 when the daemon went away.
int follow_run(struct client *c, int run, const char *file, const char *last_id, bool json);
