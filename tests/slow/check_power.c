// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// Does a power cut lose a reading that was acknowledged, or leave a file that cannot be read?
//
//   check_power [-s SEED] [-n CUTS]
//
// Campaigns are written over a file system that keeps a record (power.h); the record is cut at a
// random place, the files are made as they may be found then, opened as goniod opens them, read and
// verified. CUTS: 20,000, or 1,000 when CI is set, or GONIO_POWER_CUTS. 0 lost and 0 broken must
// come out. Then the same where synchronous = NORMAL was forced, which must lose readings, and with
// a disk that never syncs, which must break files: so the cuts bite.
#include "campaign/store_verify.h"
#include "tests/slow/power.h"
#include "tests/unit/campaign_fixture.h"
#include "tests/unit/randoms.h"

#include <fcntl.h>
#include <getopt.h>
#include <inttypes.h>
#include <sys/stat.h>
#include <time.h>

enum { CUTS = 20000, CUTS_CI = 1000, CUTS_BITE = 400, WORKLOADS = 20, SEED = 20261126 };
enum { MOST_READINGS = 300, MOST_SAID = 5 };

static const char config_text[] =
    "campaign: { name = \"power\"; theta_i_deg = (10, 20, 30); theta_r: { step_deg = 1; };"
    " dense: { half_width_deg = 0; }; };";

struct tally {
    int cuts, lost, broken; // cuts that lost readings, that left a broken file
    int64_t acknowledged, lost_readings;
};

static struct {
    char folder[64], path[128], cut_path[128];
    struct store_reading offered[MOST_READINGS]; // in the plan's order
    int count;
    char settings[120]; // of each connection while the record is made
    int said;
} check;

static void stop(const char *what, const struct gon_error *err)
{
    fprintf(stderr, "check_power: %s: %s\n", what, err->text);
    exit(1);
}

// --- a campaign that is written ------------------------------------------------------------------

static void make_campaign(void)
{
    const struct campaign_config config = fixture_campaign(config_text);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s;
    struct gon_error err;
    if (plan_make(&config, &bench, &plan, &err) < 0)
        stop("plan", &err);
    const struct store_new what = {&config, config_text, "power.cfg", &bench, FIXTURE_BENCH,
                                   &plan,   1000,        NULL,        0};
    unlink(check.path);
    if (store_create(check.path, &what, &s, &err) < 0)
        stop("create", &err);
    store_close(s, NULL);
    check.count = 0;
    for (int i = 0; i < plan.count && check.count < MOST_READINGS; i++)
        check.offered[check.count++] = (struct store_reading){.sweep = plan.points[i].sweep,
                                                              .point = plan.points[i].point,
                                                              .attempt = 1,
                                                              .t_utc_ms = 1700000000000 + i,
                                                              .signal_v = 1e-3 / (i + 1),
                                                              .signal_sd_v = 1e-6,
                                                              .monitor_v = 1,
                                                              .count = 4};
    plan_clear(&plan);
}

static int set_connection(sqlite3 *db, char **ret_text, const void *api)
{
    (void)ret_text;
    (void)api;
    return sqlite3_exec(db, check.settings, NULL, NULL, NULL);
}

static void append_something(struct store *s, uint64_t *random)
{
    const struct store_profile p = {"sr830", "detector", random_next(random) % 2 ? "a" : "b"};
    switch (random_next(random) % 20) {
    case 0: store_append_event(s, 1, "notice", "engine", "something happened", NULL); break;
    case 1: store_append_state(s, 1, "paused", "for a while", NULL); break;
    case 2: store_append_profiles(s, 1, &p, 1, NULL); break;
    default: break;
    }
}

// Some days of a campaign: opened, readings and what else happens, closed; each acknowledgement is
// a mark.
static void write_campaign(uint64_t *random)
{
    struct gon_error err;
    struct store *s = NULL;
    const int readings = 100 + (int)(random_next(random) % (MOST_READINGS - 100));
    for (int i = 0; i < readings; i++) {
        if (!s && store_open(check.path, STORE_WRITE, &s, &err) < 0)
            stop("open", &err);
        if (store_append_reading(s, &check.offered[i], &err) < 0)
            stop("append", &err);
        power_mark(i + 1);
        append_something(s, random);
        if (random_next(random) % 50 == 0) {
            store_close(s, NULL);
            s = NULL;
        }
    }
    store_close(s, NULL);
}

// --- a cut ---------------------------------------------------------------------------------------

static bool happens(uint64_t *random, double chance)
{
    return random_between(random, 0, 1) < chance;
}

