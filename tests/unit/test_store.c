// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "store_fixture.h"

#include "base/units.h"
#include "campaign/catalog.h"
#include "campaign/reduce.h"
#include "campaign/store_lock.h"
#include "campaign/store_row.h"

#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/vfs.h>
#include <sys/wait.h>
#include <time.h>

static void what_goes_in_comes_out(void **state)
{
    (void)state;
    struct store *s = created();
    const struct store_reading a = reading(1, 0, 1);
    struct store_reading b = reading(1, 0, 2), *rows;
    b.monitor_v = b.monitor_sd_v = (double)NAN;
    b.signal_v = -0.0;
    b.theta_r_udeg = INT_MIN;
    b.flags = STORE_SATURATED | STORE_MOVED;
    append(s, &b);
    append(s, &a);
    assert_int_equal(store_close(s, NULL), 0);
    s = opened(STORE_READ);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 2);
    unsigned char in[STORE_ROW_BYTES], out[STORE_ROW_BYTES];
    store_row_bytes(&a, in);
    store_row_bytes(&rows[0], out);
    assert_memory_equal(in, out, sizeof in);
    assert_true(rows[0].signal_v == a.signal_v && rows[0].theta_r_udeg == a.theta_r_udeg);
    assert_true(isnan(rows[1].monitor_v) && isnan(rows[1].monitor_sd_v) && rows[1].signal_v == 0);
    assert_true(rows[1].theta_r_udeg == INT_MIN && rows[1].flags == b.flags &&
                rows[1].attempt == 2);
    free(rows);
    assert_int_equal(store_read_readings(s, 2, &rows, NULL), 0);
    free(rows);
    assert_int_equal(store_append_reading(s, &a, NULL), GON_E_REFUSED);
    store_close(s, NULL);
}

// The canonical bytes, by an independent packing (Python's struct '<iiiqiiddddiiI' and a bitwise
// CRC).
static void check_values_are_as_documented(void **state)
{
    (void)state;
    struct store_reading r = reading(3, 17, 2);
    r.flags = 5;
    assert_int_equal(store_row_crc(&r), 0x159a72a4);
    r.monitor_v = r.monitor_sd_v = (double)NAN;
    assert_int_equal(store_row_crc(&r), 0xde9242c6);
}

static void the_campaign_is_kept_as_it_was(void **state)
{
    (void)state;
    struct campaign_config c, original = fixture_campaign(CONFIG);
    struct bench_config b;
    const struct bench_config bench = fixture_bench();
    struct plan made, kept;
    store_close(created(), NULL);
    struct store *s = opened(STORE_READ);
    assert_int_equal(store_read_config(s, &c, NULL), 0);
    assert_memory_equal(&c, &original, sizeof c);
    assert_int_equal(store_read_bench(s, &b, NULL), 0);
    assert_memory_equal(&b, &bench, sizeof b);
    assert_int_equal(plan_make(&c, &b, &made, NULL), 0);
    assert_int_equal(store_read_plan(s, &kept, NULL), 0);
    assert_true(kept.count == made.count && kept.samples == made.samples &&
                kept.sweeps == made.sweeps);
    for (int i = 0; i < made.count; i++) {
        const struct plan_point *x = &kept.points[i], *y = &made.points[i];
        assert_true(x->sweep == y->sweep && x->point == y->point && x->kind == y->kind &&
                    x->dense == y->dense);
        assert_true(x->theta_i_deg == y->theta_i_deg && x->theta_r_deg == y->theta_r_deg &&
                    x->weight == y->weight);
        assert_true(!x->done && x->attempts == 0);
        assert_true(x->pol_in == POL_U && y->pol_in == POL_U && x->pol_out == y->pol_out);
        assert_string_equal(x->station, y->station);
    }
    const char *const meta[][2] = {
        {"name", "Test paint"}, {"sample", "panel 3"},     {"created_utc_ms", "1700000000123"},
        {"pol_in", "u"},        {"regime", "underfilled"}, {"config", CONFIG}};
    for (size_t i = 0; i < sizeof meta / sizeof *meta; i++) {
        char *text = store_read_meta(s, meta[i][0]);
        assert_string_equal(text, meta[i][1]);
        free(text);
    }
    assert_null(store_read_meta(s, "colour"));
    plan_clear(&made);
    plan_clear(&kept);
    store_close(s, NULL);
}

static void the_same_row_again_is_accepted_another_is_not(void **state)
{
    (void)state;
    struct store *s = created();
    struct store_reading r = reading(1, 2, 1), *rows;
    struct gon_error err;
    append(s, &r);
    append(s, &r);
    r.signal_v *= 1.0000001;
    assert_int_equal(store_append_reading(s, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "sweep 1, point 2, attempt 1 is there already"));
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 1);
    free(rows);
    store_close(s, NULL);
}

static void what_is_not_a_reading_is_refused(void **state)
{
    (void)state;
    struct store *s = created();
    struct store_reading bad[8], *rows;
    for (int i = 0; i < 8; i++)
        bad[i] = reading(1, 1, 1);
    bad[0].signal_v = (double)NAN;
    bad[1].signal_sd_v = (double)INFINITY;
    bad[2].monitor_v = (double)INFINITY;
    bad[3].monitor_sd_v = (double)NAN; // with a monitor
    bad[4].attempt = 0;
    bad[5].count = 0;
    bad[6].signal_sd_v = -1;
    bad[7].point = 99; // not in the plan
    for (int i = 0; i < 8; i++)
        assert_int_equal(store_append_reading(s, &bad[i], NULL), GON_E_INPUT);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 0);
    free(rows);
    store_close(s, NULL);
}

