// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: whether a file is still the one that was opened. SQLite keeps its
// descriptors and would go on writing into a file that nobody can find any more.
#pragma once
#include <stdbool.h>
#include <sys/types.h>

struct store_watch {
    dev_t device;
    ino_t inode;
    off_t size; // the largest that was seen
    bool held;
    int handle; // O_PATH: closing it drops no lock of SQLite's
};

enum store_seen {
    STORE_SEEN_SAME,
    STORE_SEEN_CUT,  // the same file, and shorter than it was
    STORE_SEEN_OTHER // moved, removed or replaced
};

// What is there now; begins anew what was begun before.
void store_watch_begin(struct store_watch *w, const char *path);
void store_watch_end(struct store_watch *w); // all zero is fine
// The file has no name any more: it ends with the last descriptor.
bool store_watch_is_removed(const struct store_watch *w);
enum store_seen store_watch_look(struct store_watch *w, const char *path);
