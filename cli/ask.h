// SPDX-License-Identifier: MIT
// A run asked for (GET /api/v1/runs/N) where the event stream does not tell: what has changed since
// the last answer becomes events like the stream's, without ids. Thread: one.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct ask;
struct json_t; // of jansson

// The events go to a function; it may not ask. socket as in client_new; requests give up as
// client_interrupt_by says.
int ask_new(const char *socket, int interrupt_fd, int run,
            void (*event)(void *ctx, const struct json_t *event), void *ctx, struct ask **ret_ask,
            struct gon_error *err);
void ask_free(struct ask *a); // NULL is fine

// Tells what is new: a reading, a sweep, a fit, then a state or its reason; the first time, all of
// it. GON_E_INPUT: the daemon does not know that run (any more); others as client_request.
int ask_changes(struct ask *a, struct gon_error *err);
// The same when the run has ended, and nothing while it goes on: a stream tells that.
int ask_end(struct ask *a, struct gon_error *err);

bool ask_is_end(const char *state); // done, stopped or failed
