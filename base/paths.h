// SPDX-License-Identifier: MIT
// Where the daemon and the command meet when nobody says otherwise, and where programs are that
// belong together. Thread: any.
#pragma once
#include "base/err.h"

#include <stddef.h>

// $GONIO_SOCKET, else $XDG_RUNTIME_DIR/goniod.sock, else /run/goniod.sock for root and
// /tmp/goniod-UID/goniod.sock for others. GON_E_INPUT when it does not fit into a socket's address.
int paths_socket(char *ret_path, size_t size, struct gon_error *err);

// GON_E_INPUT when the path is empty or longer than the 107 bytes that a socket's address holds.
int paths_socket_fits(const char *path, struct gon_error *err);

// The STOP socket of the guard, beside the daemon's: goniod-guard.sock for goniod.sock. GON_E_INPUT
// as above.
int paths_guard(const char *socket, char *ret_path, size_t size, struct gon_error *err);

// Another of gonio's programs: beside this one (as it was built), in ../bin (as installed), else its
// name alone, for PATH to find.
void paths_program(const char *name, char *ret_path, size_t size);

// Who sits there, for the daemon and for colleagues: $GONIO_NAME, else the login name; "" without
// either. At most size - 1 bytes.
void paths_person(char *ret_name, size_t size);
