// SPDX-License-Identifier: MIT
#include "campaign/store_verify.h"

#include "campaign/store_db.h"
#include "campaign/store_exclude.h"
#include "campaign/store_row.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_STRUCTURE = 100 };

struct verify {
    struct store *s;
    void (*found)(void *ctx, const struct store_finding *f);
    void *ctx;
    struct store_verified seen;
};

static void find(struct verify *v, const char *what, int sweep, int point, int attempt,
                 const char *text)
{
    const struct store_finding f = {what, sweep, point, attempt, text};
    v->seen.findings++;
    v->found(v->ctx, &f);
}

// A part that could not be read to its end is itself a finding; the others are still looked at.
static void find_error(struct verify *v, const char *what, const struct gon_error *err)
{
    char head[sizeof v->s->path + 4];
    const int n = snprintf(head, sizeof head, "%s: ", v->s->path);
    find(v, what, -1, -1, -1, strncmp(err->text, head, (size_t)n) ? err->text : err->text + n);
}

static void end_part(struct verify *v, const char *what, sqlite3_stmt *q, int step)
{
    struct gon_error err;
    if (step != SQLITE_DONE) {
        store_db_fail(v->s, &err);
        find_error(v, what, &err);
    }
    sqlite3_finalize(q);
}

static sqlite3_stmt *begin_part(struct verify *v, const char *what, const char *sql)
{
    struct gon_error err;
    sqlite3_stmt *q = NULL;
    if (store_db_prepare(v->s, sql, &q, &err) < 0)
        find_error(v, what, &err);
    return q;
}

static int64_t count(struct verify *v, const char *sql)
{
    sqlite3_stmt *q = begin_part(v, "structure", sql);
    const int64_t n = q && sqlite3_step(q) == SQLITE_ROW ? sqlite3_column_int64(q, 0) : 0;
    sqlite3_finalize(q);
    return n;
}

static const char *text_of(sqlite3_stmt *q, int column)
{
    const char *text = (const char *)sqlite3_column_text(q, column);
    return text ? text : "";
}

// --- structure -----------------------------------------------------------------------------------

static void check_structure(struct verify *v)
{
    char sql[60];
    int step;
    snprintf(sql, sizeof sql, "PRAGMA integrity_check(%d)", MOST_STRUCTURE);
    sqlite3_stmt *q = begin_part(v, "structure", sql);
    if (!q)
        return;
    while ((step = sqlite3_step(q)) == SQLITE_ROW)
        if (strcmp(text_of(q, 0), "ok"))
            find(v, "structure", -1, -1, -1, text_of(q, 0));
    end_part(v, "structure", q, step);
}

static bool has(struct verify *v, const char *type, const char *name)
{
    sqlite3_stmt *q =
        begin_part(v, "structure", "SELECT 1 FROM sqlite_schema WHERE type = ?1 AND name = ?2");
    if (!q)
        return true; // said already
    store_db_bind_text(q, 1, type);
    store_db_bind_text(q, 2, name);
    const bool there = sqlite3_step(q) == SQLITE_ROW;
    sqlite3_finalize(q);
    return there;
}

// Whether what belongs to a table or view came with a later version than the file's.
static bool is_later(const struct verify *v, const char *table)
{
    if (!strcmp(table, "profile"))
        return v->seen.version < STORE_VERSION_PROFILES;
    return (!strcmp(table, "exclusion") || !strcmp(table, "excluded")) &&
           v->seen.version < STORE_VERSION_EXCLUSIONS;
}

// Every table, view and trigger that a new file has.
static void check_schema(struct verify *v)
{
    sqlite3 *fresh = NULL;
    sqlite3_stmt *q = NULL;
    char text[200];
    if (sqlite3_open(":memory:", &fresh) == SQLITE_OK &&
        sqlite3_exec(fresh, store_schema_sql, NULL, NULL, NULL) == SQLITE_OK &&
        sqlite3_prepare_v2(fresh, "SELECT type, name, tbl_name FROM sqlite_schema", -1, &q, NULL) ==
            SQLITE_OK)
        while (sqlite3_step(q) == SQLITE_ROW) {
            const bool later = is_later(v, text_of(q, 2));
            snprintf(text, sizeof text, "the %s %s is missing", text_of(q, 0), text_of(q, 1));
            if (!later && !has(v, text_of(q, 0), text_of(q, 1)))
                find(v, "structure", -1, -1, -1, text);
        }
    sqlite3_finalize(q);
    sqlite3_close(fresh);
}

