// SPDX-License-Identifier: MIT
#include "base/mail.h"

#include "base/cancel.h"

#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

struct mail {
    pthread_mutex_t lock;
    struct letter *first, **last;
    int fd;
};

struct mail *mail_new(void)
{
    struct mail *m = calloc(1, sizeof *m);
    if (!m)
        return NULL;
    m->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (m->fd < 0) {
        free(m);
        return NULL;
    }
    pthread_mutex_init(&m->lock, NULL);
    m->last = &m->first;
    return m;
}

void mail_free(struct mail *m, void (*drop)(struct letter *))
{
    if (!m)
        return;
    for (struct letter *l; (l = mail_take(m));)
        if (drop)
            drop(l);
    pthread_mutex_destroy(&m->lock);
    close(m->fd);
    free(m);
}

void mail_post(struct mail *m, struct letter *l)
{
    uint64_t one = 1;
    l->next = NULL;
    pthread_mutex_lock(&m->lock);
    *m->last = l;
    m->last = &l->next;
    ssize_t n = write(m->fd, &one, sizeof one);
    (void)n;
    pthread_mutex_unlock(&m->lock);
}

struct letter *mail_take(struct mail *m)
{
    uint64_t count;
    pthread_mutex_lock(&m->lock);
    struct letter *l = m->first;
    if (l && !(m->first = l->next))
        m->last = &m->first;
    if (!m->first) {
        ssize_t n = read(m->fd, &count, sizeof count);
        (void)n;
    }
    pthread_mutex_unlock(&m->lock);
    if (l)
        l->next = NULL;
    return l;
}

int mail_fd(const struct mail *m)
{
    return m->fd;
}

static int64_t now_ms(void)
{
    struct timespec ts;
    clock_gettime(CLOCK_MONOTONIC, &ts);
    return (int64_t)ts.tv_sec * 1000 + ts.tv_nsec / 1000000;
}

struct letter *mail_wait(struct mail *m, int timeout_ms, const struct cancel *cancel)
{
    int64_t end_ms = now_ms() + timeout_ms;
    for (;;) {
        struct letter *l = mail_take(m);
        if (l || cancel_requested(cancel))
            return l;
        int64_t left_ms = timeout_ms < 0 ? -1 : end_ms - now_ms();
        if (timeout_ms >= 0 && left_ms <= 0)
            return NULL;
        struct pollfd p[2] = {{m->fd, POLLIN, 0}, {cancel_fd(cancel), POLLIN, 0}};
        poll(p, 2, (int)left_ms);
    }
}
