// SPDX-License-Identifier: MIT
// One client's stream of server-sent events, fed from the ring. A stream with nothing to send is
// suspended, so that the library does not spin; a suspended connection does not notice that its
// client went away, so each gets a comment every 10 s, and all are resumed before the server stops.
// Thread: main.
#pragma once
#include "daemon/events.h"

#include <stdbool.h>
#include <stdint.h>

struct MHD_Connection;
struct MHD_Response;

struct stream {
    struct stream *next;
    struct MHD_Connection *connection;
    const struct events *events;
    uint64_t seen;      // id of the last event put into text
    char *text;         // being sent
    size_t size, sent;
    bool suspended, ping, closing;
};

// Starts after the event with this id.
struct stream *stream_new(struct MHD_Connection *connection, const struct events *events,
                          uint64_t seen);
void stream_free(struct stream *s);

// The response that sends it; the stream must outlive the connection's request. NULL without
// memory.
struct MHD_Response *stream_response(struct stream *s);

void stream_wake(struct stream *s);  // there may be events
void stream_ping(struct stream *s);  // sends a comment
void stream_close(struct stream *s); // ends after what is being sent