static void progress_counts_accepted_readings_only(void **state)
{
    (void)state;
    struct store *s = created();
    struct store_progress p;
    struct plan plan;
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    const int total = p.total;
    assert_true(p.done == 0 && p.sweep == 0 && p.point == 0 && p.sweeps == 3 && p.readings == 0);
    for (unsigned bit = 0; bit < 8; bit++) { // every flag rejects
        struct store_reading r = reading(0, 0, (int)bit + 1);
        r.flags = 1u << bit;
        append(s, &r);
    }
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    assert_true(p.done == 0 && p.sweep == 0 && p.point == 0 && p.readings == 8);
    append(s, &(struct store_reading){.sweep = 0, .point = 0, .attempt = 9, .count = 1});
    append(s, &(struct store_reading){.sweep = 0, .point = 1, .attempt = 1, .count = 1});
    assert_int_equal(store_read_plan(s, &plan, NULL), 0);
    assert_true(plan.points[0].done && plan.points[0].attempts == 9);
    for (int i = 0; i < plan.count; i++)
        if (plan.points[i].sweep == 1 && plan.points[i].point != 2)
            append(s, &(struct store_reading){
                          .sweep = 1, .point = plan.points[i].point, .attempt = 1, .count = 1});
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    assert_true(p.sweep == 1 && p.point == 2 && p.sweeps_done == 0);
    append(s, &(struct store_reading){.sweep = 1, .point = 2, .attempt = 1, .count = 1});
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    assert_true(p.sweep == 2 && p.point == 0 && p.sweeps_done == 1);
    for (int i = 0; i < plan.count; i++)
        if (plan.points[i].sweep > 1)
            append(s, &(struct store_reading){.sweep = plan.points[i].sweep,
                                              .point = plan.points[i].point,
                                              .attempt = 1,
                                              .count = 1});
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    assert_true(p.sweep == -1 && p.done == total && p.sweeps_done == 3);
    plan_clear(&plan);
    store_close(s, NULL);
}

static void closed_is_one_file_even_with_a_reader(void **state)
{
    (void)state;
    struct store *s = created(), *reader;
    const struct store_reading r = reading(1, 1, 1);
    append(s, &r);
    assert_true(fixture_files(&folder) > 1); // WAL and lock
    store_close(s, NULL);
    assert_int_equal(fixture_files(&folder), 1);
    s = opened(STORE_WRITE);
    struct store_reading second = reading(1, 2, 1), *rows;
    append(s, &second);
    reader = opened(STORE_READ);
    assert_int_equal(store_read_readings(reader, -1, &rows, NULL), 2);
    free(rows);
    assert_int_equal(store_close(s, NULL), 0);
    assert_int_equal(store_close(reader, NULL), 0);
    assert_int_equal(fixture_files(&folder), 1);
    store_close(opened(STORE_WRITE), NULL);
    unsigned char header[20] = "";
    int fd = open(path, O_RDONLY);
    assert_int_equal(read(fd, header, sizeof header), sizeof header);
    close(fd);
    assert_true(header[18] == 1 &&
                header[19] == 1); // no WAL: it can be read where nothing can be written
}

static void a_second_writer_is_refused_and_told_who(void **state)
{
    (void)state;
    struct store *s = created(), *other;
    struct gon_error err;
    char mine[40];
    snprintf(mine, sizeof mine, "in use by process %d", (int)getpid());
    assert_int_equal(store_open(path, STORE_WRITE, &other, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, mine));
    assert_int_equal(store_writer(path), getpid());
    store_close(s, NULL);
    assert_int_equal(store_writer(path), 0);
    // A lock file left behind by a crash stops nobody.
    char lock[160];
    snprintf(lock, sizeof lock, "%s-lock", path);
    close(open(lock, O_CREAT | O_WRONLY, 0600));
    assert_int_equal(store_writer(path), 0);
    s = opened(STORE_WRITE);
    store_close(s, NULL);
    assert_int_equal(fixture_files(&folder), 1);
}

static void a_new_file_never_replaces_one(void **state)
{
    (void)state;
    store_close(created(), NULL);
    const struct campaign_config config = fixture_campaign(CONFIG);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s;
    struct gon_error err;
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, CONFIG, "test.cfg", &bench, FIXTURE_BENCH,
                                   &plan,   1,      NULL,       0};
    assert_int_equal(store_create(path, &what, &s, &err), GON_E_REFUSED);
    assert_int_equal(fixture_files(&folder), 1);
    plan_clear(&plan);
}

static void damage_is_named_and_nothing_is_recreated(void **state)
{
    (void)state;
    struct store *s = created();
    struct gon_error err;
    for (int point = 0; point < 5; point++) {
        const struct store_reading r = reading(2, point, 1);
        append(s, &r);
    }
    store_close(s, NULL);
    tamper("DROP TRIGGER reading_UPDATE; UPDATE reading SET signal_v = signal_v * 1.001 WHERE "
           "point = 3");
    struct store_reading *rows;
    s = opened(STORE_READ);
    assert_int_equal(store_read_readings(s, -1, &rows, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "sweep 2, point 3, attempt 1 is damaged"));
    store_close(s, NULL);
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "sweep 2, point 3"));
    tamper("UPDATE meta SET value = 'campaign: {};' WHERE key = 'config'");
    struct campaign_config c;
    s = opened(STORE_READ);
    assert_int_equal(store_read_config(s, &c, &err), GON_E_STORE);
    store_close(s, NULL);
    int fd = open(path, O_WRONLY); // the schema's page
    assert_int_equal(pwrite(fd, "junkjunkjunkjunk", 16, 100), 16);
    close(fd);
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "keep the file"));
}

static void a_changed_plan_is_noticed(void **state)
{
    (void)state;
    static const char *const changes[] = {
        "UPDATE plan SET weight = 2 WHERE sweep = 1 AND point = 2",
        "UPDATE plan SET pol_in = 's' WHERE sweep = 1 AND point = 2",
        "UPDATE plan SET theta_r_udeg = theta_r_udeg + 1 WHERE sweep = 2 AND point = 0",
        "DELETE FROM plan WHERE sweep = 3 AND point = 1"};
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        struct plan plan;
        struct gon_error err;
        store_close(created(), NULL);
        tamper(changes[i]);
        struct store *s = opened(STORE_READ);
        assert_int_equal(store_read_plan(s, &plan, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, "the plan kept in it is damaged"));
        store_close(s, NULL);
        assert_int_equal(unlink(path), 0);
    }
}

