// SPDX-License-Identifier: MIT
#include "daemon/events.h"

#include <assert.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Slot of an event: its id modulo the ring's size. The kept ids are next_id - count .. next_id - 1.
struct slot {
    char *text;
    size_t size;
};

struct events {
    struct slot *slots;
    size_t most, count;
    size_t bytes, most_bytes;
    uint64_t next_id;
};

struct events *events_new(size_t most, size_t most_bytes, uint64_t first_id)
{
    assert(most > 0 && first_id > 0);
    struct events *e = calloc(1, sizeof *e);
    struct slot *slots = calloc(most, sizeof *slots);
    if (!e || !slots) {
        free(e);
        free(slots);
        return NULL;
    }
    *e = (struct events){slots, most, 0, 0, most_bytes, first_id};
    return e;
}

static struct slot *slot(const struct events *e, uint64_t id)
{
    return &e->slots[id % e->most];
}

static void drop_oldest(struct events *e)
{
    struct slot *s = slot(e, events_oldest_id(e));
    e->bytes -= s->size;
    free(s->text);
    *s = (struct slot){0};
    e->count--;
}

void events_free(struct events *e)
{
    if (!e)
        return;
    while (e->count)
        drop_oldest(e);
    free(e->slots);
    free(e);
}

uint64_t events_add(struct events *e, const char *kind, const char *data)
{
    assert(data[0] == '{' && !strchr(data, '\n'));
    char *text;
    const char *rest = data + 1, *comma = *rest == '}' ? "" : ",";
    int n = asprintf(
        &text, "id: %" PRIu64 "\nevent: %s\ndata: {\"event\":\"%s\",\"id\":%" PRIu64 "%s%s\n\n",
        e->next_id, kind, kind, e->next_id, comma, rest);
    if (n < 0)
        return 0;
    while (e->count && (e->count == e->most || e->bytes + (size_t)n > e->most_bytes))
        drop_oldest(e);
    *slot(e, e->next_id) = (struct slot){text, (size_t)n};
    e->bytes += (size_t)n;
    e->count++;
    return e->next_id++;
}

uint64_t events_last_id(const struct events *e)
{
    return e->next_id - 1;
}

uint64_t events_oldest_id(const struct events *e)
{
    return e->next_id - e->count;
}

bool events_after(const struct events *e, uint64_t id, struct event_view *ret_view)
{
    uint64_t wanted = id + 1 > events_oldest_id(e) ? id + 1 : events_oldest_id(e);
    if (id >= events_last_id(e))
        return false;
    *ret_view = (struct event_view){wanted, slot(e, wanted)->text, slot(e, wanted)->size};
    return e->count > 0;
}
