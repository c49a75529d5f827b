// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "campaign/plan.h"
#include "campaign/store.h"
#include "daemon/travel.h"

// A dark is one when the laser says so at its end: light may come by itself. Behind a shutter that
// makes the darks it stays on (engine_confirm_devices).
static int verify_dark(struct engine *e)
{
    bool on = false;
    const bool shut = e->lit && engine_shutter_darkens(e);
    int rc = e->point->kind == PLAN_DARK && !shut ? instrument_light(e->in, &on, &e->why) : 0;
    return rc < 0 || !on ? rc
                         : gon_fail(&e->why, GON_E_DEVICE,
                                    "laser: emits although it was switched off; look at it, then: "
                                    "gonio resume");
}

// What was read belongs to where the axes stood all the time; where that is not known it is kept,
// and made again.
int engine_verify(struct engine *e, const struct travel_pose *at, struct acquire_reading *r)
{
    int rc = travel_still(e->in, at, &e->why);
    if (rc < 0)
        r->flags |= rc == GON_E_DEVICE ? STORE_MOVED : STORE_DISCARDED;
    else if ((rc = verify_dark(e)) < 0)
        r->flags |= STORE_DISCARDED;
    if (rc < 0)
        r->accepted = false;
    return rc;
}
