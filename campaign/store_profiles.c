// SPDX-License-Identifier: MIT
#include "base/crc32c.h"
#include "campaign/store_db.h"

#include <string.h>

uint32_t store_profile_crc(int64_t t_utc_ms, const struct store_profile *p)
{
    const char *const texts[] = {p->name, p->role, p->text};
    unsigned char bytes[8];
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)((uint64_t)t_utc_ms >> (8 * i));
    uint32_t crc = crc32c(0, bytes, sizeof bytes);
    for (int i = 0; i < 3; i++)
        crc = crc32c(crc, texts[i], strlen(texts[i]) + 1);
    return crc;
}

int store_put_profile(struct store *s, int64_t t_utc_ms, const struct store_profile *p,
                      struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(
        s,
        "INSERT INTO profile SELECT NULL, ?1, ?2, ?3, ?4, ?5 WHERE NOT EXISTS (SELECT 1"
        " FROM profile WHERE id = (SELECT max(id) FROM profile WHERE name = ?2)"
        " AND role = ?3 AND text = ?4)",
        &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, t_utc_ms);
    store_db_bind_text(q, 2, p->name);
    store_db_bind_text(q, 3, p->role);
    store_db_bind_text(q, 4, p->text);
    sqlite3_bind_int64(q, 5, store_profile_crc(t_utc_ms, p));
    return store_db_finish(s, q, err);
}

int store_append_profiles(struct store *s, int64_t t_utc_ms, const struct store_profile *profiles,
                          int count, struct gon_error *err)
{
    int rc = store_db_ready(s, err);
    if (rc >= 0)
        rc = store_db_begin(s, err);
    if (rc < 0)
        return rc;
    for (int i = 0; i < count && rc >= 0; i++)
        rc = store_put_profile(s, t_utc_ms, &profiles[i], err);
    return store_db_end(s, rc, err);
}

static const char *text_of(sqlite3_stmt *q, int column)
{
    const char *text = (const char *)sqlite3_column_text(q, column);
    return text ? text : "";
}

static int check(struct store *s, const struct store_kept_profile *p, sqlite3_int64 crc,
                 struct gon_error *err)
{
    if (crc == store_profile_crc(p->t_utc_ms, &p->profile))
        return GON_OK;
    return gon_fail(err, GON_E_STORE,
                    "%s: the profile %lld (%.60s) kept in it is damaged (its check value is "
                    "wrong); restore the file from a copy",
                    s->path, (long long)p->id, p->profile.name);
}

int store_each_profile(struct store *s, bool (*each)(void *ctx, const struct store_kept_profile *p),
                       void *ctx, struct gon_error *err)
{
    sqlite3_stmt *q;
    int shown = 0, step = SQLITE_DONE, rc = GON_OK;
    if (s->version < STORE_VERSION_PROFILES)
        return 0;
    rc = store_db_prepare(
        s, "SELECT id, t_utc_ms, name, role, text, crc32c FROM profile ORDER BY id", &q, err);
    if (rc < 0)
        return rc;
    for (bool more = true; rc >= 0 && more && (step = sqlite3_step(q)) == SQLITE_ROW;) {
        const struct store_kept_profile p = {sqlite3_column_int64(q, 0),
                                             sqlite3_column_int64(q, 1),
                                             {text_of(q, 2), text_of(q, 3), text_of(q, 4)}};
        rc = check(s, &p, sqlite3_column_int64(q, 5), err);
        more = rc >= 0 && each(ctx, &p);
        shown += rc >= 0;
    }
    if (rc >= 0 && step != SQLITE_ROW && step != SQLITE_DONE)
        rc = store_db_fail(s, err);
    sqlite3_finalize(q);
    return rc < 0 ? rc : shown;
}
