// SPDX-License-Identifier: MIT
// The guard: what decides that a laser goes off. A state machine that is stepped by (now, event)
// and answers with what is to be done; it has no clock, no I/O and no memory but its struct, so
// that tests and a simulation on one thread can run it. guard/main.c is the process around it.
//
//  - Without a record it forwards nothing. With one it first sends OFF, until that was read back.
//  - It forwards only whole commands. One that may bring light begins the lease (500 ms), which the
//    client renews. A lease that ran out, a client that is gone, a STOP and a signal mean OFF.
//  - OFF goes out at once, whatever the gap, and again after the gap; then the laser is asked. As
//    long as it does not say off, is silent, or its port is gone (it is opened again), this goes
//    on.
//  - OFF that the client did not ask for is latched: nothing is forwarded until the client asks for
//    OFF itself, so that a client that hung cannot go on as if nothing had been.
//  - With the client gone and OFF read back it ends.
//
// A second device (the shutter) is a second struct guard in the same process. Thread: one.
#pragma once
#include "guard/talk.h"

#include <stddef.h>

enum guard_event_kind {
    GUARD_ON_TIME,    // guard_next_ns has come
    GUARD_ON_MESSAGE, // bytes: of the client's, whole
    GUARD_ON_GONE,    // the client is
    GUARD_ON_STOP,    // the STOP socket
    GUARD_ON_SIGNAL,
    GUARD_ON_OPENED, // code, text: what came of GUARD_OPEN
    GUARD_ON_DONE,   // code, text: of GUARD_WRITE and GUARD_CLEAR, and of GUARD_READ without bytes
    GUARD_ON_BYTES   // from the laser; ended: of a message
};

struct guard_event {
    enum guard_event_kind kind;
    const void *bytes;
    size_t size; // at least 1 and at most GUARD_DATA where there are bytes
    bool ended;
    int code; // enum gon_code; GON_E_GONE: the port is
    const char *text;
};

enum guard_act_kind {
    GUARD_OPEN,  // the port of the record; closed before
    GUARD_WRITE, // to the laser
    GUARD_READ,  // framed links: a message, for wait_ns
    GUARD_CLEAR, // framed links
    GUARD_TELL,  // the client
    GUARD_SAY,   // a line to all who wait at the STOP socket
    GUARD_END
};

struct guard_act {
    enum guard_act_kind kind;
    int64_t wait_ns;
    size_t size;
    char bytes[GUARD_DATA + 2];
};

enum { GUARD_ACTS = 4 };

struct guard_acts {
    int count;
    struct guard_act act[GUARD_ACTS];
};

enum guard_step { GUARD_STEP_OPEN, GUARD_STEP_OFF, GUARD_STEP_ASK, GUARD_STEP_ANSWER };

struct guard {
    struct guard_record record;
    struct guard_status status, told;
    bool client, open;
    bool waits; // the client, for what comes of its R, D, A or C
    bool heard; // something, since the question
    bool owed;  // an answer may still come that is none to our question
    enum guard_step step;
    int64_t due_ns, ready_ns, lease_ns; // the next step, the next command, the lease's end
    uint32_t asked;                     // the number of the last X
    unsigned round, ask;
    size_t have;
    char in[GUARD_DATA];
};

void guard_init(struct guard *g);
int64_t guard_next_ns(const struct guard *g); // when GUARD_ON_TIME is due; INT64_MAX: never
// What is to be done, in this order; what comes of it are further events.
void guard_step(struct guard *g, int64_t now_ns, const struct guard_event *e,
                struct guard_acts *ret_acts);
