// SPDX-License-Identifier: MIT
#include "base/crc32c.h"
#include "base/units.h"
#include "campaign/store_db.h"
#include "campaign/store_row.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double real_or_nan(sqlite3_stmt *q, int column)
{
    return sqlite3_column_type(q, column) == SQLITE_NULL ? (double)NAN
                                                         : sqlite3_column_double(q, column);
}

static void copy_text(sqlite3_stmt *q, int column, char *text, size_t size)
{
    const char *found = (const char *)sqlite3_column_text(q, column);
    if (size)
        snprintf(text, size, "%s", found ? found : "");
}

// --- plan ----------------------------------------------------------------------------------------

static int state_of(sqlite3_stmt *q, int column)
{
    const char *name = (const char *)sqlite3_column_text(q, column);
    const int state = name ? polarisation_find(name) : -1;
    return state < 0 ? POL_UNKNOWN : state;
}

static int add_point(struct plan *p, int *room, sqlite3_stmt *q)
{
    if (p->count == *room) {
        struct plan_point *larger = realloc(p->points, (size_t)(*room * 2 + 1024) * sizeof *larger);
        if (!larger)
            return GON_E_SYSTEM;
        p->points = larger;
        *room = *room * 2 + 1024;
    }
    const char *kind = (const char *)sqlite3_column_text(q, 2);
    struct plan_point *point = &p->points[p->count++];
    *point = (struct plan_point){.sweep = sqlite3_column_int(q, 0),
                                 .point = sqlite3_column_int(q, 1),
                                 .kind = !strcmp(kind, "dark")   ? PLAN_DARK
                                         : !strcmp(kind, "beam") ? PLAN_BEAM
                                                                 : PLAN_SAMPLE,
                                 .theta_i_deg = units_deg_of_udeg(sqlite3_column_int64(q, 4)),
                                 .theta_r_deg = units_deg_of_udeg(sqlite3_column_int64(q, 5)),
                                 .weight = sqlite3_column_double(q, 6),
                                 .dense = sqlite3_column_int(q, 7),
                                 .pol_in = state_of(q, 8),
                                 .pol_out = state_of(q, 9)};
    copy_text(q, 3, point->station, sizeof point->station);
    p->samples += point->kind == PLAN_SAMPLE;
    return GON_OK;
}

static int read_points(struct store *s, struct plan *p, struct gon_error *err)
{
    sqlite3_stmt *q;
    int room = 0, step,
        rc = store_db_prepare(
            s,
            "SELECT sweep, point, kind, station, theta_i_udeg, theta_r_udeg, weight,"
            " dense, pol_in, pol_out FROM plan ORDER BY sweep, point",
            &q, err);
    if (rc < 0)
        return rc;
    while ((step = sqlite3_step(q)) == SQLITE_ROW && rc >= 0)
        if (add_point(p, &room, q) < 0)
            rc = gon_fail(err, GON_E_SYSTEM, "%s: out of memory", s->path);
    if (rc >= 0 && step != SQLITE_DONE)
        rc = store_db_fail(s, err);
    sqlite3_finalize(q);
    return rc;
}

// Both are in the order of the plan.
static void mark_done(struct plan *p, const struct store_reading *rows, int count)
{
    for (int i = 0, k = 0; i < p->count; i++) {
        struct plan_point *point = &p->points[i];
        for (; k < count && rows[k].sweep == point->sweep && rows[k].point == point->point; k++) {
            point->attempts = rows[k].attempt;
            const bool accepted = !(rows[k].flags & STORE_REJECTING);
            point->done = point->done || store_reading_settles(&rows[k]);
            point->again = !point->done && (point->again || accepted);
            point->excluded += accepted && !store_reading_counts(&rows[k]);
        }
    }
}

int store_check_plan(struct store *s, struct gon_error *err)
{
    uint32_t crc;
    char text[16];
    int rc = store_plan_crc(s, &crc, err);
    if (rc < 0)
        return rc;
    snprintf(text, sizeof text, "%08x", crc);
    char *wanted = store_read_meta(s, "plan_crc32c");
    if (!wanted || strcmp(text, wanted))
        rc = gon_fail(err, GON_E_STORE,
                      "%s: the plan kept in it is damaged (its check value is wrong); restore the "
                      "file from a copy",
                      s->path);
    free(wanted);
    return rc;
}

int store_read_plan(struct store *s, struct plan *ret_plan, struct gon_error *err)
{
    struct plan p = {.duration_s = (double)NAN};
    struct store_reading *rows = NULL;
    int rc = store_check_plan(s, err);
    if (rc >= 0)
        rc = read_points(s, &p, err);
    if (rc >= 0 && p.count == 0)
        rc = gon_fail(err, GON_E_STORE, "%s: has no plan", s->path);
    int count = rc >= 0 ? store_read_readings(s, -1, &rows, err) : rc;
    if (count < 0) {
        plan_clear(&p);
        return count;
    }
    mark_done(&p, rows, count);
    free(rows);
    p.sweeps = p.points[p.count - 1].sweep - 1; // the closing references come after the last
    *ret_plan = p;
    return GON_OK;
}

