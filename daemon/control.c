// SPDX-License-Identifier: MIT
#include "daemon/control.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

bool control_taken(const struct control *c)
{
    return c->name[0] != 0;
}

static int refuse(const struct control *c, struct gon_error *err)
{
    char since[40];
    const time_t s = (time_t)(c->since_utc_ms / 1000);
    struct tm tm;
    strftime(since, sizeof since, "%Y-%m-%d %H:%M", localtime_r(&s, &tm));
    return gon_fail(err, GON_E_REFUSED,
                    "%s has control since %s%s%s%s; ask, or take it: gonio control take --from '%s'",
                    c->name, since, *c->reason ? " (" : "", c->reason, *c->reason ? ")" : "",
                    c->name);
}

int control_check(const struct control *c, const char *name, struct gon_error *err)
{
    return control_taken(c) && strcmp(c->name, name) ? refuse(c, err) : GON_OK;
}

int control_take(struct control *c, const char *name, const char *reason, const char *from,
                 int64_t utc_ms, struct gon_error *err)
{
    if (!*name || strlen(name) >= sizeof c->name)
        return gon_fail(err, GON_E_INPUT,
                        "control needs a name of at most %d bytes; set GONIO_NAME", CONTROL_NAME - 1);
    if (reason && strlen(reason) >= sizeof c->reason)
        return gon_fail(err, GON_E_INPUT, "the reason has %zu bytes, at most %d fit; shorten it",
                        strlen(reason), CONTROL_REASON - 1);
    const bool theirs = control_taken(c) && strcmp(c->name, name);
    if (theirs && (!from || strcmp(from, c->name)))
        return refuse(c, err);
    if (theirs || !control_taken(c))
        c->since_utc_ms = utc_ms;
    snprintf(c->name, sizeof c->name, "%s", name);
    snprintf(c->reason, sizeof c->reason, "%s", reason ? reason : "");
    return GON_OK;
}

int control_release(struct control *c, const char *name, struct gon_error *err)
{
    const int rc = control_check(c, name, err);
    if (rc == GON_OK)
        *c = (struct control){0};
    return rc;
}