// Where no reading lies: only a check of the whole file sees it.
static void damage_elsewhere_is_seen_before_anything_is_written(void **state)
{
    (void)state;
    static char bytes[200000];
    struct store *s =
        created_from("campaign: { name = \"a\"; theta_i_deg = 10; theta_r: { step_deg = 0.2; };"
                     " dense: { half_width_deg = 0; }; };");
    struct gon_error err = {0};
    store_close(s, NULL);
    int fd = open(path, O_RDWR);
    const ssize_t size = read(fd, bytes, sizeof bytes);
    const char *kind = memmem(bytes + 60000, (size_t)size - 60000, "sample",
                              6); // in a row of the plan, past the schema
    assert_non_null(kind);
    assert_int_equal(
        pwrite(fd, "\xff\xff\xff\xff\xff\xff\xff\xff", 8, (kind - bytes) / 4096 * 4096), 8);
    close(fd);
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "keep the file"));
}

// A file system whose calls fail when told to: the usual one with another xOpen, xSync and xWrite.
static struct {
    sqlite3_vfs vfs, *unix_vfs;
    sqlite3_io_methods methods[8]; // SQLite has several: with locks, without, for folders
    const sqlite3_io_methods *original[8];
    int opens, fail_sync, fail_write; // the failures are what the next calls return, once
} faulty;

static const sqlite3_io_methods *original(const sqlite3_file *file)
{
    return faulty.original[file->pMethods - faulty.methods];
}

static int faulty_sync(sqlite3_file *file, int flags)
{
    int rc = faulty.fail_sync;
    faulty.fail_sync = SQLITE_OK;
    return rc ? rc : original(file)->xSync(file, flags);
}

static int faulty_write(sqlite3_file *file, const void *data, int size, sqlite3_int64 at)
{
    int rc = faulty.fail_write;
    faulty.fail_write = SQLITE_OK;
    return rc ? rc : original(file)->xWrite(file, data, size, at);
}

static const sqlite3_io_methods *wrapped(const sqlite3_io_methods *methods)
{
    int k = 0;
    while (faulty.original[k] && faulty.original[k] != methods)
        k++;
    faulty.original[k] = methods;
    faulty.methods[k] = *methods;
    faulty.methods[k].xSync = faulty_sync;
    faulty.methods[k].xWrite = faulty_write;
    return &faulty.methods[k];
}

static int faulty_open(sqlite3_vfs *vfs, const char *name, sqlite3_file *file, int flags,
                       int *ret_flags)
{
    (void)vfs;
    int rc = faulty.unix_vfs->xOpen(faulty.unix_vfs, name, file, flags, ret_flags);
    if (rc == SQLITE_OK && file->pMethods) {
        file->pMethods = wrapped(file->pMethods);
        faulty.opens += (flags & SQLITE_OPEN_MAIN_DB) != 0;
    }
    return rc;
}

static void install_faulty(void)
{
    faulty.unix_vfs = sqlite3_vfs_find(NULL);
    faulty.vfs = *faulty.unix_vfs;
    faulty.vfs.zName = "faulty";
    faulty.vfs.xOpen = faulty_open;
    assert_int_equal(sqlite3_vfs_register(&faulty.vfs, 1), SQLITE_OK);
}

// After a failed fsync the kernel may have dropped what was not written: the connection's idea of
// the file is worth nothing, and it is opened and checked again before the next row.
static void a_failed_fsync_reopens_before_the_next_row(void **state)
{
    (void)state;
    const int failures[] = {SQLITE_IOERR_FSYNC, SQLITE_IOERR_WRITE, SQLITE_FULL};
    install_faulty();
    struct store *s = created();
    struct gon_error err;
    struct store_reading *rows;
    for (int k = 0; k < 3; k++) {
        const struct store_reading r = reading(1, k, 1);
        const int opens = faulty.opens;
        faulty.fail_sync = k == 0 ? failures[k] : SQLITE_OK;
        faulty.fail_write = k > 0 ? failures[k] : SQLITE_OK;
        assert_int_equal(store_append_reading(s, &r, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, k == 2 ? "the disk is full" : "disk I/O error"));
        assert_int_equal(faulty.opens, opens);
        append(s, &r);
        assert_int_equal(faulty.opens, opens + (k < 2));
        assert_int_equal(store_read_readings(s, -1, &rows, NULL), k + 1);
        free(rows);
    }
    store_close(s, NULL);
    sqlite3_vfs_register(faulty.unix_vfs, 1);
    sqlite3_vfs_unregister(&faulty.vfs);
}

static void readings_cannot_be_changed_by_accident(void **state)
{
    (void)state;
    struct store *s = created();
    const struct store_reading r = reading(1, 1, 1);
    append(s, &r);
    store_close(s, NULL);
    sqlite3 *db;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "UPDATE reading SET flags = 1", NULL, NULL, NULL),
                     SQLITE_CONSTRAINT);
    assert_int_equal(sqlite3_exec(db, "DELETE FROM reading", NULL, NULL, NULL), SQLITE_CONSTRAINT);
    sqlite3_close(db);
}

static void other_files_and_newer_ones_are_refused(void **state)
{
    (void)state;
    struct store *s;
    struct gon_error err;
    assert_int_equal(store_open(path, STORE_READ, &s, &err), GON_E_INPUT); // not there
    tamper("CREATE TABLE t (x)");
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "not a campaign file"));
    int fd = open(path, O_WRONLY | O_TRUNC);
    assert_int_equal(write(fd, "theta_i_deg,theta_r_deg,f_r\n", 28), 28);
    close(fd);
    assert_int_equal(store_open(path, STORE_READ, &s, &err), GON_E_INPUT);
    assert_int_equal(store_open(folder.path, STORE_READ, &s, &err), GON_E_INPUT);
    unlink(path);
    store_close(created(), NULL);
    tamper("PRAGMA user_version = 5");
    assert_int_equal(store_open(path, STORE_READ, &s, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "version 5 of the file, of a newer gonio"));
    assert_non_null(strstr(err.text, "install the newer one"));
    assert_int_equal(store_open(path, STORE_WRITE, &s, NULL), GON_E_REFUSED);
    assert_int_equal(fixture_files(&folder), 1);
}

