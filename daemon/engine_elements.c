// SPDX-License-Identifier: MIT
#include "daemon/engine_inside.h"

#include "campaign/bench.h"
#include "campaign/plan.h"
#include "daemon/travel.h"

// A side whose elements nobody moves is as somebody left it.
static int place(struct engine *e, const char *side, const struct bench_states *states, int is,
                 struct travel_pose *pose)
{
    const struct bench_state *s = bench_find_state(states, is);
    if (!s && states->count)
        return gon_fail(&e->why, GON_E_INPUT,
                        "the bench has no state \"%s\" for %s: add it to group polarisation",
                        polarisation_name((enum polarisation)is), side);
    for (int i = 0; s && i < s->axes_count; i++)
        pose->at[bench_axis_index(instrument_bench(e->in), s->axes[i].name)] = s->axes[i].at;
    return 0;
}

int engine_turn_elements(struct engine *e)
{
    const struct bench_polarisation *p = &instrument_bench(e->in)->polarisation;
    struct travel_pose pose = travel_stay(), at;
    if (!p->pol_in.count && !p->pol_out.count)
        return 0;
    int rc = place(e, "pol_in", &p->pol_in, e->point->pol_in, &pose);
    if (rc >= 0)
        rc = place(e, "pol_out", &p->pol_out, e->point->pol_out, &pose);
    return rc < 0 ? rc : travel_move(e->in, &pose, e->ports->cancel, &at, &e->why);
}
