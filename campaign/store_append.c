// SPDX-License-Identifier: MIT
#include "campaign/fitjson.h"
#include "campaign/reduce.h"
#include "campaign/store_db.h"
#include "campaign/store_reserve.h"
#include "campaign/store_row.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- readings ------------------------------------------------------------------------------------

// The row that is there already: the same is accepted again, another one is a mistake.
static int compare(struct store *s, const struct store_reading *r, struct gon_error *err)
{
    struct store_reading *rows;
    unsigned char wanted[STORE_ROW_BYTES], found[STORE_ROW_BYTES];
    int count = store_read_readings(s, r->sweep, &rows, err);
    if (count < 0)
        return count;
    int rc = GON_E_INPUT;
    store_row_bytes(r, wanted);
    for (int i = 0; i < count; i++) {
        store_row_bytes(&rows[i], found);
        if (!memcmp(wanted, found, sizeof wanted))
            rc = GON_OK;
    }
    free(rows);
    return rc == GON_OK ? rc
                        : gon_fail(err, GON_E_INPUT,
                                   "%s: sweep %d, point %d, attempt %d is there already with other "
                                   "values; readings are never changed",
                                   s->path, r->sweep, r->point, r->attempt);
}

static void bind_reading(sqlite3_stmt *q, const struct store_reading *r)
{
    sqlite3_bind_int(q, 1, r->sweep);
    sqlite3_bind_int(q, 2, r->point);
    sqlite3_bind_int(q, 3, r->attempt);
    sqlite3_bind_int64(q, 4, r->t_utc_ms);
    sqlite3_bind_int(q, 5, r->theta_i_udeg);
    sqlite3_bind_int(q, 6, r->theta_r_udeg);
    sqlite3_bind_double(q, 7, r->signal_v + 0.0);
    sqlite3_bind_double(q, 8, r->signal_sd_v + 0.0);
    sqlite3_bind_double(q, 9, r->monitor_v + 0.0); // NaN becomes NULL
    sqlite3_bind_double(q, 10, r->monitor_sd_v + 0.0);
    sqlite3_bind_int(q, 11, r->count);
    sqlite3_bind_int(q, 12, r->range);
    sqlite3_bind_int64(q, 13, r->flags);
    sqlite3_bind_int64(q, 14, store_row_crc(r));
}

// A row that is there already is compared.
static int insert_reading(struct store *s, const struct store_reading *r, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_ready(s, err);
    if (rc >= 0)
        rc = store_db_prepare(
            s,
            "INSERT INTO reading SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14"
            " FROM plan WHERE sweep = ?1 AND point = ?2",
            &q, err);
    if (rc < 0)
        return rc;
    bind_reading(q, r);
    int step = sqlite3_step(q);
    bool there = (step & 0xff) == SQLITE_CONSTRAINT;
    if (step != SQLITE_DONE && !there)
        rc = store_db_fail(s, err);
    else if (!there && sqlite3_changes(s->db) == 0)
        rc = gon_fail(err, GON_E_INPUT, "%s: sweep %d, point %d is not in the plan", s->path,
                      r->sweep, r->point);
    sqlite3_finalize(q);
    if (rc >= 0 && !there)
        s->rows++;
    return there ? compare(s, r, err) : rc;
}

int store_append_reading(struct store *s, const struct store_reading *r, struct gon_error *err)
{
    int rc = store_row_check(r, err);
    if (rc >= 0 && s->mode == STORE_WRITE && s->full && !store_reserve_take(s->path))
        rc = gon_fail(err, GON_E_STORE,
                      "%s: the disk is full; free %d MB on it, then it goes on by itself", s->path,
                      2 * STORE_RESERVE_BYTES >> 20);
    if (rc < 0)
        return rc;
    s->full = false;
    rc = insert_reading(s, r, err);
    // The reserve has room for it. It is safe then, but the run must pause: it is acknowledged when
    // it is offered again and the reserve is back.
    if (rc < 0 && s->full)
        insert_reading(s, r, NULL);
    return rc;
}

// --- what happened -------------------------------------------------------------------------------

static int append_texts(struct store *s, const char *sql, int64_t t_utc_ms, const char *a,
                        const char *b, const char *c, struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_ready(s, err);
    if (rc >= 0)
        rc = store_db_prepare(s, sql, &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, t_utc_ms);
    store_db_bind_text(q, 2, a ? a : "");
    store_db_bind_text(q, 3, b ? b : "");
    if (c)
        store_db_bind_text(q, 4, c);
    return store_db_finish(s, q, err);
}

int store_append_event(struct store *s, int64_t t_utc_ms, const char *level, const char *source,
                       const char *text, struct gon_error *err)
{
    return append_texts(s,
                        "INSERT INTO event (t_utc_ms, level, source, text) VALUES (?1, ?2, ?3, ?4)",
                        t_utc_ms, level, source, text ? text : "", err);
}

int store_append_state(struct store *s, int64_t t_utc_ms, const char *state, const char *why,
                       struct gon_error *err)
{
    return append_texts(s, "INSERT INTO state (t_utc_ms, state, why) VALUES (?1, ?2, ?3)", t_utc_ms,
                        state, why, NULL, err);
}

// --- results -------------------------------------------------------------------------------------