static void several_states_are_kept(void **state)
{
    (void)state;
    static const char states[] =
        "campaign: { name = \"a\"; theta_i_deg = (10, 20); pol_in = (\"s\", \"p\");"
        " dense: { half_width_deg = 0; }; };";
    struct plan made, kept;
    const struct campaign_config c = fixture_campaign(states);
    const struct bench_config bench = fixture_bench();
    store_close(created_from(states), NULL);
    struct store *s = opened(STORE_READ);
    assert_int_equal(plan_make(&c, &bench, &made, NULL), 0);
    assert_int_equal(store_read_plan(s, &kept, NULL), 0);
    assert_int_equal(kept.count, made.count);
    for (int i = 0; i < made.count; i++)
        assert_true(kept.points[i].pol_in == made.points[i].pol_in &&
                    kept.points[i].pol_out == made.points[i].pol_out);
    char *pol_in = store_read_meta(s, "pol_in");
    assert_string_equal(pol_in, "s, p");
    free(pol_in);
    plan_clear(&made);
    plan_clear(&kept);
    store_close(s, NULL);
}

// --- profiles ------------------------------------------------------------------------------------

static const struct store_profile profiles[] = {
    {"cobolt-05", "laser", "profile: { name = \"cobolt-05\"; };\n# \xc3\xa9t\xc3\xa9\n"},
    {"oriental-az", "axis", "profile: { name = \"az\"; };\n"},
};

static bool note_profile(void *ctx, const struct store_kept_profile *p)
{
    char *texts = ctx, line[200];
    snprintf(line, sizeof line, "%d %lld %s %s %s|", (int)p->id, (long long)p->t_utc_ms,
             p->profile.name, p->profile.role, p->profile.text);
    strcat(texts, line);
    return true;
}

static void profiles_are_kept_with_their_times(void **state)
{
    (void)state;
    char texts[1000] = "", wanted[1000];
    struct store *s = created();
    struct store_profile changed = profiles[1];
    assert_int_equal(store_each_profile(s, note_profile, texts, NULL), 0);
    assert_int_equal(store_append_profiles(s, 1000, profiles, 2, NULL), 0);
    assert_int_equal(store_append_profiles(s, 2000, profiles, 2, NULL), 0); // nothing new
    changed.text = "profile: { name = \"az\"; base = 1; };\n";
    assert_int_equal(store_append_profiles(s, 3000, &changed, 1, NULL), 0);
    assert_int_equal(store_append_profiles(s, 4000, profiles, 2, NULL), 0); // back again
    store_close(s, NULL);
    s = opened(STORE_READ);
    assert_int_equal(store_each_profile(s, note_profile, texts, NULL), 4);
    snprintf(wanted, sizeof wanted,
             "1 1000 cobolt-05 laser %s|2 1000 oriental-az axis %s|3 3000 oriental-az axis %s|"
             "4 4000 oriental-az axis %s|",
             profiles[0].text, profiles[1].text, changed.text, profiles[1].text);
    assert_string_equal(texts, wanted);
    store_close(s, NULL);
}

// Its check value is that of independent code: Python's struct '<q' and a bitwise CRC.
static void a_changed_profile_is_noticed(void **state)
{
    (void)state;
    static const char *const changes[] = {"text = text || ' '", "role = 'detector'", "name = 'az'",
                                          "t_utc_ms = t_utc_ms + 1", "crc32c = crc32c + 1"};
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        char sql[200], texts[1000] = "";
        struct gon_error err;
        struct store *s = created();
        assert_int_equal(store_append_profiles(s, 1000, profiles, 2, NULL), 0);
        store_close(s, NULL);
        assert_int_equal(number("SELECT crc32c FROM profile WHERE id = 2"), 0x39e18dca);
        snprintf(sql, sizeof sql, "DROP TRIGGER profile_UPDATE; UPDATE profile SET %s WHERE id = 2",
                 changes[i]);
        tamper(sql);
        s = opened(STORE_READ);
        assert_int_equal(store_each_profile(s, note_profile, texts, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, "the profile 2 ("));
        assert_non_null(strstr(texts, "cobolt-05")); // what is whole was shown
        store_close(s, NULL);
        assert_int_equal(unlink(path), 0);
    }
}

static void a_new_file_has_the_profiles_it_was_given(void **state)
{
    (void)state;
    const struct campaign_config config = fixture_campaign(CONFIG);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s;
    char texts[1000] = "";
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {.config = &config,
                                   .config_text = CONFIG,
                                   .config_name = "test.cfg",
                                   .bench = &bench,
                                   .bench_text = FIXTURE_BENCH,
                                   .plan = &plan,
                                   .t_utc_ms = 7,
                                   .profiles = profiles,
                                   .profiles_count = 2};
    assert_int_equal(store_create(path, &what, &s, NULL), 0);
    assert_int_equal(store_each_profile(s, note_profile, texts, NULL), 2);
    assert_non_null(strstr(texts, "2 7 oriental-az axis "));
    store_close(s, NULL);
    plan_clear(&plan);
    sqlite3 *db;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "UPDATE profile SET role = ''", NULL, NULL, NULL),
                     SQLITE_CONSTRAINT);
    assert_int_equal(sqlite3_exec(db, "DELETE FROM profile", NULL, NULL, NULL), SQLITE_CONSTRAINT);
    sqlite3_close(db);
}

// --- files of older versions ---------------------------------------------------------------------

// Dark 1 mV, beam 2.001 V, signal 1 mV and 1 mV more for each point of the plan.
static void a_file_of_version_1_is_read_and_written_on(void **state)
{
    (void)state;
    char profile_texts[1000] = "";
    make_from_sql("tests/golden/campaign_v1.sql");
    struct store *s = opened(STORE_READ);
    struct plan p;
    struct reduction r;
    assert_int_equal(store_each_profile(s, note_profile, profile_texts, NULL), 0);
    assert_int_equal(store_read_plan(s, &p, NULL), 0);
    store_close(s, NULL);
    plan_clear(&p);
    assert_int_equal(number("PRAGMA user_version"), 1); // reading changes nothing
    s = opened(STORE_WRITE);
    assert_int_equal(store_read_plan(s, &p, NULL), 0);
    assert_true(p.count == 8 && p.sweeps == 2 && p.points[6].done && !p.points[7].done);
    for (int i = 0; i < p.count; i++)
        assert_true(p.points[i].pol_in == POL_S && p.points[i].pol_out == POL_S);
    assert_int_equal(reduce_campaign(s, &r, NULL), 0);
    assert_true(r.count == 4 && r.beams == 2 && r.darks == 1 && r.polarisation == POL_S);
    for (int i = 0; i < 4; i++) { // the elements of that time were the operator's: nothing over T
        const double cosine = cos(units_rad(i % 2 ? 30 : 0));
        const double ratio = r.points[i].f_per_sr * r.omega_sr * cosine;
        assert_true(fabs(ratio / (1e-3 * (i + 2)) - 0.5) < 1e-9);
    }
    assert_int_equal(store_append_reduction(s, 1, &r, NULL, NULL), 0);
    const struct store_reading dark = reading(3, 1, 1);
    append(s, &dark);
    assert_int_equal(store_append_profiles(s, 5000, profiles, 2, NULL), 0);
    assert_int_equal(store_each_profile(s, note_profile, profile_texts, NULL), 2);
    reduction_clear(&r);
    plan_clear(&p);
    store_close(s, NULL);
}

