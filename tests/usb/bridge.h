// SPDX-License-Identifier: MIT
// A port whose instrument is somewhere else, behind a TCP port of 127.0.0.1: one of goniosim's can
// so be plugged in over USB. What is fed is sent there, what comes from there is the answer.
// Answers are taken when the descriptor is readable; feeding and taking are the caller's to keep
// apart.
#pragma once
#include "sim/port.h"

struct bridge {
    struct port port; // first
    int fd;
};

struct bridge *bridge_new(int tcp_port); // NULL: nobody listens there
void bridge_free(struct bridge *b);      // NULL is fine
void bridge_take(struct bridge *b, int64_t t_ns);
