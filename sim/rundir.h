// SPDX-License-Identifier: MIT
// The run directory: where goniosim's wires and files are found. One goniosim at a time (a lock on
// goniosim.pid); files appear complete, by rename; what was made is removed at the end, the
// directory too if it was made here and is empty then. Thread: the one that opened it.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdio.h>

enum { RUNDIR_PATH = 512, RUNDIR_FILE = RUNDIR_PATH + 32 };

struct rundir {
    char path[RUNDIR_PATH]; // absolute
    int lock_fd, dir_fd;
    bool made;
};

int rundir_open(struct rundir *r, const char *path, struct gon_error *err);
void rundir_close(struct rundir *r);
// path/name into ret_path, of RUNDIR_FILE bytes to be enough.
void rundir_path(const struct rundir *r, const char *name, char *ret_path, size_t size);
int rundir_write(const struct rundir *r, const char *name,
                 void (*write)(FILE *out, const void *ctx), const void *ctx, struct gon_error *err);
