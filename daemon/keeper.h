// SPDX-License-Identifier: MIT
// The queue on disk, for the store thread: what campaign/state.h keeps, spoken in notes. Thread:
// store.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct keeper;
struct note;
struct state_queue;

// Opens state.db in the folder. NULL, with err as state_open says.
struct keeper *keeper_new(const char *directory, struct gon_error *err);
void keeper_free(struct keeper *k); // NULL is fine

bool keeper_had(const struct keeper *k, int run); // in the queue of the earlier life
struct note *keeper_restored(struct keeper *k);   // NOTE_RESTORED
// NOTE_QUEUE: written. NOTE_UNKEPT when it could not be; NULL when it was.
struct note *keeper_keep(struct keeper *k, const struct note *n);
