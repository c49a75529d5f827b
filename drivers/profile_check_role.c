// SPDX-License-Identifier: MIT
#include "drivers/profile_check_inside.h"
#include "drivers/laser.h"
#include "drivers/profile_text.h"

#include <string.h>

// --- what roles have in common -------------------------------------------------------------------

static void check_sends(struct checking *c, const char *path, const struct profile_rules *r)
{
    for (int i = 0; i < r->count; i++) {
        check_condition(c, check_at("%s[%d].when", path, i), r->rule[i].when);
        check_sent_name(c, check_at("%s[%d].send", path, i), r->rule[i].send);
    }
}

static void check_rules(struct checking *c, const char *path, const struct profile_rules *r,
                        const bool gives[PROFILE_VALUES])
{
    for (int i = 0; i < r->count; i++)
        check_covered(c, check_at("%s[%d].when", path, i), r->rule[i].when, gives);
}

// A value that must be there and among what the asks bring.
static void check_role_value(struct checking *c, struct place at, const char *name,
                             const bool gives[PROFILE_VALUES])
{
    if (*name && check_value_name(c, at, name) && !gives[profile_value(c->p, name)])
        check_says(c, at, "nothing that is asked for it brings it");
}

static void check_period(struct checking *c, struct place at, const char *send, double period_ms)
{
    if (*send && period_ms <= 0)
        check_says(c, at, "missing; it says how often it has to be sent");
    if (*send && c->p->protocol == PROFILE_MESSAGE && period_ms > 0 &&
        period_ms < 2 * c->p->framing.gap_ms)
        check_says(c, at, "below 2 gap_ms: nothing else could be said in between");
}

static void check_some(struct checking *c, const char *path, int count, const char *what)
{
    if (count == 0)
        check_says(c, check_at("%s", path), "missing; it says %s", what);
}

// --- laser ---------------------------------------------------------------------------------------

static void check_states(struct checking *c, const struct profile_rules *states,
                         const bool gives[PROFILE_VALUES])
{
    bool emits = false;
    check_rules(c, "laser.states", states, gives);
    check_some(c, "laser.states", states->count, "its state");
    for (int i = 0; i < states->count; i++) {
        const bool always = strspn(states->rule[i].when, " ") == strlen(states->rule[i].when);
        emits = emits || states->rule[i].is == LASER_EMITTING;
        if (always != (i == states->count - 1))
            check_says(c, check_at("laser.states[%d].when", i),
                       always ? "always holds, so that those behind it never count"
                              : "the last one has to hold always");
    }
    if (states->count && !emits)
        check_says(c, check_at("laser.states"), "none of them is emitting");
}

// The first byte ends what somebody else left half-sent.
static void check_off(struct checking *c, const struct profile_laser *l)
{
    const char *end = c->p->framing.end_out;
    bool gives[PROFILE_VALUES] = {false};
    if (c->p->protocol == PROFILE_MESSAGE)
        check_some(c, "laser.off", l->off_count, "what switches it off");
    for (int i = 0; i < l->off_count; i++)
        if (strncmp(l->off[i], end, strlen(end)) != 0)
            check_says(c, check_at("laser.off[%d]", i),
                       "begins without the terminator that ends a half-sent command");
    check_some(c, "laser.off_asks", l->off_asks.count, "what tells that it is off");
    check_asks(c, "laser.off_asks", &l->off_asks);
    check_gives(c->p, &l->off_asks, gives);
    if (check_given(c, check_at("laser.is_off"), l->is_off,
                    "how it is seen that there is no light"))
        check_covered(c, check_at("laser.is_off"), l->is_off, gives);
}

static void check_laser_power(struct checking *c, const struct profile_laser *l,
                              const bool gives[PROFILE_VALUES])
{
    bool sends[PROFILE_VALUES] = {false};
    check_role_value(c, check_at("laser.power"), l->power, gives);
    check_role_value(c, check_at("laser.setpoint"), l->setpoint, gives);
    check_role_value(c, check_at("laser.fault"), l->fault, gives);
    if (!*l->set_power || !check_sent_name(c, check_at("laser.set_power"), l->set_power))
        return;
    if (check_given(c, check_at("laser.setpoint"), l->setpoint, "the value that set_power sends") &&
        c->p->protocol == PROFILE_MESSAGE) {
        profile_text_uses(c->p, c->p->exchanges[profile_exchange(c->p, l->set_power)].send, sends);
        const int value = profile_value(c->p, l->setpoint);
        if (value >= 0 && !sends[value])
            check_says(c, check_at("laser.set_power"), "does not send the setpoint, %s",
                       l->setpoint);
    }
    if (l->power_most_w <= 0)
        check_says(c, check_at("laser.power_most_w"), "missing; it says the most it can be set");
}

