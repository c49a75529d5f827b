// SPDX-License-Identifier: MIT
// What is in a campaign file. Columns carry their unit; angles are in micro-degrees as integers, so
// that equal angles are equal. The views are for the sqlite3 shell and pandas.
#include "campaign/store_db.h"

#include "base/crc32c.h"
#include "base/units.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// clang-format off
#define PARAMETER(p) p " REAL, u_" p " REAL, " p "_lo95 REAL, " p "_hi95 REAL, " \
                     p "_identified INTEGER, " p "_at_bound INTEGER, "
#define RESULT(p) p ", u_" p ", " p "_lo95, " p "_hi95, " p "_identified, " p "_at_bound, "
#define DERIVED(p) p " REAL, u_" p " REAL, "
#define NEVER(what, table, text) \
    "CREATE TRIGGER " table "_" what " BEFORE " what " ON " table \
    " BEGIN SELECT RAISE(ABORT, '" text "'); END;"

#define PROFILE_TABLE \
    "CREATE TABLE profile (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL, name TEXT NOT NULL," \
    " role TEXT NOT NULL, text TEXT NOT NULL, crc32c INTEGER NOT NULL);" \
    NEVER("UPDATE", "profile", "profiles are never changed") \
    NEVER("DELETE", "profile", "profiles are never removed")

const char store_profile_sql[] = PROFILE_TABLE;

// The view has what does not count now.
#define EXCLUSION_TABLE \
    "CREATE TABLE exclusion (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL," \
    " sweep INTEGER NOT NULL, point INTEGER NOT NULL, attempt INTEGER NOT NULL," \
    " what TEXT NOT NULL, reason TEXT NOT NULL CHECK (reason <> ''), who TEXT NOT NULL," \
    " crc32c INTEGER NOT NULL);" \
    "CREATE INDEX exclusion_reading ON exclusion (sweep, point, attempt);" \
    NEVER("UPDATE", "exclusion", "exclusions are never changed") \
    NEVER("DELETE", "exclusion", "exclusions are never removed") \
    "CREATE VIEW excluded AS SELECT sweep, point, attempt, what, reason, who, t_utc_ms" \
    " FROM exclusion e WHERE what IN ('excluded', 'replaced') AND id = (SELECT max(id)" \
    " FROM exclusion n WHERE n.sweep = e.sweep AND n.point = e.point AND n.attempt = e.attempt);"

// Every reading on the sample; f_r of the newest reduction for those that it used and that still
// count.
#define BRDF_VIEW \
    "CREATE VIEW reading_brdf AS SELECT r.sweep, r.point, r.attempt, r.t_utc_ms," \
    " p.theta_i_udeg / 1e6 AS theta_i_nominal_deg," \
    " p.theta_r_udeg / 1e6 AS theta_r_signed_nominal_deg," \
    " r.theta_i_udeg / 1e6 AS theta_i_deg, r.theta_r_udeg / 1e6 AS theta_r_signed_deg," \
    " p.phi_udeg / 1e6 AS phi_deg, p.pol_in, p.pol_out, p.weight AS g," \
    " d.f_r_per_sr AS f_r, d.u_a_per_sr AS u_A, d.u_b_per_sr AS u_B, r.flags," \
    " r.signal_v, r.signal_sd_v, r.monitor_v, r.monitor_sd_v, r.samples, r.detector_range," \
    " x.reason AS excluded" \
    " FROM reading r JOIN plan p ON p.sweep = r.sweep AND p.point = r.point" \
    " LEFT JOIN excluded x ON x.sweep = r.sweep AND x.point = r.point AND x.attempt = r.attempt" \
    " LEFT JOIN reduced d ON d.reduction = (SELECT max(id) FROM reduction)" \
    " AND d.sweep = r.sweep AND d.point = r.point AND d.attempt = r.attempt" \
    " AND x.reason IS NULL WHERE p.kind = 'sample';"

