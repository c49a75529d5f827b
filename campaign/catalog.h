// SPDX-License-Identifier: MIT
// Campaign files in a directory: NNNN-name.gonio. The number is the run's id, which `gonio list`
// shows and every verb takes for FILE. Thread: any; numbers are given out under a lock on the
// directory.
#pragma once
#include "base/err.h"
#include "campaign/store.h"

enum { CATALOG_PATH = 512 };

struct catalog_entry {
    int id; // 0: a file outside the catalogue
    char path[CATALOG_PATH];
    char name[CAMPAIGN_NAME], sample[CAMPAIGN_NAME];
    char state[16]; // "new" before it ever ran, "running", "paused", "stopped", "done",
                    // "failed", or "interrupted": it says running or paused, but no process holds
                    // the file; "unreadable": problem says why
    char problem[240]; // why it is paused, stopped, failed or unreadable
    int done, total;   // points
    int64_t created_utc_ms, started_utc_ms, finished_utc_ms; // 0: not yet
    int writer_pid;                                          // 0: nobody writes it
};

// Where campaigns are: wanted when it is not NULL or "", else $GONIO_DIR, else for root
// /var/lib/gonio, for others $XDG_DATA_HOME/gonio or ~/.local/share/gonio.
int catalog_directory(const char *wanted, char *ret_directory, size_t size, struct gon_error *err);
// Makes the directory (and its parents) when it is missing.
int catalog_make_directory(const char *directory, struct gon_error *err);

// The directory for one daemon: GON_E_REFUSED when another process has it ("in use by process
// 4711") or it lies on a network file system. Held until it is dropped or the process ends, however
// that ends.
struct catalog_hold;
int catalog_take(const char *directory, struct catalog_hold **ret_hold, struct gon_error *err);
void catalog_drop(struct catalog_hold *hold); // NULL is fine

// A new campaign file with the next number, open for writing. The number is above all that are
// there, and above one (0: any) that somebody remembers of files that are gone.
int catalog_create(const char *directory, int above, const struct store_new *what,
                   struct store **ret_store, int *ret_id, struct gon_error *err);

// What is there, by rising number; returns how many, free *ret_entries. A missing directory is
// empty. A file that cannot be read is listed with its problem.
int catalog_list(const char *directory, struct catalog_entry **ret_entries, struct gon_error *err);
int catalog_read(const char *path, struct catalog_entry *ret_entry); // never fails: see problem
// How long the rest of it will take on a bench, estimated; NAN: not known.
double catalog_left_s(const struct catalog_entry *e, const struct bench_config *bench);
int catalog_id(const char *path); // of its name; 0 when it has none

// FILE as a person types it: a path, a number, or a campaign's name (the newest of that name).
int catalog_resolve(const char *directory, const char *file, char *ret_path, size_t size,
                    struct gon_error *err);
// The file of a number, 1 or more. GON_E_INPUT: there is none.
int catalog_find(const char *directory, int id, char *ret_path, size_t size, struct gon_error *err);
