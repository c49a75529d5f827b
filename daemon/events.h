// SPDX-License-Identifier: MIT
// What happened, for whoever watches: a bounded ring of server-sent events with increasing ids. A
// reader that was away asks for what came after the last id it saw; what no longer fits in the ring
// it is told to have lost. Pure memory, one thread.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct events;

struct event_view {
    uint64_t id;
    const char *text; // complete in the stream's syntax: "id: 7\nevent: reading\ndata: {...}\n\n"
    size_t size;
};

// Keeps at most this many events and bytes. Ids begin at first_id: let it grow from one start of
// the daemon to the next, so that an id of an earlier life is never mistaken for one of this.
struct events *events_new(size_t most, size_t most_bytes, uint64_t first_id);
void events_free(struct events *e);

// Adds {"event": kind, "id": N, then the members of data}; data is the text of a JSON object on one
// line. Returns the event's id, 0 without memory.
uint64_t events_add(struct events *e, const char *kind, const char *data);

// Of the newest ever added; first_id - 1 before that.
uint64_t events_last_id(const struct events *e);
uint64_t events_oldest_id(const struct events *e); // still kept; events_last_id + 1 when none is

// The oldest kept event with an id greater than this, borrowed until the next events_add.
bool events_after(const struct events *e, uint64_t id, struct event_view *ret_view);
