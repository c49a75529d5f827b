// SPDX-License-Identifier: MIT
// A campaign file in a folder of its own, for the tests of campaign/store*.c.
#pragma once
#include "campaign_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <sqlite3.h>

#define CONFIG                                                                                     \
    "campaign: { name = \"Test paint\"; sample = \"panel 3\"; theta_i_deg = (10, 20, 30);"         \
    " theta_r: { from_deg = -20; to_deg = 40; step_deg = 10; }; dense: { half_width_deg = 1; }; "  \
    "};"

static struct fixture_folder folder;
static char path[128];

static inline int begin(void **state)
{
    (void)state;
    folder = fixture_folder();
    fixture_path(&folder, "0001-test.gonio", path, sizeof path);
    return 0;
}

static inline int end(void **state)
{
    (void)state;
    fixture_remove(&folder);
    return 0;
}

static inline struct store *created_from(const char *config_text)
{
    const struct campaign_config config = fixture_campaign(config_text);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s = NULL;
    struct gon_error err = {0};
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, config_text,   "test.cfg", &bench, FIXTURE_BENCH,
                                   &plan,   1700000000123, NULL,       0};
    assert_int_equal(store_create(path, &what, &s, &err), 0);
    plan_clear(&plan);
    return s;
}

static inline struct store *created(void)
{
    return created_from(CONFIG);
}

static inline struct store_reading reading(int sweep, int point, int attempt)
{
    return (struct store_reading){.sweep = sweep,
                                  .point = point,
                                  .attempt = attempt,
                                  .t_utc_ms = 1700000001000 + point,
                                  .theta_i_udeg = 10000300,
                                  .theta_r_udeg = -20000100,
                                  .signal_v = 1.23456789e-3,
                                  .signal_sd_v = 1.5e-6,
                                  .monitor_v = 1.001,
                                  .monitor_sd_v = 2e-4,
                                  .count = 4,
                                  .range = 7};
}

static inline void append(struct store *s, const struct store_reading *r)
{
    struct gon_error err = {0};
    int rc = store_append_reading(s, r, &err);
    if (rc < 0)
        print_error("%s\n", err.text);
    assert_int_equal(rc, 0);
}

static inline struct store *opened(enum store_mode mode)
{
    struct store *s = NULL;
    struct gon_error err = {0};
    int rc = store_open(path, mode, &s, &err);
    if (rc < 0)
        print_error("%s\n", err.text);
    assert_int_equal(rc, 0);
    return s;
}

// Somebody else at the file, past our code.
static inline void tamper(const char *sql)
{
    sqlite3 *db;
    char *why = NULL;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    if (sqlite3_exec(db, sql, NULL, NULL, &why) != SQLITE_OK)
        print_error("%s\n", why);
    assert_null(why);
    sqlite3_close(db);
}

// The first column of the first row.
static inline int64_t number(const char *sql)
{
    sqlite3 *db;
    sqlite3_stmt *q;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &q, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_step(q), SQLITE_ROW);
    const int64_t value = sqlite3_column_int64(q, 0);
    sqlite3_finalize(q);
    sqlite3_close(db);
    return value;
}

static inline void make_from_sql(const char *sql_path)
{
    char text[32768];
    FILE *in = fopen(sql_path, "r");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = 0;
    fclose(in);
    tamper(text);
}
