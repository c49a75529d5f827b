// SPDX-License-Identifier: MIT
// goniosim's one thread: a bench, its wires, the control socket and signals in one poll loop with
// absolute times. Thread: the one that made it.
#pragma once
#include "base/err.h"
#include "sim/config.h"

#include <stdbool.h>

struct server;

// Opens everything below the run directory; ready when it returns 0.
int server_open(const struct sim_config *config, const char *run_dir, struct server **ret_server,
                struct gon_error *err);
// Until SIGTERM or SIGINT (blocked by then; 0), or with_parent and the parent is gone.
int server_run(struct server *s, bool with_parent, struct gon_error *err);
void server_close(struct server *s);
