// SPDX-License-Identifier: MIT
#include "daemon/profile_texts.h"

#include "drivers/profile.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

// The first complaint, as the error's text.
static void keep_first(void *ctx, const char *line)
{
    struct gon_error *err = ctx;
    if (err->code == GON_OK)
        gon_fail(err, GON_E_INPUT, "%s", line);
}

static bool is_there(const struct profile_texts *t, const char *name)
{
    for (int i = 0; i < t->count; i++)
        if (!strcmp(t->profile[i].name, name))
            return true;
    return false;
}

static int add(struct profile_texts *t, const char *name, const char *folder, struct gon_error *err)
{
    struct gon_error why = {0};
    struct profile *p;
    char path[PATH_MAX], *text;
    if (is_there(t, name))
        return GON_OK;
    int rc = profile_find(name, folder, path, sizeof path, err);
    if (rc < 0)
        return rc;
    rc = profile_load(path, (struct cfg_sink){keep_first, &why}, &p, &text);
    if (rc < 0)
        return gon_fail(err, (enum gon_code)rc, "%s", why.text);
    t->profile[t->count++] = (struct store_profile){name, profile_roles[p->role], text};
    free(p);
    return GON_OK;
}

int profile_texts_read(const struct bench_config *bench, struct profile_texts *ret_texts,
                       struct gon_error *err)
{
    struct profile_texts t = {.count = 0};
    int rc = add(&t, bench->laser.driver, bench->folder, err);
    rc = rc < 0 ? rc : add(&t, bench->detector.driver, bench->folder, err);
    if (rc >= 0 && *bench->monitor.driver)
        rc = add(&t, bench->monitor.driver, bench->folder, err);
    for (int i = 0; i < bench->axes_count && rc >= 0; i++)
        rc = add(&t, bench->axes[i].driver, bench->folder, err);
    for (int i = 0; i < bench->devices_count && rc >= 0; i++)
        rc = add(&t, bench->devices[i].driver, bench->folder, err);
    if (rc < 0) {
        profile_texts_free(&t);
        return rc;
    }
    *ret_texts = t;
    return GON_OK;
}

void profile_texts_free(struct profile_texts *texts)
{
    for (int i = 0; i < texts->count; i++)
        free((char *)texts->profile[i].text);
    texts->count = 0;
}
