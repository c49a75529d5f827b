// SPDX-License-Identifier: MIT
// Who has a serial port: locking it, and saying in words why it cannot be had. Inside this layer.
// TIOCEXCL keeps others from opening it but not root; flock keeps those out who also ask. Any
// thread.
#pragma once
#include "base/err.h"

// Locks an open port until its last descriptor is closed. GON_E_REFUSED: "in use by pid N (name)".
int transport_claim(int fd, const char *path, struct gon_error *err);

// Puts an errno of opening into words: not there, in use by whom, which group to join, no terminal.
// path is what the user wrote, name what it leads to. Returns the code.
int transport_claim_failed(const char *path, const char *name, int error, struct gon_error *err);