// --- what has one check value --------------------------------------------------------------------

static void check_meta_text(struct verify *v, const char *key, const char *wanted)
{
    char text[300], *found = store_read_meta(v->s, key);
    snprintf(text, sizeof text, "meta: %s is '%.100s', the configuration says '%.100s'", key,
             found ? found : "(missing)", wanted);
    if (!found || strcmp(found, wanted))
        find(v, "meta", -1, -1, -1, text);
    free(found);
}

static void check_meta_number(struct verify *v, const char *key, double wanted)
{
    char text[200];
    sqlite3_stmt *q = begin_part(v, "meta", "SELECT value FROM meta WHERE key = ?1");
    if (!q)
        return;
    store_db_bind_text(q, 1, key);
    const double found = sqlite3_step(q) == SQLITE_ROW ? sqlite3_column_double(q, 0) : (double)NAN;
    sqlite3_finalize(q);
    snprintf(text, sizeof text, "meta: %s is %.17g, the configuration or bench says %.17g", key,
             found, wanted);
    if (!(fabs(found - wanted) <= 1e-12 * fabs(wanted)))
        find(v, "meta", -1, -1, -1, text);
}

// What meta has of the campaign is there for other programs; it must be what the texts say.
static void check_config(struct verify *v)
{
    struct gon_error err;
    struct campaign_config c;
    if (store_read_config(v->s, &c, &err) < 0) {
        find_error(v, "config", &err);
        return;
    }
    check_meta_text(v, "name", c.name);
    check_meta_text(v, "sample", c.sample);
    check_meta_text(v, "operator", c.operator_name);
    check_meta_text(v, "notes", c.notes);
    check_meta_number(v, "phi_deg", c.phi_deg);
}

static void check_bench(struct verify *v)
{
    struct gon_error err;
    struct bench_config b;
    if (store_read_bench(v->s, &b, &err) < 0) {
        find_error(v, "bench", &err);
        return;
    }
    check_meta_number(v, "wavelength_nm", b.wavelength_nm);
    check_meta_number(v, "omega_sr", bench_omega_sr(&b));
}

static void check_texts(struct verify *v)
{
    struct gon_error err;
    check_config(v);
    check_bench(v);
    if (store_check_plan(v->s, &err) < 0)
        find_error(v, "plan", &err);
}

static void check_profiles(struct verify *v)
{
    char text[200];
    int step;
    if (v->seen.version < STORE_VERSION_PROFILES)
        return;
    sqlite3_stmt *q =
        begin_part(v, "profile", "SELECT id, t_utc_ms, name, role, text, crc32c FROM profile");
    if (!q)
        return;
    for (; (step = sqlite3_step(q)) == SQLITE_ROW; v->seen.profiles++) {
        const struct store_profile p = {text_of(q, 2), text_of(q, 3), text_of(q, 4)};
        snprintf(text, sizeof text, "profile %lld (%.60s): its check value is wrong",
                 (long long)sqlite3_column_int64(q, 0), p.name);
        if (sqlite3_column_int64(q, 5) != store_profile_crc(sqlite3_column_int64(q, 1), &p))
            find(v, "profile", -1, -1, -1, text);
    }
    end_part(v, "profile", q, step);
}

// A row that is gone would make a reading count again, or no longer.
static void check_exclusions(struct verify *v)
{
    char text[200];
    int step;
    if (v->seen.version < STORE_VERSION_EXCLUSIONS)
        return;
    sqlite3_stmt *q = begin_part(
        v, "exclusion", "SELECT " STORE_EXCLUSION_COLUMNS " FROM exclusion ORDER BY id");
    if (!q)
        return;
    for (int64_t last = 0; (step = sqlite3_step(q)) == SQLITE_ROW; v->seen.exclusions++) {
        const struct store_exclusion e = store_db_exclusion(q);
        snprintf(text, sizeof text, "exclusion %lld is missing before %lld", (long long)last + 1,
                 (long long)e.id);
        if (e.id != last + 1)
            find(v, "exclusion", -1, -1, -1, text);
        last = e.id;
        snprintf(text, sizeof text,
                 "exclusion %lld (sweep %d, point %d, attempt %d): its check value is wrong",
                 (long long)e.id, e.sweep, e.point, e.attempt);
        if (sqlite3_column_int64(q, STORE_EXCLUSION_CRC) != store_exclusion_crc(&e) ||
            store_standing_of(e.what) < 0)
            find(v, "exclusion", e.sweep, e.point, e.attempt, text);
    }
    end_part(v, "exclusion", q, step);
}