int store_read_progress(struct store *s, struct store_progress *ret_progress, struct gon_error *err)
{
    struct plan p;
    int rc = store_read_plan(s, &p, err);
    if (rc < 0)
        return rc;
    struct store_progress progress = {
        .total = p.count, .sweep = -1, .point = -1, .sweeps = p.sweeps};
    for (int i = 0, open = 0; i < p.count; i++) {
        const struct plan_point *point = &p.points[i];
        open = i && p.points[i - 1].sweep == point->sweep ? open + !point->done : !point->done;
        progress.done += point->done;
        progress.again += point->again;
        progress.readings += point->attempts;
        progress.excluded += point->excluded;
        if (!point->done && progress.sweep < 0) {
            progress.sweep = point->sweep;
            progress.point = point->point;
        }
        const bool last = i + 1 == p.count || p.points[i + 1].sweep != point->sweep;
        if (point->kind == PLAN_SAMPLE && !open && last)
            progress.sweeps_done++;
    }
    plan_clear(&p);
    *ret_progress = progress;
    return GON_OK;
}

// --- readings ------------------------------------------------------------------------------------

struct store_reading store_db_reading(sqlite3_stmt *q)
{
    return (struct store_reading){
        .sweep = sqlite3_column_int(q, 0),
        .point = sqlite3_column_int(q, 1),
        .attempt = sqlite3_column_int(q, 2),
        .t_utc_ms = sqlite3_column_int64(q, 3),
        .theta_i_udeg = sqlite3_column_int(q, 4),
        .theta_r_udeg = sqlite3_column_int(q, 5),
        .signal_v = real_or_nan(q, 6),
        .signal_sd_v = real_or_nan(q, 7),
        .monitor_v = real_or_nan(q, 8),
        .monitor_sd_v = real_or_nan(q, 9),
        .count = sqlite3_column_int(q, 10),
        .range = sqlite3_column_int(q, 11),
        .flags = (unsigned)sqlite3_column_int64(q, 12),
    };
}

static int read_rows(struct store *s, sqlite3_stmt *q, struct store_reading **rows,
                     struct gon_error *err)
{
    int count = 0, room = 0, step;
    while ((step = sqlite3_step(q)) == SQLITE_ROW) {
        if (count == room) {
            struct store_reading *larger =
                realloc(*rows, (size_t)(room * 2 + 1024) * sizeof *larger);
            if (!larger)
                return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", s->path);
            *rows = larger;
            room = room * 2 + 1024;
        }
        struct store_reading *r = &(*rows)[count++];
        *r = store_db_reading(q);
        if (sqlite3_column_int64(q, STORE_READING_CRC) != store_row_crc(r))
            return gon_fail(err, GON_E_STORE,
                            "%s: sweep %d, point %d, attempt %d is damaged (its check value is "
                            "wrong); restore the file "
                            "from a copy",
                            s->path, r->sweep, r->point, r->attempt);
    }
    return step == SQLITE_DONE ? count : store_db_fail(s, err);
}

int store_read_readings(struct store *s, int sweep, struct store_reading **ret_rows,
                        struct gon_error *err)
{
    sqlite3_stmt *q;
    struct store_reading *rows = NULL;
    // Two statements: a condition for both would read the whole table for one sweep.
    const char *sql = sweep < 0 ? "SELECT " STORE_READING_COLUMNS
                                  " FROM reading ORDER BY sweep, point, attempt"
                                : "SELECT " STORE_READING_COLUMNS
                                  " FROM reading WHERE sweep = ?1 ORDER BY point, attempt";
    int rc = store_db_prepare(s, sql, &q, err);
    if (rc < 0)
        return rc;
    if (sweep >= 0)
        sqlite3_bind_int(q, 1, sweep);
    rc = read_rows(s, q, &rows, err);
    sqlite3_finalize(q);
    if (rc > 0)
        rc = store_take_standings(s, rows, rc, err);
    if (rc < 0)
        free(rows);
    else
        *ret_rows = rows;
    return rc;
}

// --- texts ---------------------------------------------------------------------------------------

static char *read_text(struct store *s, const char *sql, const char *key, int number)
{
    sqlite3_stmt *q;
    char *text = NULL;
    if (store_db_prepare(s, sql, &q, NULL) < 0)
        return NULL;
    if (key)
        store_db_bind_text(q, 1, key);
    else
        sqlite3_bind_int(q, 1, number);
    if (sqlite3_step(q) == SQLITE_ROW && sqlite3_column_type(q, 0) != SQLITE_NULL)
        text = strdup((const char *)sqlite3_column_text(q, 0));
    sqlite3_finalize(q);
    return text;
}

char *store_read_meta(struct store *s, const char *key)
{
    return read_text(s, "SELECT value FROM meta WHERE key = ?1", key, 0);
}

char *store_read_fit(struct store *s, int sweep)
{
    return read_text(s, "SELECT json FROM fit WHERE ?1 < 0 OR sweep = ?1 ORDER BY id DESC LIMIT 1",
                     NULL, sweep);
}

