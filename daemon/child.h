// SPDX-License-Identifier: MIT
// Starts a program that belongs to goniod: in a session of its own, so that a Ctrl-C at the terminal
// is for goniod alone, with all signals as they are by default, nothing on its standard input, and
// no descriptor but those named here: no device's port, no file. Thread: any.
#pragma once
#include <stdbool.h>
#include <sys/types.h>

struct child {
    char **argv;        // argv[0]: a path, or a name for PATH; NULL at its end
    char **environment; // NULL: as ours
    int out_fd, err_fd; // its standard output and error; -1: nobody's
    int given_fd;       // is its descriptor 3; -1: none
    bool blocked;       // signals that are blocked here are there, too, until it says otherwise
};

enum { CHILD_GIVEN_FD = 3 };

// 0 and its pid, or an errno.
int child_start(const struct child *c, pid_t *ret_pid);
