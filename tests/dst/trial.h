// SPDX-License-Identifier: MIT
// One simulated campaign: a bench and a plan drawn from a seed, the product's engine on this
// thread, its store core beside it, an operator who says resume, and the watch over it. The working
// folder is where the campaign file goes. Thread: one.
#pragma once
#include "base/cancel.h"
#include "daemon/instrument.h"
#include "daemon/material.h"
#include "tests/dst/disk.h"
#include "tests/dst/rig.h"
#include "tests/dst/shop.h"
#include "tests/dst/watch.h"

struct trial_spec {
    uint64_t seed;
    int readings; // points of the plan, nearly
    const char *profiles; // the folder whose profiles/ has the instruments'; absolute
    FILE *trace;
};

struct trial {
    struct trial_spec spec;
    struct rig rig;
    struct watch watch;
    struct bench_config bench;
    struct shop shop;
    struct mail *box, *to_main; // the instrument thread's and the main thread's
    struct instrument *in;
    struct cancel *cancel;
    int id;
    char path[512];
    struct run_material *material;
    // the instrument thread's side of the store
    uint64_t sequence, acknowledged;
    struct gon_error answer;
    bool reading_open;
    struct store_reading reading;
    // the operator
    bool paused, wants_pause;
    int64_t resume_ns;
    int pauses;
    char pause_text[400]; // the last
};

struct trial_result {
    enum run_state state;
    uint64_t hash, dump, traced;
    double virtual_s;
    int rows, points, pauses, violations;
    int64_t worst_gap_ns;
    char text[WATCH_TEXT]; // the first violation
    char bench[120];
};

void trial_run(const struct trial_spec *spec, struct trial_result *ret_result);

// For parts of it.
void trial_ports(struct trial *t, struct engine_ports *ret_ports);
