// SPDX-License-Identifier: MIT
#include "drivers/profile.h"

#include <string.h>

// Each of these begins with its name.
static int find(const void *first, int count, size_t stride, const char *name)
{
    const char *at = first;
    for (int i = 0; i < count; i++, at += stride)
        if (strcmp(at, name) == 0)
            return i;
    return -1;
}

int profile_value(const struct profile *p, const char *name)
{
    return find(p->values, p->values_count, sizeof *p->values, name);
}

int profile_exchange(const struct profile *p, const char *name)
{
    return find(p->exchanges, p->exchanges_count, sizeof *p->exchanges, name);
}

int profile_write(const struct profile *p, const char *name)
{
    return find(p->writes, p->writes_count, sizeof *p->writes, name);
}
