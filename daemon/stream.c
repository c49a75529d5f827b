// SPDX-License-Identifier: MIT
#include "daemon/stream.h"

#include <inttypes.h>
#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_BYTES = 16 * 1024 };

struct stream *stream_new(struct MHD_Connection *connection, const struct events *events,
                          uint64_t seen)
{
    struct stream *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    *s = (struct stream){.connection = connection, .events = events, .seen = seen};
    s->text =
        strdup(": events of goniod\nretry: 1000\n\n"); // also tells the client that it is connected
    s->size = s->text ? strlen(s->text) : 0;
    return s;
}

void stream_free(struct stream *s)
{
    if (!s)
        return;
    free(s->text);
    free(s);
}

static bool take_text(struct stream *s, char *text, size_t size)
{
    free(s->text);
    s->text = text;
    s->size = text ? size : 0;
    s->sent = 0;
    return text != NULL;
}

// The ring went on without this reader: it must know.
static bool take_lost(struct stream *s, uint64_t first, uint64_t last)
{
    char *text;
    int n = asprintf(&text,
                     "event: lost\ndata: {\"event\":\"lost\",\"first\":%" PRIu64
                     ",\"last\":%" PRIu64 "}\n\n",
                     first, last);
    s->seen = last;
    return n >= 0 && take_text(s, text, (size_t)n);
}

// Puts the next thing to send into text; false when there is none.
static bool take_next(struct stream *s)
{
    struct event_view v;
    if (events_after(s->events, s->seen, &v)) {
        if (s->seen && v.id > s->seen + 1)
            return take_lost(s, s->seen + 1, v.id - 1);
        s->seen = v.id;
        s->ping = false;
        return take_text(s, strdup(v.text), v.size);
    }
    if (!s->ping)
        return false;
    s->ping = false;
    return take_text(s, strdup(": ping\n\n"), 8);
}

static ssize_t read_some(void *cls, uint64_t position, char *buffer, size_t most)
{
    struct stream *s = cls;
    (void)position;
    if (s->sent == s->size && s->closing)
        return MHD_CONTENT_READER_END_OF_STREAM;
    if (s->sent == s->size && !take_next(s)) {
        s->suspended = true;
        MHD_suspend_connection(s->connection);
        return 0;
    }
    size_t n = s->size - s->sent < most ? s->size - s->sent : most;
    memcpy(buffer, s->text + s->sent, n);
    s->sent += n;
    return (ssize_t)n;
}

struct MHD_Response *stream_response(struct stream *s)
{
    struct MHD_Response *r =
        MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, BLOCK_BYTES, read_some, s, NULL);
    if (r) {
        MHD_add_response_header(r, "Content-Type", "text/event-stream");
        MHD_add_response_header(r, "Cache-Control", "no-cache");
    }
    return r;
}

void stream_wake(struct stream *s)
{
    if (s->suspended) {
        s->suspended = false;
        MHD_resume_connection(s->connection);
    }
}

void stream_ping(struct stream *s)
{
    s->ping = true;
    stream_wake(s);
}

void stream_close(struct stream *s)
{
    s->closing = true;
    stream_wake(s);
}
