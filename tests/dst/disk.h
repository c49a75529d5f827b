// SPDX-License-Identifier: MIT
// The disk under the campaign file, at SQLite's own system calls: full, broken, locked by somebody
// else, slow. What is written goes to the real file; flushing it to a platter costs virtual time
// only. Thread: one.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct disk {
    bool full;         // ENOSPC
    bool broken_write; // EIO
    bool broken_sync;
    bool broken_read;
    int64_t locked_until_ns; // somebody else has the write lock, by the store's own clock
    int64_t stall_ns;        // the next sync takes that much longer, once
    int64_t sync_ns;         // what each takes
    uint64_t writes, syncs, refused;
};

extern struct disk disk;

void disk_begin(void);

// For libc.c: 0, or the errno. ret_real: whether the real call is wanted too.
void disk_opened(int fd, const char *path);
void disk_closed(int fd);
int disk_write(int fd, size_t size);
int disk_read(int fd);
int disk_sync(int fd, bool *ret_real);
bool disk_locked(int fd, const void *flock);
