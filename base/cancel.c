// SPDX-License-Identifier: MIT
#include "base/cancel.h"

#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

struct cancel {
    atomic_bool requested;
    int fd;
};

struct cancel *cancel_new(void)
{
    struct cancel *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (c->fd < 0) {
        free(c);
        return NULL;
    }
    return c;
}

void cancel_free(struct cancel *c)
{
    if (!c)
        return;
    close(c->fd);
    free(c);
}

void cancel_request(struct cancel *c)
{
    atomic_store(&c->requested, true);
    uint64_t one = 1;
    ssize_t n = write(c->fd, &one, sizeof one); // EAGAIN: already readable, which is what we want
    (void)n;
}

void cancel_reset(struct cancel *c)
{
    uint64_t count;
    ssize_t n = read(c->fd, &count, sizeof count);
    (void)n;
    atomic_store(&c->requested, false);
}

bool cancel_requested(const struct cancel *c)
{
    return c && atomic_load_explicit(&c->requested, memory_order_relaxed);
}

int cancel_fd(const struct cancel *c)
{
    return c ? c->fd : -1;
}
