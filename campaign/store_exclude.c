// SPDX-License-Identifier: MIT
#include "campaign/store_exclude.h"

#include "campaign/reading_pick.h"
#include "campaign/store_db.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- one decision --------------------------------------------------------------------------------

static bool is_text(const char *text)
{
    json_t *string = json_string(text); // NULL: not UTF-8
    json_decref(string);
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f)
            return false;
    return string;
}

static int check_decision(const struct store_decision *d, struct gon_error *err)
{
    if (!d->reason || !d->reason[strspn(d->reason, " ")])
        return gon_fail(err, GON_E_INPUT,
                        "without a reason nobody will know later why; say it with --reason TEXT");
    if (strlen(d->reason) > STORE_REASON)
        return gon_fail(err, GON_E_INPUT, "the reason has %zu bytes, at most %d fit; shorten it",
                        strlen(d->reason), STORE_REASON);
    if (!is_text(d->reason) || !d->who || !is_text(d->who))
        return gon_fail(err, GON_E_INPUT,
                        "the reason and the name must be text (UTF-8) on one line");
    return GON_OK;
}

static int put_row(struct store *s, const struct store_reading *r, enum store_standing standing,
                   const struct store_decision *d, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(s, "SELECT coalesce(max(id), 0) + 1 FROM exclusion", &q, err);
    if (rc < 0)
        return rc;
    const int64_t id = sqlite3_step(q) == SQLITE_ROW ? sqlite3_column_int64(q, 0) : 0;
    sqlite3_finalize(q);
    const struct store_exclusion e = {id,        d->t_utc_ms, r->sweep,
                                      r->point,  r->attempt,  store_standing_name(standing),
                                      d->reason, d->who};
    rc = store_db_prepare(s, "INSERT INTO exclusion VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
                          &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, e.id);
    sqlite3_bind_int64(q, 2, e.t_utc_ms);
    sqlite3_bind_int(q, 3, e.sweep);
    sqlite3_bind_int(q, 4, e.point);
    sqlite3_bind_int(q, 5, e.attempt);
    store_db_bind_text(q, 6, e.what);
    store_db_bind_text(q, 7, e.reason);
    store_db_bind_text(q, 8, e.who);
    sqlite3_bind_int64(q, 9, store_exclusion_crc(&e));
    return store_db_finish(s, q, err);
}

// The standing that a verb gives a reading; negative: it says nothing of this one.
typedef int (*verdict)(const struct store_reading *r);

// One that waits to be measured again goes on waiting.
static int exclude(const struct store_reading *r)
{
    if (!store_reading_counts(r))
        return -1;
    return r->standing == STORE_REPEATED ? STORE_REPLACED : STORE_EXCLUDED;
}

static int restore(const struct store_reading *r)
{
    return r->flags & STORE_REJECTING || r->standing == STORE_COUNTS ? -1 : STORE_COUNTS;
}

static int replace(const struct store_reading *r)
{
    return r->flags & STORE_REJECTING || r->standing == STORE_REPLACED ? -1 : STORE_REPLACED;
}

static int repeat(const struct store_reading *r)
{
    if (!store_reading_settles(r))
        return -1;
    return r->standing == STORE_EXCLUDED ? STORE_REPLACED : STORE_REPEATED;
}

static bool picked(const struct reading_pick *p, const struct store_reading *r)
{
    return r->point >= p->first && r->point <= p->last && (!p->attempt || r->attempt == p->attempt);
}

// Without an attempt only the last of a point is restored.
static bool is_last(const struct store_reading *r, const struct store_reading *end, verdict v)
{
    for (const struct store_reading *k = r + 1; k < end && k->point == r->point; k++)
        if (v(k) >= 0)
            return false;
    return true;
}

