// SPDX-License-Identifier: MIT
#include "tests/dst/rig.h"

#include "tests/dst/libc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEPS_PER_UNIT 1000.0
#define WARMUP_S 4.0

static const char *const names[RIG_LINES] = {"axes", "laser", "detector"};
static const char *const paths[RIG_LINES] = {LIBC_DEVICES "axes", LIBC_DEVICES "laser",
                                             LIBC_DEVICES "detector"};

double rig_steps_per_unit(void)
{
    return STEPS_PER_UNIT;
}

void rig_draw(struct rig_spec *ret_spec, uint64_t seed)
{
    struct dice d = dice_of(seed, 1);
    *ret_spec = (struct rig_spec){
        .seed = seed,
        .controller = dice_below(&d, 4) == 0 ? BENCH_LEADSHINE : BENCH_AZ,
        .tcp = {dice_below(&d, 2) != 0, dice_below(&d, 3) == 0, dice_below(&d, 3) == 0},
        .keep_out = dice_below(&d, 3) == 0,
        .time_constant_s = dice_below(&d, 2) ? 0.01 : 0.003};
}

// --- a controller that misbehaves ----------------------------------------------------------------

// AZ: 00CC/D position, 007F status. Leadshine: 602C/D position, 1003 status.
static void falsify(struct rig_gate *g, int address, int count, uint16_t *registers)
{
    const bool az = g->rig->spec.controller == BENCH_AZ;
    const int position = az ? 0x00cc : 0x602c, status = az ? 0x007f : 0x1003;
    for (int i = 0; i < count; i++) {
        const int at = address + i;
        if (g->frozen && (at == position || at == position + 1))
            registers[i] = g->frozen_at[at - position];
        if (g->never_done && at == status && az)
            registers[i] = (uint16_t)((registers[i] | 1 << 13) & ~(1 << 14 | 1 << 5));
        if (g->hides_alarm && at == status)
            registers[i] = (uint16_t)((registers[i] & ~(1 << 7)) | 1 << 14 | 1 << 5);
        if (g->hides_alarm && (at == 0x0080 || at == 0x0081))
            registers[i] = 0;
        if (g->never_done && at == status && !az)
            registers[i] = (uint16_t)((registers[i] | 1 << 2) & ~(1 << 4 | 1 << 5));
    }
}

static int refused(struct rig_gate *g)
{
    if (g->exceptions <= 0)
        return 0;
    g->exceptions--;
    return g->exception;
}

static int gate_read(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns)
{
    struct rig_gate *g = ctx;
    int exception = refused(g);
    if (exception == 0)
        exception = g->inner.read(g->inner.ctx, address, count, ret_registers, t_ns);
    if (exception == 0)
        falsify(g, address, count, ret_registers);
    return exception;
}

static int32_t target_of(const uint16_t *registers)
{
    return (int32_t)((uint32_t)registers[4] << 16 | registers[5]);
}

// AZ: direct data operation. What goes nowhere slips nowhere.
static bool is_move(const struct rig_gate *g, int address, int count, const uint16_t *registers,
                    int64_t t_ns)
{
    if (g->rig->spec.controller != BENCH_AZ || address != 0x0058 || count != 16)
        return false;
    return abs(target_of(registers) - bench_motor(&g->rig->bench, g->axis, t_ns).steps) > 10;
}

static int gate_write(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns)
{
    struct rig_gate *g = ctx;
    uint16_t changed[16];
    const int exception = refused(g);
    if (exception)
        return exception;
    if (is_move(g, address, count, registers, t_ns) && g->misses > 0) {
        memcpy(changed, registers, (size_t)count * sizeof *changed);
        const int32_t to = target_of(registers) + g->miss_steps;
        changed[4] = (uint16_t)((uint32_t)to >> 16);
        changed[5] = (uint16_t)to;
        registers = changed;
        g->misses--;
    }
    return g->inner.write(g->inner.ctx, address, count, registers, t_ns);
}

static void gate_init(struct rig *r, int axis)
{
    struct sim_modbus_unit *unit = &r->bench.axes_port[r->spec.tcp[RIG_BUS]].unit[axis];
    r->gate[axis] = (struct rig_gate){.inner = *unit, .rig = r, .axis = (enum world_axis)axis};
    unit->read = gate_read;
    unit->write = gate_write;
    unit->ctx = &r->gate[axis];
}

// --- the bench -----------------------------------------------------------------------------------

static int link_of(const struct rig_spec *s, enum rig_line which, char *text, size_t size)
{
    static const int ports[RIG_LINES] = {502, 4001, 4002};
    const char *kind = which == RIG_BUS ? "modbus-" : "";
    if (s->tcp[which])
        return snprintf(text, size, "%s%s:192.0.2.%d:%d", kind, "tcp", which + 1, ports[which]);
    return snprintf(text, size, "%s%s:%s?baud=115200", kind, which == RIG_BUS ? "rtu" : "serial",
                    paths[which]);
}

