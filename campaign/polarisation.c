// SPDX-License-Identifier: MIT
#include "campaign/polarisation.h"

#include <stddef.h>
#include <string.h>

const char *const polarisation_names[] = {"u", "s", "p", "+45", "-45", "R", "L", "unknown", NULL};

const char *polarisation_name(enum polarisation p)
{
    return polarisation_names[p];
}

int polarisation_find(const char *name)
{
    for (int i = 0; polarisation_names[i]; i++)
        if (!strcmp(polarisation_names[i], name))
            return i;
    return -1;
}