// Rows of a campaign file and of what is kept of its older self.
static int64_t number_of(const char *file, const char *sql)
{
    char ours[sizeof path];
    strcpy(ours, path);
    strcpy(path, file);
    const int64_t value = number(sql);
    strcpy(path, ours);
    return value;
}

static void an_older_file_is_copied_before_it_changes(void **state)
{
    (void)state;
    static const char *const older[] = {"tests/golden/campaign_v1.sql",
                                        "tests/golden/campaign_v2.sql",
                                        "tests/golden/campaign_v3.sql"};
    static const int readings[] = {7, 13, 9};
    for (int version = 1; version <= 3; version++) {
        char backup[200], second[200];
        make_from_sql(older[version - 1]);
        struct store *s = opened(STORE_WRITE);
        snprintf(backup, sizeof backup, "%s.v%d-backup", path, version);
        assert_non_null(strstr(store_notice(s), backup));
        const struct store_reading last = reading(3, version == 2 ? 2 : 1, 1);
        append(s, &last);
        store_close(s, NULL);
        assert_int_equal(number("PRAGMA user_version"), 4);
        assert_int_equal(number("SELECT count(*) FROM reading"), readings[version - 1] + 1);
        assert_int_equal(number_of(backup, "PRAGMA user_version"), version);
        assert_int_equal(number_of(backup, "PRAGMA application_id"), 1735356009);
        assert_int_equal(number_of(backup, "SELECT count(*) FROM reading"), readings[version - 1]);
        assert_int_equal(number_of(backup, "SELECT count(*) FROM sqlite_schema WHERE name LIKE"
                                           " 'exclusion%'"),
                         0);
        assert_int_equal(fixture_files(&folder), 2);
        s = opened(STORE_WRITE); // a second time there is nothing to do
        assert_string_equal(store_notice(s), "");
        store_close(s, NULL);
        assert_int_equal(fixture_files(&folder), 2);
        assert_int_equal(rename(backup, path), 0); // somebody goes back, and on again
        close(open(backup, O_CREAT | O_WRONLY, 0600));
        s = opened(STORE_WRITE);
        snprintf(second, sizeof second, "%s.v%d-backup-2", path, version);
        assert_non_null(strstr(store_notice(s), second));
        store_close(s, NULL);
        assert_int_equal(number_of(second, "PRAGMA user_version"), version);
        assert_int_equal(unlink(path) | unlink(backup) | unlink(second), 0);
    }
}

// A step that fails leaves the file as it was, and the copy.
static void a_step_that_fails_changes_nothing(void **state)
{
    (void)state;
    struct store *s;
    struct gon_error err;
    make_from_sql("tests/golden/campaign_v1.sql");
    tamper("CREATE TABLE profile (x)"); // in its way
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "profile"));
    assert_int_equal(number("PRAGMA user_version"), 2); // step by step: the first had nothing to do
    tamper("DROP TABLE profile");
    s = opened(STORE_WRITE);
    store_close(s, NULL);
    assert_int_equal(number("PRAGMA user_version"), 4);
}

static void without_a_copy_nothing_is_changed(void **state)
{
    (void)state;
    struct store *s;
    struct gon_error err;
    struct rlimit before, tight;
    make_from_sql("tests/golden/campaign_v1.sql");
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight = before;
    tight.rlim_cur = 40000; // the file's size is more
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_STORE);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_non_null(strstr(err.text, "backup"));
    assert_int_equal(number("PRAGMA user_version"), 1);
    store_close(opened(STORE_WRITE), NULL);
}

static void a_moved_file_is_noticed_at_the_next_reading(void **state)
{
    (void)state;
    struct store *s = created();
    struct store_reading a = reading(1, 0, 1), b = reading(1, 1, 1), *rows;
    struct gon_error err;
    char away[160];
    snprintf(away, sizeof away, "%s.away", path);
    append(s, &a);
    assert_int_equal(rename(path, away), 0);
    assert_int_equal(store_append_reading(s, &b, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "moved, removed or replaced"));
    close(open(path, O_CREAT | O_WRONLY, 0600)); // another file in its place
    assert_int_equal(store_append_reading(s, &b, NULL), GON_E_STORE);
    assert_int_equal(rename(away, path), 0);
    append(s, &b);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 2);
    free(rows);
    store_close(s, NULL);
}

// What nobody but us can still see.
static void a_removed_file_is_written_again(void **state)
{
    (void)state;
    struct store_reading next = reading(1, 3, 1), *rows;
    struct gon_error err;
    store_close(created(), NULL);
    // Pages in another order than in a copy, so that the old WAL would do harm to it.
    tamper("CREATE TABLE m AS SELECT * FROM meta; DROP TABLE meta; CREATE TABLE meta"
           " (key TEXT PRIMARY KEY, value) WITHOUT ROWID; INSERT INTO meta SELECT * FROM m;"
           " DROP TABLE m");
    struct store *s = opened(STORE_WRITE), *reader = opened(STORE_READ);
    for (int point = 0; point < 3; point++) {
        const struct store_reading r = reading(1, point, 1);
        append(s, &r);
    }
    assert_int_equal(store_read_readings(reader, -1, &rows, NULL), 3); // so its WAL stays
    free(rows);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(store_append_reading(s, &next, &err), GON_E_STORE); // the run must pause
    assert_non_null(strstr(err.text, "it was written again, with all its 3 readings"));
    append(s, &next);
    next.point = 4;
    append(s, &next);
    store_close(reader, NULL);
    assert_int_equal(store_close(s, NULL), 0);
    assert_int_equal(fixture_files(&folder), 1);
    s = opened(STORE_WRITE);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 5);
    free(rows);
    store_close(s, NULL);
}

