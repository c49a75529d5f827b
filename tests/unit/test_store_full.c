// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// A disk that is really full: a tmpfs of 3 MiB in a mount namespace of our own.
#include "store_fixture.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>

#define LONG_PLAN                                                                                  \
    "campaign: { name = \"a\"; theta_i_deg = (10, 20, 30);"                                        \
    " theta_r: { step_deg = 0.1; }; dense: { half_width_deg = 0; }; };"

static void write_text(const char *file, const char *text)
{
    int fd = open(file, O_WRONLY);
    if (fd >= 0 && write(fd, text, strlen(text)) < 0)
        print_message("%s: %s\n", file, strerror(errno));
    if (fd >= 0)
        close(fd);
}

// Root may do it as it is, others in a user namespace of their own.
static bool mount_small(const char *where)
{
    char map[40];
    const unsigned uid = geteuid();
    if (unshare(CLONE_NEWNS) < 0) {
        if (unshare(CLONE_NEWUSER | CLONE_NEWNS) < 0)
            return false;
        snprintf(map, sizeof map, "0 %u 1", uid);
        write_text("/proc/self/setgroups", "deny");
        write_text("/proc/self/uid_map", map);
    }
    return mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) == 0 &&
           mount("gonio", where, "tmpfs", 0, "size=3m") == 0;
}

// All that is left, to the last block.
static void fill_disk(void)
{
    static const char zeros[4096];
    char other[160];
    fixture_path(&folder, "others", other, sizeof other);
    int fd = open(other, O_WRONLY | O_CREAT | O_APPEND, 0600);
    while (write(fd, zeros, sizeof zeros) > 0)
        ;
    assert_int_equal(errno, ENOSPC);
    close(fd);
}

static void free_disk(off_t keep)
{
    char other[160];
    fixture_path(&folder, "others", other, sizeof other);
    assert_int_equal(truncate(other, keep), 0);
}

static bool has_event(void *ctx, const struct store_event *e)
{
    *(bool *)ctx = *(bool *)ctx || strstr(e->text, "paused: the disk is full");
    return true;
}

static int64_t reserved(void)
{
    char reserve[180];
    struct stat st;
    snprintf(reserve, sizeof reserve, "%s-reserve", path);
    return stat(reserve, &st) == 0 ? (int64_t)st.st_blocks * 512 : -1;
}

static void inside(void)
{
    struct gon_error err;
    struct store_reading *rows;
    struct store *s = created_from(LONG_PLAN);
    int n = 0, rc = 0;
    assert_int_equal(reserved(), 1 << 20);
    for (; n < 20; n++) {
        const struct store_reading r = reading(1, n, 1);
        append(s, &r);
    }
    fill_disk();
    struct store_reading r;
    for (rc = 0; rc == 0; n += rc == 0) { // what the WAL has room for
        r = reading(1, n, 1);
        rc = store_append_reading(s, &r, &err);
    }
    print_message("full after %d readings more\n", n - 20);
    assert_int_equal(rc, GON_E_STORE);
    assert_non_null(strstr(err.text, "the disk is full"));
    assert_int_equal(reserved(), -1);
    // What is to be said is said, though nobody freed anything.
    assert_int_equal(store_append_event(s, 1, "err", "store", "paused: the disk is full", NULL), 0);
    assert_int_equal(store_append_state(s, 1, "paused", "the disk is full", NULL), 0);
    for (int again = 0; again < 50; again++) {
        assert_int_equal(store_append_reading(s, &r, &err), GON_E_STORE);
        assert_non_null(strstr(err.text, "free 2 MB on it"));
    }
    // The row is safe even if we are killed now.
    struct store *reader = opened(STORE_READ);
    bool said = false;
    assert_int_equal(store_read_readings(reader, -1, &rows, NULL), n + 1);
    free(rows);
    store_each_event(reader, 0, has_event, &said, NULL);
    assert_true(said);
    store_close(reader, NULL);
    // Room, and it goes on: no row lost, none twice.
    free_disk(0);
    append(s, &r);
    assert_int_equal(reserved(), 1 << 20);
    for (n++; n < 40; n++) {
        r = reading(1, n, 1);
        append(s, &r);
    }
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), 40);
    free(rows);
    // And a second time.
    fill_disk();
    for (rc = 0; rc == 0; n += rc == 0) {
        r = reading(1, n, 1);
        rc = store_append_reading(s, &r, &err);
    }
    assert_int_equal(store_append_event(s, 1, "err", "store", "again", NULL), 0);
    store_close(s, NULL); // as when somebody stops it
    assert_int_equal(reserved(), -1);
    s = opened(STORE_READ);
    assert_int_equal(store_read_readings(s, -1, &rows, NULL), n + 1);
    free(rows);
    store_close(s, NULL);
    // Opened on a full disk it can be read, and says why it cannot go on.
    fill_disk();
    rc = store_open(path, STORE_WRITE, &s, &err);
    assert_true(rc == GON_E_STORE || (rc == 0 && store_append_reading(s, &r, &err) == GON_E_STORE));
    assert_true(strstr(err.text, "the disk is full") || strstr(err.text, "No space left"));
    if (rc == 0)
        store_close(s, NULL);
    free_disk(0);
    s = opened(STORE_WRITE);
    append(s, &r);
    store_close(s, NULL);
}

static void a_full_disk_pauses_and_loses_nothing(void **state)
{
    (void)state;
    int status;
    pid_t child = fork(); // a namespace cannot be left again
    if (child == 0) {
        if (!mount_small(folder.path))
            _exit(77);
        inside();
        _exit(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77) {
        print_message("no mount namespace: %s\n", strerror(errno));
        assert_null(getenv("CI")); // there it must not go unnoticed
        skip();
    }
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_full_disk_pauses_and_loses_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
