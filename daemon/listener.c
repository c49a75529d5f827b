// SPDX-License-Identifier: MIT
#include "daemon/listener.h"

#include "base/paths.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>


struct listener {
    char path[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    char lock_path[sizeof(((struct sockaddr_un *)NULL)->sun_path) + 8];
    int fd, lock_fd;
};

// Only the last folder is made, and only for us: /tmp/goniod-1000, say, which must then be ours.
static int make_folder(const char *path, struct gon_error *err)
{
    char folder[sizeof(((struct listener *)NULL)->path)];
    struct stat st;
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (!slash || slash == folder)
        return GON_OK;
    *slash = 0;
    if (mkdir(folder, 0700) < 0 && errno != EEXIST)
        return gon_fail(err, GON_E_INPUT, "socket %s: folder %s: %s; choose another with --socket",
                        path, folder, strerror(errno));
    if (!strncmp(folder, "/tmp/goniod-", 12) &&
        (lstat(folder, &st) < 0 || !S_ISDIR(st.st_mode) || st.st_uid != geteuid()))
        return gon_fail(err, GON_E_REFUSED,
                        "socket folder %s belongs to somebody else; choose another with --socket",
                        folder);
    return GON_OK;
}

static int refuse_second(const struct listener *l, int fd, struct gon_error *err)
{
    char pid[32] = "";
    ssize_t n = pread(fd, pid, sizeof pid - 1, 0);
    pid[n > 0 ? strcspn(pid, "\n") : 0] = 0;
    return gon_fail(err, GON_E_REFUSED,
                    "already running%s%s on %s; stop it, or choose another socket with --socket",
                    *pid ? ", pid " : "", pid, l->path);
}

// A lock file may be removed by its holder between our open and our flock: then the lock is on a
// file that nobody will find, and we try again.
static int take_lock(struct listener *l, struct gon_error *err)
{
    for (int tries = 0; tries < 10; tries++) {
        struct stat held, named;
        int fd = open(l->lock_path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd < 0)
            return gon_fail(err, GON_E_INPUT, "lock %s: %s; choose another socket with --socket",
                            l->lock_path, strerror(errno));
        if (flock(fd, LOCK_EX | LOCK_NB) < 0) {
            int rc = refuse_second(l, fd, err);
            close(fd);
            return rc;
        }
        if (fstat(fd, &held) == 0 && stat(l->lock_path, &named) == 0 &&
            held.st_ino == named.st_ino) {
            l->lock_fd = fd;
            if (ftruncate(fd, 0) == 0)
                dprintf(fd, "%ld\n", (long)getpid());
            return GON_OK;
        }
        close(fd);
    }
    return gon_fail(err, GON_E_REFUSED, "lock %s: other daemons come and go; try again",
                    l->lock_path);
}

static int listen_there(struct listener *l, struct gon_error *err)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    struct stat st;
    memcpy(address.sun_path, l->path, sizeof l->path);
    if (lstat(l->path, &st) == 0 && !S_ISSOCK(st.st_mode))
        return gon_fail(err, GON_E_INPUT,
                        "%s exists and is not a socket; choose another with --socket", l->path);
    unlink(l->path); // we hold the lock: whoever made it is gone
    l->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    mode_t mask = umask(0117);
    int rc = l->fd < 0 ? -1 : bind(l->fd, (struct sockaddr *)&address, sizeof address);
    umask(mask);
    if (rc < 0 || listen(l->fd, SOMAXCONN) < 0)
        return gon_fail(err, GON_E_INPUT, "socket %s: %s; choose another with --socket", l->path,
                        strerror(errno));
    return GON_OK;
}

int listener_open(const char *path, struct listener **ret_listener, struct gon_error *err)
{
    int rc = paths_socket_fits(path, err);
    if (rc < 0)
        return rc;
    struct listener *l = calloc(1, sizeof *l);
    if (!l)
        return gon_fail(err, GON_E_SYSTEM, "socket %s: out of memory", path);
    l->fd = l->lock_fd = -1;
    snprintf(l->path, sizeof l->path, "%s", path);
    snprintf(l->lock_path, sizeof l->lock_path, "%s.lock", l->path);
    rc = make_folder(path, err);
    rc = rc < 0 ? rc : take_lock(l, err);
    rc = rc < 0 ? rc : listen_there(l, err);
    if (rc < 0) {
        listener_close(l);
        return rc;
    }
    *ret_listener = l;
    return GON_OK;
}

void listener_close(struct listener *l)
{
    if (!l)
        return;
    if (l->fd >= 0) {
        unlink(l->path);
        close(l->fd);
    }
    if (l->lock_fd >= 0) {
        unlink(l->lock_path);
        close(l->lock_fd);
    }
    free(l);
}

int listener_fd(const struct listener *l)
{
    return l->fd;
}
