// SPDX-License-Identifier: MIT
// An instrument made from its profile (sim/actor.h) as a part of the simulated world (sim/world.h).
// Nothing in it knows an instrument: which values are meant is what the profile's role says.
//
//   detector  signal, monitor and reference are what reaches the world's filter and its monitor;
//             full_scale, time_constant_s and slope_db (without them settle_s and one pole) are
//             those of that filter. Beyond 1.09 of its range the signal is "over", or stays there.
//             world.reference_hz, noise and offset are in volts: signal_per_v makes the signal of
//             them, in its own unit.
//   laser     its light is laser.power, or else the set-point, while simulate.shines (or else
//             laser.emitting) holds. The world adds drift and noise.
//   axis      position, in steps, is where the motor is, from its true place at power-up on.
//
// The world asks lasers and axes when it needs them, so that what they do by themselves is seen in
// time whoever is spoken to. Thread: one. Links must not move in memory.
#pragma once
#include "sim/actor.h"
#include "sim/world.h"

struct actor_world {
    struct actor_link link; // first
    struct actor *actor;
    struct world *world;
    double signal_per_v;     // detector
    enum world_axis axis;    // axis
    double steps_per_unit;   // axis
    int signal, monitor;     // values; -1: none
    int reference, position; // the same
};

// The actor must have been started. 0 for signal_per_v: its largest range is 1 V.
void actor_world_detector(struct actor_world *l, struct actor *a, struct world *w,
                          double signal_per_v);
void actor_world_laser(struct actor_world *l, struct actor *a, struct world *w);
void actor_world_axis(struct actor_world *l, struct actor *a, struct world *w, enum world_axis axis,
                      double steps_per_unit);
// Off and on again: it begins as its profile says, where things are.
void actor_world_power_cycle(struct actor_world *l, int64_t t_ns);
