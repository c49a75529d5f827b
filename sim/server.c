// SPDX-License-Identifier: MIT
#include "sim/server.h"
#include "base/clk.h"
#include "sim/benchfile.h"
#include "sim/control.h"
#include "sim/rundir.h"
#include "sim/wire.h"

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

enum { CLIENTS = 8, LINE = 4096, FDS = BENCH_PORTS * WIRE_FDS + CLIENTS + 2 };

struct client {
    int fd; // -1: free
    size_t size;
    char line[LINE];
};

struct server {
    struct sim_config config;
    struct bench bench;
    struct rundir dir;
    struct wire wire[BENCH_PORTS];
    struct control control;
    struct client client[CLIENTS];
    int signal_fd, listen_fd;
};

// --- opening -------------------------------------------------------------------------------------

static int open_wires(struct server *s, struct gon_error *err)
{
    for (int i = 0; i < BENCH_PORTS; i++) {
        struct wire *w = &s->wire[i];
        char path[RUNDIR_FILE];
        rundir_path(&s->dir, bench_port_names[i], path, sizeof path);
        if (i % 2)
            wire_tcp_init(w, bench_port_names[i], bench_port(&s->bench, (enum bench_port)i));
        else
            wire_pty_init(w, bench_port_names[i], bench_port(&s->bench, (enum bench_port)i), path);
        w->enforce = s->config.wire_speed;
        w->bits = i == BENCH_AXES_RTU ? 11 : 10; // 8E1; 8N1
    }
    for (int i = 0; i < BENCH_PORTS; i++)
        if (wire_plug(&s->wire[i], err))
            return err->code;
    return 0;
}

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

static void write_serial(FILE *out, const void *ctx)
{
    const struct server *s = ctx;
    char axes[700], laser[700], detector[700];
    snprintf(axes, sizeof axes, "modbus-rtu:%s?baud=%d&parity=E", s->wire[BENCH_AXES_RTU].address,
             s->config.axes_baud);
    snprintf(laser, sizeof laser, "serial:%s?baud=%d", s->wire[BENCH_LASER].address,
             s->config.laser_baud);
    snprintf(detector, sizeof detector, "serial:%s?baud=%d", s->wire[BENCH_DETECTOR].address,
             s->config.detector_baud);
    benchfile_write(out, &s->config, &(struct benchfile_links){axes, laser, detector});
}

static void write_tcp(FILE *out, const void *ctx)
{
    const struct server *s = ctx;
    char axes[700], laser[700], detector[700];
    snprintf(axes, sizeof axes, "modbus-tcp:%s", s->wire[BENCH_AXES_TCP].address);
    snprintf(laser, sizeof laser, "tcp:%s", s->wire[BENCH_LASER_TCP].address);
    snprintf(detector, sizeof detector, "tcp:%s", s->wire[BENCH_DETECTOR_TCP].address);
    benchfile_write(out, &s->config, &(struct benchfile_links){axes, laser, detector});
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
    rc = rc ? rc : open_wires(s, err);
    rc = rc ? rc : open_control(s, err);
    rc = rc ? rc : rundir_write(&s->dir, "goniod.cfg", write_serial, s, err);
    rc = rc ? rc : rundir_write(&s->dir, "goniod-tcp.cfg", write_tcp, s, err);
    return rc ? rc : rundir_write(&s->dir, "ready", write_ready, s, err);
}

int server_open(const struct sim_config *config, const char *run_dir, struct server **ret_server,
                struct gon_error *err)
{
    struct server *s = calloc(1, sizeof *s);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    s->config = *config;
    s->control = (struct control){.bench = &s->bench, .wires = s->wire};
    s->signal_fd = s->listen_fd = s->dir.lock_fd = s->dir.dir_fd = -1;
    for (int i = 0; i < CLIENTS; i++)
        s->client[i].fd = -1;
    bench_init(&s->bench, &config->bench, clk_now_ns(clk_system()));
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
    for (int i = 0; i < BENCH_PORTS; i++)
        if (s->wire[i].ops)
            wire_unplug(&s->wire[i]);
    for (int i = 0; i < CLIENTS; i++)
        if (s->client[i].fd >= 0)
            close(s->client[i].fd);
    if (s->listen_fd >= 0)
        close(s->listen_fd);
    if (s->signal_fd >= 0)
        close(s->signal_fd);
    rundir_close(&s->dir);
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
    char *text = control_answer(&s->control, line, t_ns);
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
    for (int i = 0; i < BENCH_PORTS; i++) {
        int64_t due_ns = wire_next_ns(&s->wire[i]);
        most_ns = due_ns < most_ns ? due_ns : most_ns;
    }
    return most_ns;
}

static void serve_wires(struct server *s, struct pollfd wire_fds[BENCH_PORTS][WIRE_FDS],
                        int64_t t_ns)
{
    s->bench.axes_port[0].gap_ns = wire_char_ns(&s->wire[BENCH_AXES_RTU]) * 7 / 2; // 3.5 characters
    for (int i = 0; i < BENCH_PORTS; i++)
        wire_serve(&s->wire[i], wire_fds[i], t_ns);
}

// One turn. False when it is time to go.
static bool turn(struct server *s, int64_t most_ns)
{
    struct pollfd fds[FDS], *f = fds;
    struct pollfd wire_fds[BENCH_PORTS][WIRE_FDS];
    int at[BENCH_PORTS], count[BENCH_PORTS];
    *f++ = (struct pollfd){.fd = s->signal_fd, .events = POLLIN};
    *f++ = (struct pollfd){.fd = s->listen_fd, .events = POLLIN};
    for (int i = 0; i < CLIENTS; i++)
        *f++ = (struct pollfd){.fd = s->client[i].fd, .events = POLLIN};
    for (int i = 0; i < BENCH_PORTS; i++) {
        at[i] = (int)(f - fds);
        count[i] = wire_poll_fds(&s->wire[i], f);
        f += count[i];
    }
    struct timespec left = until(next_ns(s, most_ns), clk_now_ns(clk_system()));
    if (ppoll(fds, (nfds_t)(f - fds), &left, NULL) < 0 && errno != EINTR)
        return false;
    int64_t t_ns = clk_now_ns(clk_system());
    memset(wire_fds, 0, sizeof wire_fds);
    for (int i = 0; i < BENCH_PORTS; i++)
        memcpy(wire_fds[i], &fds[at[i]], (size_t)count[i] * sizeof fds[0]);
    serve_wires(s, wire_fds, t_ns);
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