static void copy_bytes(struct power_bytes *to, const struct power_bytes *from)
{
    to->size = 0;
    power_resize(to, from->size);
    if (from->size)
        memcpy(to->data, from->data, (size_t)from->size);
}

// Each sector by its own chance.
static void put_torn(struct power_bytes *b, const struct power_op *op, uint64_t *random,
                     double chance)
{
    for (int64_t done = 0, n; done < op->size; done += n) {
        n = POWER_SECTOR - (op->at + done) % POWER_SECTOR;
        n = n > op->size - done ? op->size - done : n;
        if (happens(random, chance))
            power_put(b, op->at + done, op->data + done, n);
    }
}

static void write_file(const char *suffix, const struct power_bytes *b)
{
    char path[160];
    snprintf(path, sizeof path, "%s%s", check.cut_path, suffix);
    unlink(path);
    if (!b)
        return;
    int fd = open(path, O_WRONLY | O_CREAT, 0600);
    if (fd < 0 || write(fd, b->data, (size_t)b->size) != b->size)
        abort();
    close(fd);
}

// The files as they may be found, some luck for all that is under way.
static void leave_files(const struct power_disk *d, uint64_t *random)
{
    static const double chances[] = {0, 0.1, 0.5, 0.9, 1};
    static const char *const suffix[POWER_NAMES] = {"", "-wal", "-journal"};
    static struct power_bytes b;
    const double chance = chances[random_next(random) % 5];
    int entry[POWER_NAMES];
    bool more_names = true;
    memcpy(entry, d->entry, sizeof entry);
    for (int i = 0; i < d->pending_count; i++) { // names in their order
        const struct power_op *op = &power.ops[d->pending[i]];
        more_names = more_names && (!power_is_name(op) || happens(random, 0.5));
        if (power_is_name(op) && more_names)
            entry[op->name] = op->kind == POWER_CREATE ? op->inode : -1;
    }
    for (int name = 0; name < POWER_NAMES; name++) {
        write_file(suffix[name], NULL);
        if (entry[name] < 0)
            continue;
        copy_bytes(&b, &d->file[entry[name]]);
        for (int i = 0; i < d->pending_count; i++) {
            const struct power_op *op = &power.ops[d->pending[i]];
            if (op->inode == entry[name] && op->kind == POWER_WRITE)
                put_torn(&b, op, random, chance);
            else if (op->inode == entry[name] && op->kind == POWER_TRUNCATE &&
                     happens(random, chance))
                power_resize(&b, op->at);
        }
        write_file(suffix[name], &b);
    }
    write_file("-shm", NULL); // it is no file on a disk
}

static void say_broken(int cut, const char *text)
{
    if (check.said++ < MOST_SAID)
        printf("  cut %d of %d operations: %s\n", cut, power.count, text);
}

static void first_finding(void *ctx, const struct store_finding *f)
{
    char *text = ctx;
    if (!*text)
        snprintf(text, 200, "%s", f->text);
}

// Only what was offered, in its order, and all that was acknowledged.
static int count_good(const struct store_reading *rows, int count)
{
    for (int i = 0; i < count; i++)
        if (rows[i].sweep != check.offered[i].sweep || rows[i].point != check.offered[i].point ||
            rows[i].signal_v != check.offered[i].signal_v)
            return i;
    return count;
}

static void look_at_files(struct tally *t, int cut, int acknowledged)
{
    struct store *s;
    struct gon_error err = {0};
    struct store_reading *rows = NULL;
    struct store_verified seen = {0};
    char text[200] = "";
    t->cuts++;
    t->acknowledged += acknowledged;
    if (store_open(check.cut_path, STORE_WRITE, &s, &err) < 0) {
        t->broken++;
        say_broken(cut, err.text);
        return;
    }
    const int found = store_read_readings(s, -1, &rows, &err);
    const int good = found < 0 ? 0 : count_good(rows, found);
    if (store_verify(s, first_finding, text, &seen, &err) < 0 || seen.findings || found < 0) {
        t->broken++;
        say_broken(cut, *text ? text : err.text);
    } else if (good < found || found > acknowledged + 1) {
        t->broken++;
        say_broken(cut, "readings that nobody offered");
    } else if (found < acknowledged) {
        t->lost++;
        t->lost_readings += acknowledged - found;
        say_broken(cut, "acknowledged readings are gone");
    }
    free(rows);
    store_close(s, NULL);
}

