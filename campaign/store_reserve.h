// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: 1 MiB of disk kept in "FILE-reserve" while FILE is written. A full
// disk takes it: then there is room to say so in FILE, and for the reading that found it full.
// Readings go on once it could be had back, so that the next full disk finds it again.
#pragma once
#include <stdbool.h>

enum { STORE_RESERVE_BYTES = 1 << 20 }; // some 100 commits

// Has it, or has it again. False: the disk is full. A file system that cannot keep room is as if it
// had.
bool store_reserve_take(const char *file);
void store_reserve_give(const char *file); // back to the disk; also when FILE is closed
