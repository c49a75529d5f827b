// SPDX-License-Identifier: MIT
#include "drivers/capture.h"

#include <string.h>

static void append(struct golden_bytes *b, const void *bytes, size_t size)
{
    const size_t room = sizeof b->byte - b->size, kept = size < room ? size : room;
    memcpy(b->byte + b->size, bytes, kept);
    b->size += kept;
}

static void take(void *ctx, enum tap_way way, const void *bytes, size_t size)
{
    struct capture *c = ctx;
    if (way == TAP_SENT && c->count == CAPTURE_MOST) {
        c->lost++;
    } else if (way == TAP_SENT) {
        c->exchange[c->count].sent.size = c->exchange[c->count].received.size = 0;
        append(&c->exchange[c->count++].sent, bytes, size);
    } else if (c->lost == 0) {
        append(c->count ? &c->exchange[c->count - 1].received : &c->stray, bytes, size);
    }
}

void capture_begin(struct capture *c)
{
    c->tap = (struct tap){take, c};
    capture_forget(c);
}

void capture_forget(struct capture *c)
{
    c->count = c->lost = 0;
    c->stray.size = 0;
}
