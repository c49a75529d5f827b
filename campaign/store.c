// SPDX-License-Identifier: MIT
#include "campaign/store.h"

#include "campaign/store_db.h"
#include "campaign/store_file.h"
#include "campaign/store_reserve.h"
#include "campaign/store_row.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { CHECKED_READINGS = 1000 };

// --- SQLite with our errors ----------------------------------------------------------------------

static int busy(struct store *s, struct gon_error *err)
{
    int pid = store_lock_wal_writer(s->path);
    char who[40] = "another program";
    if (pid)
        snprintf(who, sizeof who, "process %d", pid);
    return gon_fail(err, GON_E_STORE, "%s: %s holds its write lock; end that program's transaction",
                    s->path, who);
}

// Room for what is to be said of it; a quota is an I/O error for SQLite, and so is a full disk
// where it makes its -shm file.
static int full(struct store *s, int rc, struct gon_error *err)
{
    s->broken = s->broken || (rc & 0xff) == SQLITE_IOERR;
    s->full = true;
    if (s->mode == STORE_WRITE)
        store_reserve_give(s->path);
    return gon_fail(err, GON_E_STORE, "%s: the disk is full; free some space on it", s->path);
}

int store_db_fail(struct store *s, struct gon_error *err)
{
    const int rc = s->db ? sqlite3_extended_errcode(s->db) : SQLITE_NOMEM;
    const char *text = s->db ? sqlite3_errmsg(s->db) : "out of memory";
    const int error = s->db ? sqlite3_system_errno(s->db) : 0;
    if (rc == SQLITE_FULL || error == EDQUOT || error == ENOSPC)
        return full(s, rc, err);
    switch (rc & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED: return busy(s, err);
    case SQLITE_IOERR:
        s->broken = true;
        return gon_fail(err, GON_E_STORE, "%s: %s (%s); look at the disk", s->path, text,
                        error ? strerror(error) : "no reason given");
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
        s->broken = true;
        return gon_fail(err, GON_E_STORE,
                        "%s: %s; keep the file, copy it, and try: sqlite3 COPY .recover >rows.sql",
                        s->path, text);
    default:
        s->broken = s->broken || (rc & 0xff) == SQLITE_CANTOPEN;
        return gon_fail(err, GON_E_STORE, "%s: %s%s%s", s->path, text, error ? ": " : "",
                        error ? strerror(error) : "");
    }
}

int store_db_run(struct store *s, const char *sql, struct gon_error *err)
{
    return sqlite3_exec(s->db, sql, NULL, NULL, NULL) == SQLITE_OK ? GON_OK : store_db_fail(s, err);
}

int store_db_prepare(struct store *s, const char *sql, sqlite3_stmt **ret_statement,
                     struct gon_error *err)
{
    sqlite3_stmt *statement;
    if (sqlite3_prepare_v2(s->db, sql, -1, &statement, NULL) != SQLITE_OK) {
        store_db_fail(s, err);
        return GON_E_STORE;
    }
    *ret_statement = statement;
    return GON_OK;
}

int store_db_finish(struct store *s, sqlite3_stmt *statement, struct gon_error *err)
{
    int rc = sqlite3_step(statement) == SQLITE_DONE ? GON_OK : store_db_fail(s, err);
    sqlite3_finalize(statement);
    return rc;
}

void store_db_bind_text(sqlite3_stmt *statement, int index, const char *text)
{
    sqlite3_bind_text(statement, index, text, -1, SQLITE_STATIC);
}

int store_db_begin(struct store *s, struct gon_error *err)
{
    return store_db_run(s, "BEGIN IMMEDIATE", err);
}

int store_db_end(struct store *s, int rc, struct gon_error *err)
{
    if (rc >= 0)
        rc = store_db_run(s, "COMMIT", err);
    if (rc < 0 && !sqlite3_get_autocommit(s->db))
        sqlite3_exec(s->db, "ROLLBACK", NULL, NULL, NULL);
    return rc;
}

// --- opening -------------------------------------------------------------------------------------

void store_db_close(struct store *s)
{
    sqlite3_close(s->db);
    s->db = NULL;
}

static int open_db(struct store *s, int flags, struct gon_error *err)
{
    if (sqlite3_open_v2(s->path, &s->db, flags | SQLITE_OPEN_NOMUTEX, NULL) != SQLITE_OK) {
        store_db_fail(s, err);
        store_db_close(s);
        return GON_E_STORE;
    }
    sqlite3_extended_result_codes(s->db, 1);
    sqlite3_busy_timeout(s->db, s->patience_ms);
    return GON_OK;
}

static int pragma(struct store *s, const char *sql, int64_t *ret_value, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = store_db_prepare(s, sql, &statement, err);
    if (rc < 0)
        return rc;
    if (sqlite3_step(statement) == SQLITE_ROW)
        *ret_value = sqlite3_column_int64(statement, 0);
    else
        rc = store_db_fail(s, err);
    sqlite3_finalize(statement);
    return rc;
}

