// SPDX-License-Identifier: MIT
// The main thread's event loop: epoll over descriptors, timers and the signals that end the daemon.
// Callbacks run on the loop's thread and must not block.
#pragma once
#include "base/err.h"

#include <stdint.h>

struct loop;

struct loop *loop_new(struct gon_error *err);
void loop_free(struct loop *loop); // closes timers and the signal descriptor, not what others added

// Calls ready(ctx) while fd is readable. The descriptor stays the caller's.
int loop_add(struct loop *loop, int fd, void (*ready)(void *ctx), void *ctx, struct gon_error *err);
// Calls ready(ctx) while fd's peer has closed its end, and takes no notice of data.
int loop_add_hangup(struct loop *loop, int fd, void (*ready)(void *ctx), void *ctx,
                    struct gon_error *err);
void loop_remove(struct loop *loop, int fd);

// Calls ready(ctx) every interval_ms, until loop_free.
int loop_every(struct loop *loop, int interval_ms, void (*ready)(void *ctx), void *ctx,
               struct gon_error *err);

// Calls ready(ctx) with SIGINT, SIGTERM and SIGHUP, which must be blocked in every thread before.
int loop_signals(struct loop *loop, void (*ready)(void *ctx, int signal), void *ctx,
                 struct gon_error *err);

// Called after each round; returns the longest time to wait in ms, -1 for ever. For libraries that
// keep their own timeouts. One at most.
void loop_after(struct loop *loop, int (*after)(void *ctx), void *ctx);

void loop_run(struct loop *loop); // until loop_quit
void loop_quit(struct loop *loop);
