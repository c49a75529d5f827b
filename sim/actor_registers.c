// SPDX-License-Identifier: MIT
#include "sim/actor_registers.h"
#include "sim/actor_rule.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const struct profile *the(const struct actor *a)
{
    return a->now.profile;
}

// --- where values are ----------------------------------------------------------------------------

struct cell {
    int value, word; // the how manieth register of it
};

static int words(const struct profile_value *v)
{
    bool bit = v->table == PROFILE_COIL || v->table == PROFILE_DISCRETE;
    return !bit && v->format >= PROFILE_U32 ? 2 : 1;
}

static int first_of(const struct actor *a, const struct profile_value *v)
{
    static const int first[] = {[PROFILE_HOLDING] = 40001,
                                [PROFILE_INPUT] = 30001,
                                [PROFILE_COIL] = 1,
                                [PROFILE_DISCRETE] = 10001,
                                [PROFILE_NO_TABLE] = 0};
    int base = the(a)->registers.base;
    return (int)v->address - (base > 10000 ? first[v->table] : base);
}

// Where two values lie in one register the one counts that can be read, or written.
static bool find(const struct actor *a, int table, int address, int wanted, struct cell *ret)
{
    bool found = false;
    for (int i = 0; i < the(a)->values_count; i++) {
        const struct profile_value *v = &the(a)->values[i];
        int word = address - first_of(a, v);
        bool fits = v->access == wanted || v->access == PROFILE_READ_WRITE;
        if (v->table != table || word < 0 || word >= words(v) || (found && !fits))
            continue;
        *ret = (struct cell){i, word};
        if (fits)
            return true;
        found = true;
    }
    return found;
}

static bool bridged(const struct actor *a, int table, int address)
{
    struct cell c;
    int most = the(a)->registers.gap_most, below = 1, above = 1;
    while (below <= most && !find(a, table, address - below, PROFILE_READ, &c))
        below++;
    while (above <= most && !find(a, table, address + above, PROFILE_READ, &c))
        above++;
    return below + above - 1 <= most;
}

// --- encoding ------------------------------------------------------------------------------------

static bool low_first(const struct profile *p, const struct profile_value *v)
{
    int order = v->word_order > 0 ? v->word_order - 1 : p->registers.word_order;
    return order == PROFILE_LOW_FIRST;
}

// The register that holds the upper half of a value of two is its first or its second one.
static bool is_upper(const struct profile *p, const struct profile_value *v, int word)
{
    return words(v) == 2 && (word == 0) != low_first(p, v);
}

static uint16_t turned(const struct profile *p, uint16_t r)
{
    return p->registers.byte_order == PROFILE_LOW_FIRST ? (uint16_t)(r << 8 | r >> 8) : r;
}

static uint32_t encoded(const struct profile_value *v, double wire)
{
    float real = (float)wire;
    uint32_t bits;
    if (v->format != PROFILE_F32)
        return isfinite(wire) && fabs(wire) < 1e15 ? (uint32_t)llround(wire) : 0;
    memcpy(&bits, &real, sizeof bits);
    return bits;
}

static double decoded(const struct profile_value *v, uint32_t bits)
{
    float real;
    memcpy(&real, &bits, sizeof real);
    switch (v->format) {
    case PROFILE_S16: return (int16_t)bits;
    case PROFILE_S32: return (int32_t)bits;
    case PROFILE_F32: return (double)real;
    default: return bits;
    }
}

static uint16_t encode(const struct actor_values *now, struct cell c)
{
    const struct profile_value *v = &now->profile->values[c.value];
    uint32_t bits = encoded(v, actor_values_wire(now, c.value));
    return turned(now->profile, (uint16_t)(is_upper(now->profile, v, c.word) ? bits >> 16 : bits));
}

static double decode(const struct profile *p, const struct profile_value *v, const uint16_t *r)
{
    uint32_t bits = turned(p, r[0]);
    if (words(v) == 2) {
        uint32_t second = turned(p, r[1]);
        bits = is_upper(p, v, 0) ? bits << 16 | second : second << 16 | bits;
    }
    return decoded(v, bits);
}

// --- reading -------------------------------------------------------------------------------------

static int read_table(struct actor *a, int table, int address, int count, uint16_t *ret,
                      int64_t t_ns)
{
    actor_meet(a, t_ns);
    for (int i = 0; i < count; i++) {
        struct cell c;
        if (find(a, table, address + i, PROFILE_READ, &c))
            ret[i] = encode(&a->now, c);
        else if (bridged(a, table, address + i))
            ret[i] = 0;
        else
            return MODBUS_BAD_ADDRESS;
    }
    return 0;
}

static int read_holding(void *ctx, int address, int count, uint16_t *ret, int64_t t_ns)
{
    return read_table(ctx, PROFILE_HOLDING, address, count, ret, t_ns);
}

