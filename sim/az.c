// SPDX-License-Identifier: MIT
#include "sim/az.h"
#include "sim/modbus.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define STORE_NS 200000000
#define HOME 0.0 // of the axis' own scale

enum { NUMBER, TYPE, POSITION, SPEED, START_RATE, STOP_RATE, CURRENT, TRIGGER, DESTINATION };
enum { M_BITS = 0x000f, ZHOME = 1 << 4, STOP = 1 << 5, FREE = 1 << 6, ALM_RST = 1 << 7 };
enum {
    HOME_END = 1 << 4,
    READY = 1 << 5,
    ALM_A = 1 << 7,
    SYS_BSY = 1 << 8,
    MOVE = 1 << 13,
    IN_POS = 1 << 14
};
enum {
    DIRECT = 0x0058,
    PULSE = 0x0078,
    INPUT = 0x007c,
    RESET = 0x0180,
    PRESET = 0x018a,
    CONFIGURE = 0x018c
};

static struct motion *motor(const struct sim_az *z)
{
    return &z->world->axis[z->axis];
}

void sim_az_init(struct sim_az *z, struct world *world, enum world_axis axis,
                 const struct sim_az_spec *spec)
{
    assert(spec->steps_per_unit > 0 && spec->home_speed > 0 && spec->home_acceleration > 0);
    memset(z, 0, sizeof *z);
    z->world = world;
    z->axis = axis;
    z->steps_per_unit = spec->steps_per_unit;
    z->home_speed = spec->home_speed;
    z->home_acceleration = spec->home_acceleration;
    z->start_ns = (int64_t)(spec->start_s * 1e9);
    z->homed = spec->homed;
    z->origin = spec->homed ? HOME : motion_at(motor(z), world->t_ns).motor;
    z->command_steps = sim_az_position_steps(z, world->t_ns);
    static const int32_t defaults[AZ_FIELDS] = {0, 2, 0, 1000, 1000000, 1000000, 1000, 0, 0};
    memcpy(z->field, defaults, sizeof z->field);
}

static int32_t steps(const struct sim_az *z, double at)
{
    return (int32_t)llround((at - z->origin) * z->steps_per_unit);
}

int32_t sim_az_position_steps(const struct sim_az *z, int64_t t_ns)
{
    return steps(z, motion_at(motor(z), t_ns).motor);
}

void sim_az_raise(struct sim_az *z, int alarm, int64_t t_ns)
{
    world_see(z->world, t_ns);
    motion_halt(motor(z), t_ns);
    z->alarm = alarm;
    z->homing = false;
    z->command_steps = sim_az_position_steps(z, t_ns);
}

void sim_az_power_cycle(struct sim_az *z, int64_t t_ns)
{
    struct sim_az_spec spec = {.steps_per_unit = z->steps_per_unit,
                               .home_speed = z->home_speed,
                               .home_acceleration = z->home_acceleration,
                               .start_s = (double)z->start_ns * 1e-9};
    world_see(z->world, t_ns);
    motion_halt(motor(z), t_ns);
    sim_az_init(z, z->world, z->axis, &spec);
    z->origin = motion_at(motor(z), t_ns).motor;
    z->command_steps = 0;
}

// Notices what happened since the last access: a limit was met, homing is over.
static void update(struct sim_az *z, int64_t t_ns)
{
    struct motion_state s = motion_at(motor(z), t_ns);
    if (s.limit && !z->alarm) {
        sim_az_raise(z, SIM_AZ_OVERTRAVEL, t_ns);
    } else if (z->homing && !s.moving && t_ns >= motor(z)->start_ns) {
        z->homing = false;
        z->homed = true;
        z->origin = HOME;
        z->command_steps = 0;
    }
}

// --- motion --------------------------------------------------------------------------------------

static bool may_move(const struct sim_az *z)
{
    return !z->alarm && !z->homing && !z->current_off && !(z->input & STOP);
}

// The motor follows start_ns after the command; until then a motor at rest stays at rest.
static void drive(struct sim_az *z, double target, double speed, double up, double down,
                  int64_t t_ns)
{
    world_see(z->world, t_ns);
    bool at_rest = !motion_at(motor(z), t_ns).moving;
    motion_go(motor(z), target, speed, up, down, at_rest ? t_ns + z->start_ns : t_ns);
}

