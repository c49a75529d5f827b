// SPDX-License-Identifier: MIT
#include "campaign/catalog.h"

#include "campaign/store_lock.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MOST_SLUG = 40 };

// --- where ---------------------------------------------------------------------------------------

static int put_path(char *ret_path, size_t size, struct gon_error *err, const char *a,
                    const char *b)
{
    if (snprintf(ret_path, size, "%s%s", a, b) >= (int)size)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", a);
    return GON_OK;
}

int catalog_directory(const char *wanted, char *ret_directory, size_t size, struct gon_error *err)
{
    const char *folder = getenv("GONIO_DIR"), *data = getenv("XDG_DATA_HOME"),
               *home = getenv("HOME");
    if (wanted && *wanted)
        return put_path(ret_directory, size, err, wanted, "");
    if (folder && *folder)
        return put_path(ret_directory, size, err, folder, "");
    if (geteuid() == 0)
        return put_path(ret_directory, size, err, "/var/lib/gonio", "");
    if (data && *data == '/')
        return put_path(ret_directory, size, err, data, "/gonio");
    if (home && *home == '/')
        return put_path(ret_directory, size, err, home, "/.local/share/gonio");
    return gon_fail(err, GON_E_INPUT, "no home directory; say where campaigns are with GONIO_DIR");
}

int catalog_make_directory(const char *directory, struct gon_error *err)
{
    char path[CATALOG_PATH];
    struct stat st;
    int rc = put_path(path, sizeof path, err, directory, "");
    for (char *slash = rc < 0 ? NULL : strchr(path + 1, '/'); slash;
         slash = strchr(slash + 1, '/')) {
        *slash = 0;
        mkdir(path, 0777); // what is wrong with it shows below
        *slash = '/';
    }
    if (rc >= 0 && mkdir(path, 0777) < 0 &&
        (errno != EEXIST || stat(path, &st) < 0 || !S_ISDIR(st.st_mode)))
        rc = gon_fail(err, GON_E_INPUT, "%s: cannot be made: %s", directory, strerror(errno));
    return rc;
}

struct catalog_hold {
    struct store_lock lock;
};

int catalog_take(const char *directory, struct catalog_hold **ret_hold, struct gon_error *err)
{
    struct catalog_hold *hold = malloc(sizeof *hold);
    if (!hold)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", directory);
    int rc = store_lock_take_folder(&hold->lock, directory, err);
    if (rc < 0)
        free(hold);
    else
        *ret_hold = hold;
    return rc;
}

void catalog_drop(struct catalog_hold *hold)
{
    if (hold)
        store_lock_drop(&hold->lock);
    free(hold);
}

// --- names ---------------------------------------------------------------------------------------

static bool ends(const char *name, const char *suffix)
{
    size_t n = strlen(name), m = strlen(suffix);
    return n > m && !strcmp(name + n - m, suffix);
}

int catalog_id(const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    char *end;
    if (!isdigit((unsigned char)*name) || !ends(name, STORE_SUFFIX))
        return 0;
    long id = strtol(name, &end, 10);
    return end - name >= 4 && (*end == '-' || *end == '.') && id > 0 && id < 1000000000 ? (int)id
                                                                                        : 0;
}

// Letters, digits and hyphens of a campaign's name; what is not ASCII is left out.
static void slug_of(const char *name, char slug[MOST_SLUG + 1])
{
    int n = 0;
    for (; *name && n < MOST_SLUG; name++) {
        if (isalnum((unsigned char)*name))
            slug[n++] = (char)tolower((unsigned char)*name);
        else if (n && slug[n - 1] != '-' && (unsigned char)*name < 0x80)
            slug[n++] = '-';
    }
    while (n && slug[n - 1] == '-')
        n--;
    slug[n] = 0;
}

