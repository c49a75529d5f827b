// SPDX-License-Identifier: MIT
#include "sim/bench_served.h"
#include "base/clk.h"
#include "sim/benchfile.h"
#include "sim/control.h"

#include <stdio.h>
#include <stdlib.h>

struct bench_served {
    struct served served; // first
    struct sim_config config;
    struct bench bench;
    struct wire wire[BENCH_PORTS];
};

static int open_wires(struct bench_served *b, const struct rundir *dir, struct gon_error *err)
{
    for (int i = 0; i < BENCH_PORTS; i++) {
        struct wire *w = &b->wire[i];
        char path[RUNDIR_FILE];
        rundir_path(dir, bench_port_names[i], path, sizeof path);
        if (i % 2)
            wire_tcp_init(w, bench_port_names[i], bench_port(&b->bench, (enum bench_port)i));
        else
            wire_pty_init(w, bench_port_names[i], bench_port(&b->bench, (enum bench_port)i), path);
        w->enforce = b->config.wire_speed;
        w->bits = i == BENCH_AXES_RTU ? 11 : 10; // 8E1; 8N1
    }
    for (int i = 0; i < BENCH_PORTS; i++)
        if (wire_plug(&b->wire[i], err))
            return err->code;
    return 0;
}

static void write_serial(FILE *out, const void *ctx)
{
    const struct bench_served *b = ctx;
    char axes[700], laser[700], detector[700];
    snprintf(axes, sizeof axes, "modbus-rtu:%s?baud=%d&parity=E", b->wire[BENCH_AXES_RTU].address,
             b->config.axes_baud);
    snprintf(laser, sizeof laser, "serial:%s?baud=%d", b->wire[BENCH_LASER].address,
             b->config.laser_baud);
    snprintf(detector, sizeof detector, "serial:%s?baud=%d", b->wire[BENCH_DETECTOR].address,
             b->config.detector_baud);
    benchfile_write(out, &b->config, &(struct benchfile_links){axes, laser, detector});
}

static void write_tcp(FILE *out, const void *ctx)
{
    const struct bench_served *b = ctx;
    char axes[700], laser[700], detector[700];
    snprintf(axes, sizeof axes, "modbus-tcp:%s", b->wire[BENCH_AXES_TCP].address);
    snprintf(laser, sizeof laser, "tcp:%s", b->wire[BENCH_LASER_TCP].address);
    snprintf(detector, sizeof detector, "tcp:%s", b->wire[BENCH_DETECTOR_TCP].address);
    benchfile_write(out, &b->config, &(struct benchfile_links){axes, laser, detector});
}

static int bench_open(struct served *s, const struct rundir *dir, struct gon_error *err)
{
    struct bench_served *b = (struct bench_served *)s;
    int rc = open_wires(b, dir, err);
    rc = rc ? rc : rundir_write(dir, "goniod.cfg", write_serial, b, err);
    return rc ? rc : rundir_write(dir, "goniod-tcp.cfg", write_tcp, b, err);
}

static void bench_turn(struct served *s)
{
    struct bench_served *b = (struct bench_served *)s;
    b->bench.axes_port[0].gap_ns = wire_char_ns(&b->wire[BENCH_AXES_RTU]) * 7 / 2; // 3.5 characters
}

static char *bench_control(struct served *s, const char *line, int64_t t_ns)
{
    struct bench_served *b = (struct bench_served *)s;
    return control_answer(&b->bench, b->wire, line, t_ns);
}

static void bench_free(struct served *s)
{
    free(s);
}

struct served *bench_served_new(const struct sim_config *config)
{
    static const struct served_ops ops = {bench_open, bench_turn, bench_control, bench_free};
    struct bench_served *b = calloc(1, sizeof *b);
    if (!b)
        return NULL;
    b->served = (struct served){&ops, BENCH_PORTS, b->wire};
    b->config = *config;
    bench_init(&b->bench, &config->bench, clk_now_ns(clk_system()));
    return &b->served;
}
