// SPDX-License-Identifier: MIT
// The store thread: the only one that writes campaign files. A core that is stepped by notes
// (storer_step) and a thread around it. It has at most one file open for writing; each reading is
// acknowledged to the instrument thread once it is committed, and a row that is offered again after
// an answer was lost is acknowledged again when it is the same.
#pragma once
#include "base/err.h"

struct bench_config;
struct clk;
struct mail;
struct note;
struct store_profile;
struct storer;

struct storer_links { // all borrowed for the storer's life
    struct clk *clk;        // for the times in the file
    const struct bench_config *bench;
    const char *bench_text; // as read, for the campaign files
    const char *directory;  // where new campaigns go
    struct mail *box;       // the thread's own
    struct mail *to_main, *to_runner;
    const struct store_profile *profiles; // that the bench names, as read, for the campaign files
    int profiles_count;
};

struct storer *storer_new(const struct storer_links *links); // the core; NULL without memory
void storer_step(struct storer *s, struct note *n); // takes the note; answers go to the mailboxes
void storer_free(struct storer *s);                          // closes what is open; NULL is fine

int storer_start(const struct storer_links *links, struct storer **ret_storer,
                 struct gon_error *err);
void storer_join(struct storer *s); // after NOTE_QUIT; frees it; NULL is fine
