// SPDX-License-Identifier: MIT
// goniosim's one thread: a bench, its wires, the control socket and signals in one poll loop with
// absolute times. Thread: the one that made it.
#pragma once
#include "base/err.h"
#include "sim/config.h"

#include <sys/types.h>

struct server;

// Opens everything below the run directory; ready when it returns 0.
int server_open(const struct sim_config *config, const char *run_dir, struct server **ret_server,
                struct gon_error *err);
// Until SIGTERM, SIGINT or SIGHUP (they are blocked by then), or until parent is not the parent
// process any more (0: whoever it is).
void server_run(struct server *s, pid_t parent);
void server_close(struct server *s);
