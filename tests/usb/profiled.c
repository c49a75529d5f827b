// SPDX-License-Identifier: MIT
#include "tests/usb/profiled.h"

#include "base/clk.h"
#include "drivers/link.h"

#include <stdio.h>
#include <stdlib.h>

static int make(struct profiled *p, const char *name, struct gon_error *err)
{
    struct link l;
    int rc = profile_open(name, NULL, &p->profile, err);
    if (rc == 0)
        rc = link_parse(p->profile->link, LINK_TEXT, &l, err);
    if (rc == 0 && l.kind != LINK_USBTMC)
        rc = gon_fail(err, GON_E_INPUT, "%s: is not on USB: %s", name, p->profile->link);
    if (rc == 0)
        rc = actor_init(&p->actor, p->profile, clk_now_ns(clk_system()), err);
    if (rc < 0)
        return rc;
    actor_message_init(&p->message, &p->actor);
    snprintf(p->serial, sizeof p->serial, "%s", l.place);
    p->identity =
        (struct sim_usb_identity){l.vendor, l.product, "the profile", p->profile->name, p->serial};
    return 0;
}

struct profiled *profiled_new(const char *profile)
{
    struct gon_error err = {0};
    struct profiled *p = calloc(1, sizeof *p);
    if (p && make(p, profile, &err) == 0)
        return p;
    fprintf(stderr, "%s\n", err.text);
    profiled_free(p);
    return NULL;
}

void profiled_free(struct profiled *p)
{
    if (p)
        free(p->profile);
    free(p);
}
