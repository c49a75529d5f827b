// SPDX-License-Identifier: MIT
// Ctrl-C (SIGINT, SIGTERM) as something that is asked for instead of an end in the middle.
// Thread: the only one.
#pragma once
#include <signal.h>
#include <stdbool.h>

struct interrupt {
    int fd; // readable once a signal came; -1: they end the program as usual
    sigset_t before;
};

void interrupt_open(struct interrupt *ret_interrupt);
// A signal that came is not delivered once more.
void interrupt_close(struct interrupt *i);
// Whether one came, waiting for it at most so long.
bool interrupt_came(const struct interrupt *i, int timeout_ms);
