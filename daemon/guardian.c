// SPDX-License-Identifier: MIT
#include "daemon/guardian.h"

#include "base/paths.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

enum { GUARD_FD = 3, END_MS = 1000 };

struct guardian {
    char stop[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    pid_t pid; // 0: none
    int fd;
    int left;     // a guard that a dead goniod left behind, as a process; -1: none
    bool given;   // to the link
    bool crashes; // of ours are told to it
};

extern char **environ;

// The one thing that a signal handler needs; written before there is a second thread, and by the
// one that replaces a guard.
static atomic_int guard_pid = 0;

// Not by closing the sockets: another thread would take that for the guard's death, and end it to
// start another.
static void when_crashed(int signal)
{
    if (atomic_load(&guard_pid) > 0)
        kill(atomic_load(&guard_pid), SIGTERM);
    raise(signal); // SA_RESETHAND: ends the process when we return
}

void guardian_when_crashed(struct guardian *g)
{
    static const int signals[] = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGSYS, SIGTRAP};
    struct sigaction a = {.sa_handler = when_crashed, .sa_flags = (int)SA_RESETHAND};
    g->crashes = true;
    atomic_store(&guard_pid, g->pid);
    for (size_t i = 0; i < sizeof signals / sizeof signals[0]; i++)
        sigaction(signals[i], &a, NULL);
}

// --- the process ---------------------------------------------------------------------------------

// Of another session: Ctrl-C at the terminal is for the daemon, which ends in order. Its standard
// output is nobody's, so that who reads ours sees its end.
static int spawn(struct guardian *g, int fd, struct gon_error *err)
{
    char program[PATH_MAX], number[] = {'0' + GUARD_FD, 0};
    char *argv[] = {program, number, g->stop, NULL};
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_t actions;
    sigset_t all;
    sigfillset(&all);
    paths_program("gonio-guard", program, sizeof program);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDWR, 0);
    posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
    posix_spawn_file_actions_adddup2(&actions, fd, GUARD_FD);
    posix_spawn_file_actions_addclosefrom_np(&actions, GUARD_FD + 1); // no other device's port
    int rc = posix_spawnp(&g->pid, program, &actions, &attributes, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (rc == 0)
        return 0;
    g->pid = 0;
    return gon_fail(err, GON_E_INPUT,
                    "guard: %s does not start: %s; it belongs beside goniod, which does not run "
                    "without it",
                    program, strerror(rc));
}

static int start(struct guardian *g, struct gon_error *err)
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) < 0)
        return gon_fail(err, GON_E_SYSTEM, "guard: %s", strerror(errno));
    int rc = spawn(g, ends[1], err);
    close(ends[1]);
    if (rc < 0) {
        close(ends[0]);
        return rc;
    }
    g->fd = ends[0];
    g->given = false;
    return 0;
}

static int process_fd(pid_t pid)
{
    return (int)syscall(SYS_pidfd_open, pid, 0);
}

static bool ended(int process, int patience_ms)
{
    struct pollfd p = {process, POLLIN, 0};
    return process < 0 || poll(&p, 1, patience_ms) > 0;
}

// One of a goniod that died, which still tries to switch off. Its port is wanted now; whoever wants
// it begins with OFF.
static void end_left(struct guardian *g)
{
    if (g->left < 0)
        return;
    syscall(SYS_pidfd_send_signal, g->left, SIGKILL, NULL, 0);
    ended(g->left, END_MS);
    close(g->left);
    g->left = -1;
}

static void kill_it(struct guardian *g)
{
    if (g->fd >= 0)
        close(g->fd);
    g->fd = -1;
    if (g->pid == 0)
        return;
    atomic_store(&guard_pid, 0);
    kill(g->pid, SIGKILL);
    waitpid(g->pid, NULL, 0);
    g->pid = 0;
}

static int connect_to(void *ctx, struct gon_error *err)
{
    struct guardian *g = ctx;
    int rc = 0;
    end_left(g);
    if (g->given) {
        kill_it(g);
        rc = start(g, err);
        if (g->crashes && rc == 0)
            atomic_store(&guard_pid, g->pid);
    }
    g->given = rc == 0;
    return rc < 0 ? rc : g->fd;
}

struct guard_host guardian_host(struct guardian *g)
{
    return (struct guard_host){.connect = connect_to, .ctx = g};
}

// --- beginning and end ---------------------------------------------------------------------------

// The pid of whoever listens there; 0: nobody.
static pid_t listener_of(const char *path)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    struct ucred who = {0};
    socklen_t size = sizeof who;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    snprintf(a.sun_path, sizeof a.sun_path, "%s", path);
    if (connect(fd, (struct sockaddr *)&a, sizeof a) < 0 ||
        getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) < 0)
        who.pid = 0;
    close(fd);
    return who.pid;
}

int guardian_start(const char *socket, struct guardian **ret_guardian, struct gon_error *err)
{
    struct guardian *g = calloc(1, sizeof *g);
    if (!g)
        return gon_fail(err, GON_E_SYSTEM, "guard: out of memory");
    g->fd = g->left = -1;
    int rc = paths_guard(socket, g->stop, sizeof g->stop, err);
    if (rc == 0) {
        const pid_t left = listener_of(g->stop);
        g->left = left > 0 ? process_fd(left) : -1;
        rc = start(g, err);
    }
    if (rc < 0) {
        guardian_end(g);
        return rc;
    }
    *ret_guardian = g;
    return 0;
}

void guardian_end(struct guardian *g)
{
    if (!g)
        return;
    atomic_store(&guard_pid, 0);
    if (g->fd >= 0)
        close(g->fd);
    const int process = g->pid ? process_fd(g->pid) : -1;
    if (g->pid && ended(process, END_MS)) {
        waitpid(g->pid, NULL, WNOHANG);
        unlink(g->stop);
    }
    if (process >= 0)
        close(process);
    if (g->left >= 0)
        close(g->left);
    free(g);
}
