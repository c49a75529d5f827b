// SPDX-License-Identifier: MIT
#include "campaign/store_reserve.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

enum { PATH_SIZE = 544 };

static bool path_of(const char *file, char path[PATH_SIZE])
{
    return snprintf(path, PATH_SIZE, "%s-reserve", file) < PATH_SIZE;
}

bool store_reserve_take(const char *file)
{
    char path[PATH_SIZE];
    if (!path_of(file, path))
        return true;
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    const int error = fd < 0 ? errno : posix_fallocate(fd, 0, STORE_RESERVE_BYTES);
    if (fd >= 0)
        close(fd);
    if (error) // what it has of it so far is somebody else's room
        unlink(path);
    return error != ENOSPC && error != EDQUOT;
}

void store_reserve_give(const char *file)
{
    char path[PATH_SIZE];
    if (path_of(file, path))
        unlink(path);
}
