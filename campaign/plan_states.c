// SPDX-License-Identifier: MIT
#include "campaign/plan_states.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *name_of(int state)
{
    return polarisation_name((enum polarisation)state);
}

static const struct bench_states *side_of(const struct bench_config *b, bool in)
{
    return in ? &b->polarisation.pol_in : &b->polarisation.pol_out;
}

int plan_beam_out(const struct campaign_config *config, const struct bench_config *bench, int in)
{
    const struct bench_states *out = bench ? side_of(bench, false) : NULL;
    if (!out || out->count == 0)
        return config->pol_out_count == 1 ? config->pol_out[0] : POL_U;
    if (bench_find_state(out, POL_U))
        return POL_U;
    if (bench_find_state(out, in))
        return in;
    for (int i = 0; i < out->count; i++)
        if (polarisation_passed((enum polarisation)in, (enum polarisation)out->state[i].is) > 0)
            return out->state[i].is;
    return out->state[0].is;
}

// --- time ----------------------------------------------------------------------------------------

static double side_move_s(const struct bench_config *b, const struct bench_states *side, int from,
                          int to)
{
    const struct bench_state *a = bench_find_state(side, from), *z = bench_find_state(side, to);
    double longest_s = 0;
    for (int i = 0; a && z && i < z->axes_count; i++)
        for (int k = 0; k < a->axes_count; k++)
            if (!strcmp(a->axes[k].name, z->axes[i].name))
                longest_s = fmax(longest_s, bench_axis_move_s(bench_find_axis(b, z->axes[i].name),
                                                              a->axes[k].at, z->axes[i].at));
    return longest_s;
}

double plan_states_move_s(const struct bench_config *bench, const struct plan_point *from,
                          const struct plan_point *to)
{
    return fmax(side_move_s(bench, side_of(bench, true), from->pol_in, to->pol_in),
                side_move_s(bench, side_of(bench, false), from->pol_out, to->pol_out));
}

// --- what the bench has not ----------------------------------------------------------------------

// "s, p" of one side.
static void list_states(const struct bench_states *side, char *text, size_t size)
{
    *text = 0;
    for (int i = 0; i < side->count; i++) {
        const size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", i ? ", " : "", name_of(side->state[i].is));
    }
}

int plan_state_warning(const struct bench_config *bench, bool in, int state, char *text,
                       size_t size)
{
    const struct bench_states *side = side_of(bench, in);
    char list[60];
    list_states(side, list, sizeof list);
    if (bench_find_state(side, state))
        return 0;
    if (side->count)
        return snprintf(text, size,
                        "the bench has no state \"%s\" for %s; it has %s: goniod will refuse it",
                        name_of(state), in ? "pol_in" : "pol_out", list);
    if (in && state != bench->laser.polarisation)
        return snprintf(text, size,
                        "pol_in = \"%s\", but the bench says that its laser is \"%s\": an element "
                        "must be in the beam, and no axis of the bench moves one",
                        name_of(state), name_of(bench->laser.polarisation));
    if (!in && state != POL_U)
        return snprintf(text, size,
                        "pol_out = \"%s\", but no axis of the bench moves an analyser: it must be "
                        "before the detector, also for the beam",
                        name_of(state));
    return 0;
}

static bool several(const struct plan *plan, bool in)
{
    for (int i = 1; i < plan->count; i++)
        if (in ? plan->points[i].pol_in != plan->points[0].pol_in
               : plan->points[i].pol_out != plan->points[0].pol_out)
            return true;
    return false;
}

static int check_side(const struct plan *plan, const struct bench_config *bench, bool in,
                      struct gon_error *err)
{
    const struct bench_states *side = side_of(bench, in);
    char list[60];
    if (side->count == 0 && !several(plan, in))
        return GON_OK;
    list_states(side, list, sizeof list);
    for (int i = 0; i < plan->count; i++) {
        const int state = in ? plan->points[i].pol_in : plan->points[i].pol_out;
        if (!bench_find_state(side, state))
            return gon_fail(err, GON_E_INPUT,
                            "the campaign asks for %s = \"%s\", and the bench has %s%s; see group "
                            "polarisation of its file",
                            in ? "pol_in" : "pol_out", name_of(state),
                            side->count ? "only " : "no such states", list);
    }
    return GON_OK;
}

static int check_beams(const struct plan *plan, const struct bench_config *bench,
                       struct gon_error *err)
{
    for (int i = 0; i < plan->count && bench->polarisation.pol_out.count; i++) {
        const struct plan_point *p = &plan->points[i];
        if (p->kind == PLAN_BEAM &&
            polarisation_passed((enum polarisation)p->pol_in, (enum polarisation)p->pol_out) == 0)
            return gon_fail(err, GON_E_INPUT,
                            "no state of pol_out lets the beam of pol_in = \"%s\" through; add "
                            "\"u\" or \"%s\" to group polarisation of the bench file",
                            name_of(p->pol_in), name_of(p->pol_in));
    }
    return GON_OK;
}

int plan_check_states(const struct plan *plan, const struct bench_config *bench,
                      struct gon_error *err)
{
    int rc = check_side(plan, bench, true, err);
    if (rc >= 0)
        rc = check_side(plan, bench, false, err);
    return rc < 0 ? rc : check_beams(plan, bench, err);
}
