// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// A campaign is created, written, closed, gone on with and read, and in each run another one of its
// calls fails: of the file system, or for memory. Whatever fails, the same call made again goes on,
// no acknowledged reading is lost, none is there twice, and the file is whole.
#include "store_fixture.h"

#include "campaign/reduce.h"
#include "campaign/store_verify.h"

#include <errno.h>

enum { READINGS = 5, TRIES = 8, MOST_RUNS = 50000, MEMORY_STEP = 61 };

// --- what fails ----------------------------------------------------------------------------------

// The call that counts to zero fails, and so many after it.
static struct {
    int left, more, failed;
    bool armed;
} fault;

static void arm(int nth, int more)
{
    fault.left = nth;
    fault.more = more;
    fault.failed = 0;
    fault.armed = true;
}

static bool fails(void)
{
    if (!fault.armed || --fault.left > 0)
        return false;
    if (-fault.left > fault.more)
        return false;
    fault.failed++;
    return true;
}

// --- a file system whose calls fail --------------------------------------------------------------

struct file {
    sqlite3_file base;
    sqlite3_file *real;
};

static struct {
    sqlite3_vfs vfs, *unix_vfs;
    sqlite3_io_methods methods;
    bool full; // where a disk can be: that is answered
} broken;

#define REAL(file) (((struct file *)(file))->real)
// What takes room may find the disk full.
#define ROOM(code) (broken.full ? SQLITE_FULL : (code))
#define CALL(name, code, args, call)                                                               \
    static int broken_##name args                                                                  \
    {                                                                                              \
        return fails() ? (code) : REAL(file)->pMethods->call;                                      \
    }
CALL(write, ROOM(SQLITE_IOERR_WRITE), (sqlite3_file * file, const void *p, int n, sqlite3_int64 at),
     xWrite(REAL(file), p, n, at))
CALL(truncate, ROOM(SQLITE_IOERR_TRUNCATE), (sqlite3_file * file, sqlite3_int64 size),
     xTruncate(REAL(file), size))
CALL(size, SQLITE_IOERR_FSTAT, (sqlite3_file * file, sqlite3_int64 *size),
     xFileSize(REAL(file), size))
CALL(lock, SQLITE_IOERR_LOCK, (sqlite3_file * file, int level), xLock(REAL(file), level))
CALL(reserved, SQLITE_IOERR_CHECKRESERVEDLOCK, (sqlite3_file * file, int *ret),
     xCheckReservedLock(REAL(file), ret))
CALL(shm_map, ROOM(SQLITE_IOERR_SHMMAP),
     (sqlite3_file * file, int page, int size, int extend, void volatile **ret),
     xShmMap(REAL(file), page, size, extend, ret))

// Giving a lock back does not fail.
static int broken_shm_lock(sqlite3_file *file, int at, int n, int flags)
{
    return flags & SQLITE_SHM_LOCK && fails()
               ? SQLITE_IOERR_SHMLOCK
               : REAL(file)->pMethods->xShmLock(REAL(file), at, n, flags);
}

static int broken_read(sqlite3_file *file, void *p, int n, sqlite3_int64 at)
{
    return fails() ? SQLITE_IOERR_READ : REAL(file)->pMethods->xRead(REAL(file), p, n, at);
}

// Real ones would only take time.
static int broken_sync(sqlite3_file *file, int flags)
{
    (void)file;
    (void)flags;
    return fails() ? ROOM(SQLITE_IOERR_FSYNC) : SQLITE_OK;
}

static int broken_unlock(sqlite3_file *file, int level)
{
    return REAL(file)->pMethods->xUnlock(REAL(file), level);
}

static int broken_control(sqlite3_file *file, int op, void *arg)
{
    return REAL(file)->pMethods->xFileControl(REAL(file), op, arg);
}

static int broken_sector(sqlite3_file *file)
{
    return REAL(file)->pMethods->xSectorSize(REAL(file));
}

static int broken_device(sqlite3_file *file)
{
    return REAL(file)->pMethods->xDeviceCharacteristics(REAL(file));
}

