// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: who may write a campaign file, and where one may lie.
//
// The lock is an open-file-description lock on "FILE-lock", not on FILE: closing any descriptor of
// FILE would drop the locks that SQLite holds in this process. It ends with its holder, however
// that ends.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct store_lock {
    int fd; // -1: not held
    char path[544];
};

int store_lock_take(struct store_lock *lock, const char *file,
                    struct gon_error *err);    // GON_E_REFUSED: held
// "FOLDER/.goniod.lock" in the same way; also refused on a network file system.
int store_lock_take_folder(struct store_lock *lock, const char *folder, struct gon_error *err);
void store_lock_drop(struct store_lock *lock); // and removes the file
int store_lock_holder(const char *file);       // pid; 0: none

// GON_E_REFUSED when the folder of file lies on a network file system: locks and WAL do not work
// there.
int store_lock_local(const char *file, struct gon_error *err);
// Of statfs and, for FUSE, of /proc/self/mountinfo ("fuse.sshfs"; NULL: not known).
bool store_lock_is_network(long statfs_type, const char *mount_type);

// The process that has SQLite's write lock of the WAL, as the kernel lists it; 0: none, or not
// visible.
int store_lock_wal_writer(const char *file);
