// SPDX-License-Identifier: MIT
#include "daemon/hub_inside.h"

#include "base/cancel.h"
#include "campaign/state.h"
#include "daemon/material.h"
#include "daemon/note.h"
#include "daemon/view.h"

#include <stdio.h>

static struct note *about(enum note_kind kind, const struct run *run)
{
    struct note *n = note_new(kind);
    n->run = run->id;
    n->name = note_text(run->path);
    return n;
}

static void open_port(void *ctx, const struct run *run)
{
    struct hub *h = ctx;
    note_post(h->store_box, about(NOTE_OPEN, run));
}

static void start_port(void *ctx, const struct run *run, void *material)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_START, run);
    n->thing = material;
    n->drop = run_material_free;
    note_post(h->run_box, n);
}

static void fit_port(void *ctx, const struct run *run, int sweep, bool last)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_FIT_WANTED, run);
    n->sweep = sweep;
    n->last = last;
    note_post(h->fit_box, n);
}

static void close_port(void *ctx, const struct run *run, enum run_state as)
{
    struct hub *h = ctx;
    struct note *n = about(NOTE_CLOSE, run);
    n->state = as;
    n->text = note_text(run->text);
    note_post(h->store_box, n);
}

static void cancel_port(void *ctx)
{
    struct hub *h = ctx;
    cancel_request(h->cancel);
}

void hub_keep_queue(void *ctx)
{
    struct hub *h = ctx;
    if (!h->restored)
        return;
    struct queue_entry entries[MOST_KEPT];
    const size_t count = queue_entries(h->queue, entries, MOST_KEPT);
    struct note *n = note_new(NOTE_QUEUE);
    struct state_queue *kept = state_queue_new(count);
    for (size_t i = 0; kept && i < count; i++) {
        struct state_entry *e = &kept->entries[i];
        *e = (struct state_entry){
            .run = entries[i].run->id, .held = entries[i].run->held, .active = entries[i].active};
        snprintf(e->path, sizeof e->path, "%s", entries[i].run->path);
    }
    n->thing = kept;
    if (kept)
        note_post(h->store_box, n);
    else
        note_free(n);
    hub_publish(h, "queue", view_queue(h->queue));
}

static void rearm_port(void *ctx)
{
    struct hub *h = ctx;
    if (!h->ending)
        cancel_reset(h->cancel); // no worker is at work: none can miss it
}

struct queue_ports hub_queue_ports(struct hub *h)
{
    return (struct queue_ports){h,          open_port,   start_port,  fit_port,      close_port,
                                cancel_port, rearm_port, hub_changed, hub_keep_queue};
}
