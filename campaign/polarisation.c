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

enum polarisation polarisation_crossed(enum polarisation p)
{
    static const enum polarisation crossed[POL_COUNT] = {[POL_U] = POL_U,
                                                         [POL_S] = POL_P,
                                                         [POL_P] = POL_S,
                                                         [POL_PLUS45] = POL_MINUS45,
                                                         [POL_MINUS45] = POL_PLUS45,
                                                         [POL_R] = POL_L,
                                                         [POL_L] = POL_R,
                                                         [POL_UNKNOWN] = POL_UNKNOWN};
    return crossed[p];
}

double polarisation_passed(enum polarisation in, enum polarisation out)
{
    if (out == POL_U || in == out)
        return 1;
    return in == polarisation_crossed(out) ? 0 : 0.5;
}
