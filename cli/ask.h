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

// When the run has ended, tells all of its last reading, sweep, fit and state that was not told yet;
// nothing while it goes on, because the stream tells that. GON_E_INPUT: the daemon does not know
// that run (any more); others as client_request.
int ask_end(struct ask *a, struct gon_error *err);

bool ask_is_end(const char *state); // done, stopped or failed
