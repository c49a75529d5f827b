// SPDX-License-Identifier: MIT
#include "daemon/messenger.h"

#include "base/clk.h"
#include "base/log.h"
#include "daemon/loop.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

enum { LOOK_MS = 250, MOST_ARGUMENTS = 16, MOST_VARIABLES = 512, DETAILS = 5 };

extern char **environ;

struct telling {
    char sentence[800];
    char details[DETAILS][700]; // of the environment
};

struct messenger {
    struct loop *loop;
    struct messenger_command command;
    struct log *log;
    struct telling waiting[MESSENGER_WAITING]; // the first is under way while pid is there
    int count;
    pid_t pid; // 0: none runs
    int pid_fd;
    int64_t end_ns;
};

// --- one command ---------------------------------------------------------------------------------

static int spawn(char **argv, char **environment, pid_t *ret_pid)
{
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_t actions;
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes,
                             POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1); // no device's port
    const int rc = posix_spawn(ret_pid, argv[0], &actions, &attributes, argv, environment);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    return rc;
}

// Ours, and before it the details; an earlier value of the same name loses.
static void make_environment(struct telling *t, char *environment[MOST_VARIABLES])
{
    int n = 0;
    for (; n < DETAILS; n++)
        environment[n] = t->details[n];
    for (char **e = environ; *e && n < MOST_VARIABLES - 1; e++)
        environment[n++] = *e;
    environment[n] = NULL;
}

static void ended(void *ctx);

static bool start(struct messenger *m)
{
    char *argv[MOST_ARGUMENTS + 2], *environment[MOST_VARIABLES];
    struct gon_error err = {0};
    int argc = 0;
    for (; argc < MOST_ARGUMENTS && m->command.argv[argc]; argc++)
        argv[argc] = (char *)m->command.argv[argc];
    argv[argc++] = m->waiting[0].sentence;
    argv[argc] = NULL;
    make_environment(&m->waiting[0], environment);
    const int error = spawn(argv, environment, &m->pid);
    if (error) {
        m->pid = 0;
        log_say(m->log, LOG_WARN, "notify", "%s does not start: %s; see daemon.notify in the bench file",
                argv[0], strerror(error));
        return false;
    }
    m->end_ns = clk_now_ns(clk_system()) + CLK_S(m->command.limit_s);
    m->pid_fd = (int)syscall(SYS_pidfd_open, m->pid, 0);
    if (m->pid_fd >= 0 && loop_add(m->loop, m->pid_fd, ended, m, &err) < 0)
        log_say(m->log, LOG_WARN, "notify", "%s", err.text); // its end is then seen by the timer
    return true;
}

static void forget_first(struct messenger *m)
{
    m->count--;
    memmove(m->waiting, m->waiting + 1, (size_t)m->count * sizeof *m->waiting);
}

static void start_next(struct messenger *m)
{
    while (m->count && !start(m))
        forget_first(m);
}

static void say_how(struct messenger *m, int status)
{
    if (WIFSIGNALED(status))
        log_say(m->log, LOG_WARN, "notify", "%s ended by signal %d", m->command.argv[0],
                WTERMSIG(status));
    else if (WEXITSTATUS(status))
        log_say(m->log, LOG_WARN, "notify", "%s ended with status %d", m->command.argv[0],
                WEXITSTATUS(status));
}

static void ended(void *ctx)
{
    struct messenger *m = ctx;
    int status;
    if (!m->pid || waitpid(m->pid, &status, WNOHANG) != m->pid)
        return;
    if (m->pid_fd >= 0) {
        loop_remove(m->loop, m->pid_fd);
        close(m->pid_fd);
    }
    m->pid = 0;
    say_how(m, status);
    forget_first(m);
    start_next(m);
}

// Its session's other processes go with it.
static void look(void *ctx)
{
    struct messenger *m = ctx;
    if (m->pid && clk_now_ns(clk_system()) > m->end_ns) {
        log_say(m->log, LOG_WARN, "notify", "%s: not done after %g s, killed", m->command.argv[0],
                m->command.limit_s);
        kill(-m->pid, SIGKILL);
        m->end_ns = INT64_MAX;
    }
    ended(m);
}

// --- what is told --------------------------------------------------------------------------------

int messenger_new(struct loop *loop, const struct messenger_command *command, struct log *log,
                  struct messenger **ret_messenger, struct gon_error *err)
{
    struct messenger *m = calloc(1, sizeof *m);
    if (!m)
        return gon_fail(err, GON_E_SYSTEM, "notify: out of memory");
    *m = (struct messenger){.loop = loop, .command = *command, .log = log, .pid_fd = -1};
    const int rc = loop_every(loop, LOOK_MS, look, m, err);
    if (rc < 0)
        free(m);
    else
        *ret_messenger = m;
    return rc;
}

void messenger_free(struct messenger *m)
{
    if (!m)
        return;
    if (m->pid) {
        kill(-m->pid, SIGKILL);
        waitpid(m->pid, NULL, 0);
    }
    free(m);
}

static void write_telling(struct telling *t, const struct message *what)
{
    snprintf(t->sentence, sizeof t->sentence, "run %d (%s) %s%s%s", what->run, what->campaign,
             what->event, *what->text ? ": " : "", what->text);
    snprintf(t->details[0], sizeof *t->details, "GONIO_EVENT=%s", what->event);
    snprintf(t->details[1], sizeof *t->details, "GONIO_RUN=%d", what->run);
    snprintf(t->details[2], sizeof *t->details, "GONIO_CAMPAIGN=%s", what->campaign);
    snprintf(t->details[3], sizeof *t->details, "GONIO_FILE=%s", what->file);
    snprintf(t->details[4], sizeof *t->details, "GONIO_TEXT=%s", what->text);
}

void messenger_tell(struct messenger *m, const struct message *what)
{
    if (!m)
        return;
    if (m->count == MESSENGER_WAITING) {
        log_say(m->log, LOG_WARN, "notify", "%d messages wait already; run %d %s is not told",
                MESSENGER_WAITING, what->run, what->event);
        return;
    }
    write_telling(&m->waiting[m->count++], what);
    if (!m->pid)
        start_next(m);
}
