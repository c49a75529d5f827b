// SPDX-License-Identifier: MIT
// A mailbox: a queue of messages from any thread to the one that owns the box. Messages are owned
// by whoever holds them: posting gives them away, taking receives them.
#pragma once
#include <stdint.h>

struct mail; // a mailbox
struct cancel;

// First member of every message type.
struct letter {
    struct letter *next;
    int kind; // meaning is the owner's
};

struct mail *mail_new(void); // NULL without memory or descriptors
void mail_free(struct mail *m,
               void (*drop)(struct letter *));    // drop (may be NULL) gets what is left
void mail_post(struct mail *m, struct letter *l); // any thread; never blocks, never fails
struct letter *mail_take(struct mail *m);         // the oldest, or NULL
int mail_fd(const struct mail *m);                // readable while there may be mail
// Waits up to timeout_ms (-1: for ever) for a letter; NULL on timeout or when cancel is requested.
struct letter *mail_wait(struct mail *m, int timeout_ms, const struct cancel *cancel);
