// SPDX-License-Identifier: MIT
// The rows of the exclusions: what they say of a reading.
#include "campaign/store_exclude.h"

#include "base/crc32c.h"
#include "campaign/store_db.h"

#include <stdio.h>
#include <string.h>

static const char *const standings[] = {"restored", "excluded", "replaced", "repeated"};

bool store_reading_counts(const struct store_reading *r)
{
    return !(r->flags & STORE_REJECTING) && r->standing != STORE_EXCLUDED &&
           r->standing != STORE_REPLACED;
}

bool store_reading_settles(const struct store_reading *r)
{
    return !(r->flags & STORE_REJECTING) && r->standing != STORE_REPLACED &&
           r->standing != STORE_REPEATED;
}

static unsigned char *put(unsigned char *p, uint64_t value, int size)
{
    for (int i = 0; i < size; i++)
        *p++ = (unsigned char)(value >> (8 * i));
    return p;
}

uint32_t store_exclusion_crc(const struct store_exclusion *e)
{
    const char *const texts[] = {e->what, e->reason, e->who};
    unsigned char bytes[28], *p = bytes;
    p = put(p, (uint64_t)e->id, 8);
    p = put(p, (uint64_t)e->t_utc_ms, 8);
    p = put(p, (uint32_t)e->sweep, 4);
    p = put(p, (uint32_t)e->point, 4);
    put(p, (uint32_t)e->attempt, 4);
    uint32_t crc = crc32c(0, bytes, sizeof bytes);
    for (int i = 0; i < 3; i++)
        crc = crc32c(crc, texts[i], strlen(texts[i]) + 1);
    return crc;
}

const char *store_standing_name(enum store_standing standing)
{
    return standings[standing];
}

int store_standing_of(const char *what)
{
    for (int i = 0; i < (int)(sizeof standings / sizeof *standings); i++)
        if (!strcmp(what, standings[i]))
            return i;
    return -1;
}

static const char *text_of(sqlite3_stmt *q, int column)
{
    const char *text = (const char *)sqlite3_column_text(q, column);
    return text ? text : "";
}

struct store_exclusion store_db_exclusion(sqlite3_stmt *q)
{
    return (struct store_exclusion){.id = sqlite3_column_int64(q, 0),
                                    .t_utc_ms = sqlite3_column_int64(q, 1),
                                    .sweep = sqlite3_column_int(q, 2),
                                    .point = sqlite3_column_int(q, 3),
                                    .attempt = sqlite3_column_int(q, 4),
                                    .what = text_of(q, 5),
                                    .reason = text_of(q, 6),
                                    .who = text_of(q, 7)};
}

// What a damaged row says must not be believed: it would change every number after it.
static int take_row(struct store *s, sqlite3_stmt *q, struct store_exclusion *ret_row,
                    struct gon_error *err)
{
    const struct store_exclusion e = store_db_exclusion(q);
    if (sqlite3_column_int64(q, STORE_EXCLUSION_CRC) != store_exclusion_crc(&e) ||
        store_standing_of(e.what) < 0)
        return gon_fail(err, GON_E_STORE,
                        "%s: the exclusion %lld of sweep %d, point %d is damaged (its check value "
                        "is wrong); restore the file from a copy",
                        s->path, (long long)e.id, e.sweep, e.point);
    *ret_row = e;
    return GON_OK;
}

static int each_row(struct store *s, const char *order,
                    bool (*each)(void *ctx, const struct store_exclusion *e), void *ctx,
                    struct gon_error *err)
{
    char sql[160];
    sqlite3_stmt *q;
    int shown = 0, step = SQLITE_DONE, rc;
    if (s->version < STORE_VERSION_EXCLUSIONS)
        return 0;
    snprintf(sql, sizeof sql, "SELECT " STORE_EXCLUSION_COLUMNS " FROM exclusion ORDER BY %s",
             order);
    rc = store_db_prepare(s, sql, &q, err);
    if (rc < 0)
        return rc;
    for (bool more = true; rc >= 0 && more && (step = sqlite3_step(q)) == SQLITE_ROW;) {
        struct store_exclusion e;
        rc = take_row(s, q, &e, err);
        more = rc >= 0 && each(ctx, &e);
        shown += rc >= 0;
    }
    if (rc >= 0 && step != SQLITE_ROW && step != SQLITE_DONE)
        rc = store_db_fail(s, err);
    sqlite3_finalize(q);
    return rc < 0 ? rc : shown;
}

int store_each_exclusion(struct store *s, bool (*each)(void *ctx, const struct store_exclusion *e),
                         void *ctx, struct gon_error *err)
{
    return each_row(s, "id", each, ctx, err);
}

struct walk {
    struct store_reading *rows;
    int count, at;
};

static int order(const struct store_reading *r, const struct store_exclusion *e)
{
    if (r->sweep != e->sweep)
        return r->sweep < e->sweep ? -1 : 1;
    if (r->point != e->point)
        return r->point < e->point ? -1 : 1;
    return (r->attempt > e->attempt) - (r->attempt < e->attempt);
}

static bool take_standing(void *ctx, const struct store_exclusion *e)
{
    struct walk *w = ctx;
    while (w->at < w->count && order(&w->rows[w->at], e) < 0)
        w->at++;
    if (w->at < w->count && order(&w->rows[w->at], e) == 0) // a later row of it comes later
        w->rows[w->at].standing = (enum store_standing)store_standing_of(e->what);
    return w->at < w->count;
}

int store_take_standings(struct store *s, struct store_reading *rows, int count,
                         struct gon_error *err)
{
    struct walk w = {rows, count, 0};
    int rc = each_row(s, "sweep, point, attempt, id", take_standing, &w, err);
    return rc < 0 ? rc : count;
}
