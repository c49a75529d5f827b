// SPDX-License-Identifier: MIT
#include "daemon/simulator.h"

#include "base/clk.h"
#include "base/paths.h"
#include "daemon/child.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

enum { READY_S = 20, END_MS = 2000, MOST_ARGUMENTS = 10 };

struct simulator {
    char folder[PATH_MAX / 2], config[PATH_MAX];
    pid_t pid;
    int pid_fd, out_fd;
};

static int make_folder(struct simulator *s, struct gon_error *err)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    snprintf(s->folder, sizeof s->folder, "%s/goniosim-XXXXXX",
             runtime && *runtime ? runtime : "/tmp");
    if (!mkdtemp(s->folder)) {
        int rc =
            gon_fail(err, GON_E_SYSTEM, "simulator: folder %s: %s", s->folder, strerror(errno));
        *s->folder = 0;
        return rc;
    }
    snprintf(s->config, sizeof s->config, "%s/goniod.cfg", s->folder);
    return GON_OK;
}

static int spawn(struct simulator *s, char **argv, int out_fd, struct gon_error *err)
{
    const struct child c = {
        .argv = argv, .out_fd = out_fd, .err_fd = STDERR_FILENO, .given_fd = -1};
    const int rc = child_start(&c, &s->pid);
    if (rc == 0)
        return GON_OK;
    s->pid = 0;
    return gon_fail(
        err, GON_E_INPUT,
        "simulator: %s does not start: %s; build it with make, or give a bench with --config",
        argv[0], strerror(rc));
}

static int start_process(struct simulator *s, const struct simulator_options *options,
                         struct gon_error *err)
{
    char program[PATH_MAX], seed[32];
    char *argv[MOST_ARGUMENTS] = {program, (char *)"--run-dir", s->folder,
                                  (char *)"--exit-with-parent"};
    int argc = 4, ends[2];
    paths_program("goniosim", program, sizeof program);
    if (options->fast)
        argv[argc++] = (char *)"--fast";
    if (options->seed >= 0) {
        snprintf(seed, sizeof seed, "%ld", options->seed);
        argv[argc++] = (char *)"--seed";
        argv[argc++] = seed;
    }
    if (pipe2(ends, O_CLOEXEC) < 0)
        return gon_fail(err, GON_E_SYSTEM, "simulator: %s", strerror(errno));
    int rc = spawn(s, argv, ends[1], err);
    close(ends[1]);
    s->out_fd = ends[0];
    if (rc == 0)
        s->pid_fd = (int)syscall(SYS_pidfd_open, s->pid, 0);
    return rc;
}

// Until a line "ready" comes on its standard output.
static int wait_ready(struct simulator *s, struct gon_error *err)
{
    char text[4096];
    size_t size = 0;
    int64_t end_ns = clk_now_ns(clk_system()) + CLK_S(READY_S);
    for (;;) {
        int64_t left_ns = end_ns - clk_now_ns(clk_system());
        struct pollfd p = {s->out_fd, POLLIN, 0};
        if (left_ns <= 0 || size == sizeof text - 1)
            return gon_fail(err, GON_E_SYSTEM, "simulator: goniosim was not ready within %d s",
                            READY_S);
        if (poll(&p, 1, (int)(left_ns / 1000000) + 1) <= 0)
            continue;
        ssize_t n = read(s->out_fd, text + size, sizeof text - 1 - size);
        if (n <= 0)
            return gon_fail(
                err, GON_E_SYSTEM,
                "simulator: goniosim ended before it was ready; try: goniosim --run-dir DIR");
        size += (size_t)n;
        text[size] = 0;
        if (!strncmp(text, "ready", 5) || strstr(text, "\nready"))
            return GON_OK;
    }
}

static void remove_folder(const char *folder)
{
    DIR *d = *folder ? opendir(folder) : NULL;
    if (!d)
        return;
    for (struct dirent *e; (e = readdir(d));)
        unlinkat(dirfd(d), e->d_name, 0);
    closedir(d);
    rmdir(folder);
}

static void end_process(struct simulator *s)
{
    struct pollfd p = {s->pid_fd, POLLIN, 0};
    kill(s->pid, SIGTERM);
    if (s->pid_fd < 0 || poll(&p, 1, END_MS) <= 0)
        kill(s->pid, SIGKILL);
    waitpid(s->pid, NULL, 0);
}

int simulator_start(const struct simulator_options *options, struct simulator **ret_simulator,
                    struct gon_error *err)
{
    struct simulator *s = calloc(1, sizeof *s);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, "simulator: out of memory");
    s->pid_fd = s->out_fd = -1;
    int rc = make_folder(s, err);
    rc = rc < 0 ? rc : start_process(s, options, err);
    rc = rc < 0 ? rc : wait_ready(s, err);
    if (rc < 0) {
        simulator_stop(s);
        return rc;
    }
    *ret_simulator = s;
    return GON_OK;
}

void simulator_stop(struct simulator *s)
{
    if (!s)
        return;
    if (s->pid > 0)
        end_process(s);
    remove_folder(s->folder);
    if (s->pid_fd >= 0)
        close(s->pid_fd);
    if (s->out_fd >= 0)
        close(s->out_fd);
    free(s);
}

const char *simulator_config(const struct simulator *s)
{
    return s->config;
}

const char *simulator_folder(const struct simulator *s)
{
    return s->folder;
}

int simulator_fd(const struct simulator *s)
{
    return s->pid_fd;
}