// The directory's files, called with their names; the highest number.
static int scan(const char *directory, void (*each)(void *ctx, const char *name), void *ctx)
{
    int highest = 0;
    DIR *d = opendir(directory);
    for (struct dirent *e; d && (e = readdir(d));) {
        int id = catalog_id(e->d_name);
        highest = id > highest ? id : highest;
        if (each && ends(e->d_name, STORE_SUFFIX))
            each(ctx, e->d_name);
    }
    if (d)
        closedir(d);
    return highest;
}

int catalog_create(const char *directory, int above, const struct store_new *what,
                   struct store **ret_store, int *ret_id, struct gon_error *err)
{
    char slug[MOST_SLUG + 1], path[CATALOG_PATH];
    int rc = catalog_make_directory(directory, err);
    if (rc < 0)
        return rc;
    int fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0 || flock(fd, LOCK_EX) < 0)
        rc = gon_fail(err, GON_E_STORE, "%s: %s", directory, strerror(errno));
    int highest = scan(directory, NULL, NULL), id = (highest > above ? highest : above) + 1;
    slug_of(what->config->name, slug);
    if (rc >= 0 && snprintf(path, sizeof path, "%s/%04d%s%s%s", directory, id, *slug ? "-" : "",
                            slug, STORE_SUFFIX) >= (int)sizeof path)
        rc = gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", directory);
    if (rc >= 0)
        rc = store_create(path, what, ret_store, err);
    if (rc >= 0)
        *ret_id = id;
    if (fd >= 0)
        close(fd); // and with it the lock
    return rc;
}

// --- what is there -------------------------------------------------------------------------------

static void copy_meta(struct store *s, const char *key, char *text, size_t size)
{
    char *value = store_read_meta(s, key);
    snprintf(text, size, "%s", value ? value : "");
    free(value);
}

// A state that only a process can have, without the process.
static void settle_state(struct catalog_entry *e)
{
    static const char *const living[] = {"preparing", "running", "paused", "stopping", NULL};
    if (!*e->state)
        snprintf(e->state, sizeof e->state, "new");
    for (int i = 0; living[i] && !e->writer_pid; i++)
        if (!strcmp(e->state, living[i]))
            snprintf(e->state, sizeof e->state, "interrupted");
}

static int read_entry(struct store *s, struct catalog_entry *e, struct gon_error *err)
{
    struct store_progress progress;
    int64_t since_ms = 0;
    char created[24];
    int rc = store_read_progress(s, &progress, err);
    if (rc >= 0)
        rc = store_read_state(s, e->state, sizeof e->state, e->problem, sizeof e->problem,
                              &since_ms, err);
    if (rc < 0)
        return rc;
    copy_meta(s, "name", e->name, sizeof e->name);
    copy_meta(s, "sample", e->sample, sizeof e->sample);
    copy_meta(s, "created_utc_ms", created, sizeof created);
    e->created_utc_ms = atoll(created);
    e->done = progress.done;
    e->total = progress.total;
    const int64_t prepared_ms = store_read_state_time(s, "preparing"),
                  running_ms = store_read_state_time(s, "running");
    e->started_utc_ms = prepared_ms ? prepared_ms : running_ms;
    if (!strcmp(e->state, "done") || !strcmp(e->state, "failed"))
        e->finished_utc_ms = since_ms;
    settle_state(e);
    return GON_OK;
}

int catalog_read(const char *path, struct catalog_entry *ret_entry)
{
    struct catalog_entry e = {.id = catalog_id(path), .writer_pid = store_writer(path)};
    struct store *s;
    struct gon_error err = {0};
    snprintf(e.path, sizeof e.path, "%s", path);
    int rc = store_open(path, STORE_READ, &s, &err);
    if (rc >= 0) {
        rc = read_entry(s, &e, &err);
        store_close(s, NULL);
    }
    if (rc < 0) {
        snprintf(e.state, sizeof e.state, "unreadable");
        snprintf(e.problem, sizeof e.problem, "%.239s", err.text);
    }
    *ret_entry = e;
    return rc;
}