// --- readings beside the plan --------------------------------------------------------------------

// Points are measured in the plan's order, each until a reading is accepted, attempts counting up
// from 1: anything else means that rows are gone.
struct walk {
    struct verify *v;
    sqlite3_stmt *plan;
    bool at_point;                    // plan stands at a row
    bool accepted;                    // the point has a good reading
    int last_attempt;                 // of the point
    int open_sweep, open_point, open; // the first of so many points without a good reading
};

static int compare(int sweep, int point, const struct store_reading *r)
{
    return sweep != r->sweep ? (sweep > r->sweep) - (sweep < r->sweep)
                             : (point > r->point) - (point < r->point);
}

static void next_point(struct walk *w)
{
    w->at_point = sqlite3_step(w->plan) == SQLITE_ROW;
    w->accepted = false;
    w->last_attempt = 0;
    w->v->seen.points += w->at_point;
}

static void leave_point(struct walk *w)
{
    if (!w->accepted && w->open++ == 0) {
        w->open_sweep = sqlite3_column_int(w->plan, 0);
        w->open_point = sqlite3_column_int(w->plan, 1);
    }
    next_point(w);
}

static void check_hole(struct walk *w, const struct store_reading *r)
{
    char text[200], more[40] = "";
    if (w->open > 1)
        snprintf(more, sizeof more, " and %d more", w->open - 1);
    snprintf(text, sizeof text,
             "sweep %d, point %d%s: no accepted reading, though sweep %d, point %d came later",
             w->open_sweep, w->open_point, more, r->sweep, r->point);
    if (w->open)
        find(w->v, "hole", w->open_sweep, w->open_point, -1, text);
    w->open = 0;
}

static void check_reading(struct walk *w, const struct store_reading *r, bool sound)
{
    char text[200];
    const int last = w->last_attempt;
    if (!sound) {
        snprintf(text, sizeof text, "sweep %d, point %d, attempt %d: its check value is wrong",
                 r->sweep, r->point, r->attempt);
        find(w->v, "reading", r->sweep, r->point, r->attempt, text);
    }
    if (!w->at_point ||
        compare(sqlite3_column_int(w->plan, 0), sqlite3_column_int(w->plan, 1), r)) {
        snprintf(text, sizeof text, "sweep %d, point %d, attempt %d: not in the plan", r->sweep,
                 r->point, r->attempt);
        find(w->v, "reference", r->sweep, r->point, r->attempt, text);
        return;
    }
    if (r->attempt != last + 1) {
        snprintf(text, sizeof text, "sweep %d, point %d: attempt %d is missing before attempt %d",
                 r->sweep, r->point, last + 1, r->attempt);
        find(w->v, "hole", r->sweep, r->point, last + 1, text);
    }
    w->last_attempt = r->attempt;
    w->accepted = w->accepted || !(r->flags & STORE_REJECTING);
}

static void check_readings(struct verify *v)
{
    struct walk w = {.v = v};
    sqlite3_stmt *q =
        begin_part(v, "reading",
                   "SELECT " STORE_READING_COLUMNS " FROM reading ORDER BY sweep, point, attempt");
    int step = SQLITE_DONE;
    w.plan =
        q ? begin_part(v, "plan", "SELECT sweep, point FROM plan ORDER BY sweep, point") : NULL;
    if (w.plan)
        next_point(&w);
    for (; w.plan && (step = sqlite3_step(q)) == SQLITE_ROW; v->seen.readings++) {
        const struct store_reading r = store_db_reading(q);
        while (w.at_point &&
               compare(sqlite3_column_int(w.plan, 0), sqlite3_column_int(w.plan, 1), &r) < 0)
            leave_point(&w);
        check_hole(&w, &r);
        check_reading(&w, &r, sqlite3_column_int64(q, STORE_READING_CRC) == store_row_crc(&r));
    }
    while (w.at_point)
        leave_point(&w);
    sqlite3_finalize(w.plan);
    if (q)
        end_part(v, "reading", q, step);
    char state[16] = "", text[120];
    if (store_read_state(v->s, state, sizeof state, NULL, 0, NULL, NULL) >= 0 && w.open &&
        !strcmp(state, "done")) {
        snprintf(text, sizeof text,
                 "the state is done, but from sweep %d, point %d on %d points have no accepted "
                 "reading",
                 w.open_sweep, w.open_point, w.open);
        find(v, "state", w.open_sweep, w.open_point, -1, text);
    }
}