static void a_replaced_file_is_kept_beside(void **state)
{
    (void)state;
    const struct store_reading next = reading(1, 3, 1);
    struct store_reading *rows;
    struct gon_error err;
    char rescued[160], text[8] = "";
    struct store *s = created();
    for (int point = 0; point < 3; point++) {
        const struct store_reading r = reading(1, point, 1);
        append(s, &r);
    }
    assert_int_equal(unlink(path), 0);
    fixture_path(&folder, "0001-test.gonio-rescued", rescued, sizeof rescued);
    int fd = open(path, O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(fd, "other", 5), 5);
    close(fd);
    for (int again = 0; again < 2; again++) {
        assert_int_equal(store_append_reading(s, &next, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, "what was measured is kept as"));
        assert_non_null(strstr(err.text, rescued));
    }
    fd = open(path, O_RDONLY);
    assert_int_equal(read(fd, text, 7), 5); // nobody touched it
    close(fd);
    assert_string_equal(text, "other");
    assert_int_equal(unlink(path), 0); // taken away: it goes on
    assert_int_equal(store_append_reading(s, &next, &err), GON_E_STORE);
    append(s, &next);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 4);
    free(rows);
    store_close(s, NULL);
    assert_int_equal(fixture_files(&folder), 1);
}

static void a_cut_file_is_noticed_at_the_next_reading(void **state)
{
    (void)state;
    struct store *s = created();
    struct store_reading a = reading(1, 0, 1), b = reading(1, 1, 1);
    struct gon_error err;
    append(s, &a);
    assert_int_equal(truncate(path, 0), 0);
    assert_int_equal(store_append_reading(s, &b, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "was cut while it was written"));
    assert_int_equal(store_append_reading(s, &b, NULL), GON_E_STORE); // and it stays so
    store_close(s, NULL);
}

static void wal_of(char *wal, size_t size)
{
    snprintf(wal, size, "%s-wal", path);
}

static void a_removed_wal_loses_nothing(void **state)
{
    (void)state;
    char wal[160];
    struct store_reading *rows;
    struct store *s = created();
    wal_of(wal, sizeof wal);
    for (int point = 0; point < 6; point++) {
        const struct store_reading r = reading(1, point, 1);
        append(s, &r);
        if (point == 2)
            assert_int_equal(unlink(wal), 0);
    }
    pid_t child = fork(); // as a kill finds it: nobody closes it
    if (child == 0) {
        struct store *other = opened(STORE_READ);
        _exit(store_read_readings(other, -1, &rows, NULL));
    }
    int status;
    waitpid(child, &status, 0);
    assert_int_equal(WEXITSTATUS(status), 6);
    store_close(s, NULL);
}

// What it held is lost; that is said, and said again, until somebody restores it.
static void a_cut_wal_is_noticed_at_the_next_reading(void **state)
{
    (void)state;
    char wal[160];
    struct gon_error err;
    struct store *s = created();
    wal_of(wal, sizeof wal);
    for (int point = 0; point < 3; point++) {
        const struct store_reading r = reading(1, point, 1);
        append(s, &r);
    }
    assert_int_equal(truncate(wal, 0), 0);
    const struct store_reading next = reading(1, 3, 1);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(store_append_reading(s, &next, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, "3 acknowledged readings are gone with its -wal file"));
    }
    store_close(s, NULL);
}

// Somebody else's checkpoint cuts it too, and loses nothing.
static void anothers_checkpoint_is_no_harm(void **state)
{
    (void)state;
    struct store_reading *rows;
    struct store *s = created();
    for (int point = 0; point < 6; point++) {
        const struct store_reading r = reading(1, point, 1);
        append(s, &r);
        if (point == 2)
            tamper("PRAGMA wal_checkpoint(TRUNCATE)");
    }
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 6);
    free(rows);
    store_close(s, NULL);
}

static void anothers_write_lock_is_waited_for_then_named(void **state)
{
    (void)state;
    struct store *s = created();
    const struct store_reading r = reading(1, 1, 1);
    struct gon_error err;
    sqlite3 *db;
    store_set_patience(s, 1);
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(store_append_reading(s, &r, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "holds its write lock"));
    assert_int_equal(store_lock_wal_writer(path), getpid()); // here the other is we
    sqlite3_exec(db, "ROLLBACK", NULL, NULL, NULL);
    sqlite3_close(db);
    append(s, &r);
    store_close(s, NULL);
}

// A limit on the file's size stands for a full disk: the write fails at any byte, and the rows
// before it stay.
static void a_full_disk_loses_nothing_that_was_acknowledged(void **state)
{
    (void)state;
    struct rlimit before, tight;
    struct stat st;
    struct store *s =
        created_from("campaign: { name = \"a\"; theta_i_deg = (10, 20, 30);"
                     " theta_r: { step_deg = 0.1; }; dense: { half_width_deg = 0; }; };");
    struct gon_error err = {0};
    int acknowledged = 0, refused = 0;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(stat(path, &st), 0);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight = before;
    tight.rlim_cur = (rlim_t)st.st_size + 100000;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (int sweep = 1; sweep <= 3 && refused < 3; sweep++)
        for (int point = 0; point < 1700 && refused < 3; point++) {
            const struct store_reading r = reading(sweep, point, 1);
            int rc = store_append_reading(s, &r, &err);
            assert_true(rc == 0 || rc == GON_E_STORE);
            acknowledged += rc == 0;
            refused += rc != 0;
            point -= rc != 0; // the same row again
        }
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(refused, 3);
    assert_true(acknowledged > 0);
    struct store_reading *rows, next = reading(1 + acknowledged / 1700, acknowledged % 1700, 1);
    append(s, &next);
    assert_int_equal(store_read_readings(s, -1, &rows, &err), acknowledged + 1);
    free(rows);
    store_close(s, NULL);
    s = opened(STORE_WRITE);
    assert_int_equal(store_read_readings(s, -1, &rows, &err), acknowledged + 1);
    free(rows);
    store_close(s, NULL);
}

