// SPDX-License-Identifier: MIT
#include "daemon/child.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <unistd.h>

extern char **environ;

static void give(posix_spawn_file_actions_t *actions, int fd, int as)
{
    if (fd >= 0)
        posix_spawn_file_actions_adddup2(actions, fd, as);
    else
        posix_spawn_file_actions_addopen(actions, as, "/dev/null", O_RDWR, 0);
}

int child_start(const struct child *c, pid_t *ret_pid)
{
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_t actions;
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF |
                                              (c->blocked ? 0 : POSIX_SPAWN_SETSIGMASK));
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawn_file_actions_init(&actions);
    give(&actions, -1, STDIN_FILENO);
    give(&actions, c->out_fd, STDOUT_FILENO);
    give(&actions, c->err_fd, STDERR_FILENO);
    if (c->given_fd >= 0)
        give(&actions, c->given_fd, CHILD_GIVEN_FD);
    posix_spawn_file_actions_addclosefrom_np(&actions,
                                             CHILD_GIVEN_FD + (c->given_fd >= 0 ? 1 : 0));
    const int rc = posix_spawnp(ret_pid, c->argv[0], &actions, &attributes, c->argv,
                                c->environment ? c->environment : environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    return rc;
}
