// SPDX-License-Identifier: MIT
// The store thread without a thread: the product's storer core, stepped when a note has reached it
// and it is not at work on an earlier one. Its work takes its own time (os.store_ns); its answers
// are posted when that has come. Thread: one.
#pragma once
#include "daemon/note.h"
#include "daemon/storer.h"

#include <stdbool.h>
#include <stdint.h>

struct shop {
    struct storer_links links;
    struct storer *core;
    struct mail *inbox, *answers; // answers: until they are due
    struct mail *to_runner, *to_main;
    int64_t busy_until_ns;
    bool due; // a step is on the agenda
    uint64_t steps;
};

// Borrows bench, its text and the mailboxes.
void shop_begin(struct shop *s, const struct bench_config *bench, const char *bench_text,
                struct mail *to_runner, struct mail *to_main);
void shop_end(struct shop *s);
void shop_post(struct shop *s, struct note *n);
// Lets time pass until an answer to main is there.
struct note *shop_ask(struct shop *s, struct note *n, enum note_kind answer);