double catalog_left_s(const struct catalog_entry *e, const struct bench_config *bench)
{
    struct campaign_config config;
    struct plan plan = {0};
    struct store *s;
    double left_s = (double)NAN;
    if (store_open(e->path, STORE_READ, &s, NULL) < 0)
        return left_s;
    if (store_read_config(s, &config, NULL) == 0 && plan_make(&config, bench, &plan, NULL) == 0)
        left_s = plan.duration_s * (plan.count - e->done) / plan.count;
    plan_clear(&plan);
    store_close(s, NULL);
    return left_s;
}

struct list {
    const char *directory;
    struct catalog_entry *entries;
    int count, room;
    bool failed;
};

static void add(void *ctx, const char *name)
{
    struct list *l = ctx;
    char path[CATALOG_PATH];
    if (l->count == l->room) {
        struct catalog_entry *larger =
            realloc(l->entries, (size_t)(l->room * 2 + 16) * sizeof *larger);
        l->failed = l->failed || !larger;
        if (!larger)
            return;
        l->entries = larger;
        l->room = l->room * 2 + 16;
    }
    if (snprintf(path, sizeof path, "%s/%s", l->directory, name) < (int)sizeof path)
        catalog_read(path, &l->entries[l->count++]);
}

static int by_id(const void *a, const void *b)
{
    const struct catalog_entry *x = a, *y = b;
    return x->id != y->id ? (x->id > y->id) - (x->id < y->id) : strcmp(x->path, y->path);
}

int catalog_list(const char *directory, struct catalog_entry **ret_entries, struct gon_error *err)
{
    struct list l = {.directory = directory};
    scan(directory, add, &l);
    if (l.failed) {
        free(l.entries);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", directory);
    }
    if (l.count)
        qsort(l.entries, (size_t)l.count, sizeof *l.entries, by_id);
    *ret_entries = l.entries;
    return l.count;
}

// --- FILE ----------------------------------------------------------------------------------------

struct search {
    const char *directory, *wanted;
    long id; // 0: by name
    int best_id;
    char best[CATALOG_PATH];
};

static void look(void *ctx, const char *name)
{
    struct search *q = ctx;
    char path[CATALOG_PATH], found[CAMPAIGN_NAME] = "";
    const int id = catalog_id(name);
    if (snprintf(path, sizeof path, "%s/%s", q->directory, name) >= (int)sizeof path ||
        id < q->best_id)
        return;
    if (!q->id) {
        struct store *s;
        if (store_open(path, STORE_READ, &s, NULL) < 0)
            return;
        copy_meta(s, "name", found, sizeof found);
        store_close(s, NULL);
    }
    if (q->id ? id == q->id : !strcmp(found, q->wanted) || !strcmp(name, q->wanted)) {
        q->best_id = id;
        snprintf(q->best, sizeof q->best, "%s", path);
    }
}

int catalog_resolve(const char *directory, const char *file, char *ret_path, size_t size,
                    struct gon_error *err)
{
    struct search q = {.directory = directory, .wanted = file};
    struct stat st;
    char *end;
    if (strchr(file, '/') || (stat(file, &st) == 0 && S_ISREG(st.st_mode)))
        return put_path(ret_path, size, err, file, "");
    long id = strtol(file, &end, 10);
    q.id = isdigit((unsigned char)*file) && !*end ? id : 0;
    scan(directory, look, &q);
    if (*q.best)
        return put_path(ret_path, size, err, q.best, "");
    return gon_fail(err, GON_E_INPUT,
                    "%s: no such file, and no campaign of that %s in %s; see: gonio list", file,
                    q.id ? "number" : "name", directory);
}

int catalog_find(const char *directory, int id, char *ret_path, size_t size, struct gon_error *err)
{
    struct search q = {.directory = directory, .id = id};
    scan(directory, look, &q);
    if (*q.best)
        return put_path(ret_path, size, err, q.best, "");
    return gon_fail(err, GON_E_INPUT, "there is no run %d in %s; see: gonio list", id, directory);
}
