// SPDX-License-Identifier: MIT
// The RS-232 language of an SRS SR830 in front of the world's lock-in. Several ports may lead to
// the same instrument. Thread: one. Source: the SR830 manual, page 5-2 ff. (the rule of OUTX also
// in that of the SR850, page 6-3); replies of a real one in pyvisa issue 638; settings as in
// pymeasure/pymeasure:pymeasure/instruments/srs/sr830.py. Unverified: that OUTX 0 is RS-232.
//
// Lines end with CR or LF, commands are joined by ';', each answer ends with its own CR. Answers go
// to the interface that OUTX chose, which at power-up is GPIB (1): without OUTX 0 nothing is heard.
// A command that is not known says nothing and sets *ESR bit 5, a bad parameter bit 4. Exponents
// have three digits. Not modelled: data buffer, auto functions (AGAN, ARSV, APHS), display, macros:
// not known.
#pragma once
#include "sim/line.h"
#include "sim/port.h"
#include "sim/world.h"

#include <stdint.h>

enum { SIM_SR830_SETTINGS = 24, SIM_SR830_AUX = 4 };

struct sim_sr830 {
    struct world *world;
    int64_t reply_ns;                   // its time to answer
    double setting[SIM_SR830_SETTINGS]; // by the table in sr830.c
    double aux_out_v[SIM_SR830_AUX];
    unsigned event;                  // *ESR
    unsigned enable, request_enable; // *ESE, *SRE: kept
};

struct sim_sr830_port {
    struct port port; // first
    struct sim_sr830 *lia;
    struct sim_line line;
};

void sim_sr830_init(struct sim_sr830 *s, struct world *world, int64_t reply_ns);
void sim_sr830_port_init(struct sim_sr830_port *p, struct sim_sr830 *s);
