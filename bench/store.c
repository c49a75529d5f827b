// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// What a campaign file costs: bytes a reading, a sweep read back out of many readings, a commit.
//
// GONIO_BENCH_READINGS: how many (1,000,000); GONIO_BENCH_FOLDER: where, on the disk that is meant
// (/var/tmp).
#include "bench/report.h"
#include "campaign/store_row.h"
#include "tests/unit/campaign_fixture.h"

#include <sqlite3.h>
#include <sys/stat.h>

enum { READINGS = 1000000, A_SWEEP = 850, COMMITS = 3000, READS = 200 };

static const char config_text[] =
    "campaign: { name = \"bench\"; theta_i_deg = 10; theta_r: { step_deg = 60; };"
    " dense: { half_width_deg = 0; }; };";

static void stop(const char *what, const char *why)
{
    fprintf(stderr, "bench store: %s: %s\n", what, why);
    exit(1);
}

static struct store_reading reading(int sweep, int point)
{
    return (struct store_reading){.sweep = sweep,
                                  .point = point,
                                  .attempt = 1,
                                  .t_utc_ms =
                                      1700000000000 + 150 * (A_SWEEP * (int64_t)sweep + point),
                                  .theta_i_udeg = 10000000 + sweep,
                                  .theta_r_udeg = -85000000 + 200000 * point + 137,
                                  .signal_v = 1e-3 / (1 + 0.1234567 * point),
                                  .signal_sd_v = 1.5e-6 + 1e-12 * point,
                                  .monitor_v = 1.001 - 1e-7 * point,
                                  .monitor_sd_v = 2e-4 + 1e-10 * point,
                                  .count = 4,
                                  .range = 7};
}

static void create(const char *path)
{
    const struct campaign_config config = fixture_campaign(config_text);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s;
    struct gon_error err;
    if (plan_make(&config, &bench, &plan, &err) < 0)
        stop("plan", err.text);
    const struct store_new what = {&config, config_text, "bench.cfg", &bench, FIXTURE_BENCH,
                                   &plan,   1000,        NULL,        0};
    if (store_create(path, &what, &s, &err) < 0)
        stop("create", err.text);
    store_close(s, NULL);
    plan_clear(&plan);
}

static void run(sqlite3 *db, const char *sql)
{
    if (sqlite3_exec(db, sql, NULL, NULL, NULL) != SQLITE_OK)
        stop("fill", sqlite3_errmsg(db));
}

static void insert(sqlite3_stmt *q, const struct store_reading *r)
{
    const double values[] = {r->signal_v, r->signal_sd_v, r->monitor_v, r->monitor_sd_v};
    sqlite3_bind_int(q, 1, r->sweep);
    sqlite3_bind_int(q, 2, r->point);
    sqlite3_bind_int64(q, 3, r->t_utc_ms);
    sqlite3_bind_int(q, 4, r->theta_i_udeg);
    sqlite3_bind_int(q, 5, r->theta_r_udeg);
    for (int i = 0; i < 4; i++)
        sqlite3_bind_double(q, 6 + i, values[i]);
    sqlite3_bind_int64(q, 10, store_row_crc(r));
    if (sqlite3_step(q) != SQLITE_DONE || sqlite3_reset(q) != SQLITE_OK)
        stop("fill", "a row was refused");
}

