// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: the open file, and SQLite with our errors.
#pragma once
#include "campaign/store.h"
#include "campaign/store_lock.h"
#include "campaign/store_watch.h"

#include <sqlite3.h>

enum {
    STORE_APPLICATION = 0x676f6e69, // "goni"
    STORE_VERSION = 4,
    STORE_VERSION_PROFILES = 3,   // the first that keeps profiles
    STORE_VERSION_EXCLUSIONS = 4, // the first that knows exclusions
    STORE_PATIENCE_MS = 8000
};

struct store {
    sqlite3 *db;
    enum store_mode mode;
    struct store_lock lock;
    char path[512];
    struct store_watch file, wal; // as they were opened
    int64_t rows;                 // readings that were acknowledged, or there when it was opened
    bool full;   // the disk: the reserve is given away, no reading until it is back
    bool broken; // after an I/O error nothing that SQLite remembers can be trusted: reopen first
    int patience_ms;
    int version; // of the file
    char notice[700];
};

// The error for SQLite's last complaint, with the file and what to do.
int store_db_fail(struct store *s, struct gon_error *err);
int store_db_run(struct store *s, const char *sql, struct gon_error *err);
// A statement; finalize it. GON_E_STORE.
int store_db_prepare(struct store *s, const char *sql, sqlite3_stmt **ret_statement,
                     struct gon_error *err);
// Steps a statement that returns no row and finalizes it.
int store_db_finish(struct store *s, sqlite3_stmt *statement, struct gon_error *err);
void store_db_close(struct store *s);
// Opens the file for writing, checked as a whole; what was open is closed.
int store_db_reopen(struct store *s, struct gon_error *err);
void store_wal_path(const struct store *s, char *path, size_t size);
// Ready to write: open for writing, still at its path, mended after an error.
int store_db_ready(struct store *s, struct gon_error *err);
// Several statements as one commit: begin, then end with their result.
int store_db_begin(struct store *s, struct gon_error *err);
int store_db_end(struct store *s, int rc, struct gon_error *err);

void store_db_bind_text(sqlite3_stmt *statement, int index,
                        const char *text); // NULL: NULL; must outlive it

// campaign/store_schema.c
extern const char store_schema_sql[], store_profile_sql[], store_exclusion_sql[];
// Check value of the whole plan, which meta keeps as plan_crc32c (8 hexadecimal digits): CRC-32C of
// every column of every row in order; integers and reals as 8 little-endian bytes, texts with their
// final NUL.
int store_plan_crc(struct store *s, uint32_t *ret_crc, struct gon_error *err);
// GON_E_STORE: not as meta says.
int store_check_plan(struct store *s, struct gon_error *err);
int store_write_new(struct store *s, const struct store_new *what, struct gon_error *err);

// campaign/store_read.c: a row of these columns.
#define STORE_READING_COLUMNS                                                                      \
    "sweep, point, attempt, t_utc_ms, theta_i_udeg, theta_r_udeg, signal_v, signal_sd_v,"          \
    " monitor_v, monitor_sd_v, samples, detector_range, flags, crc32c"
enum { STORE_READING_CRC = 13 };
struct store_reading store_db_reading(sqlite3_stmt *q);

// campaign/store_profiles.c: of its columns without the last; and, within a transaction:
uint32_t store_profile_crc(int64_t t_utc_ms, const struct store_profile *p);
int store_put_profile(struct store *s, int64_t t_utc_ms, const struct store_profile *p,
                      struct gon_error *err);

// campaign/store_standing.c: of its columns without the last; and the standing of rows that are in
// the plan's order, of which it returns the count.
struct store_exclusion;
uint32_t store_exclusion_crc(const struct store_exclusion *e);
#define STORE_EXCLUSION_COLUMNS "id, t_utc_ms, sweep, point, attempt, what, reason, who, crc32c"
struct store_exclusion store_db_exclusion(sqlite3_stmt *q); // borrowed until the next step
enum { STORE_EXCLUSION_CRC = 8 };
// Its what; and the other way round, -1: there is none of that name.
const char *store_standing_name(enum store_standing standing);
int store_standing_of(const char *what);
int store_take_standings(struct store *s, struct store_reading *rows, int count,
                         struct gon_error *err);

// campaign/store_migrate.c: a file of an older version becomes one of this version, a transaction a
// step, after a copy of it was made ("FILE.v1-backup"). s->notice says so.
int store_migrate(struct store *s, struct gon_error *err);