static void load(const char *path, struct power_bytes *b)
{
    struct stat st;
    int fd = open(path, O_RDONLY);
    if (fd < 0 || fstat(fd, &st) < 0)
        abort();
    power_resize(b, st.st_size);
    if (read(fd, b->data, (size_t)b->size) != b->size)
        abort();
    close(fd);
}

static int compare_ints(const void *a, const void *b)
{
    const int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

static void cut_often(struct tally *t, struct power_disk *d, int cuts, uint64_t *random)
{
    int *at = power_must(calloc((size_t)cuts, sizeof *at));
    int acknowledged = 0, looked = 0;
    for (int i = 0; i < cuts; i++)
        at[i] = (int)(random_next(random) % (uint64_t)(power.count + 1));
    qsort(at, (size_t)cuts, sizeof *at, compare_ints);
    for (int i = 0; i < cuts; i++) {
        power_advance(d, at[i]);
        for (; looked < at[i]; looked++)
            if (power.ops[looked].kind == POWER_MARK)
                acknowledged = (int)power.ops[looked].at;
        leave_files(d, random);
        look_at_files(t, at[i], acknowledged);
    }
    free(at);
}

static struct tally run(int cuts, uint64_t seed, bool normal, bool no_sync)
{
    static const int checkpoints[] = {4, 16, 64, 1000}; // pages
    struct tally t = {0};
    check.said = normal || no_sync ? MOST_SAID : 0; // expected there
    for (int w = 0; w < WORKLOADS; w++) {
        uint64_t random = seed + (uint64_t)w;
        struct power_disk disk = {.entry = {0, -1, -1}};
        make_campaign();
        load(check.path, &disk.file[0]);
        snprintf(check.settings, sizeof check.settings, "PRAGMA wal_autocheckpoint = %d;%s",
                 checkpoints[w % 4], normal ? "PRAGMA synchronous = NORMAL" : "");
        power_begin(check.path, normal, no_sync);
        sqlite3_auto_extension((void (*)(void))set_connection);
        write_campaign(&random);
        sqlite3_cancel_auto_extension((void (*)(void))set_connection);
        power_end();
        cut_often(&t, &disk, (w + 1) * cuts / WORKLOADS - w * cuts / WORKLOADS, &random);
        power_clear(&disk);
        power_forget();
    }
    return t;
}

static void print(const char *what, const struct tally *t)
{
    printf("%-24s %6d cuts  %9" PRId64 " readings acknowledged before them  lost %" PRId64
           " (in %d cuts)  broken files %d\n",
           what, t->cuts, t->acknowledged, t->lost_readings, t->lost, t->broken);
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void begin_folder(void)
{
    // In memory where there is such a folder: nothing of what is cut need reach a disk.
    snprintf(check.folder, sizeof check.folder, "%s/gonio-power-XXXXXX",
             access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    if (!mkdtemp(check.folder))
        abort();
    snprintf(check.path, sizeof check.path, "%s/0001-power.gonio", check.folder);
    snprintf(check.cut_path, sizeof check.cut_path, "%s/0002-cut.gonio", check.folder);
}

int main(int argc, char **argv)
{
    const char *given = getenv("GONIO_POWER_CUTS");
    int cuts = given ? atoi(given) : getenv("CI") ? CUTS_CI : CUTS;
    uint64_t seed = SEED;
    for (int c; (c = getopt(argc, argv, "s:n:")) != -1;) {
        if (c == 's')
            seed = strtoull(optarg, NULL, 10);
        else if (c == 'n')
            cuts = atoi(optarg);
        else
            return 2;
    }
    printf("power cuts, seed %" PRIu64 "\n", seed);
    begin_folder();
    const double start_s = now_s();
    const struct tally full = run(cuts, seed, false, false);
    print("as it is", &full);
    printf("%.1f ms a cut\n", 1e3 * (now_s() - start_s) / (full.cuts ? full.cuts : 1));
    const struct tally normal = run(CUTS_BITE, seed, true, false);
    print("synchronous = NORMAL", &normal);
    const struct tally deaf = run(CUTS_BITE, seed, false, true);
    print("a disk without sync", &deaf);
    struct fixture_folder folder;
    snprintf(folder.path, sizeof folder.path, "%s", check.folder);
    fixture_remove(&folder);
    const bool bites = normal.lost > 0 && normal.broken == 0 && deaf.broken > 0;
    if (!bites)
        printf("FAILED: the cuts do not bite\n");
    if (full.lost || full.broken || !full.cuts)
        printf("FAILED: a power cut does harm\n");
    return bites && full.cuts && !full.lost && !full.broken ? 0 : 1;
}
