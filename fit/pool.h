// SPDX-License-Identifier: MIT
// Threads that share the work of one call into fit/: started when it begins, joined when it ends.
// The calling thread is one of them, and alone asks whether the call is canceled; the others learn
// of it from a flag. Between two runs they wait, at first awake (some 20 us), then asleep.
//
// Whatever the number of threads, results are the same to the bit: a task writes only what belongs
// to its index, and whoever needs a sum adds the parts in the order of their indices.
#pragma once
#include "fit/control.h"

#define POOL_MOST 64 // threads

struct pool;

// NULL for one thread, and when not one more could be had: all work is the caller's then. With
// fewer than asked for it is slower and the same.
struct pool *pool_new(int threads);
void pool_free(struct pool *pool); // NULL is fine

// Part `index` of a computation; control is the thread's own. False when canceled.
typedef bool pool_task(void *ctx, int index, struct fit_control *control);

// Runs every index of [0, count) once, on any thread of control->pool and in any order; without a
// pool in their order. Tasks do not share their own work further (control->pool is NULL in them)
// unless there is only one. False when canceled, by any of them.
bool pool_run(struct fit_control *control, int count, pool_task *task, void *ctx);

// The same for a long array: [0, count) in at most POOL_PARTS ranges of equal length, at least
// `least`, which depend on count and least alone. A task asks control itself when a range is long.
#define POOL_PARTS 64
typedef bool pool_range(void *ctx, int part, size_t from, size_t to, struct fit_control *control);
size_t pool_range_length(size_t count, size_t least);
bool pool_ranges(struct fit_control *control, size_t count, size_t least, pool_range *task,
                 void *ctx);
