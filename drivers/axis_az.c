// SPDX-License-Identifier: MIT
// Registers of the Oriental Motor AZ series (HM-60252J, HM-60262E as cited by public drivers; [S]
// seen in such a source, [M] general knowledge, to be checked against the manual). 32-bit values:
// upper word at the lower address, both words in one transaction.
#include "drivers/axis.h"

#include "drivers/bus.h"

#include <stdbool.h>
#include <stdlib.h>

enum {
    DIRECT = 0x0058,   // direct data operation, 8 values; writing trigger 1 with them starts it [S]
    COMMAND = 0x007c,  // driver input command, in the lower word: bits act on 0 -> 1 [S]
    COMMAND_LOW = 0x007d,
    OUTPUT = 0x007e,   // driver output status (lower word), then 0080 present alarm [S]
    OUTPUT_COUNT = 4,
    POSITION = 0x00c6, // command position [M], speeds, then 00CC detected position [S]
    POSITION_COUNT = 8, // not 4: a stale answer to the other poll must not fit
    ALARM_RESET = 0x0180 // acts on 0 -> 1 [S]
};

enum { ZHOME = 1 << 4, STOP = 1 << 5 }; // of COMMAND, default assignment [S]
enum {
    HOME_END = 1 << 4 /* [M] */,
    READY = 1 << 5,
    ALM_A = 1 << 7,
    MOVE = 1 << 13,
    IN_POS = 1 << 14
};

enum { ABSOLUTE = 1, FULL_CURRENT = 1000, START = 1 };
enum { SPEED_MOST = 4000000, ACCELERATION_MOST = 1000000000 };
enum { TRIES = 3, ALARM_MOST = 0xff };

struct az {
    struct axis axis; // first
    struct bus *bus;
    int unit;
    bool edge_left;  // a command bit may still be set: the next one would have no edge
    bool reset_left; // the same for the alarm reset
    bool moved;      // target was acknowledged
    int32_t target;
};

static struct az *az_of(struct axis *a)
{
    return (struct az *)a;
}

static int32_t pair(const uint16_t *r)
{
    return (int32_t)((uint32_t)r[0] << 16 | r[1]);
}

static void put_pair(uint16_t *r, int32_t value)
{
    r[0] = (uint16_t)((uint32_t)value >> 16);
    r[1] = (uint16_t)value;
}

// --- reading -------------------------------------------------------------------------------------

// While it moves, the command position is where its profile is, not where it leads: then the target
// is that of the last move that was acknowledged.
static void decode(const struct az *z, const uint16_t *output, const uint16_t *position,
                   struct axis_status *s)
{
    const unsigned bits = output[1];
    *s = (struct axis_status){
        .position_steps = pair(position + 6),
        .target_steps = pair(position),
        .moving = bits & MOVE,
        .in_position = bits & IN_POS,
        .ready = bits & READY,
        .homed = bits & HOME_END,
        .alarm = bits & ALM_A,
        .alarm_code = pair(output + 2),
    };
    s->alarm = s->alarm || s->alarm_code != 0;
    if (s->moving && z->moved)
        s->target_steps = z->target;
}

static int status(struct axis *a, struct axis_status *ret_status, struct gon_error *err)
{
    struct az *z = az_of(a);
    uint16_t output[OUTPUT_COUNT], position[POSITION_COUNT];
    int rc = bus_read(z->bus, z->unit, OUTPUT, OUTPUT_COUNT, output, err);
    if (rc == 0)
        rc = bus_read(z->bus, z->unit, POSITION, POSITION_COUNT, position, err);
    if (rc == 0)
        decode(z, output, position, ret_status);
    return rc;
}

// --- commands ------------------------------------------------------------------------------------

// What must arrive and may be repeated: clearing a bit is harmless.
static int write_until_done(const struct az *z, int address, int count, const uint16_t *registers,
                            struct gon_error *err)
{
    int rc = GON_E_LINK;
    for (int i = 0; i < TRIES && rc == GON_E_LINK; i++)
        rc = bus_write(z->bus, z->unit, address, count, registers, err);
    return rc;
}

// Setting takes two registers and clearing one, so that neither's late echo fits the other.
static int clear_command(struct az *z, struct gon_error *err)
{
    int rc = write_until_done(z, COMMAND_LOW, 1, &(uint16_t){0}, err);
    z->edge_left = rc < 0;
    return rc;
}

// Sets the bit and takes it back, also when setting it failed: it may have arrived.
static int command(struct az *z, uint16_t bit, int tries, struct gon_error *err)
{
    int rc = z->edge_left ? clear_command(z, err) : 0;
    if (rc < 0)
        return rc;
    do {
        z->edge_left = true;
        rc = bus_write(z->bus, z->unit, COMMAND, 2, (const uint16_t[]){0, bit}, err);
        int cleared = clear_command(z, rc < 0 ? NULL : err);
        rc = rc < 0 ? rc : cleared;
    } while (rc == GON_E_LINK && --tries > 0);
    return rc;
}

