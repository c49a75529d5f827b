// SPDX-License-Identifier: MIT
#include "daemon/keeper.h"

#include "campaign/state.h"
#include "daemon/note.h"

#include <stdlib.h>

struct keeper {
    struct state *state;
    struct state_queue *earlier;
};

struct keeper *keeper_new(const char *directory, struct gon_error *err)
{
    struct keeper *k = calloc(1, sizeof *k);
    if (!k) {
        gon_fail(err, GON_E_SYSTEM, "store: out of memory");
        return NULL;
    }
    int rc = state_open(directory, &k->state, err);
    rc = rc < 0 ? rc : state_read_queue(k->state, &k->earlier, err);
    if (rc < 0) {
        keeper_free(k);
        return NULL;
    }
    return k;
}

void keeper_free(struct keeper *k)
{
    if (!k)
        return;
    state_close(k->state);
    free(k->earlier);
    free(k);
}

bool keeper_had(const struct keeper *k, int run)
{
    for (size_t i = 0; k->earlier && i < k->earlier->count; i++)
        if (k->earlier->entries[i].run == run)
            return true;
    return false;
}

struct note *keeper_restored(struct keeper *k)
{
    struct note *n = note_new(NOTE_RESTORED);
    n->thing = k->earlier;
    k->earlier = NULL;
    return n;
}

struct note *keeper_keep(struct keeper *k, const struct note *n)
{
    struct note *complaint = note_new(NOTE_UNKEPT);
    if (state_write_queue(k->state, n->thing, &complaint->err) < 0)
        return complaint;
    note_free(complaint);
    return NULL;
}