static int decide(struct store *s, const struct reading_pick *p, verdict v,
                  const struct store_decision *d, struct gon_error *err)
{
    struct store_reading *rows = NULL;
    int decided = 0, count = store_read_readings(s, p->sweep, &rows, err), rc = count;
    for (int i = 0; i < count && rc >= 0; i++) {
        const int standing = picked(p, &rows[i]) ? v(&rows[i]) : -1;
        const bool all = v != restore || p->attempt;
        if (standing < 0 || (!all && !is_last(&rows[i], rows + count, v)))
            continue;
        rc = put_row(s, &rows[i], (enum store_standing)standing, d, err);
        decided++;
    }
    free(rows);
    return rc < 0 ? rc : decided;
}

// --- several as one commit -----------------------------------------------------------------------

static void pick_text(const struct reading_pick *p, char *text, size_t size)
{
    if (p->last == READING_PICK_ALL)
        snprintf(text, size, "sweep %d", p->sweep);
    else if (p->last > p->first)
        snprintf(text, size, "sweep %d, points %d to %d", p->sweep, p->first, p->last);
    else if (p->attempt)
        snprintf(text, size, "sweep %d, point %d, attempt %d", p->sweep, p->first, p->attempt);
    else
        snprintf(text, size, "sweep %d, point %d", p->sweep, p->first);
}

static int decide_all(struct store *s, const struct reading_pick *picks, int count, verdict v,
                      const struct store_decision *d, struct gon_error *err)
{
    char text[100];
    int rc = GON_OK, all = 0;
    for (int i = 0; i < count && rc >= 0; i++) {
        rc = decide(s, &picks[i], v, d, err);
        all += rc;
        pick_text(&picks[i], text, sizeof text);
        if (rc == 0)
            rc = gon_fail(err, GON_E_INPUT,
                          v == restore
                              ? "%s: nothing of it is excluded; see: gonio show FILE --sweep %d"
                              : "%s: no reading of it counts; see: gonio show FILE --sweep %d",
                          text, picks[i].sweep);
    }
    return rc < 0 ? rc : all;
}

__attribute__((format(printf, 4, 5))) static int
tell(struct store *s, const struct store_decision *d, struct gon_error *err, const char *fmt, ...)
{
    char text[STORE_REASON + 400];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    return store_append_event(s, d->t_utc_ms, "notice", "store", text, err);
}

static int decide_once(struct store *s, const char *which, verdict v, const char *verb,
                       const struct store_decision *d, struct gon_error *err)
{
    struct reading_pick *picks = calloc(READING_PICKS, sizeof *picks);
    int all = 0, count = check_decision(d, err);
    if (!picks)
        count = gon_fail(err, GON_E_SYSTEM, "%s: out of memory", s->path);
    count = count < 0 ? count : reading_picks_take(which, picks, err);
    int rc = count < 0 ? count : store_db_ready(s, err);
    rc = rc < 0 ? rc : store_db_begin(s, err);
    if (rc >= 0) {
        all = rc = decide_all(s, picks, count, v, d, err);
        if (rc >= 0)
            rc = tell(s, d, err, "%.64s %s %d reading%s (%.200s): %s", d->who, verb, all,
                      all == 1 ? "" : "s", which, d->reason);
        rc = store_db_end(s, rc, err);
    }
    free(picks);
    return rc < 0 ? rc : all;
}

int store_exclude(struct store *s, const char *which, const struct store_decision *d,
                  struct gon_error *err)
{
    return decide_once(s, which, exclude, "excludes", d, err);
}

int store_restore(struct store *s, const char *which, const struct store_decision *d,
                  struct gon_error *err)
{
    return decide_once(s, which, restore, "restores", d, err);
}

// --- measured again ------------------------------------------------------------------------------

static int whole_sweep(struct store *s, int sweep, verdict v, const struct store_decision *d,
                       struct gon_error *err)
{
    const struct reading_pick all = {.sweep = sweep, .last = READING_PICK_ALL};
    return decide(s, &all, v, d, err);
}

