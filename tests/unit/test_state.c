// SPDX-License-Identifier: MIT
// uses: campaign model base
// state.db: what it keeps, and what it does with files that are not as it left them.
#include "campaign/state.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <dirent.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct folder {
    char path[40], file[60];
};

static int set_up(void **state)
{
    struct folder *f = calloc(1, sizeof *f);
    strcpy(f->path, "/tmp/gonio-state-XXXXXX");
    assert_non_null(mkdtemp(f->path));
    snprintf(f->file, sizeof f->file, "%s/" STATE_FILE, f->path);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct folder *f = *state;
    DIR *d = opendir(f->path);
    for (struct dirent *e; (e = readdir(d));)
        unlinkat(dirfd(d), e->d_name, 0);
    closedir(d);
    assert_int_equal(rmdir(f->path), 0);
    free(f);
    return 0;
}

static struct state *open_state(const struct folder *f)
{
    struct state *s = NULL;
    struct gon_error err = {0};
    if (state_open(f->path, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static void write_runs(struct state *s, int first, int count)
{
    struct state_queue *q = state_queue_new((size_t)count);
    for (int i = 0; i < count; i++) {
        q->entries[i] = (struct state_entry){
            .run = first + count - i, .held = i % 3 == 1, .active = i == 0};
        snprintf(q->entries[i].path, sizeof q->entries[i].path, "%04d-\"it's\".gonio", first + i);
    }
    assert_int_equal(state_write_queue(s, q, NULL), 0);
    free(q);
}

static void check_runs(struct state *s, int first, int count)
{
    struct state_queue *q;
    char path[40];
    assert_int_equal(state_read_queue(s, &q, NULL), 0);
    assert_int_equal(q->count, count);
    for (int i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%04d-\"it's\".gonio", first + i);
        assert_int_equal(q->entries[i].run, first + count - i);
        assert_string_equal(q->entries[i].path, path);
        assert_int_equal(q->entries[i].held, i % 3 == 1);
        assert_int_equal(q->entries[i].active, i == 0);
    }
    free(q);
}

static void the_queue_comes_back_in_its_order(void **state)
{
    struct state *s = open_state(*state);
    check_runs(s, 0, 0);
    write_runs(s, 7, 900);
    check_runs(s, 7, 900);
    state_close(s);
    s = open_state(*state);
    check_runs(s, 7, 900);
    write_runs(s, 3, 2);
    state_close(s);
    s = open_state(*state);
    check_runs(s, 3, 2);
    state_close(s);
}

// A run twice is a mistake of the caller; what was there stays.
static void what_cannot_be_written_changes_nothing(void **state)
{
    struct state *s = open_state(*state);
    struct gon_error err;
    write_runs(s, 3, 2);
    struct state_queue *q = state_queue_new(2);
    q->entries[0].run = q->entries[1].run = 5;
    assert_int_equal(state_write_queue(s, q, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "UNIQUE"));
    free(q);
    check_runs(s, 3, 2);
    state_close(s);
}

static void sql(const struct folder *f, const char *text)
{
    sqlite3 *db;
    assert_int_equal(sqlite3_open(f->file, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, text, NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(db);
}

static void refused(const struct folder *f, int code, const char *why)
{
    struct state *s = NULL;
    struct gon_error err;
    assert_int_equal(state_open(f->path, &s, &err), code);
    if (!strstr(err.text, why))
        fail_msg("'%s' is not in: %s", why, err.text);
}

static void a_newer_file_is_refused(void **state)
{
    state_close(open_state(*state));
    sql(*state, "PRAGMA user_version=2");
    refused(*state, GON_E_REFUSED, "version 2, this gonio knows 1");
    sql(*state, "PRAGMA user_version=1"); // nothing else was done to it
    state_close(open_state(*state));
}

static void a_removed_file_is_made_again(void **state)
{
    const struct folder *f = *state;
    struct state *s = open_state(f);
    char other[80];
    write_runs(s, 3, 2);
    assert_int_equal(unlink(f->file), 0);
    write_runs(s, 4, 3);
    snprintf(other, sizeof other, "%s.moved", f->file);
    assert_int_equal(rename(f->file, other), 0);
    write_runs(s, 5, 4);
    state_close(s);
    s = open_state(f);
    check_runs(s, 5, 4);
    state_close(s);
}

static void what_is_no_state_is_left_alone(void **state)
{
    const struct folder *f = *state;
    sql(f, "CREATE TABLE mine(x)");
    refused(f, GON_E_STORE, "not written by gonio");
    unlink(f->file);
    FILE *out = fopen(f->file, "w");
    for (int i = 0; i < 200; i++)
        fputs("this is no database, nor will it ever be one\n", out);
    fclose(out);
    refused(f, GON_E_STORE, "move it away to begin with an empty queue");
    struct stat s;
    assert_int_equal(stat(f->file, &s), 0);
    assert_int_equal(s.st_size, 200 * 45);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(the_queue_comes_back_in_its_order),
        TEST(what_cannot_be_written_changes_nothing),
        TEST(a_newer_file_is_refused),
        TEST(a_removed_file_is_made_again),
        TEST(what_is_no_state_is_left_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
