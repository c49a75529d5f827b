// SPDX-License-Identifier: MIT
// Opens each device of a bench once, asks who it is and how it is, and tells what it found. Nothing
// moves and nothing is switched on: the first bytes to a laser are OFF, before anything else is
// sent on the bench; axes are only read (their command bits, if one was left set, are taken back);
// detectors keep their settings. Where the expected device does not answer, the bench's other
// devices are looked for on its port. A few seconds for each that is silent. Thread: one.
#pragma once
#include "cli/explain.h"

#include <stdbool.h>

struct bench_config;
struct clk;

struct examine {
    const struct bench_config *bench; // its links are well-formed
    struct clk *clk;
    const char *by_id; // folder of the ports' stable names: PORTS_BY_ID
    void *ctx;
    // Whether somebody else holds this part of the bench ("laser", "theta_i"), and will be asked.
    bool (*held)(void *ctx, const char *part, const char *link);
    void (*found)(void *ctx, const struct finding *f); // in the bench's order, the laser first
};

void examine_bench(const struct examine *e);