// How many sweeps on the sample there are.
static int sweeps_of(struct store *s, int *ret_sweeps, struct gon_error *err)
{
    struct store_progress p;
    int rc = store_read_progress(s, &p, err);
    if (rc >= 0)
        *ret_sweeps = p.sweeps;
    return rc;
}

// One that waits to be measured is not done, whoever is killed next.
static int no_longer_done(struct store *s, int sweep, const struct store_decision *d,
                          struct gon_error *err)
{
    char state[16] = "", why[STORE_REASON + 80];
    int rc = store_read_state(s, state, sizeof state, NULL, 0, NULL, err);
    snprintf(why, sizeof why, "sweep %d is to be measured again: %s", sweep, d->reason);
    return rc >= 0 && !strcmp(state, "done")
               ? store_append_state(s, d->t_utc_ms, "stopped", why, err)
               : rc;
}

static int replace_sweep(struct store *s, int sweep, const struct store_decision *d,
                         struct gon_error *err)
{
    int sweeps = 0, rc = sweeps_of(s, &sweeps, err);
    if (rc >= 0 && (sweep < 1 || sweep > sweeps))
        rc = gon_fail(err, GON_E_INPUT,
                      "there is no sweep %d on the sample; allowed 1..%d (the references are "
                      "measured again with each)",
                      sweep, sweeps);
    const int all = rc < 0 ? rc : whole_sweep(s, sweep, replace, d, err);
    if (all == 0)
        return gon_fail(err, GON_E_INPUT,
                        "sweep %d: nothing of it is measured that stands; it is measured anyway: "
                        "gonio resume",
                        sweep);
    rc = all < 0 ? all : whole_sweep(s, 0, repeat, d, err);
    rc = rc < 0 ? rc : whole_sweep(s, sweeps + 1, repeat, d, err);
    rc = rc < 0 ? rc : no_longer_done(s, sweep, d, err);
    rc = rc < 0 ? rc
                : tell(s, d, err, "%.64s has sweep %d measured again, %d reading%s replaced: %s",
                       d->who, sweep, all, all == 1 ? "" : "s", d->reason);
    return rc < 0 ? rc : all;
}

int store_remeasure(struct store *s, int sweep, const struct store_decision *d,
                    struct gon_error *err)
{
    int all = check_decision(d, err);
    all = all < 0 ? all : store_db_ready(s, err);
    all = all < 0 ? all : store_db_begin(s, err);
    if (all < 0)
        return all;
    all = replace_sweep(s, sweep, d, err);
    const int rc = store_db_end(s, all, err);
    return rc < 0 ? rc : all;
}

// The last sweep that has a point to measure before the closing references, when any of these is
// settled; 0: none.
static int sweep_too_late(const struct plan *p)
{
    int open = 0;
    bool closed = false;
    for (int i = 0; i < p->count; i++) {
        const struct plan_point *point = &p->points[i];
        if (point->kind == PLAN_SAMPLE && !point->done)
            open = point->sweep;
        closed = closed || (point->sweep > p->sweeps && point->done);
    }
    return closed ? open : 0;
}

int store_reopen_closing(struct store *s, int64_t t_utc_ms, struct gon_error *err)
{
    struct plan p;
    char why[100];
    int rc = store_read_plan(s, &p, err);
    if (rc < 0)
        return rc;
    const int late = sweep_too_late(&p), closing = p.sweeps + 1;
    const struct store_decision d = {t_utc_ms, why, "goniod"};
    snprintf(why, sizeof why, "sweep %d is measured after it", late);
    plan_clear(&p);
    if (!late)
        return 0;
    rc = store_db_ready(s, err);
    rc = rc < 0 ? rc : store_db_begin(s, err);
    if (rc < 0)
        return rc;
    const int all = whole_sweep(s, closing, repeat, &d, err);
    rc = all < 0 ? all : tell(s, &d, err, "the closing references are measured again: %s", why);
    rc = store_db_end(s, rc, err);
    return rc < 0 ? rc : all;
}
