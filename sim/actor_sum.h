// SPDX-License-Identifier: MIT
// The checksum behind a line as a simulated instrument writes and checks it: its own computation,
// apart from the drivers'. What it covers is in drivers/profile.h (struct profile_checksum).
// Thread: any.
#pragma once
#include "drivers/profile.h"

#include <stddef.h>

enum { ACTOR_SUM_MOST = 16 }; // bytes that it adds

// Behind size bytes of a line with room for ACTOR_SUM_MOST more: the size with it.
size_t actor_sum_add(const struct profile_checksum *c, char *line, size_t size);
// The size of the text before it, or -1 when it is missing or wrong.
int actor_sum_check(const struct profile_checksum *c, const char *line, size_t size);
