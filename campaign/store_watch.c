// SPDX-License-Identifier: MIT
#include "campaign/store_watch.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

void store_watch_begin(struct store_watch *w, const char *path)
{
    struct stat st;
    store_watch_end(w);
    const int handle = open(path, O_PATH | O_CLOEXEC);
    if (handle < 0)
        return;
    if (fstat(handle, &st) == 0)
        *w = (struct store_watch){st.st_dev, st.st_ino, st.st_size, true, handle};
    else
        close(handle);
}

void store_watch_end(struct store_watch *w)
{
    if (w->held)
        close(w->handle);
    *w = (struct store_watch){0};
}

bool store_watch_is_removed(const struct store_watch *w)
{
    struct stat st;
    return w->held && fstat(w->handle, &st) == 0 && st.st_nlink == 0;
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
