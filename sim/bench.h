// SPDX-License-Identifier: MIT
// The whole simulated bench: one world, its instruments, and two ports to each of them (a serial
// and a TCP one). Still bytes and times only: goniosim puts wires on the ports, tests feed them.
// Thread: one.
#pragma once
#include "sim/actor_message.h"
#include "sim/actor_world.h"
#include "sim/az.h"
#include "sim/cobolt.h"
#include "sim/leadshine.h"
#include "sim/modbus.h"
#include "sim/sr830.h"
#include "sim/world.h"

enum bench_port {
    BENCH_AXES_RTU,
    BENCH_AXES_TCP,
    BENCH_LASER,
    BENCH_LASER_TCP,
    BENCH_DETECTOR,
    BENCH_DETECTOR_TCP,
    BENCH_PORTS
};

extern const char *const bench_port_names[BENCH_PORTS]; // "axes", "axes-tcp", "laser", ...

enum bench_controller { BENCH_AZ, BENCH_LEADSHINE }; // of the axes
extern const char *const bench_controllers[];        // what drivers call them; NULL at the end

struct bench_spec {
    struct world_spec world;
    double steps_per_unit[WORLD_AXES];
    double home_speed, home_acceleration; // deg/s, deg/s2; mm for the stage
    double start_s;                       // from a command to the motor
    bool homed;
    int controller; // enum bench_controller
    // Made from these instead (borrowed; actor_init takes them); NULL: not.
    const struct profile *laser, *detector, *axes;
    double signal_per_v; // of that detector, in its unit; 0: its largest range for 1 V
    double laser_reply_s, detector_reply_s, axes_reply_s;
    bool laser_echo;
};

enum bench_part { BENCH_THE_LASER = WORLD_AXES, BENCH_THE_DETECTOR, BENCH_PARTS }; // 0..: axes
extern const char *const bench_part_names[BENCH_PARTS]; // "theta_i", ..., "laser", "detector"

struct bench_actor {               // an instrument made from a profile, as a part of the world
    const struct profile *profile; // NULL: none
    struct actor actor;
    struct actor_world world;
    struct actor_message line[2]; // serial, TCP
};

struct bench {
    struct world world;
    struct bench_actor by_profile[BENCH_PARTS]; // those whose profile is there
    int controller;
    struct sim_az az[WORLD_AXES];               // units 1, 2, 3; 4 and 5 with elements
    struct sim_leadshine leadshine[WORLD_AXES]; // or these
    struct sim_cobolt laser;
    struct sim_sr830 detector;
    struct sim_modbus axes_port[2]; // serial, TCP
    struct sim_cobolt_port laser_port[2];
    struct sim_sr830_port detector_port[2];
};

void bench_defaults(struct bench_spec *ret_spec);
// The bench must not move in memory afterwards.
void bench_init(struct bench *b, const struct bench_spec *spec, int64_t t_ns);
struct port *bench_port(struct bench *b, enum bench_port which);

// The instrument made from a profile that plays this part; NULL: none does.
struct bench_actor *bench_actor(struct bench *b, int part);

// What an axis' controller says of itself, whichever kind it is.
struct bench_motor {
    bool homed;
    int alarm; // 0: none
    int32_t steps;
    uint64_t moves, ignored; // commands carried out, and echoed but ignored
};

struct bench_motor bench_motor(const struct bench *b, enum world_axis axis, int64_t t_ns);
void bench_raise(struct bench *b, enum world_axis axis, int alarm, int64_t t_ns);
void bench_power_cycle(struct bench *b, enum world_axis axis, int64_t t_ns);
