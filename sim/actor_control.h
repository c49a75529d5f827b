// SPDX-License-Identifier: MIT
// What the control socket (sim/request.h) can do to an instrument made from its profile: see
// sim/actor_served.h. Thread: the poll loop's.
#pragma once
#include "sim/actor.h"
#include "sim/request.h"

// The answer to one line, with its newline, to be freed; NULL without memory.
char *actor_control_answer(struct actor *actor, struct wire *wires, int wires_count,
                           const char *line, int64_t t_ns);
// For the whole bench: "values" and the "values" of "set", about this one.
void actor_control_values(struct request *r, struct actor *a);
void actor_control_set(struct request *r, struct actor *a, json_t *values);