static int put_reduction(struct store *s, int64_t t_utc_ms, const struct reduction *r,
                         struct gon_error *err)
{
    sqlite3_stmt *q;
    const int first = r->channel[0].pol_in;
    const double values[] = {r->omega_sr,
                             r->reference.beam_signal_v[first],
                             r->reference.beam_monitor_v[first],
                             r->reference.dark_signal_v,
                             r->reference.dark_monitor_v,
                             r->u_dark_v,
                             r->noise.floor_v,
                             r->noise.rel,
                             r->noise.rel_monitor,
                             r->u_beam_rel,
                             r->u_radius_rel,
                             r->u_distance_rel,
                             r->u_linearity_rel,
                             r->u_scale_rel};
    int rc = store_db_prepare(
        s,
        "INSERT INTO reduction VALUES (NULL, ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12,"
        " ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20)",
        &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, t_utc_ms);
    store_db_bind_text(q, 2, GONIO_VERSION);
    store_db_bind_text(q, 3, r->regime == BENCH_OVERFILLED ? "overfilled" : "underfilled");
    sqlite3_bind_int(q, 4, r->count);
    sqlite3_bind_int(q, 5, r->left_out);
    for (int i = 0; i < (int)(sizeof values / sizeof *values); i++)
        sqlite3_bind_double(q, 6 + i, values[i]);
    sqlite3_bind_int(q, 20, r->excluded);
    return store_db_finish(s, q, err);
}

static int put_reduced(struct store *s, int64_t id, const struct reduced_point *p,
                       struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc =
        store_db_prepare(s, "INSERT INTO reduced VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)", &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int64(q, 1, id);
    sqlite3_bind_int(q, 2, p->sweep);
    sqlite3_bind_int(q, 3, p->point);
    sqlite3_bind_int(q, 4, p->attempt);
    sqlite3_bind_double(q, 5, p->f_per_sr);
    sqlite3_bind_double(q, 6, p->u_a_per_sr);
    sqlite3_bind_double(q, 7, p->u_b_per_sr);
    return store_db_finish(s, q, err);
}

int store_append_reduction(struct store *s, int64_t t_utc_ms, const struct reduction *r,
                           int64_t *ret_id, struct gon_error *err)
{
    int rc = store_db_ready(s, err);
    if (rc >= 0)
        rc = store_db_begin(s, err);
    if (rc < 0)
        return rc;
    rc = put_reduction(s, t_utc_ms, r, err);
    const int64_t id = sqlite3_last_insert_rowid(s->db);
    for (int i = 0; i < r->count && rc >= 0; i++)
        rc = put_reduced(s, id, &r->points[i], err);
    rc = store_db_end(s, rc, err);
    if (rc >= 0 && ret_id)
        *ret_id = id;
    return rc;
}

static int bind_estimate(sqlite3_stmt *q, int at, const struct fit_estimate *e)
{
    const double values[] = {e->value, e->u, e->lo95, e->hi95};
    for (int i = 0; i < 4; i++)
        sqlite3_bind_double(q, at++, values[i]);
    sqlite3_bind_int(q, at++, e->identified);
    sqlite3_bind_int(q, at++, e->at_bound);
    return at;
}

static void bind_fit(sqlite3_stmt *q, int64_t t_utc_ms, const struct fit_record *f,
                     const char *json)
{
    const struct fit_result *r = &f->result;
    const struct fit_derived *const derived[] = {&r->ks_r0, &r->ks_r45, &r->dhr_0, &r->dhr_45,
                                                 &r->dhr_60};
    int at = 1;
    sqlite3_bind_int64(q, at++, t_utc_ms);
    store_db_bind_text(q, at++, GONIO_VERSION);
    sqlite3_bind_int(q, at++, f->sweep);
    sqlite3_bind_int64(q, at++, f->reduction);
    store_db_bind_text(q, at++, fit_method_name(f->options.method));
    store_db_bind_text(q, at++, fit_weighting_name(f->options.weighting));
    store_db_bind_text(q, at++, fit_diffuse_name(f->options.diffuse));
    sqlite3_bind_int64(q, at++, (sqlite3_int64)f->options.seed);
    sqlite3_bind_int64(q, at++, (sqlite3_int64)f->points);
    sqlite3_bind_double(q, at++, r->delta);
    for (int i = 0; i < FIT_PARAMS; i++)
        at = bind_estimate(q, at, &r->estimate[i]);
    for (int i = 0; i < 5; i++) {
        sqlite3_bind_double(q, at++, derived[i]->value);
        sqlite3_bind_double(q, at++, derived[i]->u);
    }
    sqlite3_bind_double(q, at++, r->chi2_per_dof);
    sqlite3_bind_int64(q, at++, r->warnings);
    sqlite3_bind_int64(q, at++, r->evaluations);
    sqlite3_bind_double(q, at++, r->elapsed_ms);
    sqlite3_bind_double(q, at++, r->elapsed_total_ms);
    store_db_bind_text(q, at++, json);
    store_db_bind_text(q, at, f->trace);
}

int store_append_fit(struct store *s, int64_t t_utc_ms, const struct fit_record *f, int64_t *ret_id,
                     struct gon_error *err)
{
    enum { COLUMNS = 10 + 6 * FIT_PARAMS + 2 * 5 + 7 };
    char sql[60 + 2 * COLUMNS] = "INSERT INTO fit VALUES (NULL", *json = fit_json(f, 0);
    sqlite3_stmt *q;
    for (int i = 0; i < COLUMNS; i++)
        strcat(sql, ",?");
    strcat(sql, ")");
    int rc = json ? store_db_ready(s, err) : gon_fail(err, GON_E_SYSTEM, "fit: out of memory");
    if (rc >= 0)
        rc = store_db_prepare(s, sql, &q, err);
    if (rc >= 0) {
        bind_fit(q, t_utc_ms, f, json);
        rc = store_db_finish(s, q, err);
    }
    if (rc >= 0 && ret_id)
        *ret_id = sqlite3_last_insert_rowid(s->db);
    free(json);
    return rc;
}
