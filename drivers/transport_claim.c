// SPDX-License-Identifier: MIT
#include "drivers/transport_claim.h"

#include <dirent.h>
#include <errno.h>
#include <grp.h>
#include <pwd.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <time.h>
#include <unistd.h>

enum { OWN_NAP_MS = 20, OWN_NAPS = 9 };

// The pid that holds a flock on this file, by /proc/locks, which shows the locks of all users:
// "1: FLOCK  ADVISORY  WRITE 1234 00:05:678 0 EOF". 0: none found.
static long lock_holder(const struct stat *file)
{
    FILE *f = fopen("/proc/locks", "re");
    char line[256];
    long found = 0;
    while (f && !found && fgets(line, sizeof line, f)) {
        char kind[16];
        long pid;
        unsigned major_number, minor_number;
        unsigned long inode;
        if (sscanf(line, "%*s %15s %*s %*s %ld %x:%x:%lu", kind, &pid, &major_number, &minor_number,
                   &inode) == 5 &&
            strcmp(kind, "FLOCK") == 0 && inode == file->st_ino &&
            makedev(major_number, minor_number) == file->st_dev)
            found = pid;
    }
    if (f)
        fclose(f);
    return found;
}

static bool has_open(const char *pid, const struct stat *file)
{
    char path[300];
    struct stat s;
    bool found = false;
    snprintf(path, sizeof path, "/proc/%s/fd", pid);
    DIR *fds = opendir(path);
    for (struct dirent *e; fds && !found && (e = readdir(fds));) {
        snprintf(path, sizeof path, "/proc/%s/fd/%.20s", pid, e->d_name);
        found = stat(path, &s) == 0 && S_ISCHR(s.st_mode) && s.st_rdev == file->st_rdev;
    }
    if (fds)
        closedir(fds);
    return found;
}

// A process other than this one that has the device open, as far as /proc lets us look. 0: none
// found.
static long open_holder(const struct stat *file)
{
    DIR *processes = opendir("/proc");
    long found = 0;
    for (struct dirent *e; processes && !found && (e = readdir(processes));) {
        long pid = strtol(e->d_name, NULL, 10);
        if (pid > 0 && pid != getpid() && has_open(e->d_name, file))
            found = pid;
    }
    if (processes)
        closedir(processes);
    return found;
}

static int say_in_use(const char *path, const struct stat *file, struct gon_error *err)
{
    char comm[64] = "", name[64];
    long pid = lock_holder(file);
    if (pid <= 0) // none, or one of another pid namespace
        pid = open_holder(file);
    if (pid <= 0)
        return gon_fail(err, GON_E_REFUSED, "%s: in use by another process; end that one first",
                        path);
    snprintf(name, sizeof name, "/proc/%ld/comm", pid);
    FILE *f = fopen(name, "re");
    if (f) {
        if (fgets(comm, sizeof comm, f))
            comm[strcspn(comm, "\n")] = 0;
        fclose(f);
    }
    return gon_fail(err, GON_E_REFUSED, "%s: in use by pid %ld%s%s%s; end that one first", path,
                    pid, comm[0] ? " (" : "", comm, comm[0] ? ")" : "");
}

// A port that we closed a moment ago can still be locked by us: somebody else's look into
// /proc/PID/fd keeps it open until that is over.
static int take_lock(int fd)
{
    const struct timespec nap = {0, OWN_NAP_MS * 1000000};
    struct stat s;
    for (int k = 0; flock(fd, LOCK_EX | LOCK_NB) < 0; k++) {
        const int error = errno;
        if (error != EWOULDBLOCK || k == OWN_NAPS || fstat(fd, &s) < 0 ||
            lock_holder(&s) != getpid())
            return error;
        nanosleep(&nap, NULL);
    }
    return 0;
}

int transport_claim(int fd, const char *path, struct gon_error *err)
{
    struct stat s;
    const int error = take_lock(fd);
    if (!error) {
        ioctl(fd, TIOCEXCL);
        return 0;
    }
    if (error == EWOULDBLOCK && fstat(fd, &s) == 0)
        return say_in_use(path, &s, err);
    return gon_fail(err, GON_E_SYSTEM, "%s: cannot be locked: %s", path, strerror(error));
}

static int say_denied(const char *path, const struct stat *file, struct gon_error *err)
{
    struct group *group = getgrgid(file->st_gid);
    struct passwd *user = getpwuid(geteuid());
    if ((file->st_mode & 060) != 060 || !group)
        return gon_fail(err, GON_E_REFUSED, "%s: permission denied (mode %03o, owner uid %ld)",
                        path, (unsigned)file->st_mode & 0777, (long)file->st_uid);
    return gon_fail(
        err, GON_E_REFUSED,
        "%s: permission denied; join the group '%s': sudo usermod -aG %s %s, then log in again",
        path, group->gr_name, group->gr_name, user ? user->pw_name : "USER");
}

int transport_claim_failed(const char *path, const char *name, int error, struct gon_error *err)
{
    struct stat s;
    const bool there = stat(name, &s) == 0;
    switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO: return gon_fail(err, GON_E_GONE, "%s: no such port; is it plugged in?", path);
    case EACCES:
    case EPERM:
        if (there)
            return say_denied(path, &s, err);
        break;
    case EBUSY:
        if (there)
            return say_in_use(path, &s, err);
        break;
    case ENOTTY: return gon_fail(err, GON_E_INPUT, "%s: is not a serial port", path);
    default: break;
    }
    return gon_fail(err, GON_E_GONE, "%s: %s", path, strerror(error));
}