static void operate(struct sim_az *z, int64_t t_ns)
{
    int64_t target = z->field[POSITION];
    if (z->field[TYPE] == 2)
        target += z->command_steps;
    else if (z->field[TYPE] == 3)
        target += sim_az_position_steps(z, t_ns);
    if (!may_move(z) || z->field[SPEED] == 0 || target != (int32_t)target) {
        z->ignored++;
        return;
    }
    double per = z->steps_per_unit;
    drive(z, z->origin + (double)target / per, fabs((double)z->field[SPEED]) / per,
          z->field[START_RATE] / per, z->field[STOP_RATE] / per, t_ns);
    z->command_steps = (int32_t)target;
    z->moves++;
}

static void stop(struct sim_az *z, int64_t t_ns)
{
    world_see(z->world, t_ns);
    // A return to home slows down at its own rate, not at that of the last direct operation.
    double down = z->homing ? z->home_acceleration : z->field[STOP_RATE] / z->steps_per_unit;
    motion_stop(motor(z), down, t_ns);
    z->homing = false;
    double rest_s = motion_left_s(motor(z), t_ns);
    z->command_steps = sim_az_position_steps(z, t_ns + (int64_t)(rest_s * 1e9) + 1);
}

static void home(struct sim_az *z, int64_t t_ns)
{
    if (!may_move(z)) {
        z->ignored++;
        return;
    }
    drive(z, HOME, z->home_speed, z->home_acceleration, z->home_acceleration, t_ns);
    z->homing = true;
    z->homed = false;
    z->moves++;
}

static void reset_alarm(struct sim_az *z)
{
    z->alarm = 0;
}

static void input(struct sim_az *z, uint16_t value, int64_t t_ns)
{
    uint16_t rising = (uint16_t)(value & ~z->input);
    z->input = value;
    if (rising & ALM_RST)
        reset_alarm(z);
    if (rising & STOP)
        stop(z, t_ns);
    if ((rising & FREE) && !z->current_off) {
        world_see(z->world, t_ns);
        motion_halt(motor(z), t_ns);
        z->homing = false;
        z->command_steps = sim_az_position_steps(z, t_ns);
    }
    z->current_off = value & FREE;
    if (rising & ZHOME)
        home(z, t_ns);
}

// --- reading -------------------------------------------------------------------------------------

static uint16_t status(const struct sim_az *z, int64_t t_ns)
{
    struct motion_state s = motion_at(motor(z), t_ns);
    bool moving = s.moving; // not yet while the driver has not begun
    bool busy = t_ns < z->busy_until_ns;
    uint16_t bits = z->input & M_BITS; // M0_R.. and START_R follow the inputs
    bits |= z->homed ? HOME_END : 0;
    bits |= z->alarm ? ALM_A : 0;
    bits |= busy ? SYS_BSY : 0;
    bits |= moving ? MOVE : 0;
    bits |= !moving && !z->alarm && !z->current_off ? IN_POS : 0;
    bits |= !moving && !busy && may_move(z) ? READY : 0;
    return bits;
}

// A readable 32-bit value by the address of its upper word; false: there is none.
static bool value(const struct sim_az *z, int address, int64_t t_ns, int32_t *ret)
{
    struct motion_state s = motion_at(motor(z), t_ns);
    double hz = s.speed * z->steps_per_unit;
    bool at_target = !s.moving && !s.limit && t_ns >= motor(z)->start_ns;
    if (address >= DIRECT && address < DIRECT + 2 * AZ_FIELDS) {
        *ret = z->field[(address - DIRECT) / 2];
        return true;
    }
    switch (address) {
    case PULSE: *ret = 0; break;
    case INPUT: *ret = z->input; break;
    case 0x007e: *ret = status(z, t_ns); break;
    case 0x0080: *ret = z->alarm; break;
    case 0x00c6:
    case 0x0122: *ret = at_target ? z->command_steps : steps(z, s.motor); break;
    case 0x00c8:
    case 0x00ca:
    case 0x00d0: *ret = (int32_t)llround(hz); break;
    case 0x00cc:
    case 0x0120: *ret = steps(z, s.motor); break;
    case 0x00ce: *ret = (int32_t)llround(hz * 60 / 1000); break; // 1000 steps a turn
    case 0x00d2:
    case 0x00d4: *ret = 0; break; // there, but what is in it was not found
    case RESET: *ret = z->last_reset; break;
    case PRESET: *ret = z->last_preset; break;
    case CONFIGURE: *ret = z->last_configure; break;
    default: return false;
    }
    return true;
}