static int move_abs(struct axis *a, int32_t position_steps, int32_t speed_steps_per_s,
                    int32_t acceleration_steps_per_s2, struct gon_error *err)
{
    struct az *z = az_of(a);
    if (speed_steps_per_s < 1 || speed_steps_per_s > SPEED_MOST || acceleration_steps_per_s2 < 1 ||
        acceleration_steps_per_s2 > ACCELERATION_MOST)
        return gon_fail(
            err, GON_E_INPUT,
            "unit %d: %ld steps/s, %ld steps/s2; allowed: 1..%d steps/s, 1..%d steps/s2", z->unit,
            (long)speed_steps_per_s, (long)acceleration_steps_per_s2, SPEED_MOST,
            ACCELERATION_MOST);
    // Rates are in 0.001 kHz/s [M], which is 1 step/s2.
    const int32_t rate = acceleration_steps_per_s2;
    const int32_t fields[] = {0,    ABSOLUTE, position_steps, speed_steps_per_s,
                              rate, rate,     FULL_CURRENT,   START};
    enum { FIELDS = sizeof fields / sizeof fields[0] };
    uint16_t registers[2 * FIELDS];
    for (int i = 0; i < FIELDS; i++)
        put_pair(registers + 2 * i, fields[i]);
    z->moved = false;
    int rc = z->edge_left ? clear_command(z, err) : 0; // a STOP left set would forbid the move
    if (rc == 0)
        rc = bus_write(z->bus, z->unit, DIRECT, 2 * FIELDS, registers, err);
    if (rc < 0)
        return rc;
    z->moved = true;
    z->target = position_steps;
    return 0;
}

static int stop(struct axis *a, struct gon_error *err)
{
    az_of(a)->moved = false;
    return command(az_of(a), STOP, TRIES, err);
}

static int home(struct axis *a, struct gon_error *err)
{
    az_of(a)->moved = false;
    return command(az_of(a), ZHOME, 1, err);
}

static int write_reset(struct az *z, uint16_t value, struct gon_error *err)
{
    return write_until_done(z, ALARM_RESET, 2, (const uint16_t[]){0, value}, err);
}

static int reset_alarm(struct axis *a, struct gon_error *err)
{
    struct az *z = az_of(a);
    int rc = z->reset_left ? write_reset(z, 0, err) : 0;
    if (rc < 0)
        return rc;
    z->reset_left = true;
    rc = write_reset(z, 1, err);
    int cleared = write_reset(z, 0, rc < 0 ? NULL : err);
    z->reset_left = cleared < 0;
    return rc < 0 ? rc : cleared;
}

// The upper words are always 0 and alarms are one byte: another kind of unit hardly looks so.
static int identify(struct axis *a, struct gon_error *err)
{
    struct az *z = az_of(a);
    uint16_t output[OUTPUT_COUNT];
    struct axis_status s;
    int rc = bus_read(z->bus, z->unit, OUTPUT, OUTPUT_COUNT, output, err);
    if (rc < 0)
        return rc;
    if (output[0] != 0 || output[2] != 0 || output[3] > ALARM_MOST)
        return gon_fail(
            err, GON_E_DEVICE,
            "%s: unit %d does not look like an AZ driver (%04X %04X %04X %04X at 007Eh)",
            bus_link(z->bus), z->unit, output[0], output[1], output[2], output[3]);
    rc = status(a, &s, err);
    return rc < 0 ? rc : clear_command(z, err);
}

// --- alarms --------------------------------------------------------------------------------------

static const struct {
    int code;
    const char *text;
} alarms[] = { // [M]
    {0x10, "position deviation too large: blocked or overloaded"},
    {0x20, "overcurrent"},
    {0x21, "main circuit too hot"},
    {0x22, "overvoltage"},
    {0x23, "main power off"},
    {0x25, "undervoltage"},
    {0x26, "motor too hot"},
    {0x28, "encoder error"},
    {0x2a, "encoder communication error"},
    {0x30, "overload"},
    {0x31, "overspeed"},
    {0x33, "absolute position lost"},
    {0x34, "command pulse error"},
    {0x41, "EEPROM error"},
    {0x42, "encoder error at power-on"},
    {0x43, "motor turned at power-on"},
    {0x44, "encoder EEPROM error"},
    {0x45, "motor does not fit the driver"},
    {0x4a, "homing incomplete"},
    {0x53, "HWTO input circuit error"},
    {0x60, "both limit switches on"},
    {0x61, "limit switches exchanged"},
    {0x62, "homing failed"},
    {0x63, "no home switch found"},
    {0x64, "homing: TIM, ZSG or SLIT not found"},
    {0x66, "limit switch reached"},
    {0x67, "software limit reached"},
    {0x68, "HWTO input off"},
    {0x6a, "homing offset failed"},
    {0x6d, "mechanical end reached"},
    {0x70, "operation data out of range"},
    {0x71, "electronic gear out of range"},
    {0x72, "wrap setting out of range"},
    {0x81, "network error"},
    {0x84, "RS-485 communication error"},
    {0x85, "RS-485 communication timeout"},
    {0xf0, "CPU error"},
};

static const char *alarm_text(int code)
{
    for (size_t i = 0; i < sizeof alarms / sizeof alarms[0]; i++)
        if (alarms[i].code == code)
            return alarms[i].text;
    return code ? "not in the list of alarms" : "no alarm";
}

static const struct link_stats *az_stats(const struct axis *a)
{
    return bus_stats(((const struct az *)a)->bus);
}

static void az_free(struct axis *a)
{
    free(a);
}

struct axis *axis_az_new(struct bus *bus, int unit)
{
    static const struct axis_ops ops = {identify,    status,     move_abs, stop,   home,
                                        reset_alarm, alarm_text, az_stats, az_free};
    struct az *z = calloc(1, sizeof *z);
    if (!z)
        return NULL;
    *z = (struct az){
        .axis = {&ops}, .bus = bus, .unit = unit, .edge_left = true, .reset_left = true};
    return &z->axis;
}
