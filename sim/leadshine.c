// SPDX-License-Identifier: MIT
#include "sim/leadshine.h"
#include "sim/modbus.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define STORE_NS 500000000
#define HOME 0.0            // of the axis' own scale
#define RPM_PER_RATE 1000.0 // accelerations are milliseconds per 1000 rpm
#define STOP_MS 100.0       // of a quick stop, per 1000 rpm

enum { MODE, TO_HIGH, TO_LOW, SPEED, UP, DOWN, PAUSE };
enum {
    PULSES = 0x0001,
    ENABLE = 0x000f,
    STATUS = 0x1003,
    WORD = 0x1801,
    ALARM = 0x2203,
    CONTROL = 0x6002,
    COMMAND = 0x602a,
    MOTOR = 0x602c,
    PATH = 0x6200,
    PATH_CONTROL = PATH + LEADSHINE_FIELDS
};
enum { START_PATH = 0x0010, GO_HOME = 0x0020, SET_ZERO = 0x0021, QUICK_STOP = 0x0040 };
enum { RUNNING_STATE = 0x0100, RESET_WORD = 0x1111, STORE_WORD = 0x2211 };
enum { FAULT = 1, ENABLED = 2, RUNNING = 4, COMMAND_DONE = 16, PATH_DONE = 32, HOME_DONE = 64 };
enum { ABSOLUTE = 1, RELATIVE = 0x41 };

static struct motion *motor(const struct sim_leadshine *z)
{
    return &z->world->axis[z->axis];
}

void sim_leadshine_init(struct sim_leadshine *z, struct world *world, enum world_axis axis,
                        const struct sim_leadshine_spec *spec)
{
    assert(spec->steps_per_unit > 0 && spec->home_speed > 0 && spec->home_acceleration > 0);
    memset(z, 0, sizeof *z);
    z->world = world;
    z->axis = axis;
    z->steps_per_unit = spec->steps_per_unit;
    z->home_speed = spec->home_speed;
    z->home_acceleration = spec->home_acceleration;
    z->start_ns = (int64_t)(spec->start_s * 1e9);
    z->pulses_per_turn = 10000;
    z->homed = spec->homed;
    z->origin = spec->homed ? HOME : motion_at(motor(z), world->t_ns).motor;
    z->command_steps = sim_leadshine_position_steps(z, world->t_ns);
}

static int32_t steps(const struct sim_leadshine *z, double at)
{
    return (int32_t)llround((at - z->origin) * z->steps_per_unit);
}

int32_t sim_leadshine_position_steps(const struct sim_leadshine *z, int64_t t_ns)
{
    return steps(z, motion_at(motor(z), t_ns).motor);
}

static void halt(struct sim_leadshine *z, int64_t t_ns)
{
    world_see(z->world, t_ns);
    motion_halt(motor(z), t_ns);
    z->homing = false;
    z->command_steps = sim_leadshine_position_steps(z, t_ns);
}

void sim_leadshine_raise(struct sim_leadshine *z, int alarm, int64_t t_ns)
{
    halt(z, t_ns);
    z->alarm = alarm;
}

void sim_leadshine_power_cycle(struct sim_leadshine *z, int64_t t_ns)
{
    const struct sim_leadshine_spec spec = {.steps_per_unit = z->steps_per_unit,
                                            .home_speed = z->home_speed,
                                            .home_acceleration = z->home_acceleration,
                                            .start_s = (double)z->start_ns * 1e-9};
    halt(z, t_ns);
    sim_leadshine_init(z, z->world, z->axis, &spec);
    z->origin = motion_at(motor(z), t_ns).motor;
    z->command_steps = 0;
}

// Notices that homing is over.
static void update(struct sim_leadshine *z, int64_t t_ns)
{
    const struct motion_state s = motion_at(motor(z), t_ns);
    if (!z->homing || s.moving || t_ns < motor(z)->start_ns)
        return;
    z->homing = false;
    z->homed = true;
    z->origin = HOME;
    z->command_steps = 0;
}

static bool is_running(const struct sim_leadshine *z, int64_t t_ns)
{
    return motion_at(motor(z), t_ns).moving || t_ns < motor(z)->start_ns;
}

// --- motion --------------------------------------------------------------------------------------

static double units_per_s(const struct sim_leadshine *z, double rpm)
{
    return rpm * z->pulses_per_turn / 60 / z->steps_per_unit;
}

static double units_per_s2(const struct sim_leadshine *z, double ms)
{
    return units_per_s(z, RPM_PER_RATE) / (fmax(ms, 1) * 1e-3);
}

static void drive(struct sim_leadshine *z, double target, double speed, double up, double down,
                  int64_t t_ns)
{
    world_see(z->world, t_ns);
    const bool at_rest = !motion_at(motor(z), t_ns).moving;
    motion_go(motor(z), target, speed, up, down, at_rest ? t_ns + z->start_ns : t_ns);
    z->moves++;
}

static void run_path(struct sim_leadshine *z, int64_t t_ns)
{
    const int32_t to = (int32_t)((uint32_t)z->path[TO_HIGH] << 16 | z->path[TO_LOW]);
    const double speed = units_per_s(z, fabs((double)(int16_t)z->path[SPEED]));
    const bool can = z->path[MODE] == ABSOLUTE || z->path[MODE] == RELATIVE;
    if (!can || speed == 0 || z->alarm || !z->enabled || z->homing) {
        z->ignored++;
        return;
    }
    z->command_steps = to + (z->path[MODE] == RELATIVE ? z->command_steps : 0);
    drive(z, z->origin + z->command_steps / z->steps_per_unit, speed, units_per_s2(z, z->path[UP]),
          units_per_s2(z, z->path[DOWN]), t_ns);
}

