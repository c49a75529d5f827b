// SPDX-License-Identifier: MIT
// The bench on its wires: sim/'s world and instruments, each behind a line, with gates in which
// controllers can be made to misbehave. And the bench file that leads to it. Thread: one.
#pragma once
#include "sim/bench.h"
#include "tests/dst/line.h"

enum { RIG_AXES = 3 };
enum rig_line { RIG_BUS, RIG_LASER, RIG_DETECTOR, RIG_LINES };

struct rig;

struct rig_gate { // between a Modbus unit and its registers
    struct sim_modbus_unit inner;
    struct rig *rig;
    enum world_axis axis;
    int exception, exceptions; // the next so many requests are refused with it
    bool frozen;               // the encoder stands still
    uint16_t frozen_at[2];
    bool never_done;  // it says that it moves
    bool hides_alarm; // AZ
    int misses;       // the next moves end somewhere else
    int32_t miss_steps;
};

struct rig_spec {
    uint64_t seed;
    int controller; // enum bench_controller
    bool tcp[RIG_LINES];
    bool keep_out;
    double time_constant_s;
};

struct rig {
    struct rig_spec spec;
    struct bench bench;
    struct line line[RIG_LINES];
    struct rig_gate gate[RIG_AXES];
    bool unlocked;         // the lock-in has no reference
    char bench_text[4000]; // goniod.cfg
};

void rig_draw(struct rig_spec *ret_spec, uint64_t seed); // what kind of bench a seed has
void rig_init(struct rig *r, const struct rig_spec *spec);
const char *rig_describe(const struct rig *r, char *text, size_t size);

void rig_step(struct rig *r);        // what goes on all the time
bool rig_emits(const struct rig *r); // or is on its way: light may come at any moment
double rig_steps_per_unit(void);
