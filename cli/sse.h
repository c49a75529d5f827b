// SPDX-License-Identifier: MIT
// Server-sent events from a stream of bytes, cut anywhere: fields end with LF, CR or CRLF, an event
// with an empty line; comments and unknown fields are skipped. Pure; one thread.
#pragma once
#include "base/err.h"

#include <stddef.h>

struct sse;

struct sse_event {
    const char *kind; // "message" when the stream named none
    const char *id;   // the last that the stream gave, "" before it did
    const char *data;
};

// The event is borrowed for the call.
struct sse *sse_new(void (*event)(void *ctx, const struct sse_event *event), void *ctx);
void sse_free(struct sse *s);
// GON_E_SYSTEM without memory, GON_E_LINK: an event too long.
int sse_feed(struct sse *s, const char *data, size_t size);
void sse_reconnected(struct sse *s); // forgets what is half read, keeps the id
const char *sse_last_id(const struct sse *s);
