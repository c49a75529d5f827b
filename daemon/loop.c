// SPDX-License-Identifier: MIT
#include "daemon/loop.h"

#include <errno.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

struct source {
    struct source *next;
    int fd;
    bool timer, signals, removed;
    void (*ready)(void *ctx);
    void (*signaled)(void *ctx, int signal);
    void *ctx;
};

struct loop {
    int epoll_fd;
    bool quit;
    struct source *sources;
    int (*after)(void *ctx);
    void *after_ctx;
};

struct loop *loop_new(struct gon_error *err)
{
    struct loop *loop = calloc(1, sizeof *loop);
    if (loop && (loop->epoll_fd = epoll_create1(EPOLL_CLOEXEC)) >= 0)
        return loop;
    free(loop);
    gon_fail(err, GON_E_SYSTEM, "event loop: %s", strerror(errno));
    return NULL;
}

void loop_free(struct loop *loop)
{
    if (!loop)
        return;
    for (struct source *s = loop->sources, *next; s; s = next) {
        next = s->next;
        if (s->timer || s->signals)
            close(s->fd);
        free(s);
    }
    close(loop->epoll_fd);
    free(loop);
}

static struct source *add(struct loop *loop, int fd, uint32_t what, void *ctx,
                          struct gon_error *err)
{
    struct source *s = calloc(1, sizeof *s);
    struct epoll_event e = {.events = what, .data.ptr = s};
    if (!s || epoll_ctl(loop->epoll_fd, EPOLL_CTL_ADD, fd, &e) < 0) {
        free(s);
        gon_fail(err, GON_E_SYSTEM, "event loop: descriptor %d: %s", fd, strerror(errno));
        return NULL;
    }
    s->fd = fd;
    s->ctx = ctx;
    s->next = loop->sources;
    loop->sources = s;
    return s;
}

static int add_ready(struct loop *loop, int fd, uint32_t what, void (*ready)(void *ctx), void *ctx,
                     struct gon_error *err)
{
    struct source *s = add(loop, fd, what, ctx, err);
    if (!s)
        return GON_E_SYSTEM;
    s->ready = ready;
    return GON_OK;
}

int loop_add(struct loop *loop, int fd, void (*ready)(void *ctx), void *ctx, struct gon_error *err)
{
    return add_ready(loop, fd, EPOLLIN, ready, ctx, err);
}

int loop_add_hangup(struct loop *loop, int fd, void (*ready)(void *ctx), void *ctx,
                    struct gon_error *err)
{
    return add_ready(loop, fd, EPOLLRDHUP, ready, ctx, err);
}

// Freed between rounds only: an event of this round may still point at it.
void loop_remove(struct loop *loop, int fd)
{
    for (struct source *s = loop->sources; s; s = s->next)
        if (s->fd == fd && !s->removed) {
            epoll_ctl(loop->epoll_fd, EPOLL_CTL_DEL, fd, NULL);
            s->removed = true;
        }
}

static void sweep_removed(struct loop *loop)
{
    for (struct source **p = &loop->sources; *p;) {
        struct source *s = *p;
        if (s->removed) {
            *p = s->next;
            free(s);
        } else {
            p = &s->next;
        }
    }
}

int loop_every(struct loop *loop, int interval_ms, void (*ready)(void *ctx), void *ctx,
               struct gon_error *err)
{
    struct timespec t = {interval_ms / 1000, interval_ms % 1000 * 1000000L};
    struct itimerspec every = {t, t};
    int fd = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    struct source *s = fd < 0 ? NULL : add(loop, fd, EPOLLIN, ctx, err);
    if (!s || timerfd_settime(fd, 0, &every, NULL) < 0) {
        if (fd >= 0 && !s)
            close(fd);
        return gon_fail(err, GON_E_SYSTEM, "event loop: timer: %s", strerror(errno));
    }
    s->timer = true;
    s->ready = ready;
    return GON_OK;
}

int loop_signals(struct loop *loop, void (*ready)(void *ctx, int signal), void *ctx,
                 struct gon_error *err)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
    int fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    struct source *s = fd < 0 ? NULL : add(loop, fd, EPOLLIN, ctx, err);
    if (!s) {
        if (fd >= 0)
            close(fd);
        return gon_fail(err, GON_E_SYSTEM, "event loop: signals: %s", strerror(errno));
    }
    s->signals = true;
    s->signaled = ready;
    return GON_OK;
}

void loop_after(struct loop *loop, int (*after)(void *ctx), void *ctx)
{
    loop->after = after;
    loop->after_ctx = ctx;
}

static void dispatch(struct source *s)
{
    uint64_t ticks;
    struct signalfd_siginfo info;
    if (s->removed)
        return;
    if (s->signals) {
        while (read(s->fd, &info, sizeof info) == (ssize_t)sizeof info)
            s->signaled(s->ctx, (int)info.ssi_signo);
    } else if (!s->timer || read(s->fd, &ticks, sizeof ticks) == (ssize_t)sizeof ticks) {
        s->ready(s->ctx);
    }
}

void loop_run(struct loop *loop)
{
    struct epoll_event events[16];
    loop->quit = false;
    int timeout_ms = loop->after ? loop->after(loop->after_ctx) : -1;
    while (!loop->quit) {
        int n = epoll_wait(loop->epoll_fd, events, 16, timeout_ms);
        for (int i = 0; i < n; i++)
            dispatch(events[i].data.ptr);
        sweep_removed(loop);
        timeout_ms = loop->after ? loop->after(loop->after_ctx) : -1;
    }
}

void loop_quit(struct loop *loop)
{
    loop->quit = true;
}