// A text of meta whose check value stands beside it; free it.
static char *checked_text(struct store *s, const char *key, struct gon_error *err)
{
    char crc_key[40], crc[16] = "";
    snprintf(crc_key, sizeof crc_key, "%s_crc32c", key);
    char *text = store_read_meta(s, key), *wanted = store_read_meta(s, crc_key);
    if (text)
        snprintf(crc, sizeof crc, "%08x", crc32c(0, text, strlen(text)));
    if (!text || !wanted || strcmp(crc, wanted)) {
        gon_fail(err, GON_E_STORE,
                 "%s: the %s kept in it is damaged or missing; restore the file from a copy",
                 s->path, key);
        free(text);
        text = NULL;
    }
    free(wanted);
    return text;
}

static void keep_first(void *ctx, const char *line)
{
    struct gon_error *err = ctx;
    if (err && err->code == GON_OK)
        gon_fail(err, GON_E_INPUT, "%s", line);
}

int store_read_config(struct store *s, struct campaign_config *ret_config, struct gon_error *err)
{
    struct gon_error why = {0};
    char *text = checked_text(s, "config", err), *name = store_read_meta(s, "config_name");
    int rc = text ? campaign_config_parse(text, name ? name : "config",
                                          (struct cfg_sink){keep_first, &why}, ret_config)
                  : GON_E_STORE;
    if (text && rc < 0)
        gon_fail(err, (enum gon_code)rc, "%s: its campaign cannot be read any more: %.300s",
                 s->path, why.text);
    free(text);
    free(name);
    return rc;
}

int store_read_bench(struct store *s, struct bench_config *ret_bench, struct gon_error *err)
{
    struct gon_error why = {0};
    char *text = checked_text(s, "bench", err);
    int rc = text
                 ? bench_config_parse(text, "bench", (struct cfg_sink){keep_first, &why}, ret_bench)
                 : GON_E_STORE;
    if (text && rc < 0)
        gon_fail(err, (enum gon_code)rc, "%s: its bench cannot be read any more: %.300s", s->path,
                 why.text);
    free(text);
    return rc;
}

// --- history -------------------------------------------------------------------------------------

int store_read_state(struct store *s, char *ret_state, size_t state_size, char *ret_why,
                     size_t why_size, int64_t *ret_since_ms, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(s, "SELECT state, why, t_utc_ms FROM state ORDER BY id DESC LIMIT 1",
                              &q, err);
    if (rc < 0)
        return rc;
    int step = sqlite3_step(q);
    if (step != SQLITE_ROW && step != SQLITE_DONE) {
        rc = store_db_fail(s, err);
    } else { // no row: columns read as NULL and 0
        if (ret_state)
            copy_text(q, 0, ret_state, state_size);
        if (ret_why)
            copy_text(q, 1, ret_why, why_size);
        if (ret_since_ms)
            *ret_since_ms = sqlite3_column_int64(q, 2);
    }
    sqlite3_finalize(q);
    return rc;
}

int64_t store_read_state_time(struct store *s, const char *state)
{
    char *text = read_text(s, "SELECT min(t_utc_ms) FROM state WHERE state = ?1", state, 0);
    int64_t t = text ? atoll(text) : 0;
    free(text);
    return t;
}

int store_each_event(struct store *s, int64_t after_id,
                     bool (*each)(void *ctx, const struct store_event *e), void *ctx,
                     struct gon_error *err)
{
    sqlite3_stmt *q;
    int shown = 0, step = SQLITE_DONE;
    int rc = store_db_prepare(
        s, "SELECT id, t_utc_ms, level, source, text FROM event WHERE id > ?1 ORDER BY id", &q,
        err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, after_id);
    for (bool more = true; more && (step = sqlite3_step(q)) == SQLITE_ROW; shown++) {
        struct store_event e = {.id = sqlite3_column_int64(q, 0),
                                .t_utc_ms = sqlite3_column_int64(q, 1)};
        copy_text(q, 2, e.level, sizeof e.level);
        copy_text(q, 3, e.source, sizeof e.source);
        e.text = (const char *)sqlite3_column_text(q, 4);
        more = each(ctx, &e);
    }
    rc = step == SQLITE_ROW || step == SQLITE_DONE ? shown : store_db_fail(s, err);
    sqlite3_finalize(q);
    return rc;
}

int store_read_fits(struct store *s, int64_t *ret_ids, int *ret_sweeps, int most,
                    struct gon_error *err)
{
    sqlite3_stmt *q;
    int count = 0, step = SQLITE_DONE;
    int rc = store_db_prepare(s, "SELECT id, sweep FROM fit ORDER BY id", &q, err);
    if (rc < 0)
        return rc;
    while (count < most && (step = sqlite3_step(q)) == SQLITE_ROW) {
        ret_ids[count] = sqlite3_column_int64(q, 0);
        ret_sweeps[count++] = sqlite3_column_int(q, 1);
    }
    rc = step == SQLITE_ROW || step == SQLITE_DONE ? count : store_db_fail(s, err);
    sqlite3_finalize(q);
    return rc;
}
