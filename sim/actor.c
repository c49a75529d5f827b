// SPDX-License-Identifier: MIT
#include "sim/actor.h"
#include "sim/actor_rule.h"

#include <math.h>
#include <string.h>

#define LOOK_NS 10000000 // how often conditions are looked at
enum { CHAIN = 64 };     // changes that follow each other at one time

static const struct profile *the(const struct actor *a)
{
    return a->now.profile;
}

// --- where values go -----------------------------------------------------------------------------

struct course {
    int value;
    double to, rate; // a second; 0: at once
};

// Where the row takes its value now; false: nowhere.
static bool course(const struct actor *a, const struct profile_drift *d, struct course *ret)
{
    int value = actor_values_find(&a->now, d->value, strlen(d->value));
    if (value < 0 || (a->link && a->link->tells[value]) || !actor_when(&a->now, d->when))
        return false;
    *ret = (struct course){.value = value, .to = actor_number(&a->now, d->to, value), d->rate};
    if (*d->rate_value)
        ret->rate = fabs(actor_number(&a->now, d->rate_value, -1));
    return !isnan(ret->to);
}

// The rows that count: of each value the first whose condition holds.
static int courses(struct actor *a, struct course ret[PROFILE_STEPS], int row[PROFILE_STEPS])
{
    bool taken[PROFILE_VALUES] = {false};
    int count = 0;
    for (int i = 0; i < the(a)->simulate.drift_count; i++) {
        struct course c;
        bool counts = course(a, &the(a)->simulate.drift[i], &c) && !taken[c.value];
        if (!counts) {
            a->there[i] = false;
            continue;
        }
        taken[c.value] = true;
        row[count] = i;
        ret[count++] = c;
    }
    return count;
}

// Arrives where values are already, and goes where it takes no time. True when something changed.
static bool arrive(struct actor *a)
{
    struct course c[PROFILE_STEPS];
    int row[PROFILE_STEPS], count = courses(a, c, row);
    for (int i = 0; i < count; i++) {
        double *number = &a->now.number[c[i].value];
        const struct profile_drift *d = &the(a)->simulate.drift[row[i]];
        if (c[i].rate == 0 && !*d->rate_value)
            *number = c[i].to;
        if (*number != c[i].to)
            a->there[row[i]] = false;
        else if (!a->there[row[i]]) {
            a->there[row[i]] = true;
            actor_do(a, d->then);
            return true;
        }
    }
    return false;
}

static void follow(struct actor *a)
{
    for (int i = 0; i < the(a)->simulate.follows_count; i++)
        if (actor_when(&a->now, the(a)->simulate.follows[i].when))
            actor_do(a, the(a)->simulate.follows[i].then);
}

static void settle(struct actor *a)
{
    for (int i = 0; i < CHAIN && arrive(a); i++)
        ;
    follow(a);
}

// Until the first arrival, at most most_ns; 0: nothing moves.
static int64_t stride_ns(const struct actor *a, const struct course *c, int count, int64_t most_ns)
{
    bool moving = false;
    for (int i = 0; i < count; i++) {
        double left = fabs(c[i].to - a->now.number[c[i].value]);
        if (!(left > 0) || !(c[i].rate > 0))
            continue;
        moving = true;
        double ns = ceil(left / c[i].rate * 1e9);
        if (ns < (double)most_ns)
            most_ns = ns > 1 ? (int64_t)ns : 1;
    }
    return moving ? most_ns : 0;
}

static void go(struct actor *a, const struct course *c, double dt_s)
{
    double *number = &a->now.number[c->value];
    double left = c->to - *number, way = c->rate * dt_s;
    if (c->rate > 0)
        *number = fabs(left) <= way ? c->to : *number + copysign(way, left);
}

void actor_step(struct actor *a, int64_t t_ns)
{
    int64_t look_ns = (t_ns - a->t_ns) / 1000;
    look_ns = look_ns > LOOK_NS ? look_ns : LOOK_NS;
    settle(a);
    while (a->t_ns < t_ns) {
        struct course c[PROFILE_STEPS];
        int row[PROFILE_STEPS], count = courses(a, c, row);
        int64_t left_ns = t_ns - a->t_ns;
        int64_t step_ns = stride_ns(a, c, count, left_ns < look_ns ? left_ns : look_ns);
        if (step_ns == 0) {
            a->t_ns = t_ns;
            return;
        }
        for (int i = 0; i < count; i++)
            go(a, &c[i], (double)step_ns * 1e-9);
        a->t_ns += step_ns;
        settle(a);
    }
}

void actor_meet(struct actor *a, int64_t t_ns)
{
    if (a->link)
        a->link->meet(a->link, t_ns);
    actor_step(a, t_ns);
}

// --- what is done to it --------------------------------------------------------------------------

void actor_do(struct actor *a, const char *assignments)
{
    actor_then(&a->now, assignments, NULL);
}

int actor_set(struct actor *a, const char *assignments, int64_t t_ns, struct gon_error *err)
{
    actor_meet(a, t_ns);
    int rc = actor_then(&a->now, assignments, err);
    settle(a);
    actor_meet(a, t_ns);
    return rc;
}

const struct profile_deny *actor_denies(const struct actor_values *v, const char *does)
{
    const struct profile_simulate *s = &v->profile->simulate;
    for (int i = 0; i < s->deny_count; i++)
        if (strcmp(s->deny[i].does, does) == 0 && actor_when(v, s->deny[i].when))
            return &s->deny[i];
    return NULL;
}

// --- the beginning -------------------------------------------------------------------------------

static int readable(const struct profile *p, const char *where, const char *then,
                    struct gon_error *err)
{
    struct actor_values v;
    actor_values_start(&v, p);
    int rc = actor_then(&v, then, err);
    return rc ? gon_prefix(err, "profile %s: %s: then", p->name, where) : 0;
}

int actor_init(struct actor *a, const struct profile *p, int64_t t_ns, struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; i < p->exchanges_count && rc == 0; i++)
        rc = readable(p, p->exchanges[i].name, p->exchanges[i].then, err);
    for (int i = 0; i < p->writes_count && rc == 0; i++)
        rc = readable(p, p->writes[i].name, p->writes[i].then, err);
    for (int i = 0; i < p->simulate.drift_count && rc == 0; i++)
        rc = readable(p, p->simulate.drift[i].value, p->simulate.drift[i].then, err);
    for (int i = 0; i < p->simulate.follows_count && rc == 0; i++)
        rc = readable(p, "follows", p->simulate.follows[i].then, err);
    for (int i = 0; i < p->simulate.deny_count && rc == 0; i++)
        rc = readable(p, p->simulate.deny[i].does, p->simulate.deny[i].then, err);
    if (rc)
        return rc;
    *a = (struct actor){.t_ns = t_ns};
    actor_values_start(&a->now, p);
    actor_power_cycle(a, t_ns);
    return 0;
}

void actor_power_cycle(struct actor *a, int64_t t_ns)
{
    actor_values_start(&a->now, the(a));
    memset(a->there, 0, sizeof a->there);
    a->t_ns = t_ns;
    a->last_ns = INT64_MIN;
    settle(a);
}