static void check_laser_on(struct checking *c, const struct profile_laser *l,
                           const bool status[PROFILE_VALUES])
{
    bool gives[PROFILE_VALUES];
    memcpy(gives, status, sizeof gives);
    check_asks(c, "laser.before_on", &l->before_on);
    check_gives(c->p, &l->before_on, gives);
    check_rules(c, "laser.may_not", &l->may_not, gives);
    check_sends(c, "laser.prepare", &l->prepare);
    check_rules(c, "laser.prepare", &l->prepare, gives);
    check_some(c, "laser.on", l->on.count, "what switches it on");
    check_sends(c, "laser.on", &l->on);
    check_asks(c, "laser.after_refusal", &l->after_refusal);
    check_gives(c->p, &l->after_refusal, gives);
    check_rules(c, "laser.refusals", &l->refusals, gives);
}

static void check_laser(struct checking *c)
{
    const struct profile_laser *l = &c->p->laser;
    bool status[PROFILE_VALUES] = {false}, light[PROFILE_VALUES] = {false};
    check_some(c, "laser.status", l->status.count, "what is asked for its state");
    check_asks(c, "laser.status", &l->status);
    check_asks(c, "laser.once", &l->once);
    check_gives(c->p, &l->status, status);
    check_gives(c->p, &l->once, status);
    check_some(c, "laser.light", l->light.count, "what tells that light comes out");
    check_asks(c, "laser.light", &l->light);
    check_gives(c->p, &l->light, light);
    if (check_given(c, check_at("laser.emitting"), l->emitting, "how light is seen")) {
        check_covered(c, check_at("laser.emitting"), l->emitting, light);
    }
    check_covered(c, check_at("laser.interlock_closed"), l->interlock_closed, status);
    check_states(c, &l->states, status);
    check_laser_power(c, l, status);
    check_laser_on(c, l, status);
    check_off(c, l);
    check_codes(c, "laser.faults", l->faults, l->faults_count);
    check_sent_name(c, check_at("laser.keepalive.send"), l->keepalive.send);
    check_period(c, check_at("laser.keepalive.period_ms"), l->keepalive.send,
                 l->keepalive.period_ms);
}

// --- detector ------------------------------------------------------------------------------------

// Each is asked alone: what is read has to come with every one.
static void check_sample(struct checking *c, const char *path, const struct profile_asks *asks,
                         const char *name, const char *setting)
{
    for (int i = 0; i < asks->count; i++) {
        struct profile_asks one = {.count = 1};
        bool gives[PROFILE_VALUES] = {false};
        memcpy(one.name[0], asks->name[i], sizeof one.name[0]);
        check_gives(c->p, &one, gives);
        const int value = profile_value(c->p, name);
        if (value >= 0 && !gives[value])
            check_says(c, check_at("%s[%d]", path, i), "does not bring the %s, %s", setting, name);
    }
}

static void check_ranges(struct checking *c, const struct profile_detector *d)
{
    bool gives[PROFILE_VALUES] = {false};
    check_asks(c, "detector.read_range", &d->read_range);
    check_gives(c->p, &d->read_range, gives);
    check_some(c, "detector.read_range", d->read_range.count, "what tells the range");
    if (check_given(c, check_at("detector.full_scale"), d->full_scale, "the value with the range"))
        check_role_value(c, check_at("detector.full_scale"), d->full_scale, gives);
    const int value = profile_value(c->p, d->full_scale);
    if (value >= 0 && !c->p->values[value].ladder_count && !d->ranges_count)
        check_says(c, check_at("detector.full_scale"),
                   "has no ladder, and detector.ranges is empty: which ranges are there?");
    check_sent_name(c, check_at("detector.set_range"), d->set_range);
}

static void check_detector(struct checking *c)
{
    const struct profile_detector *d = &c->p->detector;
    bool gives[PROFILE_VALUES] = {false};
    check_sends(c, "detector.setup", &d->setup);
    check_ranges(c, d);
    check_some(c, "detector.sample", d->sample.count, "what is asked for a reading");
    check_asks(c, "detector.sample", &d->sample);
    check_asks(c, "detector.sample_monitor", &d->sample_monitor);
    check_given(c, check_at("detector.signal"), d->signal, "the value with the signal");
    check_value_name(c, check_at("detector.signal"), d->signal);
    check_value_name(c, check_at("detector.monitor"), d->monitor);
    check_value_name(c, check_at("detector.reference"), d->reference);
    check_sample(c, "detector.sample", &d->sample, d->signal, "signal");
    check_sample(c, "detector.sample_monitor", &d->sample_monitor, d->signal, "signal");
    check_sample(c, "detector.sample_monitor", &d->sample_monitor, d->monitor, "monitor");
    check_asks(c, "detector.clear", &d->clear);
    check_asks(c, "detector.condition", &d->condition);
    check_gives(c->p, &d->read_range, gives);
    check_gives(c->p, &d->sample, gives);
    check_gives(c->p, &d->condition, gives);
    check_rules(c, "detector.flags", &d->flags, gives);
}

// --- axis ----------------------------------------------------------------------------------------

