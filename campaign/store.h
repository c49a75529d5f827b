// SPDX-License-Identifier: MIT
// A campaign is one SQLite file: plan, configuration, bench and the instruments' profiles as they
// were, every reading with every attempt, reductions, fits, events. Readings are added, never changed. Acknowledged means
// committed. What is not to count is said in rows of their own (store_exclude.h).
//
// While it is written: WAL, synchronous=FULL, a commit a call. Closed: a single file. One writer at
// a time, held by a lock on "FILE-lock" beside it, which names its process; readers never wait for
// it. "FILE-reserve" is room on the disk: when that is full, readings are refused until there is
// room again, while events and states are still written. A struct store belongs to one thread; several may be open on one file.
//
// Errors: GON_E_STORE, the file or its disk (full, I/O, busy, moved, damaged: the text says which
// and what to do); after one the same call may be repeated. GON_E_REFUSED: in use by another
// process, on a network file system, or newer than this program. GON_E_INPUT: no campaign file, or
// a value that cannot be stored.
//
// Each reading carries the CRC-32C (base/crc32c.h) of these little-endian bytes in this order:
//   int32 sweep, point, attempt; int64 t_utc_ms; int32 theta_i_udeg, theta_r_udeg; float64
//   signal_v, signal_sd_v, monitor_v, monitor_sd_v (NULL is the quiet NaN 0x7ff8000000000000);
//   int32 count, range; uint32 flags.
// A row that fails it is an error that names sweep and point, whenever it is read. The plan, the
// configuration and the bench have one check value each (meta: plan_crc32c, ...), a profile that of
// int64 t_utc_ms and of name, role and text with their final NULs, an exclusion that of int64 id,
// t_utc_ms; int32 sweep, point, attempt; and of what, reason and who with their final NULs.
//
// A file of an older version is read as it is; opened for writing it becomes one of this version
// (store_migrate.c), after a copy of it was put beside it.
#pragma once
#include "base/err.h"
#include "campaign/config.h"
#include "campaign/plan.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct store;
struct reduction;
struct fit_record;

#define STORE_SUFFIX ".gonio"

enum store_mode { STORE_READ, STORE_WRITE };

enum store_flag {
    STORE_SATURATED = 1 << 0,
    STORE_UNDER_RANGE = 1 << 1, // too small for its range: made again further down
    STORE_STALE = 1 << 2,       // the same bits again and again
    STORE_MONITOR_LOW = 1 << 3, // the light was lost
    STORE_MOVED = 1 << 4,       // an axis moved while it was read
    STORE_UNLOCKED = 1 << 5,    // no reference
    STORE_UNSETTLED = 1 << 6,   // something changed the filter
    STORE_DISCARDED = 1 << 7    // by the engine, as an event says
};
// A reading with any of these does not count as the point's.
#define STORE_REJECTING 0xffu

// What people decided later (store_exclude.h).
enum store_standing { STORE_COUNTS, STORE_EXCLUDED, STORE_REPLACED, STORE_REPEATED };

struct store_reading {
    int sweep, point, attempt; // attempt from 1
    int64_t t_utc_ms;
    int32_t theta_i_udeg, theta_r_udeg; // from the encoders
    double signal_v, signal_sd_v;       // mean and sample sd; must be finite
    double monitor_v, monitor_sd_v;     // NAN: no monitor
    int count;                          // samples averaged, >= 1
    int range;                          // of the detector
    unsigned flags;                     // of store_flag
    enum store_standing standing;       // of the newest decision; no part of the row
};

struct store_progress {
    int done, total;  // points
    int again;        // points that were done and are to be measured again
    int sweep, point; // the first without an accepted reading; -1 when there is none
    int64_t readings; // rows: every attempt
    int64_t excluded; // of them accepted ones that do not count, as somebody decided
    int sweeps_done;  // 1..sweeps that are complete
    int sweeps;
};

struct store_event {
    int64_t id, t_utc_ms;
    char level[8]; // "err", "warn", "notice", "info"
    char source[32];
    const char *text; // borrowed for the call
};

// An instrument's profile (gonio-profile(5)), which this layer keeps and does not read.
struct store_profile {
    const char *name; // as the bench has it
    const char *role; // "laser", "detector", "axis", ...
    const char *text; // the file
};

struct store_kept_profile {
    int64_t id, t_utc_ms; // since when; until the next of that name
    struct store_profile profile; // borrowed for the call
};

struct store_new {
    const struct campaign_config *config;
    const char *config_text, *config_name; // the file as it was read, and its name
    const struct bench_config *bench;
    const char *bench_text;
    const struct plan *plan;
    int64_t t_utc_ms;
    const struct store_profile *profiles; // of all that the bench names
    int profiles_count;
};

