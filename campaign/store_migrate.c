// SPDX-License-Identifier: MIT
// Versions of the campaign file (user_version):
//   1  points of one state of polarisation
//   2  the same tables; points of several states: their beams must not be averaged
//   3  the profiles of the instruments are kept, in a table of their own; any states
//   4  readings can be excluded, in a table of its own; a reduction says how many were
#include "campaign/store_db.h"

#include <stdio.h>
#include <unistd.h>

enum { MOST_BACKUPS = 100 };

// What makes version i + 2 of version i + 1. A step never changes once a gonio with it was given
// away.
static const char *const steps[] = {"", store_profile_sql, store_exclusion_sql};
_Static_assert(sizeof steps / sizeof *steps == STORE_VERSION - 1, "a step for each version");

// A copy is never overwritten: it may be of what the file was before somebody restored it.
static int back_up(struct store *s, char *path, size_t size, struct gon_error *err)
{
    int rc = GON_E_REFUSED;
    for (int i = 1; i <= MOST_BACKUPS && rc == GON_E_REFUSED; i++) {
        if (i == 1)
            snprintf(path, size, "%s.v%d-backup", s->path, s->version);
        else
            snprintf(path, size, "%s.v%d-backup-%d", s->path, s->version, i);
        rc = access(path, F_OK) == 0
                 ? gon_fail(err, GON_E_REFUSED, "%s: too many of them; move some away", path)
                 : store_copy(s, path, err);
    }
    return rc;
}

static int take_step(struct store *s, struct gon_error *err)
{
    char pragma[60];
    snprintf(pragma, sizeof pragma, "PRAGMA user_version = %d", s->version + 1);
    int rc = store_db_begin(s, err);
    if (rc < 0)
        return rc;
    rc = store_db_run(s, steps[s->version - 1], err);
    if (rc >= 0)
        rc = store_db_run(s, pragma, err);
    rc = store_db_end(s, rc, err);
    if (rc >= 0)
        s->version++;
    return rc;
}

int store_migrate(struct store *s, struct gon_error *err)
{
    char path[sizeof s->path + 40];
    const int from = s->version;
    if (from == STORE_VERSION)
        return GON_OK;
    if (from < 1)
        return gon_fail(err, GON_E_INPUT, "%s: version %d of the file was never written", s->path,
                        from);
    int rc = back_up(s, path, sizeof path, err);
    while (rc >= 0 && s->version < STORE_VERSION)
        rc = take_step(s, err);
    if (rc >= 0)
        snprintf(s->notice, sizeof s->notice,
                 "the file was of version %d and is now of version %d; as it was it is kept as %s",
                 from, STORE_VERSION, path);
    return rc;
}
