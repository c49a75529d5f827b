// SPDX-License-Identifier: MIT
#include "tests/dst/disk.h"

#include "tests/dst/os.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>

enum { FILES = 1024 };
enum { WAL_WRITE_LOCK = 120 }; // the byte of the -shm file (SQLite's walformat)

struct disk disk;
static unsigned char kind[FILES]; // by descriptor

enum { OTHER, DATABASE, SHARED };

void disk_begin(void)
{
    disk = (struct disk){.sync_ns = OS_MS(0.2)};
    memset(kind, 0, sizeof kind);
}

static int kind_of(int fd)
{
    return os.on && fd >= 0 && fd < FILES ? kind[fd] : OTHER;
}

void disk_opened(int fd, const char *path)
{
    if (fd < 0 || fd >= FILES || !os.on)
        return;
    kind[fd] = strstr(path, ".gonio-shm") ? SHARED : strstr(path, ".gonio") ? DATABASE : OTHER;
}

void disk_closed(int fd)
{
    if (fd >= 0 && fd < FILES)
        kind[fd] = OTHER;
}

static int refuse(int error)
{
    disk.refused++;
    return error;
}

int disk_write(int fd, size_t size)
{
    if (kind_of(fd) != DATABASE)
        return 0;
    disk.writes++;
    if (disk.full && size > 0)
        return refuse(ENOSPC);
    return disk.broken_write ? refuse(EIO) : 0;
}

int disk_read(int fd)
{
    return kind_of(fd) == DATABASE && disk.broken_read ? refuse(EIO) : 0;
}

int disk_sync(int fd, bool *ret_real)
{
    *ret_real = !os.on;
    if (kind_of(fd) != DATABASE)
        return 0;
    disk.syncs++;
    if (os.storing)
        os.store_ns += disk.sync_ns + disk.stall_ns;
    disk.stall_ns = 0;
    return disk.broken_sync ? refuse(EIO) : 0;
}

bool disk_locked(int fd, const void *lock)
{
    const struct flock64 *l = lock;
    const int64_t now_ns = os.storing ? os.store_ns : os.now_ns;
    if (kind_of(fd) != SHARED || l->l_type != F_WRLCK || now_ns >= disk.locked_until_ns ||
        l->l_start > WAL_WRITE_LOCK || l->l_start + l->l_len <= WAL_WRITE_LOCK)
        return false;
    disk.refused++;
    return true;
}
