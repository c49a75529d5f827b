// SPDX-License-Identifier: MIT
// GET /metrics: what the daemon knows in the Prometheus text format 0.0.4. A number that is not
// known has no sample. Counters of links start with the daemon. Pure. Thread: main.
#pragma once
#include <stdbool.h>
#include <stdint.h>

struct instrument_snapshot;
struct run;

#define METRICS_TYPE "text/plain; version=0.0.4; charset=utf-8"

struct metrics_source {
    double uptime_s, snapshot_age_s;
    bool simulator;
    uint64_t readings;                          // stored in this life of the daemon
    const struct run *run;                      // that has the bench; NULL: idle
    const struct instrument_snapshot *snapshot; // NULL: none yet
};

char *metrics_text(const struct metrics_source *m); // malloc'ed; NULL without memory
