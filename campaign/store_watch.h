// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: whether a file is still the one that was opened. SQLite keeps its
// descriptors and would go on writing into a file that nobody can find any more.
#pragma once
#include <sys/types.h>

struct store_watch {
    dev_t device;
    ino_t inode;
    off_t size; // the largest that was seen
};

enum store_seen {
    STORE_SEEN_SAME,
    STORE_SEEN_CUT,  // the same file, and shorter than it was
    STORE_SEEN_OTHER // moved, removed or replaced
};

void store_watch_begin(struct store_watch *w, const char *path); // what is there now
enum store_seen store_watch_look(struct store_watch *w, const char *path);
