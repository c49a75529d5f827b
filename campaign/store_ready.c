// SPDX-License-Identifier: MIT
// Before each write: is the file still there, and is what SQLite remembers of it to be trusted?
#include "campaign/store_db.h"
#include "campaign/store_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// The name is free: the copy takes it. The WAL of the file that was removed must not be taken for
// the copy's.
static int put_back(struct store *s, const char *copy, struct gon_error *err)
{
    static const char *const suffixes[] = {"-wal", "-shm", "-journal"};
    char path[sizeof s->path + 16];
    store_db_close(s);
    s->broken = true; // until it is opened again
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s%s", s->path, suffixes[i]);
        unlink(path);
    }
    if (store_file_publish(copy, s->path) < 0 || store_file_sync_folder(s->path) < 0)
        return gon_fail(err, GON_E_STORE,
                        "%s: was removed while it was written; it is kept as %s: %s", s->path, copy,
                        strerror(errno));
    store_watch_begin(&s->file, s->path);
    return gon_fail(err, GON_E_STORE,
                    "%s: was removed while it was written; it was written again, with all its "
                    "%lld readings",
                    s->path, (long long)s->rows);
}

// A file that was removed is still there for those who have it open.
static int rescue(struct store *s, struct gon_error *err)
{
    char copy[sizeof s->path + 16];
    snprintf(copy, sizeof copy, "%s-rescued", s->path);
    const bool kept = access(copy, F_OK) == 0;
    int rc = kept ? GON_OK : store_copy(s, copy, err);
    if (rc < 0)
        return gon_prefix(err, "was removed while it was written");
    if (access(s->path, F_OK) == 0)
        return gon_fail(err, GON_E_STORE,
                        "%s: was removed while it was written, and another is in its place; what "
                        "was measured is kept as %s",
                        s->path, copy);
    return put_back(s, copy, err);
}

static int check_file(struct store *s, struct gon_error *err)
{
    const long long before = (long long)s->file.size;
    switch (store_watch_look(&s->file, s->path)) {
    case STORE_SEEN_SAME: return GON_OK;
    case STORE_SEEN_CUT:
        return gon_fail(err, GON_E_STORE,
                        "%s: was cut while it was written (it had %lld bytes); keep it and its "
                        "-wal file, and restore it from a copy",
                        s->path, before);
    case STORE_SEEN_OTHER: break;
    }
    if (store_watch_is_removed(&s->file) && !s->broken)
        return rescue(s, err);
    return gon_fail(err, GON_E_STORE,
                    "%s: was moved, removed or replaced while it was written; put it back",
                    s->path);
}

// What is in a WAL that was removed still reaches the file through the descriptors that are open.
static void check_wal(struct store *s)
{
    char wal[sizeof s->path + 8];
    store_wal_path(s, wal, sizeof wal);
    if (s->broken || store_watch_look(&s->wal, wal) == STORE_SEEN_SAME)
        return;
    sqlite3_exec(s->db, "PRAGMA wal_checkpoint(TRUNCATE)", NULL, NULL, NULL);
    s->broken = true;
}

int store_db_ready(struct store *s, struct gon_error *err)
{
    if (s->mode != STORE_WRITE)
        return gon_fail(err, GON_E_REFUSED, "%s: open for reading only", s->path);
    int rc = check_file(s, err);
    if (rc >= 0)
        check_wal(s);
    if (rc >= 0 && s->broken) {
        store_db_close(s);
        rc = store_db_reopen(s, err);
    }
    return rc;
}