// --- what refers to something else ---------------------------------------------------------------

// Each row is a finding: sweep, point, attempt, text.
static const char *const references[] = {
    "SELECT -1, -1, -1, format('table reduced: reduction %d is not there', reduction)"
    " FROM (SELECT DISTINCT reduction FROM reduced)"
    " WHERE reduction NOT IN (SELECT id FROM reduction)",

    "SELECT sweep, point, attempt, format('reduction %d uses sweep %d, point %d, attempt %d, which"
    " is not there', reduction, sweep, point, attempt) FROM reduced d"
    " WHERE NOT EXISTS (SELECT 1 FROM reading r WHERE r.sweep = d.sweep AND r.point = d.point"
    " AND r.attempt = d.attempt)",

    "SELECT -1, -1, -1, format('reduction %d is of %d points, %d are there', id, points, found)"
    " FROM (SELECT id, points, (SELECT count(*) FROM reduced WHERE reduction = id) AS found"
    " FROM reduction) WHERE points <> found",

    "SELECT sweep, -1, -1, format('fit %d is of reduction %d, which is not there', id, reduction)"
    " FROM fit WHERE reduction > 0 AND reduction NOT IN (SELECT id FROM reduction)",

    "SELECT sweep, -1, -1, format('fit %d: its JSON cannot be read', id) FROM fit"
    " WHERE NOT json_valid(json)",
};

// The same of exclusions.
static const char *const decided[] = {
    "SELECT sweep, point, attempt, format('exclusion %d is of sweep %d, point %d, attempt %d, which"
    " is not there', id, sweep, point, attempt) FROM exclusion e"
    " WHERE NOT EXISTS (SELECT 1 FROM reading r WHERE r.sweep = e.sweep AND r.point = e.point"
    " AND r.attempt = e.attempt)",

    // With another newer row the point has been settled by hand.
    "SELECT e.sweep, e.point, e.attempt, format('the state is done, but sweep %d, point %d is to be"
    " measured again, as exclusion %d says', e.sweep, e.point, e.id) FROM exclusion e"
    " WHERE e.what IN ('replaced', 'repeated')"
    " AND (SELECT state FROM state ORDER BY id DESC LIMIT 1) = 'done'"
    " AND NOT EXISTS (SELECT 1 FROM reading r WHERE r.sweep = e.sweep AND r.point = e.point"
    " AND (r.flags & 255) = 0 AND coalesce((SELECT what FROM exclusion n WHERE n.sweep = r.sweep"
    " AND n.point = r.point AND n.attempt = r.attempt ORDER BY id DESC LIMIT 1), 'restored')"
    " IN ('restored', 'excluded'))",
};

static void check_references(struct verify *v, const char *const *queries, size_t most)
{
    for (size_t i = 0; i < most; i++) {
        sqlite3_stmt *q = begin_part(v, "reference", queries[i]);
        int step;
        if (!q)
            continue;
        while ((step = sqlite3_step(q)) == SQLITE_ROW)
            find(v, "reference", sqlite3_column_int(q, 0), sqlite3_column_int(q, 1),
                 sqlite3_column_int(q, 2), text_of(q, 3));
        end_part(v, "reference", q, step);
    }
}

int store_verify(struct store *s, void (*found)(void *ctx, const struct store_finding *f),
                 void *ctx, struct store_verified *ret_verified, struct gon_error *err)
{
    struct verify v = {.s = s, .found = found, .ctx = ctx, .seen.version = s->version};
    int rc = store_db_run(s, "BEGIN", err);
    if (rc < 0)
        return rc;
    check_structure(&v);
    check_schema(&v);
    check_texts(&v);
    check_profiles(&v);
    check_exclusions(&v);
    check_readings(&v);
    check_references(&v, references, sizeof references / sizeof *references);
    if (s->version >= STORE_VERSION_EXCLUSIONS)
        check_references(&v, decided, sizeof decided / sizeof *decided);
    v.seen.reductions = count(&v, "SELECT count(*) FROM reduction");
    v.seen.fits = count(&v, "SELECT count(*) FROM fit");
    sqlite3_exec(s->db, "ROLLBACK", NULL, NULL, NULL);
    *ret_verified = v.seen;
    return GON_OK;
}