int sim_az_read(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns)
{
    struct sim_az *z = ctx;
    update(z, t_ns);
    for (int i = 0; i < count; i++) {
        int32_t v;
        if (!value(z, (address + i) & ~1, t_ns, &v))
            return MODBUS_BAD_ADDRESS;
        ret_registers[i] = (address + i) & 1 ? (uint16_t)v : (uint16_t)((uint32_t)v >> 16);
    }
    return 0;
}

// --- writing -------------------------------------------------------------------------------------

static int32_t pair(const uint16_t *r)
{
    return (int32_t)((uint32_t)r[0] << 16 | r[1]);
}

static bool field_in_range(int field, int32_t v)
{
    switch (field) {
    case NUMBER: return v >= 0 && v <= 255;
    case TYPE: return v >= 1 && v <= 3; // of 0..22 without 4, 5, 6, 19
    case POSITION: return true;
    case SPEED: return v >= -4000000 && v <= 4000000;
    case START_RATE:
    case STOP_RATE: return v >= 1 && v <= 1000000000;
    case CURRENT: return v >= 0 && v <= 1000;
    case TRIGGER: return v >= -7 && v <= 1;
    case DESTINATION: return v == 0;
    default: return false;
    }
}

// Trigger -7..-1 starts when that one field is written: -7 the number, ... -1 the current.
static int write_direct(struct sim_az *z, int first, int fields, const uint16_t *r, int64_t t_ns)
{
    bool start = false;
    for (int i = 0; i < fields; i++)
        if (!field_in_range(first + i, pair(r + 2 * i)))
            return MODBUS_BAD_VALUE;
    for (int i = 0; i < fields; i++) {
        z->field[first + i] = pair(r + 2 * i);
        start |= first + i == TRIGGER && z->field[TRIGGER] == 1;
        start |= first + i == z->field[TRIGGER] + 7 && z->field[TRIGGER] < 0;
    }
    if (z->field[TRIGGER] > 0)
        z->field[TRIGGER] = 0;
    if (start)
        operate(z, t_ns);
    return 0;
}

// Commands that store something: not while moving, and busy for a while.
static int write_stored(struct sim_az *z, uint16_t *last, uint16_t v, bool preset, int64_t t_ns)
{
    bool rising = v == 1 && *last == 0;
    if (v > 1)
        return MODBUS_BAD_VALUE;
    if (rising && motion_at(motor(z), t_ns).moving)
        return MODBUS_FAILURE;
    *last = v;
    if (rising) {
        z->busy_until_ns = t_ns + STORE_NS;
        if (preset) {
            z->origin = motion_at(motor(z), t_ns).motor;
            z->command_steps = 0;
            z->homed = true;
        }
    }
    return 0;
}

static int write_value(struct sim_az *z, int address, uint16_t v, int64_t t_ns)
{
    switch (address) {
    case PULSE:
        input(z, (uint16_t)(z->input & ~v), t_ns);
        input(z, z->input | v, t_ns);
        input(z, (uint16_t)(z->input & ~v), t_ns);
        return 0;
    case INPUT: input(z, v, t_ns); return 0;
    case RESET:
        if (v > 1)
            return MODBUS_BAD_VALUE;
        if (v == 1 && z->last_reset == 0)
            reset_alarm(z);
        z->last_reset = v;
        return 0;
    case PRESET: return write_stored(z, &z->last_preset, v, true, t_ns);
    case CONFIGURE: return write_stored(z, &z->last_configure, v, false, t_ns);
    default: return MODBUS_BAD_ADDRESS;
    }
}

int sim_az_write(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns)
{
    struct sim_az *z = ctx;
    update(z, t_ns);
    int upper = address & ~1;
    if (address + count > DIRECT && address < DIRECT + 2 * AZ_FIELDS) {
        if (address < DIRECT || address + count > DIRECT + 2 * AZ_FIELDS)
            return MODBUS_BAD_ADDRESS;
        if (address != upper || count % 2)
            return MODBUS_BAD_VALUE; // half of a 32-bit value
        if (t_ns < z->busy_until_ns)
            return MODBUS_BUSY;
        return write_direct(z, (address - DIRECT) / 2, count / 2, registers, t_ns);
    }
    if (count == 1 && (address == INPUT + 1 || address == PULSE + 1))
        return write_value(z, upper, registers[0], t_ns);
    if (address != upper || count != 2)
        return count == 1 && address == upper ? MODBUS_BAD_VALUE : MODBUS_BAD_ADDRESS;
    if (registers[0] != 0)
        return MODBUS_BAD_VALUE;
    return write_value(z, upper, registers[1], t_ns);
}