// As store_append_reading leaves them, in one transaction; a plan of two sweeps more than that.
static void fill(const char *path, int sweeps)
{
    sqlite3 *db;
    sqlite3_stmt *q;
    if (sqlite3_open(path, &db) != SQLITE_OK)
        stop("fill", "open");
    char sql[400];
    snprintf(sql, sizeof sql,
             "PRAGMA synchronous = OFF; BEGIN; INSERT INTO plan WITH RECURSIVE n(i) AS (SELECT 0"
             " UNION ALL SELECT i + 1 FROM n LIMIT %d) SELECT 100 + i / %d, i %% %d, 'sample', '',"
             " 0, 0, 0, 's', 's', 1, 0 FROM n",
             (sweeps + 4) * A_SWEEP, A_SWEEP, A_SWEEP);
    run(db, sql);
    if (sqlite3_prepare_v2(
            db,
            "INSERT INTO reading VALUES (?1, ?2, 1, ?3, ?4, ?5, ?6, ?7, ?8, ?9, 4, 7,"
            " 0, ?10)",
            -1, &q, NULL) != SQLITE_OK)
        stop("fill", sqlite3_errmsg(db));
    for (int sweep = 0; sweep < sweeps; sweep++)
        for (int point = 0; point < A_SWEEP; point++) {
            const struct store_reading r = reading(100 + sweep, point);
            insert(q, &r);
        }
    sqlite3_finalize(q);
    run(db, "COMMIT");
    sqlite3_close(db);
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double read_sweeps_ms(const char *path, int sweeps)
{
    struct store *s;
    struct gon_error err;
    double ms[READS];
    if (store_open(path, STORE_READ, &s, &err) < 0)
        stop("open", err.text);
    for (int i = 0; i < READS; i++) {
        struct store_reading *rows;
        const double start = report_now_ns();
        const int sweep = 100 + (int)((int64_t)i * 7919 % sweeps);
        if (store_read_readings(s, sweep, &rows, &err) != A_SWEEP)
            stop("read", err.text);
        ms[i] = 1e-6 * (report_now_ns() - start);
        free(rows);
    }
    store_close(s, NULL);
    qsort(ms, READS, sizeof *ms, compare);
    return ms[READS * 99 / 100];
}

static void commit(const char *path, int sweeps, double *ret_median_ms, double *ret_p99_ms)
{
    static double ms[COMMITS];
    struct store *s;
    struct gon_error err;
    if (store_open(path, STORE_WRITE, &s, &err) < 0)
        stop("open", err.text);
    for (int i = 0; i < COMMITS; i++) {
        const struct store_reading r = reading(100 + sweeps + i / A_SWEEP, i % A_SWEEP);
        const double start = report_now_ns();
        if (store_append_reading(s, &r, &err) < 0)
            stop("append", err.text);
        ms[i] = 1e-6 * (report_now_ns() - start);
    }
    store_close(s, NULL);
    qsort(ms, COMMITS, sizeof *ms, compare);
    *ret_median_ms = ms[COMMITS / 2];
    *ret_p99_ms = ms[COMMITS * 99 / 100];
}

int main(void)
{
    const char *given = getenv("GONIO_BENCH_READINGS"), *where = getenv("GONIO_BENCH_FOLDER");
    const int sweeps = (given && atoi(given) > 0 ? atoi(given) : READINGS) / A_SWEEP + 1;
    struct fixture_folder folder;
    struct stat before, after;
    char path[128];
    double median_ms, p99_ms;
    snprintf(folder.path, sizeof folder.path, "%.40s/gonio-bench-XXXXXX",
             where ? where : "/var/tmp");
    if (!mkdtemp(folder.path))
        stop(folder.path, "cannot be made");
    fixture_path(&folder, "0001-bench.gonio", path, sizeof path);
    create(path);
    stat(path, &before);
    fill(path, sweeps);
    stat(path, &after);
    commit(path, sweeps, &median_ms, &p99_ms);
    report_row("store", "readings in the file", (double)sweeps * A_SWEEP, "", 0, NULL);
    report_row("store", "a reading and its point of the plan",
               (double)(after.st_size - before.st_size) / ((double)sweeps * A_SWEEP), "bytes", 0,
               NULL);
    report_row("store", "one sweep of 850 readings read, 99 %", read_sweeps_ms(path, sweeps), "ms",
               0, NULL);
    report_row("store", "a reading committed, median", median_ms, "ms", 0, NULL);
    report_row("store", "a reading committed, 99 %", p99_ms, "ms", 0, NULL);
    fixture_remove(&folder);
    return 0;
}
