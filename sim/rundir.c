// SPDX-License-Identifier: MIT
#include "sim/rundir.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *const files[] = {"axes",       "laser",          "detector", "control.sock",
                                    "goniod.cfg", "goniod-tcp.cfg", "ready",    "goniosim.pid"};

void rundir_path(const struct rundir *r, const char *name, char *ret_path, size_t size)
{
    snprintf(ret_path, size, "%s/%s", r->path, name);
}

// Only one goniosim; whoever has the lock also wrote its process id.
static int lock(struct rundir *r, struct gon_error *err)
{
    char path[RUNDIR_FILE], text[32] = "";
    rundir_path(r, "goniosim.pid", path, sizeof path);
    r->lock_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (r->lock_fd < 0)
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", path, strerror(errno));
    if (flock(r->lock_fd, LOCK_EX | LOCK_NB)) {
        ssize_t n = read(r->lock_fd, text, sizeof text - 1);
        text[n > 0 ? n : 0] = 0;
        text[strcspn(text, "\n")] = 0;
        close(r->lock_fd);
        r->lock_fd = -1;
        return gon_fail(err, GON_E_REFUSED,
                        "%s is used by goniosim with process id %s; give another --run-dir",
                        r->path, text);
    }
    if (ftruncate(r->lock_fd, 0) || dprintf(r->lock_fd, "%ld\n", (long)getpid()) < 0)
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", path, strerror(errno));
    return 0;
}

int rundir_open(struct rundir *r, const char *path, struct gon_error *err)
{
    char full[PATH_MAX];
    *r = (struct rundir){.lock_fd = -1, .dir_fd = -1};
    if (mkdir(path, 0700) == 0)
        r->made = true;
    else if (errno != EEXIST)
        return gon_fail(err, GON_E_INPUT, "run directory %s: %s", path, strerror(errno));
    if (!realpath(path, full))
        return gon_fail(err, GON_E_INPUT, "run directory %s: %s", path, strerror(errno));
    if (strlen(full) >= sizeof r->path)
        return gon_fail(err, GON_E_INPUT, "run directory %s: its path has more than %zu characters",
                        full, sizeof r->path - 1);
    strcpy(r->path, full);
    r->dir_fd = open(full, O_PATH | O_DIRECTORY | O_CLOEXEC);
    return lock(r, err);
}

void rundir_close(struct rundir *r)
{
    char path[RUNDIR_FILE];
    if (r->lock_fd < 0)
        return;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        rundir_path(r, files[i], path, sizeof path);
        unlink(path);
    }
    if (r->made)
        rmdir(r->path);
    close(r->dir_fd);
    close(r->lock_fd);
    r->lock_fd = -1;
}

int rundir_write(const struct rundir *r, const char *name,
                 void (*write)(FILE *out, const void *ctx), const void *ctx, struct gon_error *err)
{
    char path[RUNDIR_FILE], draft[RUNDIR_FILE + 8];
    rundir_path(r, name, path, sizeof path);
    snprintf(draft, sizeof draft, "%s.new", path);
    FILE *out = fopen(draft, "we");
    if (!out)
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", draft, strerror(errno));
    write(out, ctx);
    int failed = ferror(out);
    failed |= fclose(out);
    if (failed || rename(draft, path)) {
        unlink(draft);
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", path, strerror(errno));
    }
    return 0;
}
