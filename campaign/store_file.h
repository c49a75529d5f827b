// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: a new file, whole and on the disk or not there. 0, or -1 with
// errno.
#pragma once

// Renames without replacing: EEXIST.
int store_file_publish(const char *temporary, const char *path);
int store_file_sync(const char *path);
int store_file_sync_folder(const char *path); // the one that holds path