static void child_appends(int to_parent, struct store *s)
{
    int n = 0;
    for (int sweep = 1; sweep <= 3; sweep++)
        for (int point = 0; point < 1700; point++, n++) {
            const struct store_reading r = reading(sweep, point, 1);
            if (store_append_reading(s, &r, NULL) < 0 || write(to_parent, &n, sizeof n) != sizeof n)
                _exit(1);
        }
    _exit(0);
}

// SIGKILL at a random moment: every acknowledged row is there and the file can be written again.
static void killed_writers_lose_no_acknowledged_row(void **state)
{
    (void)state;
    const char *given = getenv("TEST_SEED");
    unsigned seed = given ? (unsigned)atoi(given) : (unsigned)time(NULL) ^ (unsigned)getpid();
    print_message("seed %u (TEST_SEED)\n", seed);
    for (int round = 0; round < 5; round++) {
        int fds[2], last = -1, n, rows_count;
        char name[32];
        snprintf(name, sizeof name, "%d.gonio", round);
        fixture_path(&folder, name, path, sizeof path);
        store_close(
            created_from("campaign: { name = \"a\"; theta_i_deg = (10, 20, 30);"
                         " theta_r: { step_deg = 0.1; }; dense: { half_width_deg = 0; }; };"),
            NULL);
        assert_int_equal(pipe(fds), 0);
        pid_t child = fork();
        if (child == 0) {
            struct store *s;
            close(fds[0]);
            if (store_open(path, STORE_WRITE, &s, NULL) < 0)
                _exit(2);
            child_appends(fds[1], s);
        }
        close(fds[1]);
        const int kill_after = (int)(rand_r(&seed) % 300);
        while (last < kill_after && read(fds[0], &n, sizeof n) == sizeof n)
            last = n;
        kill(child, SIGKILL);
        while (read(fds[0], &n, sizeof n) == sizeof n) // acknowledged before it died
            last = n;
        close(fds[0]);
        waitpid(child, NULL, 0);
        struct store_reading *rows;
        struct store *s = opened(STORE_WRITE);
        rows_count = store_read_readings(s, -1, &rows, NULL);
        assert_true(last >= kill_after && rows_count >= last + 1 && rows_count <= last + 2);
        for (int i = 0; i < rows_count; i++)
            assert_int_equal((rows[i].sweep - 1) * 1700 + rows[i].point, i);
        free(rows);
        store_close(s, NULL);
    }
}

// A child that dies with a transaction half in the file: its rollback journal is left, as a kill
// leaves it while the file goes to WAL or back.
static void leave_a_hot_journal(void)
{
    pid_t child = fork();
    if (child == 0) {
        sqlite3 *db;
        const char *sql =
            "PRAGMA cache_size = 5; BEGIN; CREATE TABLE half (x);"
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 2000)"
            " INSERT INTO half SELECT randomblob(400) FROM n";
        _exit(sqlite3_open(path, &db) || sqlite3_exec(db, sql, NULL, NULL, NULL));
    }
    int status;
    waitpid(child, &status, 0);
    assert_int_equal(status, 0);
}

static void a_reader_recovers_what_a_killed_writer_left(void **state)
{
    (void)state;
    struct store_reading r = reading(1, 1, 1), *rows;
    char journal[160];
    struct stat st;
    struct store *s = created();
    append(s, &r);
    store_close(s, NULL);
    leave_a_hot_journal();
    snprintf(journal, sizeof journal, "%s-journal", path);
    assert_int_equal(stat(journal, &st), 0);
    assert_true(st.st_size > 0);
    s = opened(STORE_READ);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 1);
    assert_int_equal(store_row_crc(&rows[0]), store_row_crc(&r));
    free(rows);
    store_close(s, NULL);
    assert_int_equal(stat(journal, &st), -1);
}

// 240 bytes a reading are promised; measured on 10,000 rows as they are in a campaign.
static void readings_are_small(void **state)
{
    (void)state;
    struct stat before, after;
    struct store *s =
        created_from("campaign: { name = \"a\"; theta_i_deg = (10, 20, 30, 40, 50, 60);"
                     " theta_r: { step_deg = 0.1; }; dense: { half_width_deg = 0; }; };");
    store_close(s, NULL);
    assert_int_equal(stat(path, &before), 0);
    s = opened(STORE_WRITE);
    int n = 0;
    for (int sweep = 1; sweep <= 6; sweep++)
        for (int point = 0; point < 1701 && n < 10000; point++, n++) {
            struct store_reading r = reading(sweep, point, 1);
            r.t_utc_ms += 150 * n;
            r.theta_r_udeg = -85000000 + 100000 * point + 137;
            r.signal_v = 1e-3 / (1 + 0.1234567 * point);
            append(s, &r);
        }
    store_close(s, NULL);
    assert_int_equal(stat(path, &after), 0);
    const double bytes = (double)(after.st_size - before.st_size) / n;
    print_message("%.1f bytes a reading\n", bytes);
    assert_true(n == 10000 && bytes > 60 && bytes <= 240);
}

static bool count_event(void *ctx, const struct store_event *e)
{
    char *texts = ctx;
    strcat(strcat(strcat(strcat(texts, e->level), " "), e->source), " ");
    strcat(strcat(texts, e->text), ";");
    return strlen(texts) < 60;
}