static int axis_text(const struct rig_spec *s, int unit, const char *name, const char *unit_name,
                     double min, double max, double backlash, char *text, size_t size)
{
    return snprintf(text, size,
                    "%s  { name = \"%s\"; driver = \"%s\"; bus = \"axes\"; unit = %d;\n"
                    "    unit_name = \"%s\"; steps_per_unit = %.1f; min = %.1f; max = %.1f;\n"
                    "    speed = 200.0; acceleration = 10000.0; backlash = %.3f; deadband = 0.003; }",
                    unit > 1 ? ",\n" : "", name, bench_controllers[s->controller], unit, unit_name,
                    STEPS_PER_UNIT, min, max, backlash);
}

static void write_text(struct rig *r)
{
    const struct rig_spec *s = &r->spec;
    char bus[80], laser[80], detector[80], axes[1500];
    size_t used = 0;
    link_of(s, RIG_BUS, bus, sizeof bus);
    link_of(s, RIG_LASER, laser, sizeof laser);
    link_of(s, RIG_DETECTOR, detector, sizeof detector);
    used += (size_t)axis_text(s, 1, "theta_i", "deg", -5, 88, 0.02, axes, sizeof axes);
    used +=
        (size_t)axis_text(s, 2, "theta_r", "deg", -91, 181, 0.02, axes + used, sizeof axes - used);
    axis_text(s, 3, "sample", "mm", 0, 30, 0, axes + used, sizeof axes - used);
    snprintf(
        r->bench_text, sizeof r->bench_text,
        "bench: { name = \"simulation\"; wavelength_nm = 1060.0; regime = \"underfilled\";\n"
        "  aperture_radius_mm = 8.0; u_aperture_radius_mm = 0.004;\n  distance_mm = 500.0; "
        "u_distance_mm = 0.25; };\n"
        "buses: ( { name = \"axes\"; link = \"%s\"; timeout_ms = 100; } );\n"
        "axes: (\n%s );\n"
        "laser: { driver = \"cobolt-05\"; link = \"%s\"; power_w = 0.05; warmup_s = %.1f;\n"
        "  polarisation = \"u\"; };\n"
        "detector: { driver = \"sr830\"; link = \"%s\"; time_constant_s = %.3f;\n"
        "  slope_db = 12; monitor_aux = 1; };\n"
        "stations: ( { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = "
        "30.0; },\n  { name = \"park\"; theta_i_deg = 0.0; theta_r_deg = 0.0; sample_mm = 0.0; "
        "} );\n%s",
        bus, axes, laser, WARMUP_S / 2, detector, s->time_constant_s,
        s->keep_out ? "keep_out: ( { name = \"lamp\"; polygon = ( (60.0, -40.0), (70.0, "
                      "-40.0), (70.0, -30.0), (60.0, -30.0) ); } );\n"
                    : "");
}

void rig_init(struct rig *r, const struct rig_spec *spec)
{
    struct bench_spec b;
    memset(r, 0, sizeof *r);
    r->spec = *spec;
    bench_defaults(&b);
    b.world.seed = spec->seed;
    b.world.laser.temperatures_s = 0.5;
    b.world.laser.warmup_s = WARMUP_S;
    b.controller = spec->controller;
    b.home_speed = 40;
    b.home_acceleration = 400;
    for (int i = 0; i < WORLD_AXES; i++)
        b.steps_per_unit[i] = STEPS_PER_UNIT;
    bench_init(&r->bench, &b, os.now_ns);
    for (int i = 0; i < RIG_AXES; i++)
        gate_init(r, i);
    static const enum bench_port ports[RIG_LINES] = {BENCH_AXES_RTU, BENCH_LASER, BENCH_DETECTOR};
    for (int i = 0; i < RIG_LINES; i++) {
        line_init(
            &r->line[i], names[i], spec->tcp[i] ? NULL : paths[i], 0xc0000200u + (uint32_t)i + 1,
            bench_port(&r->bench, ports[i] + (spec->tcp[i] ? 1 : 0)), i == RIG_BUS, spec->seed);
        libc_add_line(&r->line[i]);
    }
    write_text(r);
}

const char *rig_describe(const struct rig *r, char *text, size_t size)
{
    snprintf(text, size, "%s %s, laser %s, detector %s, %.0f ms%s",
             bench_controllers[r->spec.controller], r->spec.tcp[RIG_BUS] ? "tcp" : "rtu",
             r->spec.tcp[RIG_LASER] ? "tcp" : "serial",
             r->spec.tcp[RIG_DETECTOR] ? "tcp" : "serial", 1e3 * r->spec.time_constant_s,
             r->spec.keep_out ? ", keep-out" : "");
    return text;
}

void rig_step(struct rig *r)
{
    if (r->unlocked)
        r->bench.world.lockin.condition |= LOCKIN_UNLOCKED;
}

bool rig_emits(const struct rig *r)
{
    const enum sim_laser_state s = r->bench.world.laser.state;
    return s >= SIM_LASER_TEMPERATURES && s <= SIM_LASER_COMPLETED;
}