const char store_exclusion_sql[] =
    "ALTER TABLE reduction ADD COLUMN excluded INTEGER NOT NULL DEFAULT 0;"
    EXCLUSION_TABLE
    "DROP VIEW reading_brdf;"
    BRDF_VIEW;

const char store_schema_sql[] =
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value) WITHOUT ROWID;"

    "CREATE TABLE plan (sweep INTEGER, point INTEGER, kind TEXT NOT NULL, station TEXT NOT NULL,"
    " theta_i_udeg INTEGER NOT NULL, theta_r_udeg INTEGER NOT NULL, phi_udeg INTEGER NOT NULL,"
    " pol_in TEXT NOT NULL, pol_out TEXT NOT NULL, weight REAL NOT NULL, dense INTEGER NOT NULL,"
    " PRIMARY KEY (sweep, point)) WITHOUT ROWID;"

    "CREATE TABLE reading (sweep INTEGER, point INTEGER, attempt INTEGER,"
    " t_utc_ms INTEGER NOT NULL, theta_i_udeg INTEGER NOT NULL, theta_r_udeg INTEGER NOT NULL,"
    " signal_v REAL NOT NULL, signal_sd_v REAL NOT NULL, monitor_v REAL, monitor_sd_v REAL,"
    " samples INTEGER NOT NULL, detector_range INTEGER NOT NULL, flags INTEGER NOT NULL,"
    " crc32c INTEGER NOT NULL, PRIMARY KEY (sweep, point, attempt)) WITHOUT ROWID;"
    NEVER("UPDATE", "reading", "readings are never changed")
    NEVER("DELETE", "reading", "readings are never removed")

    PROFILE_TABLE

    EXCLUSION_TABLE

    "CREATE TABLE event (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL, level TEXT NOT NULL,"
    " source TEXT NOT NULL, text TEXT NOT NULL);"
    "CREATE TABLE state (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL, state TEXT NOT NULL,"
    " why TEXT NOT NULL);"

    "CREATE TABLE reduction (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL,"
    " gonio_version TEXT NOT NULL, regime TEXT NOT NULL, points INTEGER NOT NULL,"
    " left_out INTEGER NOT NULL, omega_sr REAL, beam_signal_v REAL, beam_monitor_v REAL,"
    " dark_signal_v REAL, dark_monitor_v REAL, u_dark_v REAL, noise_floor_v REAL, noise_rel REAL,"
    " noise_monitor_rel REAL, u_beam_rel REAL, u_radius_rel REAL, u_distance_rel REAL,"
    " u_linearity_rel REAL, u_scale_rel REAL, excluded INTEGER NOT NULL DEFAULT 0);"
    "CREATE TABLE reduced (reduction INTEGER, sweep INTEGER, point INTEGER,"
    " attempt INTEGER NOT NULL, f_r_per_sr REAL NOT NULL, u_a_per_sr REAL,"
    " u_b_per_sr REAL NOT NULL, PRIMARY KEY (reduction, sweep, point)) WITHOUT ROWID;"

    "CREATE TABLE fit (id INTEGER PRIMARY KEY, t_utc_ms INTEGER NOT NULL,"
    " gonio_version TEXT NOT NULL, sweep INTEGER NOT NULL, reduction INTEGER,"
    " method TEXT NOT NULL, weights TEXT NOT NULL, diffuse TEXT NOT NULL, seed INTEGER NOT NULL,"
    " points INTEGER NOT NULL, delta REAL, "
    PARAMETER("n") PARAMETER("k") PARAMETER("sigma") PARAMETER("ks") PARAMETER("kd")
    DERIVED("ks_r0") DERIVED("ks_r45") DERIVED("dhr_0") DERIVED("dhr_45") DERIVED("dhr_60")
    "chi2_per_dof REAL, warnings INTEGER NOT NULL, evaluations INTEGER, elapsed_ms REAL,"
    " elapsed_total_ms REAL, json TEXT NOT NULL, trace TEXT);"

    BRDF_VIEW

    "CREATE VIEW fit_result AS SELECT id, t_utc_ms, sweep, method, weights, diffuse, seed, points,"
    " delta, " RESULT("n") RESULT("k") RESULT("sigma") RESULT("ks") RESULT("kd")
    " ks_r0, u_ks_r0, ks_r45, u_ks_r45, dhr_0, u_dhr_0, dhr_45, u_dhr_45, dhr_60, u_dhr_60,"
    " chi2_per_dof, warnings, elapsed_ms FROM fit;";
