// SPDX-License-Identifier: MIT
// The daemon's Unix socket: one daemon a socket. A lock file beside it (PATH.lock) is held with
// flock as long as the daemon lives and holds its process id; so a socket left by a dead daemon is
// replaced and a living one is refused. Mode 0660; a directory that has to be made is 0700. Thread:
// main.
#pragma once
#include "base/err.h"

struct listener;

// GON_E_REFUSED: another daemon has it ("already running, pid 4711"); GON_E_INPUT: the path cannot
// be used.
int listener_open(const char *path, struct listener **ret_listener, struct gon_error *err);
void listener_close(struct listener *l); // removes the socket and its lock file
int listener_fd(const struct listener *l); // non-blocking; closed by listener_close
