// SPDX-License-Identifier: MIT
// Following a run to its end: a live line on a terminal, a line a sweep otherwise, or with json
// each of the daemon's events as one line on stdout. Ctrl-C ends the following, never the run.
//
// Where the event stream cannot tell the end (events were lost, the daemon was away and is another
// one now, no stream is free), the run is asked for instead.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct interrupt;

struct follow_run {
    int run;
    const char *file;    // where its readings go; "" unknown
    const char *last_id; // of the event after which to begin
    bool json;
};

// socket as in client_new. Returns the exit status: of the run when it ended, 130 after Ctrl-C, 3
// when the daemon went away.
int follow_run(const char *socket, const struct interrupt *i, const struct follow_run *what);
