// SPDX-License-Identifier: MIT
#include "cli/sse.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 4 * 1024 * 1024 }; // of one event; more than the daemon's whole ring

struct text {
    char *bytes;
    size_t size, room;
};

struct sse {
    void (*event)(void *ctx, const struct sse_event *event);
    void *ctx;
    struct text line, data;
    char kind[32], id[32], next_id[32]; // an id counts once its event was whole
    bool after_cr;
};

struct sse *sse_new(void (*event)(void *ctx, const struct sse_event *event), void *ctx)
{
    struct sse *s = calloc(1, sizeof *s);
    if (s)
        *s = (struct sse){.event = event, .ctx = ctx};
    return s;
}

void sse_free(struct sse *s)
{
    if (!s)
        return;
    free(s->line.bytes);
    free(s->data.bytes);
    free(s);
}

static int append(struct text *t, const char *bytes, size_t size)
{
    if (t->size + size + 1 > LONGEST)
        return GON_E_LINK;
    if (t->size + size + 1 > t->room) {
        size_t room = 2 * (t->size + size + 1);
        char *more = realloc(t->bytes, room);
        if (!more)
            return GON_E_SYSTEM;
        t->bytes = more;
        t->room = room;
    }
    memcpy(t->bytes + t->size, bytes, size);
    t->size += size;
    t->bytes[t->size] = 0;
    return GON_OK;
}

static void dispatch(struct sse *s)
{
    strcpy(s->id, s->next_id);
    if (s->data.size) {
        s->data.bytes[s->data.size - 1] = 0; // the last line's end
        s->event(s->ctx, &(struct sse_event){*s->kind ? s->kind : "message", s->id, s->data.bytes});
    }
    s->data.size = 0;
    *s->kind = 0;
}

static void keep(char *to, size_t room, const char *value)
{
    if (strlen(value) < room)
        strcpy(to, value);
}

static int take_line(struct sse *s)
{
    char *line = s->line.bytes;
    if (s->line.size == 0) {
        dispatch(s);
        return GON_OK;
    }
    s->line.size = 0;
    char *value = line + strcspn(line, ":");
    bool colon = *value == ':';
    *value = 0;
    value += colon;
    value += colon && *value == ' ';
    if (!strcmp(line, "event"))
        keep(s->kind, sizeof s->kind, value);
    else if (!strcmp(line, "id"))
        keep(s->next_id, sizeof s->next_id, value);
    else if (!strcmp(line, "data")) {
        int rc = append(&s->data, value, strlen(value));
        return rc < 0 ? rc : append(&s->data, "\n", 1);
    }
    return GON_OK;
}

int sse_feed(struct sse *s, const char *data, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        bool second = s->after_cr && data[i] == '\n';
        s->after_cr = data[i] == '\r';
        int rc = GON_OK;
        if (data[i] != '\n' && data[i] != '\r')
            rc = append(&s->line, &data[i], 1);
        else if (!second)
            rc = take_line(s);
        if (rc < 0)
            return rc;
    }
    return GON_OK;
}

void sse_reconnected(struct sse *s)
{
    s->line.size = s->data.size = 0;
    *s->kind = 0;
    strcpy(s->next_id, s->id);
    s->after_cr = false;
}

const char *sse_last_id(const struct sse *s)
{
    return s->id;
}