static void go_home(struct sim_leadshine *z, int64_t t_ns)
{
    if (z->alarm || !z->enabled) {
        z->ignored++;
        return;
    }
    drive(z, HOME, z->home_speed, z->home_acceleration, z->home_acceleration, t_ns);
    z->homing = true;
    z->homed = false;
}

static void quick_stop(struct sim_leadshine *z, int64_t t_ns)
{
    world_see(z->world, t_ns);
    motion_stop(motor(z), units_per_s2(z, STOP_MS), t_ns);
    z->homing = false;
    const double rest_s = motion_left_s(motor(z), t_ns);
    z->command_steps = sim_leadshine_position_steps(z, t_ns + (int64_t)(rest_s * 1e9) + 1);
}

static void set_zero(struct sim_leadshine *z, int64_t t_ns)
{
    z->origin = motion_at(motor(z), t_ns).motor;
    z->command_steps = 0;
    z->homed = true;
}

static void control(struct sim_leadshine *z, uint16_t value, int64_t t_ns)
{
    switch (value) {
    case START_PATH: run_path(z, t_ns); break;
    case GO_HOME: go_home(z, t_ns); break;
    case QUICK_STOP: quick_stop(z, t_ns); break;
    case SET_ZERO: set_zero(z, t_ns); break;
    default: break;
    }
}

// --- reading -------------------------------------------------------------------------------------

static uint16_t status(const struct sim_leadshine *z, int64_t t_ns)
{
    const bool running = is_running(z, t_ns);
    uint16_t bits = z->alarm ? FAULT : 0;
    bits |= z->enabled && !z->alarm ? ENABLED : 0;
    bits |= running ? RUNNING : COMMAND_DONE | PATH_DONE;
    bits |= z->homed ? HOME_DONE : 0;
    return bits;
}

// A parameter by its even address; false: there is none.
static bool parameter(const struct sim_leadshine *z, int address, int64_t t_ns, int32_t *ret)
{
    const struct motion_state s = motion_at(motor(z), t_ns);
    const bool at_target = !is_running(z, t_ns) && !s.limit;
    switch (address) {
    case PULSES & ~1: *ret = z->pulses_per_turn; break;
    case ENABLE & ~1: *ret = z->enabled; break;
    case STATUS & ~1: *ret = status(z, t_ns); break;
    case WORD & ~1: *ret = 0; break;
    case ALARM & ~1: *ret = z->alarm; break;
    case COMMAND: *ret = at_target ? z->command_steps : steps(z, s.motor); break;
    case MOTOR: *ret = steps(z, s.motor); break;
    default: return false;
    }
    return true;
}

static bool word(const struct sim_leadshine *z, int address, int64_t t_ns, uint16_t *ret)
{
    int32_t v;
    if (address >= PATH && address < PATH_CONTROL) {
        *ret = z->path[address - PATH];
    } else if (address == CONTROL || address == PATH_CONTROL) {
        *ret = is_running(z, t_ns) ? RUNNING_STATE : 0;
    } else {
        if (!parameter(z, address & ~1, t_ns, &v))
            return false;
        *ret = address & 1 ? (uint16_t)v : (uint16_t)((uint32_t)v >> 16);
    }
    return true;
}

int sim_leadshine_read(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns)
{
    struct sim_leadshine *z = ctx;
    update(z, t_ns);
    for (int i = 0; i < count; i++)
        if (!word(z, address + i, t_ns, &ret_registers[i]))
            return MODBUS_BAD_ADDRESS;
    return 0;
}

// --- writing -------------------------------------------------------------------------------------

// The exception that a value gives; 0: it is taken. Other paths than 0 are not here.
static int objection(const struct sim_leadshine *z, int address, uint16_t value, int64_t t_ns)
{
    switch (address) {
    case ENABLE: return value > 1 ? MODBUS_BAD_VALUE : 0;
    case WORD:
        if (value != RESET_WORD && value != STORE_WORD)
            return MODBUS_BAD_VALUE;
        return value == STORE_WORD && is_running(z, t_ns) ? MODBUS_FAILURE : 0;
    case CONTROL:
    case PATH_CONTROL:
        if (value == SET_ZERO)
            return is_running(z, t_ns) ? MODBUS_FAILURE : 0;
        return value == 0 || value == START_PATH || value == GO_HOME || value == QUICK_STOP
                   ? 0
                   : MODBUS_BAD_VALUE;
    default: return address >= PATH && address < PATH_CONTROL ? 0 : MODBUS_BAD_ADDRESS;
    }
}

static void write_register(struct sim_leadshine *z, int address, uint16_t value, int64_t t_ns)
{
    switch (address) {
    case ENABLE:
        if (!value && z->enabled)
            halt(z, t_ns);
        z->enabled = value;
        break;
    case WORD:
        if (value == RESET_WORD)
            z->alarm = 0;
        else
            z->busy_until_ns = t_ns + STORE_NS;
        break;
    case CONTROL:
    case PATH_CONTROL: control(z, value, t_ns); break;
    default: z->path[address - PATH] = value; break;
    }
}

int sim_leadshine_write(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns)
{
    struct sim_leadshine *z = ctx;
    update(z, t_ns);
    for (int i = 0; i < count; i++) {
        const int exception = objection(z, address + i, registers[i], t_ns);
        if (exception)
            return exception;
    }
    if (t_ns < z->busy_until_ns)
        return MODBUS_BUSY;
    for (int i = 0; i < count; i++)
        write_register(z, address + i, registers[i], t_ns);
    return 0;
}