static void events_and_states_are_a_history(void **state)
{
    (void)state;
    char now[16], why[80], texts[400] = "";
    int64_t since_ms = -1;
    struct store *s = created();
    assert_int_equal(store_read_state(s, now, sizeof now, why, sizeof why, &since_ms, NULL), 0);
    assert_string_equal(now, "");
    assert_int_equal(store_append_state(s, 1000, "running", NULL, NULL), 0);
    assert_int_equal(store_append_state(s, 2000, "paused", "laser: gone", NULL), 0);
    assert_int_equal(store_append_state(s, 3000, "running", "", NULL), 0);
    assert_int_equal(store_append_state(s, 4000, "paused", "axis theta_r: gone", NULL), 0);
    assert_int_equal(store_read_state(s, now, sizeof now, why, sizeof why, &since_ms, NULL), 0);
    assert_string_equal(now, "paused");
    assert_string_equal(why, "axis theta_r: gone");
    assert_int_equal(since_ms, 4000);
    assert_int_equal(store_read_state_time(s, "running"), 1000);
    assert_int_equal(store_read_state_time(s, "done"), 0);
    assert_int_equal(store_append_event(s, 1, "warn", "engine", "first", NULL), 0);
    assert_int_equal(store_append_event(s, 2, "notice", "engine", "second", NULL), 0);
    assert_int_equal(store_append_event(s, 3, "err", "laser", "'third'; DROP TABLE reading", NULL),
                     0);
    assert_int_equal(store_each_event(s, 1, count_event, texts, NULL), 2);
    assert_string_equal(texts, "notice engine second;err laser 'third'; DROP TABLE reading;");
    store_close(s, NULL);
}

static void network_file_systems_are_known(void **state)
{
    (void)state;
    assert_true(store_lock_is_network(0x6969, NULL));
    assert_true(store_lock_is_network((long)(int)0xff534d42, NULL)); // CIFS, sign-extended
    assert_true(store_lock_is_network(0xff534d42, NULL));
    assert_true(store_lock_is_network(0x65735546, "fuse.sshfs"));
    assert_false(store_lock_is_network(0x65735546, "fuse.fuse-overlayfs"));
    assert_false(store_lock_is_network(0xef53, "ext4"));
    assert_false(store_lock_is_network(0x01021994, "tmpfs"));
    assert_int_equal(store_lock_local(path, NULL), 0);
}

// Also for the library: what a mounted NFS would answer.
static long pretended_type;

int statfs(const char *file, struct statfs *ret_fs)
{
    const int rc = (int)syscall(SYS_statfs, file, ret_fs);
    if (rc == 0 && pretended_type)
        ret_fs->f_type = pretended_type;
    return rc;
}

static void nothing_is_written_on_a_network_file_system(void **state)
{
    (void)state;
    struct store *s;
    struct gon_error err;
    struct catalog_hold *hold;
    store_close(created(), NULL);
    pretended_type = 0x6969;
    assert_int_equal(store_open(path, STORE_WRITE, &s, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "lies on a network file system"));
    assert_int_equal(catalog_take(folder.path, &hold, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "lies on a network file system"));
    assert_int_equal(store_open(path, STORE_READ, &s, NULL), 0);
    store_close(s, NULL);
    assert_int_equal(fixture_files(&folder), 1);
    assert_int_equal(unlink(path), 0);
    const struct campaign_config config = fixture_campaign(CONFIG);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, CONFIG, "test.cfg", &bench, FIXTURE_BENCH,
                                   &plan,   1,      NULL,       0};
    assert_int_equal(store_create(path, &what, &s, &err), GON_E_REFUSED);
    assert_int_equal(fixture_files(&folder), 0);
    plan_clear(&plan);
    pretended_type = 0;
}

static void a_folder_is_for_one_daemon(void **state)
{
    (void)state;
    struct catalog_hold *hold, *second;
    struct gon_error err;
    char mine[40], lock[160];
    snprintf(mine, sizeof mine, "in use by process %d", (int)getpid());
    assert_int_equal(catalog_take(folder.path, &hold, NULL), 0);
    assert_int_equal(catalog_take(folder.path, &second, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, mine));
    catalog_drop(hold);
    fixture_path(&folder, ".goniod.lock", lock, sizeof lock);
    assert_int_equal(access(lock, F_OK), -1);
    // Of one that was killed.
    close(open(lock, O_CREAT | O_WRONLY, 0600));
    assert_int_equal(catalog_take(folder.path, &hold, NULL), 0);
    catalog_drop(hold);
}

static void flags_are_words(void **state)
{
    (void)state;
    char text[100];
    store_flags_text(STORE_SATURATED | STORE_UNLOCKED, text, sizeof text);
    assert_string_equal(text, "saturated, no reference");
    store_flags_text(0, text, sizeof text);
    assert_string_equal(text, "");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_goes_in_comes_out),
        TEST(check_values_are_as_documented),
        TEST(the_campaign_is_kept_as_it_was),
        TEST(the_same_row_again_is_accepted_another_is_not),
        TEST(what_is_not_a_reading_is_refused),
        TEST(progress_counts_accepted_readings_only),
        TEST(closed_is_one_file_even_with_a_reader),
        TEST(a_second_writer_is_refused_and_told_who),
        TEST(a_new_file_never_replaces_one),
        TEST(damage_is_named_and_nothing_is_recreated),
        TEST(a_changed_plan_is_noticed),
        TEST(damage_elsewhere_is_seen_before_anything_is_written),
        TEST(a_failed_fsync_reopens_before_the_next_row),
        TEST(readings_cannot_be_changed_by_accident),
        TEST(other_files_and_newer_ones_are_refused),
        TEST(several_states_are_kept),
        TEST(profiles_are_kept_with_their_times),
        TEST(a_changed_profile_is_noticed),
        TEST(a_new_file_has_the_profiles_it_was_given),
        TEST(a_file_of_version_1_is_read_and_written_on),
        TEST(an_older_file_is_copied_before_it_changes),
        TEST(a_step_that_fails_changes_nothing),
        TEST(without_a_copy_nothing_is_changed),
        TEST(a_moved_file_is_noticed_at_the_next_reading),
        TEST(a_removed_file_is_written_again),
        TEST(a_replaced_file_is_kept_beside),
        TEST(a_cut_file_is_noticed_at_the_next_reading),
        TEST(a_removed_wal_loses_nothing),
        TEST(a_cut_wal_is_noticed_at_the_next_reading),
        TEST(anothers_checkpoint_is_no_harm),
        TEST(anothers_write_lock_is_waited_for_then_named),
        TEST(a_full_disk_loses_nothing_that_was_acknowledged),
        TEST(killed_writers_lose_no_acknowledged_row),
        TEST(a_reader_recovers_what_a_killed_writer_left),
        TEST(readings_are_small),
        TEST(events_and_states_are_a_history),
        TEST(network_file_systems_are_known),
        TEST(nothing_is_written_on_a_network_file_system),
        TEST(a_folder_is_for_one_daemon),
        TEST(flags_are_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