// A new file, open for writing; GON_E_REFUSED when there is one already. Nothing is left when it
// fails.
int store_create(const char *path, const struct store_new *what, struct store **ret_store,
                 struct gon_error *err);
// For writing, the file is checked as a whole first, and the last 1000 readings' CRCs.
int store_open(const char *path, enum store_mode mode, struct store **ret_store,
               struct gon_error *err);
// Makes it a single file. The store is gone in any case; GON_E_STORE when the last checkpoint
// failed, which loses nothing. NULL is fine.
int store_close(struct store *s, struct gon_error *err);

// What opening it for writing did that should be told (a file of an older version was changed), ""
// otherwise; one sentence, the store's own.
const char *store_notice(const struct store *s);

// How long somebody else's write lock on the file is waited for: 8000 ms unless said otherwise
// here.
void store_set_patience(struct store *s, int patience_ms);

// The process that has the file open for writing, 0: none.
int store_writer(const char *path);

// --- writing -------------------------------------------------------------------------------------
// The same row again is accepted again; another row with the same (sweep, point, attempt) is
// GON_E_INPUT, as is a value that is not finite and a point that is not in the plan.
int store_append_reading(struct store *s, const struct store_reading *r, struct gon_error *err);
int store_append_event(struct store *s, int64_t t_utc_ms, const char *level, const char *source,
                       const char *text, struct gon_error *err);
// A run's state ("running", "paused", "stopped", "done", "failed") and why; a history.
int store_append_state(struct store *s, int64_t t_utc_ms, const char *state, const char *why,
                       struct gon_error *err);
// Those that are not there yet, or not with this text as the newest of their name; one commit.
int store_append_profiles(struct store *s, int64_t t_utc_ms, const struct store_profile *profiles,
                          int count, struct gon_error *err);
int store_append_reduction(struct store *s, int64_t t_utc_ms, const struct reduction *r,
                           int64_t *ret_id, struct gon_error *err);
int store_append_fit(struct store *s, int64_t t_utc_ms, const struct fit_record *f, int64_t *ret_id,
                     struct gon_error *err);

// --- reading -------------------------------------------------------------------------------------
const char *store_path(const struct store *s);
// The file as it is in one moment, whoever writes it, as a single file on the disk; GON_E_REFUSED:
// there is one of that name.
int store_copy(struct store *s, const char *path, struct gon_error *err);
int store_read_plan(struct store *s, struct plan *ret_plan,
                    struct gon_error *err); // done and attempts filled in
// All readings of a sweep (-1: of all sweeps) in the order of the plan; returns how many, free
// *ret_rows.
int store_read_readings(struct store *s, int sweep, struct store_reading **ret_rows,
                        struct gon_error *err);
int store_read_progress(struct store *s, struct store_progress *ret_progress,
                        struct gon_error *err);
int store_read_config(struct store *s, struct campaign_config *ret_config, struct gon_error *err);
int store_read_bench(struct store *s, struct bench_config *ret_bench, struct gon_error *err);
// The profiles in the order in which they were kept, until each returns false; files before version
// 3 have none. Returns how many were shown; GON_E_STORE for one whose check value is wrong.
int store_each_profile(struct store *s,
                       bool (*each)(void *ctx, const struct store_kept_profile *p), void *ctx,
                       struct gon_error *err);
// A text of meta ("name", "sample", "created_utc_ms", "config", "bench", "gonio_version", ...);
// free it. NULL: no such key, or it cannot be read.
char *store_read_meta(struct store *s, const char *key);
// The newest state, "" when there is none yet; both buffers may be NULL. ret_since_ms: when it
// began.
int store_read_state(struct store *s, char *ret_state, size_t state_size, char *ret_why,
                     size_t why_size, int64_t *ret_since_ms, struct gon_error *err);
// When it first was in a state; 0: never.
int64_t store_read_state_time(struct store *s, const char *state);
// Events after an id (0: all), oldest first; each returns false to end. Returns how many were
// shown.
int store_each_event(struct store *s, int64_t after_id,
                     bool (*each)(void *ctx, const struct store_event *e), void *ctx,
                     struct gon_error *err);
// The JSON of a fit: of the newest after a sweep, or with sweep -1 the newest of all; free it.
// NULL: none.
char *store_read_fit(struct store *s, int sweep);
// Its ids, oldest first: returns how many, at most most.
int store_read_fits(struct store *s, int64_t *ret_ids, int *ret_sweeps, int most,
                    struct gon_error *err);
int store_flags_text(unsigned flags, char *text, size_t size); // "saturated, moved"; as snprintf
bool store_reading_counts(const struct store_reading *r);  // may be used
bool store_reading_settles(const struct store_reading *r); // its point need not be measured again
