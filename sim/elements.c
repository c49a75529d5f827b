// SPDX-License-Identifier: MIT
#include "sim/elements.h"

#include "base/units.h"

#include <math.h>

#define TURNS_DEG 195.0 // and 15 below zero
#define OUT_DEG 250.0

bool elements_are_idle(const struct elements_spec *e)
{
    return !e->present && e->laser == BRDF_STATE_U;
}

// A linear diattenuator between free path and closed rim.
static struct brdf_mueller element(const struct element_spec *e, double deg)
{
    const double open = deg >= OUT_DEG ? 1 : 0;
    if (deg > TURNS_DEG || deg < TURNS_DEG - 210)
        return (struct brdf_mueller){
            {{open, 0, 0, 0}, {0, open, 0, 0}, {0, 0, open, 0}, {0, 0, 0, open}}};
    const double c = cos(2 * units_rad(deg)), s = sin(2 * units_rad(deg));
    const double along = e->transmission, across = e->transmission * e->extinction;
    const double mean = (along + across) / 2, half = (along - across) / 2;
    const double both = sqrt(along * across);
    return (struct brdf_mueller){{{mean, half * c, half * s, 0},
                                  {half * c, mean * c * c + both * s * s, (mean - both) * c * s, 0},
                                  {half * s, (mean - both) * c * s, mean * s * s + both * c * c, 0},
                                  {0, 0, 0, both}}};
}

struct elements_view elements_view(const struct elements_spec *e, double polariser_deg,
                                   double analyser_deg)
{
    const struct brdf_stokes laser = brdf_state_stokes((enum brdf_state)e->laser);
    struct elements_view v = {.light = laser, .seen = {{1, 0, 0, 0}}};
    if (!e->present)
        return v;
    const struct brdf_mueller polariser = element(&e->polariser, polariser_deg);
    const struct brdf_mueller analyser = element(&e->analyser, analyser_deg);
    for (int j = 0; j < 4; j++) {
        v.light.s[j] = 0;
        for (int k = 0; k < 4; k++)
            v.light.s[j] += polariser.m[j][k] * laser.s[k];
        v.seen.s[j] = analyser.m[0][j];
    }
    return v;
}

double elements_of_beam(const struct elements_view *v)
{
    double sum = 0;
    for (int j = 0; j < 4; j++)
        sum += v->seen.s[j] * v->light.s[j];
    return sum;
}

double elements_through(const struct elements_view *v, const struct brdf_mueller *m)
{
    double sum = 0;
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++)
            sum += v->seen.s[j] * m->m[j][k] * v->light.s[k];
    return sum;
}
