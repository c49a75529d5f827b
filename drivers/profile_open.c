// SPDX-License-Identifier: MIT
#include "drivers/profile.h"

#include <limits.h>
#include <stdio.h>

// The first complaint, as the error's text.
static void keep_first(void *ctx, const char *line)
{
    struct gon_error *err = ctx;
    if (!*err->text)
        snprintf(err->text, sizeof err->text, "%s", line);
}

int profile_open(const char *name, const char *folder, struct profile **ret_profile,
                 struct gon_error *err)
{
    struct gon_error why = {0};
    char path[PATH_MAX];
    int rc = profile_find(name, folder, path, sizeof path, err);
    if (rc < 0)
        return rc;
    rc = profile_load(path, (struct cfg_sink){keep_first, &why}, ret_profile, NULL);
    return rc < 0 ? gon_fail(err, (enum gon_code)rc, "%s", why.text) : 0;
}
