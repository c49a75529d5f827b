// SPDX-License-Identifier: MIT
#include "drivers/registers.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { LAST_ADDRESS = 0xffff, MODICON = 30001 };

bool registers_is_bit(const struct profile_value *v)
{
    return v->table == PROFILE_COIL || v->table == PROFILE_DISCRETE;
}

int registers_count(const struct profile_value *v)
{
    return registers_is_bit(v) || v->format == PROFILE_U16 || v->format == PROFILE_S16 ? 1 : 2;
}

// --- where ---------------------------------------------------------------------------------------

// Manuals that count from 40001 number the four tables apart.
static long base_of(const struct profile *p, int table)
{
    if (p->registers.base < MODICON)
        return p->registers.base;
    switch (table) {
    case PROFILE_HOLDING: return 40001;
    case PROFILE_INPUT: return 30001;
    case PROFILE_DISCRETE: return 10001;
    default: return 1;
    }
}

int registers_address(const struct profile *p, const struct profile_value *v, int *ret_address,
                      struct gon_error *err)
{
    const long address = (long)v->address - base_of(p, v->table);
    if (v->table == PROFILE_NO_TABLE)
        return gon_fail(err, GON_E_INPUT, "%s: has no register", v->name);
    if (v->type == PROFILE_STRING)
        return gon_fail(err, GON_E_INPUT, "%s: a text cannot be in registers", v->name);
    if (address < 0 || address + registers_count(v) - 1 > LAST_ADDRESS)
        return gon_fail(err, GON_E_INPUT,
                        "%s: address %ld is not in its table, which starts at %ld and has 65536",
                        v->name, (long)v->address, base_of(p, v->table));
    *ret_address = (int)address;
    return 0;
}

// --- what ----------------------------------------------------------------------------------------

static uint16_t turned(const struct profile *p, uint16_t r)
{
    return p->registers.byte_order == PROFILE_LOW_FIRST ? (uint16_t)(r << 8 | r >> 8) : r;
}

static bool is_low_first(const struct profile *p, const struct profile_value *v)
{
    const int order = v->word_order > 0 ? v->word_order - 1 : p->registers.word_order;
    return order == PROFILE_LOW_FIRST;
}

double registers_wire(const struct profile *p, const struct profile_value *v,
                      const uint16_t *registers)
{
    if (registers_is_bit(v))
        return registers[0] != 0;
    const uint16_t first = turned(p, registers[0]);
    if (registers_count(v) == 1)
        return v->format == PROFILE_S16 ? (double)(int16_t)first : (double)first;
    const uint16_t second = turned(p, registers[1]);
    const bool low_first = is_low_first(p, v);
    const uint32_t all =
        (uint32_t)(low_first ? second : first) << 16 | (low_first ? first : second);
    if (v->format == PROFILE_U32)
        return all;
    if (v->format == PROFILE_S32)
        return (int32_t)all;
    float f;
    memcpy(&f, &all, sizeof f);
    return isfinite(f) ? (double)f : (double)NAN;
}

struct range {
    double least, most;
};

static struct range range_of(const struct profile_value *v)
{
    if (registers_is_bit(v))
        return (struct range){0, 1};
    switch (v->format) {
    case PROFILE_U16: return (struct range){0, UINT16_MAX};
    case PROFILE_S16: return (struct range){INT16_MIN, INT16_MAX};
    case PROFILE_U32: return (struct range){0, UINT32_MAX};
    case PROFILE_S32: return (struct range){INT32_MIN, INT32_MAX};
    default: return (struct range){-(double)FLT_MAX, (double)FLT_MAX};
    }
}

static uint32_t bits_of(const struct profile_value *v, double wire)
{
    uint32_t bits;
    const float f = (float)wire;
    if (v->format != PROFILE_F32 || registers_is_bit(v))
        return (uint32_t)(int64_t)wire;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

int registers_put(const struct profile *p, const struct profile_value *v, double wire,
                  uint16_t *ret_registers, struct gon_error *err)
{
    const struct range range = range_of(v);
    const bool whole = registers_is_bit(v) || v->format != PROFILE_F32;
    wire = whole ? round(wire) : wire;
    if (!(wire >= range.least && wire <= range.most))
        return gon_fail(err, GON_E_INPUT,
                        "%s: %.10g does not fit its register; allowed: %.10g..%.10g", v->name, wire,
                        range.least, range.most);
    const uint32_t bits = bits_of(v, wire);
    const uint16_t high = (uint16_t)(bits >> 16), low = (uint16_t)bits;
    const bool low_first = is_low_first(p, v);
    if (registers_is_bit(v)) {
        ret_registers[0] = low;
    } else if (registers_count(v) == 1) {
        ret_registers[0] = turned(p, low);
    } else {
        ret_registers[0] = turned(p, low_first ? low : high);
        ret_registers[1] = turned(p, low_first ? high : low);
    }
    return 0;
}
