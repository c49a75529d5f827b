// SPDX-License-Identifier: MIT
#include "campaign/store_db.h"
#include "campaign/store_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// SQLite reads one moment of the file, whoever writes it meanwhile, and does not sync the copy. It
// counts the copy as writing, too: a connection for reading is opened up as long as it takes.
static int vacuum_into(struct store *s, const char *path, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(s, "VACUUM INTO ?1", &q, err);
    if (rc < 0)
        return rc;
    store_db_bind_text(q, 1, path);
    sqlite3_exec(s->db, "PRAGMA query_only = 0", NULL, NULL, NULL);
    rc = store_db_finish(s, q, err);
    if (s->mode == STORE_READ)
        sqlite3_exec(s->db, "PRAGMA query_only = 1", NULL, NULL, NULL);
    return rc;
}

int store_copy(struct store *s, const char *path, struct gon_error *err)
{
    char temporary[544];
    if (snprintf(temporary, sizeof temporary, "%s-new.%d", path, (int)getpid()) >=
        (int)sizeof temporary)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", path);
    unlink(temporary); // of a process that had our number and died
    int rc = vacuum_into(s, temporary, err);
    if (rc < 0)
        gon_prefix(err, "the copy %s", path);
    else if (store_file_sync(temporary) < 0 || store_file_publish(temporary, path) < 0 ||
             store_file_sync_folder(path) < 0)
        rc = errno == EEXIST
                 ? gon_fail(err, GON_E_REFUSED, "%s: there already; nothing was changed", path)
                 : gon_fail(err, GON_E_STORE, "%s: %s", path, strerror(errno));
    unlink(temporary);
    return rc;
}
