// SPDX-License-Identifier: MIT
// gonio-guard FD PATH: the process around the guard; started by goniod, whose end of a pair of
// sockets FD is. PATH is the STOP socket's. It alone holds the laser's port.
#include "base/cancel.h"
#include "drivers/transport.h"
#include "guard/guard.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { AT_CLIENT, AT_SIGNAL, AT_STOP, AT_LASER, FDS, STOPS = 4 };
#define WRITE_NS CLK_MS(100)

// The clock of the transport: what it waits for ends when something more urgent happens.
struct shell {
    struct clk clk; // first
    struct guard guard;
    struct transport *transport; // NULL: not opened yet
    struct cancel *urgent;
    struct pollfd fds[FDS];
    int stop[STOPS], stops; // who wait for an answer
    bool end;
};

static int64_t now_ns(const struct clk *clk)
{
    (void)clk;
    return clk_now_ns(clk_system());
}

static void turn(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    struct shell *s = (struct shell *)clk;
    struct pollfd f[] = {s->fds[AT_CLIENT], s->fds[AT_SIGNAL], s->fds[AT_STOP]};
    f[0].events = 0; // its end; what it says can wait
    if (poll(f, 3, 0) > 0)
        cancel_request(s->urgent);
    clk_sleep_until(clk_system(), t_ns, cancel);
}

static void step(struct shell *s, const struct guard_event *e);

static int open_port(struct shell *s, struct gon_error *err)
{
    const char *link = s->guard.record.link;
    if (s->transport && strcmp(link, transport_link(s->transport)) == 0)
        return transport_reopen(s->transport, err);
    transport_close(s->transport), s->transport = NULL;
    return transport_open(link, &s->clk, NULL, &s->transport, err);
}

// What came of an act, as the next event.
static void carry_out(struct shell *s, const struct guard_act *a)
{
    char bytes[GUARD_DATA];
    struct gon_error err = {.text = ""};
    struct guard_event e = {.kind = GUARD_ON_DONE, .bytes = bytes, .text = err.text};
    const int64_t until_ns = now_ns(NULL) + a->wait_ns;
    switch (a->kind) {
    case GUARD_OPEN:
        e.code = open_port(s, &err);
        e.kind = GUARD_ON_OPENED;
        break;
    case GUARD_WRITE:
        e.code = transport_write(s->transport, a->bytes, a->size, until_ns + WRITE_NS, &err);
        break;
    case GUARD_CLEAR: e.code = transport_drain(s->transport, a->wait_ns, &err); break;
    case GUARD_READ:
        cancel_reset(s->urgent);
        transport_mind(s->transport, s->urgent);
        e.code = transport_read(s->transport, bytes, sizeof bytes, until_ns, &err);
        transport_mind(s->transport, NULL);
        e.kind = e.code > 0 ? GUARD_ON_BYTES : GUARD_ON_DONE;
        break;
    case GUARD_TELL: send(s->fds[AT_CLIENT].fd, a->bytes, a->size, MSG_DONTWAIT); return;
    case GUARD_SAY:
        for (; s->stops > 0; close(s->stop[--s->stops]))
            send(s->stop[s->stops - 1], a->bytes, a->size, MSG_DONTWAIT);
        return;
    default: s->end = true; return;
    }
    e.size = (size_t)e.code; // where there are bytes
    e.ended = s->transport && transport_ended(s->transport);
    step(s, &e);
}

static void step(struct shell *s, const struct guard_event *e)
{
    struct guard_acts acts;
    guard_step(&s->guard, now_ns(NULL), e, &acts);
    for (int i = 0; i < acts.count; i++)
        carry_out(s, &acts.act[i]);
}

static void hear_client(struct shell *s)
{
    char bytes[sizeof(struct guard_record) + 1];
    const ssize_t n = recv(s->fds[AT_CLIENT].fd, bytes, sizeof bytes, 0);
    struct guard_event e = {.kind = GUARD_ON_MESSAGE, .bytes = bytes, .size = (size_t)n};
    if (n <= 0) {
        s->fds[AT_CLIENT].fd = -1;
        e.kind = GUARD_ON_GONE;
    }
    step(s, &e);
}

static void hear_stop(struct shell *s)
{
    if (s->stops == STOPS)
        close(s->stop[--s->stops]);
    s->stop[s->stops++] = accept4(s->fds[AT_STOP].fd, NULL, NULL, SOCK_CLOEXEC);
    step(s, &(struct guard_event){.kind = GUARD_ON_STOP});
}

static void hear_laser(struct shell *s)
{
    char bytes[GUARD_DATA];
    struct gon_error err = {.text = ""};
    const int n = transport_read(s->transport, bytes, sizeof bytes, 0, &err);
    struct guard_event e = {
        n < 0 ? GUARD_ON_DONE : GUARD_ON_BYTES, bytes, (size_t)n, false, n, err.text};
    if (n != GON_E_LINK) // there was nothing after all
        step(s, &e);
}

// One round; the client first, whose end is what matters most.
static void serve(struct shell *s)
{
    const bool streams = s->transport && !transport_framed(s->transport);
    const int64_t next_ns = guard_next_ns(&s->guard), left_ns = next_ns - now_ns(NULL);
    const int wait_ms = next_ns == INT64_MAX ? -1 : left_ns > 0 ? (int)(left_ns / 1000000) + 1 : 0;
    s->fds[AT_LASER] = (struct pollfd){streams ? transport_fd(s->transport) : -1, POLLIN, 0};
    if (poll(s->fds, FDS, wait_ms) < 0)
        return;
    struct signalfd_siginfo info;
    if (s->fds[AT_CLIENT].revents)
        hear_client(s);
    if (s->fds[AT_SIGNAL].revents && read(s->fds[AT_SIGNAL].fd, &info, sizeof info) > 0)
        step(s, &(struct guard_event){.kind = GUARD_ON_SIGNAL});
    if (s->fds[AT_STOP].revents)
        hear_stop(s);
    if (s->fds[AT_LASER].revents)
        hear_laser(s);
    step(s, &(struct guard_event){.kind = GUARD_ON_TIME});
}

static int listen_at(const char *path)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    snprintf(a.sun_path, sizeof a.sun_path, "%s", path);
    unlink(path); // goniod holds the lock beside it: whoever made it is gone or let go
    umask(0117);
    return bind(fd, (struct sockaddr *)&a, sizeof a) == 0 && listen(fd, STOPS) == 0 ? fd : -1;
}

int main(int argc, char **argv)
{
    static const struct clk_ops ops = {now_ns, now_ns, turn};
    struct shell s = {.clk = {&ops}, .urgent = cancel_new()};
    sigset_t set;
    if (argc != 3 || !s.urgent)
        return 2;     // goniod starts it, and nobody else
    sigfillset(&set); // whoever sends one of them wants the end
    sigprocmask(SIG_SETMASK, &set, NULL);
    // Its main thread's end; that of the sockets waits for a thread that a slow disk holds.
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    mlockall(MCL_CURRENT); // both as far as we may
    setpriority(PRIO_PROCESS, 0, -15);
    s.fds[AT_CLIENT] = (struct pollfd){(int)strtol(argv[1], NULL, 10), POLLIN, 0};
    s.fds[AT_SIGNAL] = (struct pollfd){signalfd(-1, &set, SFD_CLOEXEC), POLLIN, 0};
    s.fds[AT_STOP] = (struct pollfd){listen_at(argv[2]), POLLIN, 0};
    guard_init(&s.guard);
    while (!s.end && s.fds[AT_STOP].fd >= 0)
        serve(&s);
    transport_close(s.transport);
    return !s.end;
}
