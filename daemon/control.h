// SPDX-License-Identifier: MIT
// Who runs the bench: at most one person at a time, by name, with a reason and since when. While
// somebody has control the commands of others are refused with that name; watching is always
// allowed, and a stop is everybody's. While nobody has it everybody may command.
//
// This keeps colleagues out of each other's way. It is no defence: on one socket anybody can say any
// name. A core without I/O; it does not outlive the daemon. Thread: main.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { CONTROL_NAME = 65, CONTROL_REASON = 161 }; // sizes with the final NUL

struct control { // zeroed: nobody
    char name[CONTROL_NAME], reason[CONTROL_REASON];
    int64_t since_utc_ms;
};

bool control_taken(const struct control *c);
// Takes it, or gives a new reason. Somebody else's is taken only by who names them (from; NULL:
// nobody). GON_E_INPUT: no name, or longer than the sizes above; GON_E_REFUSED: another has it.
int control_take(struct control *c, const char *name, const char *reason, const char *from,
                 int64_t utc_ms, struct gon_error *err);
int control_release(struct control *c, const char *name, struct gon_error *err);
// GON_E_REFUSED: another has it, with name, time and reason.
int control_check(const struct control *c, const char *name, struct gon_error *err);
