// SPDX-License-Identifier: MIT
#include "sim/bench.h"

#include <stddef.h>

const char *const bench_port_names[BENCH_PORTS] = {"axes",      "axes-tcp", "laser",
                                                   "laser-tcp", "detector", "detector-tcp"};

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

void bench_init(struct bench *b, const struct bench_spec *spec, int64_t t_ns)
{
    world_init(&b->world, &spec->world, t_ns);
    sim_cobolt_init(&b->laser, &b->world, ns(spec->laser_reply_s));
    b->laser.echo = spec->laser_echo;
    sim_sr830_init(&b->detector, &b->world, ns(spec->detector_reply_s));
    for (int tcp = 0; tcp < 2; tcp++) {
        sim_modbus_init(&b->axes_port[tcp], tcp, 0, ns(spec->axes_reply_s));
        sim_cobolt_port_init(&b->laser_port[tcp], &b->laser);
        sim_sr830_port_init(&b->detector_port[tcp], &b->detector);
    }
    for (int i = 0; i < WORLD_AXES; i++) {
        struct sim_az_spec az = {.steps_per_unit = spec->steps_per_unit[i],
                                 .home_speed = spec->home_speed,
                                 .home_acceleration = spec->home_acceleration,
                                 .start_s = spec->start_s,
                                 .homed = spec->homed};
        sim_az_init(&b->az[i], &b->world, (enum world_axis)i, &az);
        for (int tcp = 0; tcp < 2 && i < world_axes(&spec->world); tcp++)
            sim_modbus_add(&b->axes_port[tcp], (struct sim_modbus_unit){.id = i + 1,
                                                                        .read = sim_az_read,
                                                                        .write = sim_az_write,
                                                                        .ctx = &b->az[i]});
    }
}

struct port *bench_port(struct bench *b, enum bench_port which)
{
    int tcp = which % 2;
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