static void broken_barrier(sqlite3_file *file)
{
    REAL(file)->pMethods->xShmBarrier(REAL(file));
}

static int broken_shm_unmap(sqlite3_file *file, int remove)
{
    return REAL(file)->pMethods->xShmUnmap(REAL(file), remove);
}

static int broken_close(sqlite3_file *file)
{
    int rc = REAL(file)->pMethods->xClose(REAL(file));
    free(REAL(file));
    return rc;
}

static int broken_open(sqlite3_vfs *vfs, const char *name, sqlite3_file *file, int flags,
                       int *ret_flags)
{
    (void)vfs;
    file->pMethods = NULL;
    if (fails())
        return SQLITE_CANTOPEN;
    sqlite3_file *real = calloc(1, (size_t)broken.unix_vfs->szOsFile);
    int rc = broken.unix_vfs->xOpen(broken.unix_vfs, name, real, flags, ret_flags);
    if (rc != SQLITE_OK) {
        free(real);
        return rc;
    }
    REAL(file) = real;
    file->pMethods = &broken.methods;
    return SQLITE_OK;
}

static int broken_delete(sqlite3_vfs *vfs, const char *name, int sync)
{
    (void)vfs;
    (void)sync;
    return fails() ? SQLITE_IOERR_DELETE : broken.unix_vfs->xDelete(broken.unix_vfs, name, 0);
}

static int broken_access(sqlite3_vfs *vfs, const char *name, int flags, int *ret)
{
    (void)vfs;
    return fails() ? SQLITE_IOERR_ACCESS
                   : broken.unix_vfs->xAccess(broken.unix_vfs, name, flags, ret);
}

static void install(void)
{
    broken.unix_vfs = sqlite3_vfs_find("unix");
    broken.vfs = *broken.unix_vfs;
    broken.vfs.zName = "broken";
    broken.vfs.szOsFile = sizeof(struct file);
    broken.vfs.xOpen = broken_open;
    broken.vfs.xDelete = broken_delete;
    broken.vfs.xAccess = broken_access;
    broken.methods = (sqlite3_io_methods){.iVersion = 2,
                                          .xClose = broken_close,
                                          .xRead = broken_read,
                                          .xWrite = broken_write,
                                          .xTruncate = broken_truncate,
                                          .xSync = broken_sync,
                                          .xFileSize = broken_size,
                                          .xLock = broken_lock,
                                          .xUnlock = broken_unlock,
                                          .xCheckReservedLock = broken_reserved,
                                          .xFileControl = broken_control,
                                          .xSectorSize = broken_sector,
                                          .xDeviceCharacteristics = broken_device,
                                          .xShmMap = broken_shm_map,
                                          .xShmLock = broken_shm_lock,
                                          .xShmBarrier = broken_barrier,
                                          .xShmUnmap = broken_shm_unmap};
    assert_int_equal(sqlite3_vfs_register(&broken.vfs, 1), SQLITE_OK);
}

static void uninstall(void)
{
    sqlite3_vfs_register(broken.unix_vfs, 1);
    sqlite3_vfs_unregister(&broken.vfs);
}

// --- memory --------------------------------------------------------------------------------------

static sqlite3_mem_methods memory;

static void *failing_malloc(int size)
{
    return fails() ? NULL : memory.xMalloc(size);
}

static void *failing_realloc(void *old, int size)
{
    return fails() ? NULL : memory.xRealloc(old, size);
}

static void begin_memory(void *(*own_malloc)(int size), void *(*own_realloc)(void *old, int size))
{
    assert_int_equal(sqlite3_shutdown(), SQLITE_OK);
    assert_int_equal(sqlite3_config(SQLITE_CONFIG_GETMALLOC, &memory), SQLITE_OK);
    sqlite3_mem_methods ours = memory;
    ours.xMalloc = own_malloc;
    ours.xRealloc = own_realloc;
    assert_int_equal(sqlite3_config(SQLITE_CONFIG_MALLOC, &ours), SQLITE_OK);
    assert_int_equal(sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0), SQLITE_OK); // all through us
    sqlite3_initialize();
}

