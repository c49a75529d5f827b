// SPDX-License-Identifier: MIT
// Profiles for tests: those of configs/profiles by their names, read from the repository's root,
// and others from texts. Each is read once and kept for the program's life.
#pragma once
#include "drivers/profile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static inline void profiles_say(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

static inline const struct profile *profiles_get(const char *name)
{
    static struct profile *loaded[16];
    char path[128];
    int i = 0;
    for (; i < 16 && loaded[i]; i++)
        if (strcmp(loaded[i]->name, name) == 0)
            return loaded[i];
    snprintf(path, sizeof path, "configs/profiles/%s.cfg", name);
    if (i == 16 || profile_load(path, (struct cfg_sink){profiles_say, NULL}, &loaded[i], NULL) < 0)
        abort();
    return loaded[i];
}

static inline struct profile *profiles_parse(const char *text)
{
    struct profile *p;
    if (profile_parse(text, "test.cfg", (struct cfg_sink){profiles_say, NULL}, &p) < 0)
        abort();
    return p;
}