// clang-format on

// --- the first content ---------------------------------------------------------------------------

static int put_text(struct store *s, const char *key, const char *text, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = store_db_prepare(s, "INSERT INTO meta VALUES (?1, ?2)", &statement, err);
    if (rc < 0)
        return rc;
    store_db_bind_text(statement, 1, key);
    store_db_bind_text(statement, 2, text);
    return store_db_finish(s, statement, err);
}

static int put_number(struct store *s, const char *key, double value, struct gon_error *err)
{
    sqlite3_stmt *statement;
    int rc = store_db_prepare(s, "INSERT INTO meta VALUES (?1, ?2)", &statement, err);
    if (rc < 0)
        return rc;
    store_db_bind_text(statement, 1, key);
    sqlite3_bind_double(statement, 2, value);
    return store_db_finish(s, statement, err);
}

// The states of one side on the sample, in order, each once: "s" or "s, p".
static void states_text(const struct plan *plan, bool in, char *text, size_t size)
{
    bool seen[POL_COUNT] = {false};
    *text = 0;
    for (int i = 0; i < plan->count; i++) {
        const struct plan_point *p = &plan->points[i];
        const int state = in ? p->pol_in : p->pol_out;
        const size_t used = strlen(text);
        if (p->kind != PLAN_SAMPLE || seen[state])
            continue;
        snprintf(text + used, size - used, "%s%s", used ? ", " : "",
                 polarisation_name((enum polarisation)state));
        seen[state] = true;
    }
}

static int put_meta(struct store *s, const struct store_new *what, struct gon_error *err)
{
    char config_crc[16], bench_crc[16], created[24], pol_in[60], pol_out[60];
    const struct campaign_config *c = what->config;
    states_text(what->plan, true, pol_in, sizeof pol_in);
    states_text(what->plan, false, pol_out, sizeof pol_out);
    snprintf(config_crc, sizeof config_crc, "%08x",
             crc32c(0, what->config_text, strlen(what->config_text)));
    snprintf(bench_crc, sizeof bench_crc, "%08x",
             crc32c(0, what->bench_text, strlen(what->bench_text)));
    snprintf(created, sizeof created, "%lld", (long long)what->t_utc_ms);
    const char *const texts[][2] = {
        {"name", c->name},
        {"sample", c->sample},
        {"operator", c->operator_name},
        {"notes", c->notes},
        {"created_utc_ms", created},
        {"gonio_version", GONIO_VERSION},
        {"config_name", what->config_name},
        {"config", what->config_text},
        {"config_crc32c", config_crc},
        {"bench", what->bench_text},
        {"bench_crc32c", bench_crc},
        {"bench_name", what->bench->name},
        {"regime", what->bench->regime == BENCH_OVERFILLED ? "overfilled" : "underfilled"},
        {"pol_in", pol_in},
        {"pol_out", pol_out},
    };
    int rc = GON_OK;
    for (size_t i = 0; i < sizeof texts / sizeof *texts && rc >= 0; i++)
        rc = put_text(s, texts[i][0], texts[i][1], err);
    if (rc >= 0)
        rc = put_number(s, "wavelength_nm", what->bench->wavelength_nm, err);
    if (rc >= 0)
        rc = put_number(s, "phi_deg", c->phi_deg, err);
    return rc >= 0 ? put_number(s, "omega_sr", bench_omega_sr(what->bench), err) : rc;
}