static int read_other(void *ctx, enum sim_modbus_table table, int address, int count, uint16_t *ret,
                      int64_t t_ns)
{
    static const int tables[] = {[MODBUS_INPUTS] = PROFILE_INPUT,
                                 [MODBUS_COILS] = PROFILE_COIL,
                                 [MODBUS_DISCRETES] = PROFILE_DISCRETE};
    return read_table(ctx, tables[table], address, count, ret, t_ns);
}

// --- writing -------------------------------------------------------------------------------------

struct written {
    struct actor_values now; // with what was written
    bool value[PROFILE_VALUES];
};

// The widest value that begins here and is written as a whole.
static bool whole(const struct actor *a, int table, int address, int left, int *ret_value)
{
    int best = 0;
    for (int i = 0; i < the(a)->values_count; i++) {
        const struct profile_value *v = &the(a)->values[i];
        if (v->table != table || v->access == PROFILE_READ || first_of(a, v) != address ||
            words(v) > left || words(v) <= best)
            continue;
        best = words(v);
        *ret_value = i;
    }
    return best > 0;
}

static bool shared(const struct profile_value *a, const struct profile_value *b)
{
    return strcmp(a->shares, b->name) == 0 || strcmp(b->shares, a->name) == 0;
}

// What else lies in these registers, and is meant to, changes with them.
static void share(const struct actor *a, int value, int address, const uint16_t *r,
                  struct written *w)
{
    const struct profile_value *v = &the(a)->values[value];
    for (int i = 0; i < the(a)->values_count; i++) {
        const struct profile_value *other = &the(a)->values[i];
        uint16_t own[2];
        bool touched = false;
        if (other->table != v->table || !shared(v, other))
            continue;
        for (int k = 0; k < words(other); k++) {
            int at = first_of(a, other) + k - address;
            bool here = at >= 0 && at < words(v);
            own[k] = here ? r[at] : encode(&w->now, (struct cell){i, k});
            touched = touched || here;
        }
        if (touched && actor_values_take(&w->now, i, decode(the(a), other, own)))
            w->value[i] = true;
    }
}

static int take(const struct actor *a, int table, int address, int count, const uint16_t *r,
                struct written *ret)
{
    for (int i = 0; i < count;) {
        struct cell c;
        int value = 0;
        if (!find(a, table, address + i, PROFILE_WRITE, &c) ||
            the(a)->values[c.value].access == PROFILE_READ)
            return MODBUS_BAD_ADDRESS;
        if (!whole(a, table, address + i, count - i, &value))
            return MODBUS_BAD_VALUE;
        const struct profile_value *v = &the(a)->values[value];
        if (!actor_values_take(&ret->now, value, decode(the(a), v, r + i)))
            return MODBUS_BAD_VALUE;
        ret->value[value] = true;
        share(a, value, address + i, r + i, ret);
        i += words(v);
    }
    return 0;
}

static bool rises(const struct actor *a, const struct written *w, const char *edge)
{
    int value, bit;
    return *edge && actor_values_part(&w->now, edge, &value, &bit) && w->value[value] &&
           actor_values_bit(&a->now, value, bit) == 0 && actor_values_bit(&w->now, value, bit) != 0;
}

static bool is_this(const struct actor *a, const struct written *w, const struct profile_write *p)
{
    for (int i = 0; i < p->set_count; i++) {
        int value;
        bool fits;
        if (!actor_item(&w->now, p->set[i], &value, &fits) || !fits || !w->value[value])
            return false;
    }
    return p->set_count > 0 || rises(a, w, p->edge);
}

static int write_table(struct actor *a, int table, int address, int count, const uint16_t *r,
                       int64_t t_ns)
{
    const struct profile *p = the(a);
    bool done[PROFILE_WRITES];
    actor_meet(a, t_ns);
    struct written w = {.now = a->now};
    int exception = take(a, table, address, count, r, &w);
    const struct profile_deny *deny = NULL;
    for (int i = 0; i < p->writes_count && !exception; i++) {
        done[i] = is_this(a, &w, &p->writes[i]);
        if (done[i] && !deny)
            deny = actor_denies(&w.now, p->writes[i].name);
    }
    if (deny) {
        exception = *deny->answer ? atoi(deny->answer) : MODBUS_FAILURE;
        actor_do(a, deny->then);
    }
    a->commands++;
    a->refused += exception != 0;
    if (exception)
        return exception;
    a->now = w.now;
    for (int i = 0; i < p->writes_count; i++)
        if (done[i])
            actor_do(a, p->writes[i].then);
    actor_meet(a, t_ns);
    return 0;
}

static int write_holding(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns)
{
    return write_table(ctx, PROFILE_HOLDING, address, count, registers, t_ns);
}

static int write_coils(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    return write_table(ctx, PROFILE_COIL, address, count, values, t_ns);
}

struct sim_modbus_unit actor_registers_unit(struct actor *actor, int id)
{
    static const struct sim_modbus_tables tables = {read_other, write_coils};
    return (struct sim_modbus_unit){
        .id = id, .read = read_holding, .write = write_holding, .ctx = actor, .tables = &tables};
}
