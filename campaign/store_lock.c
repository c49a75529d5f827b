// SPDX-License-Identifier: MIT
#include "campaign/store_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/sysmacros.h>
#include <unistd.h>

enum { WAL_WRITE_LOCK = 120 }; // byte of FILE-shm (sqlite.org/walformat.html, section 2.1)

static int lock_path(const char *file, char *path, size_t size)
{
    return snprintf(path, size, "%s-lock", file) < (int)size ? 0 : -1;
}

static int read_pid(int fd)
{
    char text[32] = "";
    ssize_t n = pread(fd, text, sizeof text - 1, 0);
    return n > 0 ? atoi(text) : 0;
}

static bool same_file(int fd, const char *path)
{
    struct stat a, b;
    return fstat(fd, &a) == 0 && stat(path, &b) == 0 && a.st_ino == b.st_ino &&
           a.st_dev == b.st_dev;
}

// The lock file that is locked must still be the one that others will find: its last holder may
// have removed it between our open and our lock.
static int open_locked(const char *path, int *ret_holder)
{
    for (int k = 0; k < 100; k++) {
        struct flock whole = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
        int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
        if (fd < 0)
            return -1;
        if (fcntl(fd, F_OFD_SETLK, &whole) < 0) {
            *ret_holder = read_pid(fd);
            close(fd);
            errno = EAGAIN;
            return -1;
        }
        if (same_file(fd, path))
            return fd;
        close(fd);
    }
    errno = EAGAIN;
    return -1;
}

// What lock->path says.
static int take(struct store_lock *lock, const char *what, struct gon_error *err)
{
    char pid[24];
    int holder = 0;
    lock->fd = open_locked(lock->path, &holder);
    if (lock->fd < 0 && errno == EAGAIN)
        return gon_fail(err, GON_E_REFUSED, "%s: in use by process %d", what, holder);
    if (lock->fd < 0)
        return gon_fail(err, GON_E_STORE, "%s: %s", lock->path, strerror(errno));
    snprintf(pid, sizeof pid, "%d\n", (int)getpid());
    if (ftruncate(lock->fd, 0) < 0 || pwrite(lock->fd, pid, strlen(pid), 0) < 0) {
        gon_fail(err, GON_E_STORE, "%s: %s", lock->path, strerror(errno));
        store_lock_drop(lock);
        return GON_E_STORE;
    }
    return GON_OK;
}

int store_lock_take(struct store_lock *lock, const char *file, struct gon_error *err)
{
    lock->fd = -1;
    if (lock_path(file, lock->path, sizeof lock->path) < 0)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", file);
    return take(lock, file, err);
}

int store_lock_take_folder(struct store_lock *lock, const char *folder, struct gon_error *err)
{
    lock->fd = -1;
    if (snprintf(lock->path, sizeof lock->path, "%s/.goniod.lock", folder) >=
        (int)sizeof lock->path)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", folder);
    int rc = store_lock_local(lock->path, err);
    return rc < 0 ? rc : take(lock, folder, err);
}

void store_lock_drop(struct store_lock *lock)
{
    if (lock->fd < 0)
        return;
    unlink(lock->path);
    close(lock->fd);
    lock->fd = -1;
}

int store_lock_holder(const char *file)
{
    char path[544];
    struct flock whole = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    int pid = 0, fd = lock_path(file, path, sizeof path) == 0 ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (fd < 0)
        return 0;
    if (fcntl(fd, F_OFD_GETLK, &whole) == 0 && whole.l_type != F_UNLCK)
        pid = read_pid(fd);
    close(fd);
    return pid;
}

// --- where a file may lie ------------------------------------------------------------------------

bool store_lock_is_network(long statfs_type, const char *mount_type)
{
    static const unsigned types[] = {
        0x6969,     // NFS
        0x517b,     // SMB
        0xff534d42, // CIFS
        0xfe534d42, // SMB2
        0x00c36400, // Ceph
        0x5346414f, // AFS
        0x73757245, // Coda
        0x0bd00bd0, // Lustre
        0x47504653, // GPFS
    };
    static const char *const fuses[] = {
        "fuse.sshfs", "fuse.rclone",    "fuse.s3fs",     "fuse.gcsfuse", "fuse.glusterfs",
        "fuse.davfs", "fuse.curlftpfs", "fuse.smbnetfs", "fuse.cifs",    NULL};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if ((unsigned)statfs_type == types[i])
            return true;
    for (int i = 0; mount_type && fuses[i]; i++)
        if (!strncmp(mount_type, fuses[i], strlen(fuses[i])))
            return true;
    return false;
}

// The type of the mount that holds a device: " - TYPE " of its line.
static void mount_type(dev_t device, char *type, size_t size)
{
    char line[2000], number[40];
    FILE *in = fopen("/proc/self/mountinfo", "re");
    snprintf(number, sizeof number, " %u:%u ", major(device), minor(device));
    *type = 0;
    while (in && fgets(line, sizeof line, in)) {
        const char *dash = strstr(line, " - ");
        if (dash && strstr(line, number))
            snprintf(type, size, "%.*s", (int)strcspn(dash + 3, " "), dash + 3);
    }
    if (in)
        fclose(in);
}

int store_lock_local(const char *file, struct gon_error *err)
{
    char folder[512], type[40];
    struct statfs fs;
    struct stat st;
    const char *slash = strrchr(file, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - file) + 1 : 1,
             slash ? file : ".");
    if (statfs(folder, &fs) < 0 || stat(folder, &st) < 0)
        return gon_fail(err, GON_E_STORE, "%s: %s", folder, strerror(errno));
    mount_type(st.st_dev, type, sizeof type);
    if (store_lock_is_network((long)fs.f_type, type))
        return gon_fail(err, GON_E_REFUSED,
                        "%s lies on a network file system, where campaigns would be damaged; "
                        "choose a local folder",
                        folder);
    return GON_OK;
}

// --- who holds SQLite's lock ---------------------------------------------------------------------

// Lines like "3: POSIX  ADVISORY  WRITE 4711 08:01:131090 120 120".
int store_lock_wal_writer(const char *file)
{
    char shm[544], line[200], wanted[60];
    struct stat st;
    int holder = 0;
    if (snprintf(shm, sizeof shm, "%s-shm", file) >= (int)sizeof shm || stat(shm, &st) < 0)
        return 0;
    snprintf(wanted, sizeof wanted, "%02x:%02x:%lu", major(st.st_dev), minor(st.st_dev),
             (unsigned long)st.st_ino);
    FILE *in = fopen("/proc/locks", "re");
    while (in && fgets(line, sizeof line, in)) {
        char place[60];
        int pid;
        long long first, last;
        if (sscanf(line, "%*s %*s %*s WRITE %d %59s %lld %lld", &pid, place, &first, &last) == 4 &&
            !strcmp(place, wanted) && first <= WAL_WRITE_LOCK && last >= WAL_WRITE_LOCK)
            holder = pid;
    }
    if (in)
        fclose(in);
    return holder;
}
