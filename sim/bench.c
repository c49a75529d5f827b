// SPDX-License-Identifier: MIT
#include "sim/bench.h"

#include "sim/actor_registers.h"
#include "sim/actor_rule.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

const char *const bench_port_names[BENCH_PORTS] = {"axes",      "axes-tcp", "laser",
                                                   "laser-tcp", "detector", "detector-tcp"};

const char *const bench_part_names[BENCH_PARTS] = {"theta_i",  "theta_r", "sample",  "polariser",
                                                   "analyser", "laser",   "detector"};

const char *const bench_controllers[] = {"oriental-az", "leadshine-pr", NULL};

void bench_defaults(struct bench_spec *ret_spec)
{
    *ret_spec = (struct bench_spec){
        .steps_per_unit = {1000, 1000, 1000, 1000, 1000},
        .home_speed = 10,
        .home_acceleration = 60,
        .start_s = 0.002,
        .laser_reply_s = 0.002,
        .detector_reply_s = 0.005,
        .axes_reply_s = 0,
    };
    world_defaults(&ret_spec->world);
}

static int64_t ns(double s)
{
    return (int64_t)(s * 1e9);
}

static void controllers_init(struct bench *b, const struct bench_spec *spec, enum world_axis axis)
{
    const struct sim_az_spec az = {.steps_per_unit = spec->steps_per_unit[axis],
                                   .home_speed = spec->home_speed,
                                   .home_acceleration = spec->home_acceleration,
                                   .start_s = spec->start_s,
                                   .homed = spec->homed};
    const struct sim_leadshine_spec leadshine = {.steps_per_unit = az.steps_per_unit,
                                                 .home_speed = az.home_speed,
                                                 .home_acceleration = az.home_acceleration,
                                                 .start_s = az.start_s,
                                                 .homed = az.homed};
    sim_az_init(&b->az[axis], &b->world, axis, &az);
    sim_leadshine_init(&b->leadshine[axis], &b->world, axis, &leadshine);
}

static struct sim_modbus_unit unit_of(struct bench *b, int axis)
{
    if (bench_actor(b, axis))
        return actor_registers_unit(&b->by_profile[axis].actor, axis + 1);
    if (b->controller == BENCH_LEADSHINE)
        return (struct sim_modbus_unit){.id = axis + 1,
                                        .read = sim_leadshine_read,
                                        .write = sim_leadshine_write,
                                        .ctx = &b->leadshine[axis]};
    return (struct sim_modbus_unit){
        .id = axis + 1, .read = sim_az_read, .write = sim_az_write, .ctx = &b->az[axis]};
}

// --- made from profiles --------------------------------------------------------------------------

struct bench_actor *bench_actor(struct bench *b, int part)
{
    return b->by_profile[part].profile ? &b->by_profile[part] : NULL;
}

static struct actor *cast(struct bench *b, int part, const struct profile *p, int64_t t_ns)
{
    struct bench_actor *a = &b->by_profile[part];
    a->profile = p;
    int rc = p ? actor_init(&a->actor, p, t_ns, NULL) : 0;
    assert(rc == 0);
    for (int tcp = 0; tcp < 2 && p && rc == 0; tcp++)
        actor_message_init(&a->line[tcp], &a->actor);
    return p ? &a->actor : NULL;
}

static void actors_init(struct bench *b, const struct bench_spec *spec, int64_t t_ns)
{
    struct actor *laser = cast(b, BENCH_THE_LASER, spec->laser, t_ns);
    struct actor *detector = cast(b, BENCH_THE_DETECTOR, spec->detector, t_ns);
    for (int i = 0; i < world_axes(&spec->world); i++) {
        struct actor *axis = cast(b, i, spec->axes, t_ns);
        if (axis)
            actor_world_axis(&b->by_profile[i].world, axis, &b->world, (enum world_axis)i,
                             spec->steps_per_unit[i]);
    }
    if (laser)
        actor_world_laser(&b->by_profile[BENCH_THE_LASER].world, laser, &b->world);
    if (detector)
        actor_world_detector(&b->by_profile[BENCH_THE_DETECTOR].world, detector, &b->world,
                             spec->signal_per_v);
}

