// SPDX-License-Identifier: MIT
#include "base/standard.h"

#include <fcntl.h>
#include <unistd.h>

void standard_hold(void)
{
    // In this order, for open gives the lowest number that is free.
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0)
            (void)!open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}
