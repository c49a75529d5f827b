// SPDX-License-Identifier: MIT
#include "cli/ports.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int is_name(const struct dirent *e)
{
    return e->d_name[0] != '.';
}

static void add(char *text, size_t size, const char *folder, const char *name)
{
    const size_t used = strlen(text);
    if (used + strlen(folder) + strlen(name) + 4 < size)
        snprintf(text + used, size - used, "%s%s/%s", text[used - 1] == ':' ? " " : ", ", folder,
                 name);
}

void ports_text(const char *folder, char *ret_text, size_t size)
{
    struct dirent **names = NULL;
    int count = scandir(folder, &names, is_name, alphasort);
    if (count > 0)
        snprintf(ret_text, size, "ports that exist:");
    else
        snprintf(ret_text, size, "no USB serial adapter is plugged in (%s has none)", folder);
    for (int i = 0; i < count; i++) {
        add(ret_text, size, folder, names[i]->d_name);
        free(names[i]);
    }
    free(names);
}
