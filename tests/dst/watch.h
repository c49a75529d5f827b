// SPDX-License-Identifier: MIT
// What must never happen, seen from the world and the wires: the light and the axes as they are,
// what the detector really said, what the engine published and which rows it was told are safe.
// Nothing here asks the engine anything. Thread: one.
//
//   emission   only in a campaign that prepares or runs, while the thread that holds the lease
//              breathes at least every 500 ms, with the interlock closed when it is switched on,
//              and not with an axis in alarm
//   motion     no axis is commanded beyond its limits, none by position before it is homed, and
//              none is ever inside a keep-out
//   values     each stored row is the mean of answers that the detector gave, while the axes stood
//              where the row says and where the plan wanted them; an accepted one is what the world
//              has there, and its light was on or off as its kind wants
//   rows       what was acknowledged is in the file at the end, as it was, and nothing else is;
//              each point has one accepted reading when the campaign is done; an opening reference
//              at most one more for each pause and each stop
//   words      pauses have a reason; nobody says "laser off" while it is on; at rest the light goes
//              off; the campaign goes on, pauses or ends
#pragma once
#include "campaign/bench.h"
#include "campaign/plan.h"
#include "campaign/store.h"
#include "daemon/engine.h"
#include "tests/dst/rig.h"

enum { WATCH_SAMPLES = 64, WATCH_TEXT = 300 };

enum watch_rule {
    WATCH_EMISSION,
    WATCH_MOTION,
    WATCH_VALUES,
    WATCH_ROWS,
    WATCH_WORDS,
    WATCH_RULES
};

extern const char *const watch_rule_names[WATCH_RULES];

struct watch_sample { // an answer of the detector
    int64_t t_ns;
    double x_v, truth_v, monitor_v, noise_v;
    double motor[RIG_AXES], load[RIG_AXES];
    bool still, emits;
};

struct watch {
    struct rig *rig;
    const struct bench_config *bench;
    const struct plan *plan;
    int *first; // of each sweep's points in the plan
    // seen last
    bool emits;
    uint64_t motions[RIG_AXES];
    bool moving;
    int64_t moving_until_ns, path_ns;
    int homings; // begun
    bool is_homed[RIG_AXES], is_homing[RIG_AXES];
    int64_t unhomed_ns[RIG_AXES], alarm_ns[RIG_AXES];
    // what the engine says
    bool running; // a campaign was begun and did not end
    enum run_state state;
    int64_t state_ns, breath_ns, worst_gap_ns;
    bool stop; // was asked for
    int64_t stop_ns;
    // excuses: what was done to the laser and to the clock
    int64_t laser_hit_ns, forced_ns;
    int64_t world_ns; // when dark or power were changed by a fault
    struct watch_sample sample[WATCH_SAMPLES];
    int samples;
    // rows that were acknowledged
    struct store_reading *row;
    int rows, room;
    unsigned char *accepted; // by index in the plan
    int gaps;                // pauses, and stops that were gone on from
    // found
    int violations[WATCH_RULES], all;
    char text[WATCH_TEXT];               // the first
    char texts[WATCH_RULES][WATCH_TEXT]; // the first of each
};

void watch_init(struct watch *w, struct rig *rig, const struct bench_config *bench,
                const struct plan *plan);
void watch_free(struct watch *w);
void watch_violate(struct watch *w, enum watch_rule rule, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

void watch_stop(struct watch *w);   // somebody asks for it
void watch_resume(struct watch *w); // a stopped campaign goes on
void watch_step(struct watch *w, int64_t t_ns);
void watch_breath(struct watch *w);
void watch_event(struct watch *w, const struct engine_event *event);
void watch_heard(struct watch *w, const uint8_t *bytes, size_t size); // by the detector
void watch_offered(struct watch *w, const struct store_reading *row); // to the store
void watch_acknowledged(struct watch *w, const struct store_reading *row);
void watch_end(struct watch *w, enum run_state ended);
// The rows of the file, in its order, against those acknowledged.
void watch_file(struct watch *w, const struct store_reading *rows, int count);