static void end_memory(void)
{
    sqlite3_shutdown();
    sqlite3_config(SQLITE_CONFIG_MALLOC, &memory);
}

// What is not SQLite's: the store's own and the C library's. A sanitizer has its own.
#if !defined __SANITIZE_ADDRESS__
static bool memory_fails;
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);

void *malloc(size_t size)
{
    return memory_fails && fails() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return memory_fails && fails() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
    return memory_fails && fails() ? NULL : __libc_realloc(old, size);
}

static void *passing_malloc(int size)
{
    const bool before = memory_fails;
    memory_fails = false;
    void *p = memory.xMalloc(size);
    memory_fails = before;
    return p;
}

static void *passing_realloc(void *old, int size)
{
    const bool before = memory_fails;
    memory_fails = false;
    void *p = memory.xRealloc(old, size);
    memory_fails = before;
    return p;
}
#endif

// --- a campaign ----------------------------------------------------------------------------------

static struct campaign {
    struct campaign_config config;
    struct bench_config bench;
    struct plan plan;
    struct store_new what;
} campaign;

static const struct store_profile profile = {"sr830", "detector", "profile: {};\n"};

// What failed for want of disk or memory is to be made again as it is.
#define AGAIN(call)                                                                                \
    do {                                                                                           \
        int rc_, tries_ = 0;                                                                       \
        struct gon_error err = {0};                                                                \
        while ((rc_ = (call)) < 0 && tries_++ < TRIES) {                                           \
            if (rc_ != GON_E_STORE && rc_ != GON_E_SYSTEM)                                         \
                print_error("%d: %s\n", rc_, err.text);                                            \
            assert_true((rc_ == GON_E_STORE || rc_ == GON_E_SYSTEM) && *err.text);                 \
        }                                                                                          \
        assert_true(rc_ >= 0);                                                                     \
    } while (0)

static int create(struct store **ret_store, struct gon_error *err)
{
    int rc = store_create(path, &campaign.what, ret_store, err);
    // Made, and only its opening failed: it is opened again, as goniod does.
    return rc == GON_E_REFUSED ? store_open(path, STORE_WRITE, ret_store, err) : rc;
}

static int read_back(struct gon_error *err)
{
    struct store *s = NULL;
    struct store_reading *rows = NULL;
    int rc = store_open(path, STORE_READ, &s, err);
    rc = rc < 0 ? rc : store_read_readings(s, -1, &rows, err);
    if (rc >= 0)
        assert_int_equal(rc, 2 * READINGS);
    if (rc >= 0)
        free(rows);
    store_close(s, NULL);
    return rc;
}

static void live_through(void)
{
    struct store *s;
    AGAIN(create(&s, &err));
    for (int day = 0; day < 2; day++) {
        if (day)
            AGAIN(store_open(path, STORE_WRITE, &s, &err));
        AGAIN(store_append_profiles(s, 1, &profile, 1, &err));
        for (int i = 0; i < READINGS; i++) {
            const struct store_reading r = reading(1, day * READINGS + i, 1);
            AGAIN(store_append_reading(s, &r, &err));
        }
        AGAIN(store_append_state(s, 1, "stopped", "", &err));
        store_close(s, NULL); // loses nothing, whatever it says
    }
    AGAIN(read_back(&err));
}

static void count_finding(void *ctx, const struct store_finding *f)
{
    (void)ctx;
    // The sweep's first points are here; those before it were not measured.
    if (strcmp(f->what, "hole"))
        print_error("%s: %s\n", f->what, f->text);
    assert_string_equal(f->what, "hole");
}

static void look_at_it(void)
{
    struct store_verified seen;
    struct store *s = opened(STORE_READ);
    assert_int_equal(store_verify(s, count_finding, NULL, &seen, NULL), 0);
    assert_int_equal(seen.readings, 2 * READINGS);
    assert_true(seen.profiles == 1 && seen.findings == 1);
    store_close(s, NULL);
}

