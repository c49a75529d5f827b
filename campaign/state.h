// SPDX-License-Identifier: MIT
// What the daemon must still know after it died: state.db in the folder of the campaigns. It holds
// the queue; what was measured is in the campaign files, which are right when the two disagree.
// WAL, synchronous=FULL; each call is one transaction, written through when it returns. Thread: the
// store's.
//
// Whoever opens it has the folder (catalog_take). GON_E_REFUSED: a file of a newer gonio.
// GON_E_STORE: the file or its disk.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>

struct state;

#define STATE_FILE "state.db"

struct state_entry {
    int run;
    char path[512]; // of the campaign file
    bool held;      // waits until it is released
    bool active;    // had the bench
};

struct state_queue { // in its order
    size_t count;
    struct state_entry entries[];
};
struct state_queue *state_queue_new(size_t count); // zeroed; free it. NULL without memory

// Made when it is not there.
int state_open(const char *directory, struct state **ret_state, struct gon_error *err);
void state_close(struct state *s); // NULL is fine

int state_read_queue(struct state *s, struct state_queue **ret_queue, struct gon_error *err);
// Also when the file was removed meanwhile: it is made again.
int state_write_queue(struct state *s, const struct state_queue *q, struct gon_error *err);
