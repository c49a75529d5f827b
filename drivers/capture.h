// SPDX-License-Identifier: MIT
// What went over a link, as exchanges: everything that came after something was sent, and before
// the next was, is its answer. Give its tap to transport_tap or bus_tap. Thread: the transport's.
#pragma once
#include "drivers/golden_peer.h"
#include "drivers/tap.h"

enum { CAPTURE_MOST = 64 };

struct captured {
    struct golden_bytes sent, received; // as they went, terminators and frames included
};

struct capture {
    struct tap tap;
    struct captured exchange[CAPTURE_MOST];
    int count;
    struct golden_bytes stray; // came before anything was sent
    int lost;                  // exchanges that found no room
};

void capture_begin(struct capture *c);  // also to begin anew
void capture_forget(struct capture *c); // what was captured so far; the tap stays
