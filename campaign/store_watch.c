// SPDX-License-Identifier: MIT
#include "campaign/store_watch.h"

#include <sys/stat.h>

void store_watch_begin(struct store_watch *w, const char *path)
{
    struct stat st;
    *w = (struct store_watch){0};
    if (stat(path, &st) == 0)
        *w = (struct store_watch){st.st_dev, st.st_ino, st.st_size};
}

enum store_seen store_watch_look(struct store_watch *w, const char *path)
{
    struct stat st;
    if (stat(path, &st) < 0 || st.st_dev != w->device || st.st_ino != w->inode)
        return STORE_SEEN_OTHER;
    if (st.st_size < w->size)
        return STORE_SEEN_CUT;
    w->size = st.st_size;
    return STORE_SEEN_SAME;
}
