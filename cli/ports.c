// SPDX-License-Identifier: MIT
#include "cli/ports.h"

#include "drivers/transport_adapter.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int is_name(const struct dirent *e)
{
    return e->d_name[0] != '.';
}

static void add(char *text, size_t size, const char *port)
{
    const size_t used = strlen(text);
    if (used + strlen(port) + 3 < size)
        snprintf(text + used, size - used, "%s%s", used ? ", " : "", port);
}

static void add_names(char *text, size_t size, const char *folder)
{
    char port[600];
    struct dirent **names = NULL;
    const int count = scandir(folder, &names, is_name, alphasort);
    for (int i = 0; i < count; i++) {
        snprintf(port, sizeof port, "%s/%s", folder, names[i]->d_name);
        add(text, size, port);
        free(names[i]);
    }
    free(names);
}

static void add_adapters(char *text, size_t size, const struct adapter *adapters, int count)
{
    char link[ADAPTER_LINK], port[sizeof link + sizeof adapters->name + 4];
    for (int i = 0; i < count; i++) {
        transport_adapter_link(&adapters[i], link);
        snprintf(port, sizeof port, "%s (%s)", link, adapters[i].name);
        add(text, size, port);
    }
}

void ports_text(const char *folder, const struct adapter *adapters, int count, char *ret_text,
                size_t size)
{
    static const char begins[] = "ports that exist: ";
    const size_t used = sizeof begins - 1;
    snprintf(ret_text, size, "%s", begins);
    add_names(ret_text + used, size - used, folder);
    add_adapters(ret_text + used, size - used, adapters, count);
    if (!ret_text[used])
        snprintf(ret_text, size, "no USB serial adapter is plugged in (%s has none)", folder);
}
