// SPDX-License-Identifier: MIT
// The fit thread: one fit at a time. It opens the campaign file for reading, reduces the readings,
// fits, and gives reduction and fit to the store thread, which tells the main thread when they are
// committed; a failure it tells the main thread itself. A core stepped by notes and a thread around
// it. A fit under way and all that wait are ended within 10 ms by the cancel token.
#pragma once
#include "base/err.h"

struct cancel;
struct fitter;
struct mail;
struct note;

struct fitter_links { // all borrowed for the fitter's life
    const struct cancel *cancel;
    struct mail *box; // the thread's own
    struct mail *to_main, *to_store;
};

struct fitter *fitter_new(const struct fitter_links *links); // the core; NULL without memory
void fitter_step(struct fitter *f, struct note *n);          // takes the note
void fitter_free(struct fitter *f);                          // NULL is fine

int fitter_start(const struct fitter_links *links, struct fitter **ret_fitter,
                 struct gon_error *err);
void fitter_join(struct fitter *f); // after NOTE_QUIT; frees it; NULL is fine