static int newer(struct store *s, struct gon_error *err)
{
    char *writer = store_read_meta(s, "gonio_version"); // if that is still where it was
    gon_fail(err, GON_E_REFUSED,
             "%s: version %d of the file, of a newer gonio (begun with %s); this one (%s) knows "
             "versions up to %d: install the newer one, or take the copy that it made before it "
             "changed an older file (.v%d-backup beside it)",
             s->path, s->version, writer ? writer : "?", GONIO_VERSION, STORE_VERSION,
             STORE_VERSION);
    free(writer);
    return GON_E_REFUSED;
}

// SQLITE_NOTADB means here that somebody named a file that never was one.
static int identify(struct store *s, struct gon_error *err)
{
    int64_t application = 0, version = 0;
    int rc = pragma(s, "PRAGMA application_id", &application, err);
    if (rc < 0 && (sqlite3_errcode(s->db) & 0xff) == SQLITE_NOTADB)
        application = 0;
    else if (rc < 0 || (rc = pragma(s, "PRAGMA user_version", &version, err)) < 0)
        return rc;
    if (application != STORE_APPLICATION)
        return gon_fail(err, GON_E_INPUT, "%s: not a campaign file", s->path);
    s->version = (int)version;
    return version > STORE_VERSION ? newer(s, err) : GON_OK;
}

static int quick_check(struct store *s, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = store_db_prepare(s, "PRAGMA quick_check(1)", &statement, err);
    if (rc < 0)
        return rc;
    const char *text = NULL;
    if (sqlite3_step(statement) != SQLITE_ROW)
        rc = store_db_fail(s, err);
    else if (strcmp(text = (const char *)sqlite3_column_text(statement, 0), "ok"))
        rc =
            gon_fail(err, GON_E_STORE,
                     "%s: damaged (%.200s); keep the file, copy it, and try: sqlite3 COPY .recover "
                     ">rows.sql",
                     s->path, text);
    sqlite3_finalize(statement);
    return rc;
}

// A WAL that was cut or removed takes with it what was acknowledged since the last checkpoint.
static int count_readings(struct store *s, struct gon_error *err)
{
    int64_t rows = 0;
    int rc = pragma(s, "SELECT count(*) FROM reading", &rows, err);
    if (rc >= 0 && rows < s->rows)
        return gon_fail(err, GON_E_STORE,
                        "%s: %lld acknowledged readings are gone with its -wal file, which was cut "
                        "or removed while it was written; stop the run and restore both from a "
                        "copy",
                        s->path, (long long)(s->rows - rows));
    s->rows = rows;
    return rc;
}

void store_wal_path(const struct store *s, char *path, size_t size)
{
    snprintf(path, size, "%s-wal", s->path);
}

int store_db_reopen(struct store *s, struct gon_error *err)
{
    char wal[sizeof s->path + 8];
    int rc = open_db(s, SQLITE_OPEN_READWRITE, err);
    if (rc >= 0)
        rc = identify(s, err);
    if (rc >= 0 && sqlite3_db_readonly(s->db, "main") == 1)
        rc = gon_fail(err, GON_E_STORE, "%s: may only be read; mend its permissions", s->path);
    if (rc >= 0)
        rc = quick_check(s, err);
    if (rc >= 0)
        rc = store_db_run(s, "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL", err);
    if (rc >= 0)
        rc = count_readings(s, err);
    if (rc < 0) {
        store_db_close(s);
        return rc;
    }
    store_wal_path(s, wal, sizeof wal);
    store_watch_begin(&s->file, s->path);
    store_watch_begin(&s->wal, wal);
    s->broken = false;
    return GON_OK;
}

static int open_for_reading(struct store *s, struct gon_error *err)
{
    // Read-write where permitted, because a WAL left behind needs it; query_only keeps us from
    // writing.
    int rc = open_db(s, SQLITE_OPEN_READWRITE, err);
    if (rc >= 0)
        rc = identify(s, err);
    return rc >= 0 ? store_db_run(s, "PRAGMA query_only = 1", err) : rc;
}

static int check_newest(struct store *s, struct gon_error *err);

