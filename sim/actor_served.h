// SPDX-License-Identifier: MIT
// One instrument made from its profile, on its wires: a pty named after the profile in the run
// directory, and NAME-tcp on 127.0.0.1. A Modbus instrument is the unit that was asked for, RTU on
// the pty and Modbus TCP. Thread: the poll loop's.
//
// On the control socket, besides what concerns wires (sim/request.h):
//   {"do":"state"}   {"do":"values"}   {"do":"power-cycle"}
//   {"do":"set","values":{"interlock":1, "mode":"warming", "status.fault":true}}
#pragma once
#include "sim/actor.h"
#include "sim/server.h"

#include <stdio.h>

struct actor_spec {
    const struct profile *profile; // borrowed
    int unit;                      // Modbus
    bool enforce;                  // the line's baud rate
};

int actor_served_new(const struct actor_spec *spec, struct served **ret_served,
                     struct gon_error *err);
// How it is reached, a line each: "serial:DIR/NAME?baud=115200". Once it is open.
void actor_served_links(const struct served *s, FILE *out);
