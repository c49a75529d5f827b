// SPDX-License-Identifier: MIT
#include "cli/interrupt.h"

#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

void interrupt_open(struct interrupt *ret_interrupt)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigprocmask(SIG_BLOCK, &set, &ret_interrupt->before);
    ret_interrupt->fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    if (ret_interrupt->fd < 0)
        sigprocmask(SIG_SETMASK, &ret_interrupt->before, NULL);
}

void interrupt_close(struct interrupt *i)
{
    struct signalfd_siginfo info;
    while (i->fd >= 0 && read(i->fd, &info, sizeof info) == (ssize_t)sizeof info)
        continue;
    if (i->fd >= 0)
        close(i->fd);
    i->fd = -1;
    sigprocmask(SIG_SETMASK, &i->before, NULL);
}

bool interrupt_came(const struct interrupt *i, int timeout_ms)
{
    struct pollfd p = {i->fd, POLLIN, 0};
    return poll(&p, 1, timeout_ms) > 0;
}
