// SPDX-License-Identifier: MIT
#include "campaign/reduce_elements.h"

#include <math.h>
#include <stddef.h>

const struct reduce_channel *reduce_channel_of(const struct reduction *r, int pol_in, int pol_out)
{
    for (int i = 0; i < r->channels; i++)
        if (r->channel[i].pol_in == pol_in && r->channel[i].pol_out == pol_out)
            return &r->channel[i];
    return NULL;
}

static const struct plan_point *in_channel(const struct plan *plan, const struct reduction *r,
                                           int k, const struct reduce_channel *c)
{
    const struct plan_point *p = k < r->count ? &plan->points[r->points[k].index] : NULL;
    return p && p->pol_in == c->pol_in && p->pol_out == c->pol_out ? p : NULL;
}

// Of two points of the sample: before, the same direction, behind.
static int by_direction(const struct plan_point *a, const struct plan_point *b)
{
    if (a->sweep != b->sweep)
        return a->sweep < b->sweep ? -1 : 1;
    return (a->theta_r_deg > b->theta_r_deg) - (a->theta_r_deg < b->theta_r_deg);
}

// What leaks of the crossed channel (NULL: not measured) into u_B of this one. In each channel
// directions rise within a sweep.
static void add_leak(struct reduction *r, const struct plan *plan, const struct reduce_channel *c,
                     const struct reduce_channel *crossed, double extinction)
{
    for (int k = 0, other = 0; k < r->count; k++) {
        const struct plan_point *p = in_channel(plan, r, k, c), *q = NULL;
        struct reduced_point *point = &r->points[k];
        double leak_per_sr = point->f_per_sr;
        if (!p)
            continue;
        for (; crossed && other < r->count; other++)
            if ((q = in_channel(plan, r, other, crossed)) && by_direction(q, p) >= 0)
                break;
        if (q && by_direction(q, p) == 0)
            leak_per_sr = r->points[other].f_per_sr;
        point->u_b_per_sr = hypot(point->u_b_per_sr, extinction * leak_per_sr / sqrt(3));
    }
}

static int crossed(int state)
{
    return polarisation_crossed((enum polarisation)state);
}

void reduce_add_leaks(struct reduction *r, const struct plan *plan, const struct bench_config *b)
{
    const struct bench_polarisation *p = &b->polarisation;
    for (int i = 0; i < r->channels; i++) {
        const struct reduce_channel *c = &r->channel[i];
        if (p->pol_in.count && c->pol_in != POL_U && p->polariser_extinction > 0)
            add_leak(r, plan, c, reduce_channel_of(r, crossed(c->pol_in), c->pol_out),
                     p->polariser_extinction);
        if (p->pol_out.count && c->pol_out != POL_U && p->extinction > 0)
            add_leak(r, plan, c, reduce_channel_of(r, c->pol_in, crossed(c->pol_out)),
                     p->extinction);
    }
}

double reduce_analyser(const struct bench_polarisation *p, int pol_in, int beam_out, int pol_out,
                       double *ret_u_rel)
{
    const double of_sample = pol_out == POL_U ? 1 : p->transmission;
    const double of_beam = beam_out == POL_U
                               ? 1
                               : p->transmission * polarisation_passed((enum polarisation)pol_in,
                                                                       (enum polarisation)beam_out);
    *ret_u_rel = 0;
    if (p->pol_out.count == 0)
        return 1;
    if ((pol_out == POL_U) != (beam_out == POL_U))
        *ret_u_rel = p->u_transmission / p->transmission;
    return of_sample / of_beam;
}
