// SPDX-License-Identifier: MIT
// One simulated campaign: a bench and a plan drawn from a seed, the product's engine on this
// thread, its store core beside it, an operator who says resume, and the watch over it. The working
// folder is where the campaign file goes. Thread: one.
#pragma once
#include "base/cancel.h"
#include "daemon/instrument.h"
#include "daemon/material.h"
#include "tests/dst/disk.h"
#include "tests/dst/faults.h"
#include "tests/dst/mutation.h"
#include "tests/dst/rig.h"
#include "tests/dst/shop.h"
#include "tests/dst/watch.h"

enum { TRIAL_FAULTS = 80 };

// What the engine is about, as far as it shows outside.
enum trial_moment {
    MOMENT_IDLE, // before the campaign
    MOMENT_PREPARING,
    MOMENT_WARMING,
    MOMENT_MOVING,
    MOMENT_SETTLING,
    MOMENT_SAMPLING,
    MOMENT_STORING,
    MOMENT_PAUSED,
    MOMENT_STOPPING,
    MOMENTS
};

extern const char *const trial_moment_names[MOMENTS];

struct trial_spec {
    uint64_t seed;
    int readings;               // points of the plan, nearly
    const char *profiles;       // the folder whose profiles/ has the instruments'; absolute
    double faults_per_1000;     // readings, at random
    const struct rig_spec *rig; // NULL: drawn
    int fault;                  // one of the table, at a moment; -1: none
    enum trial_moment moment;
    int variant;
    const struct mutation *mutation; // a defect put in; NULL: none
    FILE *trace;
};

// What was to be seen after the first fault.
struct trial_seen {
    bool begun;
    int operators, returns; // pauses that an operator ended, and those that ended by themselves
    int flagged, homings;
    int stops;
    bool warned, told; // told: the fault's words were in a pause's reason
    char reason[300];  // of the first pause
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
    struct run_material *material; // as it was last opened
    struct plan plan;              // as it was at first
    // the instrument thread's side of the store
    uint64_t sequence, acknowledged;
    struct gon_error answer;
    bool reading_open;
    struct store_reading reading;
    // the operator
    bool paused, wants_pause, resume, resumed, no_operator;
    struct dice dice;
    int pauses;
    int64_t row_ns; // when there was one last
    // faults
    bool active[TRIAL_FAULTS];
    int64_t began_ns[TRIAL_FAULTS];
    int64_t paused_ns; // since when
    int counts[TRIAL_FAULTS];
    int injected, last_fault;
    bool aimed; // at its moment: on the agenda
    bool asked;
    int64_t ask_ns; // when a pause or a stop is to be asked for, for its moment
    struct trial_seen seen;
    int homings_before;
};

struct trial_result {
    enum run_state state;
    uint64_t hash, dump, traced;
    double virtual_s;
    int rows, points, pauses, faults, violations;
    int counts[TRIAL_FAULTS];
    int64_t worst_gap_ns;
    struct trial_seen seen;
    char text[WATCH_TEXT]; // the first violation
    int rules[WATCH_RULES];
    char texts[WATCH_RULES][WATCH_TEXT];
    char bench[120];
};

void trial_run(const struct trial_spec *spec, struct trial_result *ret_result);

// For parts of it.
void trial_arm(struct trial *t);
void trial_ports(struct trial *t, struct engine_ports *ret_ports);
void trial_aim(struct trial *t, enum trial_moment now, int64_t at_ns); // it is that moment