static void check_axis_conditions(struct checking *c, const struct profile_axis *a,
                                  const bool gives[PROFILE_VALUES])
{
    const struct {
        const char *name, *condition;
    } all[] = {{"moving", a->moving},      {"in_position", a->in_position},
               {"ready", a->ready},        {"homed", a->homed},
               {"alarm", a->alarm},        {"limit", a->limit},
               {"following", a->following}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        check_covered(c, check_at("axis.%s", all[i].name), all[i].condition, gives);
}

static void check_axis_sends(struct checking *c, const struct profile_axis *a)
{
    const struct {
        const char *name, *send;
    } all[] = {{"move", a->move},        {"stop", a->stop},     {"home", a->home},
               {"reset", a->reset},      {"enable", a->enable}, {"clear", a->clear},
               {"watchdog", a->watchdog}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        check_sent_name(c, check_at("axis.%s", all[i].name), all[i].send);
}

static void check_move(struct checking *c, const struct profile_axis *a)
{
    const int write = profile_write(c->p, a->move);
    bool given = false;
    if (write < 0)
        return;
    for (int i = 0; i < c->p->writes[write].set_count; i++)
        given = given || strstr(c->p->writes[write].set[i], "$position");
    if (!given)
        check_says(c, check_at("axis.move"), "does not set anything to $position");
}

static void check_axis(struct checking *c)
{
    const struct profile_axis *a = &c->p->axis;
    bool gives[PROFILE_VALUES] = {false};
    check_some(c, "axis.status", a->status.count, "what is asked for its state");
    check_asks(c, "axis.status", &a->status);
    check_gives(c->p, &a->status, gives);
    check_given(c, check_at("axis.position"), a->position, "the value with the position");
    check_given(c, check_at("axis.moving"), a->moving, "how it is seen that it moves");
    check_given(c, check_at("axis.move"), a->move, "the write that moves it");
    check_given(c, check_at("axis.stop"), a->stop, "the write that stops it");
    check_role_value(c, check_at("axis.position"), a->position, gives);
    check_role_value(c, check_at("axis.target"), a->target, gives);
    check_role_value(c, check_at("axis.alarm_code"), a->alarm_code, gives);
    check_axis_conditions(c, a, gives);
    check_axis_sends(c, a);
    check_move(c, a);
    check_codes(c, "axis.alarms", a->alarms, a->alarms_count);
    check_period(c, check_at("axis.watchdog_ms"), a->watchdog, a->watchdog_ms);
}

// --- selector, inputs ----------------------------------------------------------------------------

static void check_selector(struct checking *c)
{
    const struct profile_selector *s = &c->p->selector;
    bool gives[PROFILE_VALUES] = {false}, safe = !*s->safe;
    check_some(c, "selector.status", s->status.count, "what is asked for its position");
    check_some(c, "selector.positions", s->positions_count, "where it can be");
    check_asks(c, "selector.status", &s->status);
    check_gives(c->p, &s->status, gives);
    for (int i = 0; i < s->positions_count; i++) {
        const struct profile_position *at = &s->positions[i];
        for (int j = 0; j < i; j++)
            if (strcmp(at->name, s->positions[j].name) == 0)
                check_says(c, check_at("selector.positions[%d].name", i),
                           "is the name of selector.positions[%d], too", j);
        safe = safe || strcmp(at->name, s->safe) == 0;
        check_given(c, check_at("selector.positions[%d].when", i), at->when,
                    "how it is seen that it is there");
        check_covered(c, check_at("selector.positions[%d].when", i), at->when, gives);
        check_sent_name(c, check_at("selector.positions[%d].send", i), at->send);
    }
    if (!safe)
        check_says(c, check_at("selector.safe"), "there is no such position");
    check_covered(c, check_at("selector.moving"), s->moving, gives);
    check_sends(c, "selector.setup", &s->setup);
}

static void check_inputs(struct checking *c)
{
    const struct profile_inputs *i = &c->p->inputs;
    check_some(c, "inputs.status", i->status.count, "the values that are read");
    check_asks(c, "inputs.status", &i->status);
    check_sent_name(c, check_at("inputs.watchdog"), i->watchdog);
    check_period(c, check_at("inputs.watchdog_ms"), i->watchdog, i->watchdog_ms);
}

void check_roles(struct checking *c)
{
    const struct profile *p = c->p;
    const bool has[] = {p->laser.status.count > 0, p->detector.sample.count > 0,
                        p->axis.status.count > 0, p->selector.positions_count > 0,
                        p->inputs.status.count > 0};
    static void (*const checks[])(struct checking *) = {check_laser, check_detector, check_axis,
                                                        check_selector, check_inputs};
    for (int role = 0; role < (int)(sizeof has / sizeof *has); role++)
        if (has[role] && role != p->role)
            check_says(c, check_at("%s", profile_roles[role]), "but profile.role is %s",
                       profile_roles[p->role]);
    checks[p->role](c);
}