// What the last reader could not tidy up is SQLite's; nothing else may be left.
static void clear(void)
{
    static const char *const suffixes[] = {"", "-wal", "-shm", "-journal"};
    for (int i = 0; i < 4; i++) {
        char name[160];
        snprintf(name, sizeof name, "%s%s", path, suffixes[i]);
        unlink(name);
    }
    assert_int_equal(fixture_files(&folder), 0);
}

// Until a run is through before its turn comes; returns how many there were.
static int each_in_turn(int first, int step, int more)
{
    int nth = first;
    for (;; nth += step) {
        assert_true(nth < MOST_RUNS);
        arm(nth, more);
        live_through();
        fault.armed = false;
        if (!fault.failed)
            break;
        look_at_it();
        clear();
    }
    assert_true(nth > 5);
    return nth - step;
}

static void begin_campaign(void)
{
    campaign.config = fixture_campaign(CONFIG);
    campaign.bench = fixture_bench();
    assert_int_equal(plan_make(&campaign.config, &campaign.bench, &campaign.plan, NULL), 0);
    campaign.what = (struct store_new){.config = &campaign.config,
                                       .config_text = CONFIG,
                                       .config_name = "test.cfg",
                                       .bench = &campaign.bench,
                                       .bench_text = FIXTURE_BENCH,
                                       .plan = &campaign.plan,
                                       .t_utc_ms = 1};
}

static void any_call_of_the_file_system_may_fail(void **state)
{
    (void)state;
    begin_campaign();
    install();
    for (int i = 0; i < 4; i++) {
        static const struct {
            bool full;
            int more, step;
        } ways[] = {{false, 0, 1}, {true, 2, 1}, {false, 2, 7}, {true, 0, 7}};
        broken.full = ways[i].full;
        print_message("%d calls, each %d-th failed in turn: %s, %d more after it\n",
                      each_in_turn(1, ways[i].step, ways[i].more), ways[i].step,
                      ways[i].full ? "full" : "I/O error", ways[i].more);
        clear();
    }
    uninstall();
    plan_clear(&campaign.plan);
}

static int given(const char *name, int otherwise)
{
    const char *text = getenv(name);
    const int value = text ? atoi(text) : 0;
    return value > 0 ? value : otherwise;
}

// All of them take minutes: GONIO_TEST_STEP=1.
static void any_memory_of_the_database_may_be_missing(void **state)
{
    (void)state;
    const int step = given("GONIO_TEST_STEP", MEMORY_STEP);
    begin_campaign();
    begin_memory(failing_malloc, failing_realloc);
    install();
    print_message("%d allocations, each %d-th failed in turn from %d on\n",
                  each_in_turn(1 + given("GONIO_TEST_SEED", 0) % step, step, 0), step,
                  1 + given("GONIO_TEST_SEED", 0) % step);
    uninstall();
    end_memory();
    plan_clear(&campaign.plan);
}

// Some thousand files are made and synced: in memory, where there is such a folder.
static int begin_in_memory(void **state)
{
    if (access("/dev/shm", W_OK) < 0)
        return begin(state);
    strcpy(folder.path, "/dev/shm/gonio-test-XXXXXX");
    assert_non_null(mkdtemp(folder.path));
    fixture_path(&folder, "0001-test.gonio", path, sizeof path);
    return 0;
}

static void any_other_memory_may_be_missing(void **state)
{
    (void)state;
#if defined __SANITIZE_ADDRESS__
    skip();
#else
    begin_campaign();
    begin_memory(passing_malloc, passing_realloc);
    memory_fails = true;
    print_message("%d allocations, each failed in turn\n", each_in_turn(1, 1, 0));
    memory_fails = false;
    end_memory();
    plan_clear(&campaign.plan);
#endif
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin_in_memory, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(any_call_of_the_file_system_may_fail),
        TEST(any_memory_of_the_database_may_be_missing),
        TEST(any_other_memory_may_be_missing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
