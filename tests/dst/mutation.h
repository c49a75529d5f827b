// SPDX-License-Identifier: MIT
// Defects put in on purpose, one at a time, each of which a rule of the watch must report: so that
// the rules are seen to bite. They stand where the product would have them: in what is commanded on
// the wires behind the engine's back, in the ports, in what is said. Thread: one.
#pragma once
#include "daemon/engine.h"
#include "tests/dst/watch.h"

struct trial;

struct mutation {
    const char *name, *what;
    enum watch_rule rule;
    const char *words; // of the report
    int64_t row;       // after this acknowledged row it happens; 0: all the time
    void (*happen)(struct trial *t);
    void (*reading)(struct store_reading *stored, struct store_reading *told);
    void (*event)(struct engine_event *event);
    bool keep; // the reading is told to be safe and never stored
};

// Runs each on a short campaign; prints a table; returns how many were not reported.
int mutation_run_all(const char *profiles, FILE *out);

// For the ports; all do nothing without a mutation.
void mutation_after_row(struct trial *t);
// What is stored and what the watch is told was measured; true: it is not stored at all.
bool mutation_of_reading(const struct trial *t, struct store_reading *stored,
                         struct store_reading *told);
void mutation_of_event(const struct trial *t, struct engine_event *event);
