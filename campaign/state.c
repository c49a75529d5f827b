// SPDX-License-Identifier: MIT
#include "campaign/state.h"

#include "campaign/store_watch.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    STATE_APPLICATION = 0x676f6e73, // "gons"
    STATE_VERSION = 1,
    STATE_PATIENCE_MS = 8000
};

struct state {
    sqlite3 *db;
    struct store_watch file; // as it was opened
    char path[512];
};

static const char schema[] =
    "CREATE TABLE queue(place INTEGER PRIMARY KEY, run INTEGER NOT NULL UNIQUE CHECK(run > 0),"
    " path TEXT NOT NULL, held INTEGER NOT NULL, active INTEGER NOT NULL) STRICT";

// --- SQLite with our errors ----------------------------------------------------------------------

static int fail(struct state *s, struct gon_error *err)
{
    const int rc = s->db ? sqlite3_errcode(s->db) & 0xff : SQLITE_NOMEM;
    const char *text = s->db ? sqlite3_errmsg(s->db) : "out of memory";
    if (rc == SQLITE_CORRUPT || rc == SQLITE_NOTADB)
        return gon_fail(err, GON_E_STORE,
                        "%s: %s; move it away to begin with an empty queue (no reading is in it)",
                        s->path, text);
    return gon_fail(err, GON_E_STORE, "%s: %s; look at the disk", s->path, text);
}

static int run(struct state *s, const char *sql, struct gon_error *err)
{
    return sqlite3_exec(s->db, sql, NULL, NULL, NULL) == SQLITE_OK ? GON_OK : fail(s, err);
}

static int prepare(struct state *s, const char *sql, sqlite3_stmt **ret_statement,
                   struct gon_error *err)
{
    return sqlite3_prepare_v2(s->db, sql, -1, ret_statement, NULL) == SQLITE_OK ? GON_OK
                                                                                : fail(s, err);
}

static int number(struct state *s, const char *sql, int64_t *ret_value, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = prepare(s, sql, &statement, err);
    if (rc < 0)
        return rc;
    rc = sqlite3_step(statement) == SQLITE_ROW ? GON_OK : fail(s, err);
    *ret_value = rc < 0 ? 0 : sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return rc;
}

// --- opening -------------------------------------------------------------------------------------

static int make_tables(struct state *s, struct gon_error *err)
{
    char sql[700];
    snprintf(sql, sizeof sql,
             "BEGIN IMMEDIATE; PRAGMA application_id=%d; PRAGMA user_version=%d; %s; COMMIT",
             STATE_APPLICATION, STATE_VERSION, schema);
    return run(s, sql, err);
}

static int check_tables(struct state *s, struct gon_error *err)
{
    int64_t application, version, tables;
    int rc = number(s, "PRAGMA application_id", &application, err);
    rc = rc < 0 ? rc : number(s, "PRAGMA user_version", &version, err);
    rc = rc < 0 ? rc : number(s, "SELECT count(*) FROM sqlite_schema", &tables, err);
    if (rc < 0)
        return rc;
    if (!application && !tables)
        return make_tables(s, err);
    if (application != STATE_APPLICATION)
        return gon_fail(err, GON_E_STORE, "%s: not written by gonio; move it away", s->path);
    if (version > STATE_VERSION)
        return gon_fail(err, GON_E_REFUSED,
                        "%s: version %lld, this gonio knows %d; use the newer gonio, or move the "
                        "file away to begin with an empty queue",
                        s->path, (long long)version, STATE_VERSION);
    return run(s, "SELECT place, run, path, held, active FROM queue", err);
}

static int open_db(struct state *s, struct gon_error *err)
{
    if (sqlite3_open_v2(s->path, &s->db,
                        SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX,
                        NULL) != SQLITE_OK)
        return fail(s, err);
    sqlite3_busy_timeout(s->db, STATE_PATIENCE_MS);
    int rc = run(s, "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL", err);
    rc = rc < 0 ? rc : check_tables(s, err);
    store_watch_begin(&s->file, s->path);
    return rc;
}

