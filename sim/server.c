// SPDX-License-Identifier: MIT
#include "sim/server.h"
#include "base/clk.h"

#include <assert.h>
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define PARENT_NS 500000000

enum { CLIENTS = 8, LINE = 4096, FDS = SERVER_WIRES * WIRE_FDS + CLIENTS + 2 };

struct client {
    int fd; // -1: free
    size_t size;
    char line[LINE];
};

struct server {
    struct served *served;
    struct rundir dir;
    struct client client[CLIENTS];
    int signal_fd, listen_fd;
};

// --- opening -------------------------------------------------------------------------------------

static int open_control(struct server *s, struct gon_error *err)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    // Through /proc, because a socket's address holds 107 bytes and a path may be longer.
    snprintf(a.sun_path, sizeof a.sun_path, "/proc/self/fd/%d/control.sock", s->dir.dir_fd);
    unlink(a.sun_path); // of one that was killed: this one has the lock
    s->listen_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (s->listen_fd < 0 || bind(s->listen_fd, (struct sockaddr *)&a, sizeof a) ||
        listen(s->listen_fd, CLIENTS))
        return gon_fail(err, GON_E_SYSTEM, "%s/control.sock: %s", s->dir.path, strerror(errno));
    return 0;
}

static int open_signals(struct server *s, struct gon_error *err)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP);
    sigprocmask(SIG_BLOCK, &set, NULL);
    signal(SIGPIPE, SIG_IGN);
    s->signal_fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    return s->signal_fd >= 0 ? 0 : gon_fail(err, GON_E_SYSTEM, "signalfd: %s", strerror(errno));
}

static void write_ready(FILE *out, const void *ctx)
{
    (void)ctx;
    fprintf(out, "ready\n");
}

static int open_all(struct server *s, const char *run_dir, struct gon_error *err)
{
    int rc = open_signals(s, err);
    rc = rc ? rc : rundir_open(&s->dir, run_dir, err);
    rc = rc ? rc : s->served->ops->open(s->served, &s->dir, err);
    rc = rc ? rc : open_control(s, err);
    return rc ? rc : rundir_write(&s->dir, "ready", write_ready, s, err);
}

int server_open(struct served *served, const char *run_dir, struct server **ret_server,
                struct gon_error *err)
{
    struct server *s = calloc(1, sizeof *s);
    if (!s) {
        served->ops->free(served);
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    }
    assert(served->wires_count <= SERVER_WIRES);
    s->served = served;
    s->signal_fd = s->listen_fd = s->dir.lock_fd = s->dir.dir_fd = -1;
    for (int i = 0; i < CLIENTS; i++)
        s->client[i].fd = -1;
    int rc = open_all(s, run_dir, err);
    if (rc)
        server_close(s);
    else
        *ret_server = s;
    return rc;
}

void server_close(struct server *s)
{
    if (!s)
        return;
    for (int i = 0; i < s->served->wires_count; i++)
        if (s->served->wires[i].ops)
            wire_unplug(&s->served->wires[i]);
    for (int i = 0; i < CLIENTS; i++)
        if (s->client[i].fd >= 0)
            close(s->client[i].fd);
    if (s->listen_fd >= 0)
        close(s->listen_fd);
    if (s->signal_fd >= 0)
        close(s->signal_fd);
    rundir_close(&s->dir);
    s->served->ops->free(s->served);
    free(s);
}

// --- control clients -----------------------------------------------------------------------------

static void drop(struct client *c)
{
    close(c->fd);
    c->fd = -1;
    c->size = 0;
}

static void answer(struct server *s, struct client *c, const char *line, int64_t t_ns)
{
    char *text = s->served->ops->control(s->served, line, t_ns);
    size_t size = text ? strlen(text) : 0;
    if (!text || send(c->fd, text, size, MSG_NOSIGNAL) != (ssize_t)size)
        drop(c); // gone, or it does not read its answers
    free(text);
}