int store_open(const char *path, enum store_mode mode, struct store **ret_store,
               struct gon_error *err)
{
    struct stat st;
    struct store *s = calloc(1, sizeof *s);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", path);
    *s = (struct store){.mode = mode, .lock.fd = -1, .patience_ms = STORE_PATIENCE_MS};
    int rc = GON_OK;
    if (snprintf(s->path, sizeof s->path, "%s", path) >= (int)sizeof s->path)
        rc = gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", path);
    else if (stat(path, &st) < 0)
        rc = gon_fail(err, GON_E_INPUT, "%s: %s", path, strerror(errno));
    else if (!S_ISREG(st.st_mode))
        rc = gon_fail(err, GON_E_INPUT, "%s: not a campaign file", path);
    if (rc >= 0 && mode == STORE_WRITE)
        rc = store_lock_local(path, err);
    if (rc >= 0 && mode == STORE_WRITE)
        rc = store_lock_take(&s->lock, path, err);
    if (rc >= 0)
        rc = mode == STORE_WRITE ? store_db_reopen(s, err) : open_for_reading(s, err);
    if (rc >= 0 && mode == STORE_WRITE)
        rc = check_newest(s, err);
    if (rc >= 0 && mode == STORE_WRITE)
        rc = store_migrate(s, err);
    if (rc >= 0 && mode == STORE_WRITE)
        s->full = !store_reserve_take(path);
    if (rc < 0) {
        store_close(s, NULL);
        return rc;
    }
    *ret_store = s;
    return GON_OK;
}

// The newest readings are the ones that a crash may have hurt; the others are checked when they are
// used.
static int check_newest(struct store *s, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(s,
                              "SELECT DISTINCT sweep FROM (SELECT sweep FROM reading"
                              " ORDER BY sweep DESC, point DESC LIMIT ?1)",
                              &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int(q, 1, CHECKED_READINGS);
    while (rc >= 0 && sqlite3_step(q) == SQLITE_ROW) {
        struct store_reading *rows;
        rc = store_read_readings(s, sqlite3_column_int(q, 0), &rows, err);
        if (rc >= 0)
            free(rows);
    }
    sqlite3_finalize(q);
    return rc < 0 ? rc : GON_OK;
}

int store_close(struct store *s, struct gon_error *err)
{
    int rc = GON_OK;
    if (!s)
        return rc;
    // Fails while somebody reads: then the last reader's close tidies up.
    if (s->db && s->mode == STORE_WRITE && !s->broken) {
        sqlite3_busy_timeout(s->db, 100);
        sqlite3_exec(s->db, "PRAGMA journal_mode = DELETE", NULL, NULL, NULL);
        if (sqlite3_errcode(s->db) != SQLITE_OK && (sqlite3_errcode(s->db) & 0xff) != SQLITE_BUSY &&
            (sqlite3_errcode(s->db) & 0xff) != SQLITE_LOCKED)
            rc = store_db_fail(s, err);
    }
    store_watch_end(&s->file);
    store_watch_end(&s->wal);
    store_db_close(s);
    if (s->lock.fd >= 0) // ours
        store_reserve_give(s->path);
    store_lock_drop(&s->lock);
    free(s);
    return rc;
}

void store_set_patience(struct store *s, int patience_ms)
{
    s->patience_ms = patience_ms;
    sqlite3_busy_timeout(s->db, patience_ms);
}

int store_writer(const char *path)
{
    return store_lock_holder(path);
}

const char *store_notice(const struct store *s)
{
    return s->notice;
}

const char *store_path(const struct store *s)
{
    return s->path;
}

// --- a new file ----------------------------------------------------------------------------------

static int write_file(const char *path, const struct store_new *what, struct gon_error *err)
{
    struct store s = {.lock.fd = -1, .mode = STORE_WRITE, .patience_ms = STORE_PATIENCE_MS};
    snprintf(s.path, sizeof s.path, "%s", path);
    int rc = open_db(&s, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, err);
    if (rc >= 0)
        rc = store_db_run(&s, "PRAGMA synchronous = FULL", err);
    if (rc >= 0)
        rc = store_write_new(&s, what, err);
    store_db_close(&s);
    return rc;
}

// Written beside its place first, so that a campaign file is whole or not there.
int store_create(const char *path, const struct store_new *what, struct store **ret_store,
                 struct gon_error *err)
{
    char temporary[512];
    if (snprintf(temporary, sizeof temporary, "%s-new.%d", path, (int)getpid()) >=
        (int)sizeof temporary)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", path);
    int rc = store_lock_local(path, err);
    if (rc < 0)
        return rc;
    unlink(temporary); // of a process that had our number and died
    rc = write_file(temporary, what, err);
    if (rc >= 0 && store_file_publish(temporary, path) < 0)
        rc = errno == EEXIST
                 ? gon_fail(err, GON_E_REFUSED, "%s: there already; nothing was changed", path)
                 : gon_fail(err, GON_E_STORE, "%s: %s", path, strerror(errno));
    else if (rc >= 0 && store_file_sync_folder(path) < 0)
        rc = gon_fail(err, GON_E_STORE, "the folder of %s: %s", path, strerror(errno));
    unlink(temporary);
    return rc >= 0 ? store_open(path, STORE_WRITE, ret_store, err) : rc;
}
