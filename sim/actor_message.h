// SPDX-License-Identifier: MIT
// The text side of an instrument made from a profile (sim/actor.h): commands in lines, matched
// against its exchanges, and answers with all that its framing puts around them. Several ports may
// lead to the same instrument. Thread: one.
//
// Any character of end_out ends a command and empty ones are nothing; without end_out what arrives
// together is one. A command sooner than gap_ms after the one before is ignored. Of exchanges that
// share what is sent all "then" are done, and the first answer is given. What is not known, or has
// a value that cannot be, is answered as "deny" says, else as the first refusal that the profile
// knows, else not at all.
#pragma once
#include "sim/actor.h"
#include "sim/port.h"

enum { ACTOR_LINE = 256 };

struct actor_message {
    struct port port; // first
    struct actor *actor;
    char in[ACTOR_LINE];
    size_t have;
};

void actor_message_init(struct actor_message *m, struct actor *actor);