static void serve_client(struct server *s, struct client *c, int64_t t_ns)
{
    ssize_t n = read(c->fd, c->line + c->size, sizeof c->line - 1 - c->size);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (n <= 0) { // also when a line is too long: there was no room to read into
        drop(c);
        return;
    }
    c->size += (size_t)n;
    c->line[c->size] = 0;
    for (char *end; c->fd >= 0 && (end = strchr(c->line, '\n'));) {
        *end = 0;
        answer(s, c, c->line, t_ns);
        if (c->fd < 0)
            return;
        c->size -= (size_t)(end + 1 - c->line);
        memmove(c->line, end + 1, c->size + 1);
    }
}

static void welcome(struct server *s)
{
    int fd = accept4(s->listen_fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    for (int i = 0; fd >= 0 && i < CLIENTS; i++)
        if (s->client[i].fd < 0) {
            s->client[i] = (struct client){.fd = fd};
            return;
        }
    if (fd >= 0)
        close(fd);
}

// --- the loop ------------------------------------------------------------------------------------

static struct timespec until(int64_t due_ns, int64_t now_ns)
{
    int64_t left_ns = due_ns > now_ns ? due_ns - now_ns : 0;
    return (struct timespec){.tv_sec = left_ns / 1000000000, .tv_nsec = left_ns % 1000000000};
}

static int64_t next_ns(const struct server *s, int64_t most_ns)
{
    for (int i = 0; i < s->served->wires_count; i++) {
        int64_t due_ns = wire_next_ns(&s->served->wires[i]);
        most_ns = due_ns < most_ns ? due_ns : most_ns;
    }
    return most_ns;
}

static void serve_wires(const struct served *s, struct pollfd wire_fds[SERVER_WIRES][WIRE_FDS],
                        int64_t t_ns)
{
    for (int i = 0; i < s->wires_count; i++)
        wire_serve(&s->wires[i], wire_fds[i], t_ns);
}

// One turn. False when it is time to go.
static bool turn(struct server *s, int64_t most_ns)
{
    struct served *served = s->served;
    struct pollfd fds[FDS], *f = fds;
    struct pollfd wire_fds[SERVER_WIRES][WIRE_FDS];
    int at[SERVER_WIRES], count[SERVER_WIRES];
    *f++ = (struct pollfd){.fd = s->signal_fd, .events = POLLIN};
    *f++ = (struct pollfd){.fd = s->listen_fd, .events = POLLIN};
    for (int i = 0; i < CLIENTS; i++)
        *f++ = (struct pollfd){.fd = s->client[i].fd, .events = POLLIN};
    for (int i = 0; i < served->wires_count; i++) {
        at[i] = (int)(f - fds);
        count[i] = wire_poll_fds(&served->wires[i], f);
        f += count[i];
    }
    struct timespec left = until(next_ns(s, most_ns), clk_now_ns(clk_system()));
    if (ppoll(fds, (nfds_t)(f - fds), &left, NULL) < 0 && errno != EINTR)
        return false;
    int64_t t_ns = clk_now_ns(clk_system());
    memset(wire_fds, 0, sizeof wire_fds);
    for (int i = 0; i < served->wires_count; i++)
        memcpy(wire_fds[i], &fds[at[i]], (size_t)count[i] * sizeof fds[0]);
    served->ops->turn(served);
    serve_wires(served, wire_fds, t_ns);
    for (int i = 0; i < CLIENTS; i++)
        if (s->client[i].fd >= 0 && fds[2 + i].revents)
            serve_client(s, &s->client[i], t_ns);
    if (fds[1].revents)
        welcome(s);
    return !fds[0].revents;
}

void server_run(struct server *s, pid_t parent)
{
    prctl(PR_SET_TIMERSLACK, 1000UL);
    do {
        int64_t most_ns =
            clk_now_ns(clk_system()) + (parent ? PARENT_NS : 3600 * INT64_C(1000000000));
        if (!turn(s, most_ns))
            return;
    } while (!parent || getppid() == parent);
}
