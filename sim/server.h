// SPDX-License-Identifier: MIT
// goniosim's one thread: what is served, its wires, the control socket and signals in one poll loop
// with absolute times. Thread: the one that made it.
#pragma once
#include "base/err.h"
#include "sim/rundir.h"
#include "sim/wire.h"

#include <sys/types.h>

enum { SERVER_WIRES = 8 };

struct served;

struct served_ops {
    // Plugs the wires in and writes the files that say how to reach them.
    int (*open)(struct served *s, const struct rundir *dir, struct gon_error *err);
    void (*turn)(struct served *s); // before the wires are served
    // The answer to a line of the control socket, to be freed; NULL without memory.
    char *(*control)(struct served *s, const char *line, int64_t t_ns);
    void (*free)(struct served *s); // its wires are unplugged
};

struct served { // first member of what is served: sim/bench_served, sim/actor_served
    const struct served_ops *ops;
    int wires_count; // at most SERVER_WIRES
    struct wire *wires;
};

struct server;

// Opens everything below the run directory; ready when it returns 0. What is served is taken over.
int server_open(struct served *served, const char *run_dir, struct server **ret_server,
                struct gon_error *err);
// Until SIGTERM, SIGINT or SIGHUP (they are blocked by then), or until parent is not the parent
// process any more (0: whoever it is).
void server_run(struct server *s, pid_t parent);
void server_close(struct server *s);
