// SPDX-License-Identifier: MIT
#include "cli/show_exclusions.h"

#include "campaign/store_exclude.h"
#include "cli/out.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

// --- reading -------------------------------------------------------------------------------------

struct taking {
    struct exclusions *x;
    int room;
    bool failed;
};

static bool take(void *ctx, const struct store_exclusion *e)
{
    struct taking *t = ctx;
    if (t->x->count == t->room) {
        const int room = 2 * t->room + 64;
        struct exclusion *larger = realloc(t->x->list, (size_t)room * sizeof *larger);
        t->failed = !larger;
        if (!larger)
            return false;
        t->x->list = larger;
        t->room = room;
    }
    struct exclusion *k = &t->x->list[t->x->count++];
    *k = (struct exclusion){.id = e->id,
                            .t_utc_ms = e->t_utc_ms,
                            .sweep = e->sweep,
                            .point = e->point,
                            .attempt = e->attempt,
                            .reason = strdup(e->reason),
                            .who = strdup(e->who)};
    snprintf(k->what, sizeof k->what, "%s", e->what);
    t->failed = !k->reason || !k->who;
    return !t->failed;
}

static int by_reading(const struct exclusion *a, int sweep, int point, int attempt)
{
    if (a->sweep != sweep)
        return a->sweep < sweep ? -1 : 1;
    if (a->point != point)
        return a->point < point ? -1 : 1;
    return (a->attempt > attempt) - (a->attempt < attempt);
}

static int compare(const void *a, const void *b)
{
    const struct exclusion *x = a, *y = b;
    const int order = by_reading(x, y->sweep, y->point, y->attempt);
    return order ? order : (x->id > y->id) - (x->id < y->id);
}

// Of each reading the newest, unless that restores it.
static void keep_what_holds(struct exclusions *x)
{
    int kept = 0;
    for (int i = 0; i < x->count; i++) {
        struct exclusion *e = &x->list[i];
        const bool newest =
            i + 1 == x->count || by_reading(e, e[1].sweep, e[1].point, e[1].attempt);
        if (newest && strcmp(e->what, "restored")) {
            x->list[kept++] = *e;
            continue;
        }
        free(e->reason);
        free(e->who);
    }
    x->count = kept;
}

int exclusions_read(struct store *s, struct exclusions *ret_exclusions, struct gon_error *err)
{
    struct exclusions x = {0};
    struct taking t = {.x = &x};
    int rc = store_each_exclusion(s, take, &t, err);
    if (rc >= 0 && t.failed)
        rc = gon_fail(err, GON_E_SYSTEM, "show: out of memory");
    if (rc < 0) {
        exclusions_clear(&x);
        return rc;
    }
    if (x.count)
        qsort(x.list, (size_t)x.count, sizeof *x.list, compare);
    keep_what_holds(&x);
    *ret_exclusions = x;
    return GON_OK;
}

void exclusions_clear(struct exclusions *x)
{
    if (!x)
        return;
    for (int i = 0; i < x->count; i++) {
        free(x->list[i].reason);
        free(x->list[i].who);
    }
    free(x->list);
    *x = (struct exclusions){0};
}

const struct exclusion *exclusions_find(const struct exclusions *x, const struct store_reading *r)
{
    int low = 0, high = x->count;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        const int order = by_reading(&x->list[middle], r->sweep, r->point, r->attempt);
        if (order == 0)
            return &x->list[middle];
        low = order < 0 ? middle + 1 : low;
        high = order < 0 ? high : middle;
    }
    return NULL;
}

// --- showing -------------------------------------------------------------------------------------

static bool together(const struct exclusion *a, const struct exclusion *b)
{
    return a->t_utc_ms == b->t_utc_ms && a->sweep == b->sweep && !strcmp(a->what, b->what) &&
           !strcmp(a->reason, b->reason) && !strcmp(a->who, b->who) && b->point - a->point <= 1;
}

void exclusions_print(const struct exclusions *x)
{
    for (int i = 0, end; i < x->count; i = end) {
        const struct exclusion *e = &x->list[i];
        char when[40];
        for (end = i + 1; end < x->count && together(&x->list[end - 1], &x->list[end]); end++)
            continue;
        out_local(e->t_utc_ms, when, sizeof when);
        const int last = x->list[end - 1].point;
        if (last > e->point)
            printf("%-9s sweep %d, points %d to %d", e->what, e->sweep, e->point, last);
        else
            printf("%-9s sweep %d, point %d", e->what, e->sweep, e->point);
        printf(": %s (%s, %s)\n", e->reason, e->who, when);
    }
}

json_t *exclusions_json(const struct exclusions *x)
{
    json_t *all = json_array();
    for (int i = 0; i < x->count; i++) {
        const struct exclusion *e = &x->list[i];
        json_array_append_new(all, json_pack("{s:i, s:i, s:i, s:s, s:s, s:s, s:I}", "sweep",
                                             e->sweep, "point", e->point, "attempt", e->attempt,
                                             "what", e->what, "reason", e->reason, "who", e->who,
                                             "t_utc_ms", (json_int_t)e->t_utc_ms));
    }
    return all;
}