int state_open(const char *directory, struct state **ret_state, struct gon_error *err)
{
    struct state *s = calloc(1, sizeof *s);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, STATE_FILE ": out of memory");
    int rc = GON_OK;
    if (snprintf(s->path, sizeof s->path, "%s/" STATE_FILE, directory) >= (int)sizeof s->path)
        rc = gon_fail(err, GON_E_INPUT, "%s: the path is too long", directory);
    rc = rc < 0 ? rc : open_db(s, err);
    if (rc < 0) {
        state_close(s);
        return rc;
    }
    *ret_state = s;
    return GON_OK;
}

void state_close(struct state *s)
{
    if (!s)
        return;
    sqlite3_close(s->db);
    free(s);
}

// --- the queue -----------------------------------------------------------------------------------

static void take_row(sqlite3_stmt *row, struct state_entry *e)
{
    const unsigned char *path = sqlite3_column_text(row, 1);
    *e = (struct state_entry){.run = sqlite3_column_int(row, 0),
                              .held = sqlite3_column_int(row, 2) != 0,
                              .active = sqlite3_column_int(row, 3) != 0};
    snprintf(e->path, sizeof e->path, "%s", path ? (const char *)path : "");
}

struct state_queue *state_queue_new(size_t count)
{
    struct state_queue *q = calloc(1, sizeof *q + count * sizeof *q->entries);
    if (q)
        q->count = count;
    return q;
}

static int take_rows(struct state *s, sqlite3_stmt *rows, struct state_queue *q,
                     struct gon_error *err)
{
    size_t taken = 0;
    int step = SQLITE_ROW;
    while (taken < q->count && (step = sqlite3_step(rows)) == SQLITE_ROW)
        take_row(rows, &q->entries[taken++]);
    q->count = taken;
    return step == SQLITE_ROW || step == SQLITE_DONE ? GON_OK : fail(s, err);
}

int state_read_queue(struct state *s, struct state_queue **ret_queue, struct gon_error *err)
{
    sqlite3_stmt *rows;
    int64_t count = 0;
    int rc = number(s, "SELECT count(*) FROM queue", &count, err);
    if (rc < 0)
        return rc;
    struct state_queue *q = state_queue_new((size_t)count);
    if (!q)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", s->path);
    rc = prepare(s, "SELECT run, path, held, active FROM queue ORDER BY place", &rows, err);
    if (rc == 0) {
        rc = take_rows(s, rows, q, err);
        sqlite3_finalize(rows);
    }
    if (rc < 0)
        free(q);
    else
        *ret_queue = q;
    return rc;
}

static int insert(struct state *s, sqlite3_stmt *statement, const struct state_entry *e, int place,
                  struct gon_error *err)
{
    sqlite3_bind_int(statement, 1, place);
    sqlite3_bind_int(statement, 2, e->run);
    sqlite3_bind_text(statement, 3, e->path, -1, SQLITE_STATIC);
    sqlite3_bind_int(statement, 4, e->held);
    sqlite3_bind_int(statement, 5, e->active);
    int rc = sqlite3_step(statement) == SQLITE_DONE ? GON_OK : fail(s, err);
    sqlite3_reset(statement);
    return rc;
}

static int replace(struct state *s, const struct state_queue *q, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = run(s, "DELETE FROM queue", err);
    rc = rc < 0 ? rc : prepare(s, "INSERT INTO queue VALUES(?, ?, ?, ?, ?)", &statement, err);
    if (rc < 0)
        return rc;
    for (size_t i = 0; i < q->count && rc == 0; i++)
        rc = insert(s, statement, &q->entries[i], (int)i, err);
    sqlite3_finalize(statement);
    return rc;
}

// A file that was removed or replaced would take what is written with it.
static int find_again(struct state *s, struct gon_error *err)
{
    if (s->db && store_watch_look(&s->file, s->path) != STORE_SEEN_OTHER)
        return GON_OK;
    sqlite3_close(s->db);
    s->db = NULL;
    return open_db(s, err);
}

int state_write_queue(struct state *s, const struct state_queue *q, struct gon_error *err)
{
    int rc = find_again(s, err);
    rc = rc < 0 ? rc : run(s, "BEGIN IMMEDIATE", err);
    if (rc < 0)
        return rc;
    rc = replace(s, q, err);
    rc = rc < 0 ? rc : run(s, "COMMIT", err);
    if (rc < 0)
        sqlite3_exec(s->db, "ROLLBACK", NULL, NULL, NULL);
    return rc;
}
