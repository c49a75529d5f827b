// SPDX-License-Identifier: MIT
// The text protocol of a Cobolt 05-01 laser: cmd CR, answer CR LF, in front of the world's laser.
// Several ports may lead to the same laser. Thread: one. Source: public drivers, no manual
// (cobolt-lasers/pycobolt, the vendor's own; microscope's cobolt.py; Micro-Manager's
// CoboltOfficial.cpp).
//
// A command that comes less than 100 ms after the one before is ignored, whole and without an
// answer; empty lines and line feeds are nothing at all. Settings answer OK, what is not known
// "Syntax error: illegal command", what is refused "Error: ..." (the real texts are not known). l1
// is refused while autostart is enabled, with the interlock open, without the key, with a fault;
// @cob1 waits for the key.
#pragma once
#include "sim/line.h"
#include "sim/port.h"
#include "sim/world.h"

#include <stdbool.h>
#include <stdint.h>

#define SIM_COBOLT_GAP_NS 100000000

enum { SIM_COBOLT_HEARD = 64 };

struct sim_cobolt_heard { // one command, as it came over the wire
    int64_t t_ns;
    bool too_early; // and was ignored
    char text[24];
};

struct sim_cobolt { // the laser's controller, shared by its ports
    struct world *world;
    int64_t reply_ns; // its time to answer
    int64_t last_ns;  // when it took the last command
    bool echo;
    uint64_t too_early; // commands ignored
    double hours;
    uint64_t heard_count; // all of them; the newest are kept, each at its number % SIM_COBOLT_HEARD
    struct sim_cobolt_heard heard[SIM_COBOLT_HEARD];
};

struct sim_cobolt_port {
    struct port port; // first
    struct sim_cobolt *laser;
    struct sim_line line;
};

void sim_cobolt_init(struct sim_cobolt *c, struct world *world, int64_t reply_ns);
void sim_cobolt_port_init(struct sim_cobolt_port *p, struct sim_cobolt *c);