void bench_init(struct bench *b, const struct bench_spec *spec, int64_t t_ns)
{
    world_init(&b->world, &spec->world, t_ns);
    b->controller = spec->controller;
    actors_init(b, spec, t_ns);
    sim_cobolt_init(&b->laser, &b->world, ns(spec->laser_reply_s));
    b->laser.echo = spec->laser_echo;
    sim_sr830_init(&b->detector, &b->world, ns(spec->detector_reply_s));
    for (int tcp = 0; tcp < 2; tcp++) {
        sim_modbus_init(&b->axes_port[tcp], tcp, 0, ns(spec->axes_reply_s));
        sim_cobolt_port_init(&b->laser_port[tcp], &b->laser);
        sim_sr830_port_init(&b->detector_port[tcp], &b->detector);
    }
    for (int i = 0; i < WORLD_AXES; i++) {
        controllers_init(b, spec, (enum world_axis)i);
        for (int tcp = 0; tcp < 2 && i < world_axes(&spec->world); tcp++)
            sim_modbus_add(&b->axes_port[tcp], unit_of(b, i));
    }
}

struct port *bench_port(struct bench *b, enum bench_port which)
{
    int tcp = which % 2;
    int part = which < BENCH_DETECTOR ? BENCH_THE_LASER : BENCH_THE_DETECTOR;
    if (which >= BENCH_LASER && which < BENCH_PORTS && bench_actor(b, part))
        return &b->by_profile[part].line[tcp].port;
    switch (which) {
    case BENCH_AXES_RTU:
    case BENCH_AXES_TCP: return &b->axes_port[tcp].port;
    case BENCH_LASER:
    case BENCH_LASER_TCP: return &b->laser_port[tcp].port;
    case BENCH_DETECTOR:
    case BENCH_DETECTOR_TCP: return &b->detector_port[tcp].port;
    default: return NULL;
    }
}

// --- an axis' controller -------------------------------------------------------------------------

static struct bench_motor actor_motor(const struct actor *a)
{
    const struct profile_axis *is = &a->now.profile->axis;
    const int at = actor_values_find(&a->now, is->position, strlen(is->position));
    const int code = actor_values_find(&a->now, is->alarm_code, strlen(is->alarm_code));
    const double steps = at < 0 ? (double)NAN : a->now.number[at];
    const double alarm = code < 0 ? (double)NAN : a->now.number[code];
    return (struct bench_motor){actor_when(&a->now, is->homed), isfinite(alarm) ? (int)alarm : 0,
                                isfinite(steps) ? (int32_t)steps : 0, a->commands, a->refused};
}

struct bench_motor bench_motor(const struct bench *b, enum world_axis axis, int64_t t_ns)
{
    const struct sim_az *z = &b->az[axis];
    const struct sim_leadshine *l = &b->leadshine[axis];
    if (b->by_profile[axis].profile)
        return actor_motor(&b->by_profile[axis].actor);
    if (b->controller == BENCH_LEADSHINE)
        return (struct bench_motor){l->homed, l->alarm, sim_leadshine_position_steps(l, t_ns),
                                    l->moves, l->ignored};
    return (struct bench_motor){z->homed, z->alarm, sim_az_position_steps(z, t_ns), z->moves,
                                z->ignored};
}

static void raise_actor(struct actor *a, int alarm, int64_t t_ns)
{
    char text[PROFILE_TEXT];
    snprintf(text, sizeof text, "%s = %d", a->now.profile->axis.alarm_code, alarm);
    actor_set(a, text, t_ns, NULL);
}

void bench_raise(struct bench *b, enum world_axis axis, int alarm, int64_t t_ns)
{
    if (bench_actor(b, axis))
        raise_actor(&b->by_profile[axis].actor, alarm, t_ns);
    else if (b->controller == BENCH_LEADSHINE)
        sim_leadshine_raise(&b->leadshine[axis], alarm, t_ns);
    else
        sim_az_raise(&b->az[axis], alarm, t_ns);
}

void bench_power_cycle(struct bench *b, enum world_axis axis, int64_t t_ns)
{
    if (bench_actor(b, axis))
        actor_world_power_cycle(&b->by_profile[axis].world, t_ns);
    else if (b->controller == BENCH_LEADSHINE)
        sim_leadshine_power_cycle(&b->leadshine[axis], t_ns);
    else
        sim_az_power_cycle(&b->az[axis], t_ns);
}
