// SPDX-License-Identifier: MIT
#include "sim/actor_world.h"
#include "sim/actor_rule.h"

#include <math.h>
#include <string.h>

#define OVER 1.09 // of a range: as far as it shows
#define DB_PER_POLE 6

static const struct profile *the(const struct actor_world *l)
{
    return l->actor->now.profile;
}

static int find(const struct actor_world *l, const char *name)
{
    return *name ? actor_values_find(&l->actor->now, name, strlen(name)) : -1;
}

static double number(const struct actor_world *l, int value, double without)
{
    double n = value < 0 ? (double)NAN : l->actor->now.number[value];
    return isfinite(n) ? n : without;
}

static void tell(struct actor_world *l, int value, double number)
{
    if (value >= 0)
        l->actor->now.number[value] = number;
}

static void begin(struct actor_world *l, struct actor *a, struct world *w,
                  void (*meet)(struct actor_link *l, int64_t t_ns))
{
    *l = (struct actor_world){.link = {.meet = meet},
                              .actor = a,
                              .world = w,
                              .signal = -1,
                              .monitor = -1,
                              .reference = -1,
                              .position = -1};
    a->link = &l->link;
}

static int linked(struct actor_world *l, const char *name)
{
    int value = find(l, name);
    if (value >= 0)
        l->link.tells[value] = true;
    return value;
}

// --- detectors -----------------------------------------------------------------------------------

// Its largest range; without ranges as far as its signal goes.
static double widest(const struct actor_world *l)
{
    const struct profile_detector *d = &the(l)->detector;
    int range = find(l, d->full_scale);
    const struct profile_value *full = range >= 0 ? &the(l)->values[range] : NULL;
    double most = 0;
    for (int i = 0; i < d->ranges_count; i++)
        most = fmax(most, d->ranges[i]);
    for (int i = 0; full && i < full->ladder_count && d->ranges_count == 0; i++)
        most = fmax(most, full->ladder[i]);
    if (most == 0 && l->signal >= 0)
        most = the(l)->values[l->signal].max;
    return most > 0 ? most : 1;
}

// What the filter is set to; called when the world stands at the time of the change.
static void set_filter(const struct actor_world *l)
{
    struct lockin *f = &l->world->lockin;
    const struct profile_detector *d = &the(l)->detector;
    double tau_s = number(l, find(l, "time_constant_s"), d->settle_s);
    double slope_db = number(l, find(l, "slope_db"), DB_PER_POLE);
    f->time_constant_s = fmax(tau_s, 1e-4);
    f->poles = (int)fmin(fmax(slope_db / DB_PER_POLE, 1), LOCKIN_POLES);
    f->full_scale_v = number(l, find(l, d->full_scale), widest(l)) / l->signal_per_v;
}

static double shown(const struct actor_world *l)
{
    const struct lockin *f = &l->world->lockin;
    const struct profile_value *p = &the(l)->values[l->signal];
    double v = lockin_x_v(f) * l->signal_per_v;
    if (fabs(f->x[f->poles - 1]) > OVER * f->full_scale_v && p->over_count > 0)
        return (double)INFINITY;
    return p->min < p->max ? fmin(fmax(v, p->min), p->max) : v;
}

static void meet_detector(struct actor_link *link, int64_t t_ns)
{
    struct actor_world *l = (struct actor_world *)link;
    world_see(l->world, t_ns);
    set_filter(l);
    tell(l, l->signal, shown(l));
    int input = (int)number(l, find(l, "monitor_aux"), 1);
    if (l->monitor >= 0)
        tell(l, l->monitor, world_aux_v(l->world, input));
    tell(l, l->reference, l->world->spec.reference_hz);
}

void actor_world_detector(struct actor_world *l, struct actor *a, struct world *w,
                          double signal_per_v)
{
    begin(l, a, w, meet_detector);
    const struct profile_detector *d = &the(l)->detector;
    l->signal = linked(l, d->signal);
    l->monitor = linked(l, d->monitor);
    l->reference = linked(l, d->reference);
    l->signal_per_v = signal_per_v > 0 ? signal_per_v : widest(l);
    set_filter(l);
    world_settle(w);
    meet_detector(&l->link, w->t_ns);
}

// --- lasers --------------------------------------------------------------------------------------

static void meet_world(struct actor_link *link, int64_t t_ns)
{
    world_see(((struct actor_world *)link)->world, t_ns);
}

static double light_w(void *ctx, int64_t t_ns)
{
    struct actor_world *l = ctx;
    const struct profile *p = the(l);
    actor_step(l->actor, t_ns);
    if (!actor_when(&l->actor->now, *p->simulate.shines ? p->simulate.shines : p->laser.emitting))
        return 0;
    const char *power = *p->laser.power ? p->laser.power : p->laser.setpoint;
    return fmax(number(l, find(l, power), 0), 0);
}

void actor_world_laser(struct actor_world *l, struct actor *a, struct world *w)
{
    begin(l, a, w, meet_world);
    w->light = (struct world_source){light_w, l};
}

// --- axes ----------------------------------------------------------------------------------------

static double place(void *ctx, int64_t t_ns)
{
    struct actor_world *l = ctx;
    actor_step(l->actor, t_ns);
    return number(l, l->position, 0) / l->steps_per_unit;
}

static void stand(struct actor_world *l, double at)
{
    tell(l, l->position, rint(at * l->steps_per_unit));
    tell(l, find(l, the(l)->axis.target), rint(at * l->steps_per_unit));
}

void actor_world_axis(struct actor_world *l, struct actor *a, struct world *w, enum world_axis axis,
                      double steps_per_unit)
{
    begin(l, a, w, meet_world);
    l->position = find(l, the(l)->axis.position); // it goes by itself: the world follows
    l->axis = axis;
    l->steps_per_unit = steps_per_unit;
    stand(l, motion_at(&w->axis[axis], w->t_ns).motor);
    w->place[axis] = (struct world_source){place, l};
}

void actor_world_power_cycle(struct actor_world *l, int64_t t_ns)
{
    world_see(l->world, t_ns);
    actor_power_cycle(l->actor, t_ns);
    if (l->position >= 0)
        stand(l, motion_at(&l->world->axis[l->axis], t_ns).motor);
    actor_meet(l->actor, t_ns);
}