static int put_point(struct store *s, const struct store_new *what, const struct plan_point *p,
                     struct gon_error *err)
{
    sqlite3_stmt *q;
    int rc = store_db_prepare(
        s, "INSERT INTO plan VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)", &q, err);
    if (rc < 0)
        return rc;
    sqlite3_bind_int(q, 1, p->sweep);
    sqlite3_bind_int(q, 2, p->point);
    store_db_bind_text(q, 3, plan_kind_name(p->kind));
    store_db_bind_text(q, 4, p->station);
    sqlite3_bind_int64(q, 5, units_udeg(p->theta_i_deg));
    sqlite3_bind_int64(q, 6, units_udeg(p->theta_r_deg));
    sqlite3_bind_int64(q, 7, units_udeg(what->config->phi_deg));
    store_db_bind_text(q, 8, polarisation_name((enum polarisation)p->pol_in));
    store_db_bind_text(q, 9, polarisation_name((enum polarisation)p->pol_out));
    sqlite3_bind_double(q, 10, p->weight);
    sqlite3_bind_int(q, 11, p->dense);
    return store_db_finish(s, q, err);
}

static uint32_t column_crc(uint32_t crc, sqlite3_stmt *q, int column)
{
    const int type = sqlite3_column_type(q, column);
    if (type == SQLITE_TEXT) {
        const unsigned char *text = sqlite3_column_text(q, column);
        return crc32c(crc, text, (size_t)sqlite3_column_bytes(q, column) + 1);
    }
    unsigned char bytes[8];
    uint64_t bits = (uint64_t)sqlite3_column_int64(q, column);
    const double value = sqlite3_column_double(q, column);
    if (type == SQLITE_FLOAT)
        memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(bits >> (8 * i));
    return crc32c(crc, bytes, sizeof bytes);
}

int store_plan_crc(struct store *s, uint32_t *ret_crc, struct gon_error *err)
{
    sqlite3_stmt *q;
    uint32_t crc = 0;
    int step, rc = store_db_prepare(s, "SELECT * FROM plan ORDER BY sweep, point", &q, err);
    if (rc < 0)
        return rc;
    while ((step = sqlite3_step(q)) == SQLITE_ROW)
        for (int i = 0; i < sqlite3_column_count(q); i++)
            crc = column_crc(crc, q, i);
    rc = step == SQLITE_DONE ? GON_OK : store_db_fail(s, err);
    sqlite3_finalize(q);
    if (rc >= 0)
        *ret_crc = crc;
    return rc;
}

static int put_plan(struct store *s, const struct store_new *what, struct gon_error *err)
{
    char text[16];
    uint32_t crc = 0;
    int rc = GON_OK;
    for (int i = 0; i < what->plan->count && rc >= 0; i++)
        rc = put_point(s, what, &what->plan->points[i], err);
    if (rc >= 0)
        rc = store_plan_crc(s, &crc, err);
    snprintf(text, sizeof text, "%08x", crc);
    return rc >= 0 ? put_text(s, "plan_crc32c", text, err) : rc;
}

int store_write_new(struct store *s, const struct store_new *what, struct gon_error *err)
{
    char pragmas[120];
    snprintf(pragmas, sizeof pragmas, "PRAGMA application_id = %d; PRAGMA user_version = %d;",
             STORE_APPLICATION, STORE_VERSION);
    int rc = store_db_begin(s, err);
    if (rc < 0)
        return rc;
    rc = store_db_run(s, pragmas, err);
    if (rc >= 0)
        rc = store_db_run(s, store_schema_sql, err);
    if (rc >= 0)
        rc = put_meta(s, what, err);
    if (rc >= 0)
        rc = put_plan(s, what, err);
    for (int i = 0; i < what->profiles_count && rc >= 0; i++)
        rc = store_put_profile(s, what->t_utc_ms, &what->profiles[i], err);
    return store_db_end(s, rc, err);
}
