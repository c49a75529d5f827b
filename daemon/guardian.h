// SPDX-License-Identifier: MIT
// The guard process (guard/): started before anything else, and anew when it died. It holds the
// laser's port; this end has the process and the sockets, drivers/guard_link.h speaks.
//
// A guard that a dead goniod left behind, still trying to switch off, is ended when ours is about
// to be given the laser, and not before: it begins with OFF. Thread: the main thread starts and
// ends it; in between the instrument thread's.
#pragma once
#include "base/err.h"
#include "drivers/guard_link.h"

struct guardian;

// For the daemon on that socket, whose lock it holds: no other daemon lives there. GON_E_INPUT:
// gonio-guard is not found, or the STOP socket's path is too long.
int guardian_start(const char *socket, struct guardian **ret_guardian, struct gon_error *err);
// Lets the guard go: it switches off once more and ends. Waits for that, at most 1 s; one that
// cannot confirm OFF goes on alone. NULL is fine.
void guardian_end(struct guardian *g);
struct guard_host guardian_host(struct guardian *g);

// When this process crashes (SIGSEGV, SIGABRT, ...) the guard is to know before a core is written,
// which may take seconds. Once, for the process.
void guardian_when_crashed(struct guardian *g);
