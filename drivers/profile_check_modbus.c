// SPDX-License-Identifier: MIT
#include "drivers/profile_check_inside.h"
#include "drivers/registers.h"

#include <string.h>

static void check_no_messages(struct checking *c)
{
    const struct profile *p = c->p;
    if (p->exchanges_count)
        check_says(c, check_at("exchanges"), "a Modbus instrument has writes instead of exchanges");
    if (p->refusals_count)
        check_says(c, check_at("refusals"), "a Modbus instrument refuses by exception answers");
    if (*p->errors.ask)
        check_says(c, check_at("errors.ask"), "only for message instruments");
    if (*p->framing.end_out || *p->framing.end_in)
        check_says(c, check_at("framing"), "only for message instruments");
    if (p->checksum.kind != PROFILE_NO_SUM)
        check_says(c, check_at("checksum"), "Modbus has its own");
}

// --- values --------------------------------------------------------------------------------------

static bool is_read_only(const struct profile_value *v)
{
    return v->table == PROFILE_INPUT || v->table == PROFILE_DISCRETE;
}

static bool lies(const struct profile *p, const struct profile_value *v, int *ret_address)
{
    return v->table != PROFILE_NO_TABLE && registers_address(p, v, ret_address, NULL) == 0;
}

// Read and written apart, in the same registers: a command and its status.
static bool are_two_sides(const struct profile_value *a, const struct profile_value *b)
{
    return (a->access == PROFILE_READ && b->access == PROFILE_WRITE) ||
           (a->access == PROFILE_WRITE && b->access == PROFILE_READ);
}

static bool is_meant(const struct profile_value *a, const struct profile_value *b)
{
    return strcmp(a->shares, b->name) == 0 || strcmp(b->shares, a->name) == 0;
}

static bool overlap(const struct profile *p, const struct profile_value *a,
                    const struct profile_value *b, int *ret_address)
{
    int at_a, at_b;
    if (a->table != b->table || !lies(p, a, &at_a) || !lies(p, b, &at_b))
        return false;
    *ret_address = at_a > at_b ? at_a : at_b;
    return at_a < at_b + registers_count(b) && at_b < at_a + registers_count(a);
}

static void check_overlap(struct checking *c, int i, const struct profile_value *v)
{
    for (int j = 0; j < i; j++) {
        const struct profile_value *other = &c->p->values[j];
        int address;
        if (overlap(c->p, v, other, &address) && !are_two_sides(v, other) && !is_meant(v, other))
            check_says(c, check_at("values[%d].address", i),
                       "overlaps %s at register %04Xh; if that is meant: shares = \"%s\"",
                       other->name, (unsigned)address, other->name);
    }
}

static void check_register(struct checking *c, int i)
{
    const struct profile_value *v = &c->p->values[i];
    struct gon_error err;
    int address;
    if (v->table == PROFILE_NO_TABLE)
        return;
    if (v->type == PROFILE_STRING)
        check_says(c, check_at("values[%d].type", i), "registers hold no texts");
    if (is_read_only(v) && v->access != PROFILE_READ)
        check_says(c, check_at("values[%d].access", i),
                   "input registers and discrete inputs are only read: \"r\"");
    if (registers_address(c->p, v, &address, &err) < 0)
        check_says(c, check_at("values[%d].address", i), "%s", err.text);
    check_overlap(c, i, v);
    if (check_value_name(c, check_at("values[%d].shares", i), v->shares) && *v->shares &&
        !overlap(c->p, v, &c->p->values[profile_value(c->p, v->shares)], &address))
        check_says(c, check_at("values[%d].shares", i), "does not lie there");
}

// --- writes --------------------------------------------------------------------------------------

static const struct profile_param move_params[] = {
    {"position", 0}, {"speed", 0}, {"acceleration", 0}, {NULL, 0}};

struct setting {
    const struct profile *p;
    bool sets[PROFILE_VALUES];
};

static int see_set(void *ctx, int value, double number, const char *text, struct gon_error *err)
{
    struct setting *s = ctx;
    const struct profile_value *v = &s->p->values[value];
    (void)number, (void)text;
    if (v->access == PROFILE_READ || v->table == PROFILE_NO_TABLE)
        return gon_fail(err, GON_E_INPUT, "%s is only read (access), or has no register", v->name);
    if (s->sets[value])
        return gon_fail(err, GON_E_INPUT, "%s is set twice", v->name);
    s->sets[value] = true;
    return 0;
}

// Assignments, or a name alone: what the value is by then.
static int see_item(struct setting *s, const char *item, const struct profile_param *params,
                    struct gon_error *err)
{
    const int value = profile_value(s->p, item);
    return value >= 0 ? see_set(s, value, 0, NULL, err)
                      : profile_assign(s->p, item, params, see_set, s, err);
}

// One transaction is one run of registers of one table.
static void check_transaction(struct checking *c, struct place at, const bool sets[PROFILE_VALUES])
{
    int first = 65536, last = -1, registers = 0, table = -1, address;
    for (int i = 0; i < c->p->values_count; i++) {
        const struct profile_value *v = &c->p->values[i];
        if (!sets[i] || !lies(c->p, v, &address))
            continue;
        const int count = registers_count(v);
        if (table >= 0 && table != v->table) {
            check_says(c, at, "%s is in another table; one transaction writes one", v->name);
            return;
        }
        table = v->table;
        first = address < first ? address : first;
        last = address + count - 1 > last ? address + count - 1 : last;
        registers += count;
    }
    if (last >= 0 && registers != last - first + 1)
        check_says(c, at, "%d registers in %04Xh..%04Xh; one transaction writes each of them once",
                   registers, (unsigned)first, (unsigned)last);
}

static void check_set(struct checking *c, int i, const struct profile_write *w)
{
    const bool moves = strcmp(w->name, c->p->axis.move) == 0;
    struct setting s = {.p = c->p};
    struct gon_error err;
    for (int k = 0; k < w->set_count; k++)
        if (see_item(&s, w->set[k], moves ? move_params : NULL, &err) < 0)
            check_says(c, check_at("writes[%d].set[%d]", i, k), "%s", err.text);
    check_transaction(c, check_at("writes[%d].set", i), s.sets);
    for (int v = 0; v < c->p->values_count; v++)
        if (w->readback && s.sets[v] && c->p->values[v].access == PROFILE_WRITE)
            check_says(c, check_at("writes[%d].readback", i), "%s is only written (access)",
                       c->p->values[v].name);
}

static void check_edge(struct checking *c, int i, const struct profile_write *w)
{
    bool uses[PROFILE_VALUES] = {false};
    struct gon_error err;
    if (!*w->edge)
        return;
    if (w->edge[strspn(w->edge,
                       "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.")] ||
        !strchr(w->edge, '.')) {
        check_says(c, check_at("writes[%d].edge", i), "not a bit: VALUE.NAME");
        return;
    }
    if (profile_when_check(c->p, w->edge, &err) < 0)
        check_says(c, check_at("writes[%d].edge", i), "%s", err.text);
    profile_when_uses(c->p, w->edge, uses);
    for (int v = 0; v < c->p->values_count; v++)
        if (uses[v] && c->p->values[v].access == PROFILE_READ)
            check_says(c, check_at("writes[%d].edge", i), "%s is only read (access)",
                       c->p->values[v].name);
}

static void check_write(struct checking *c, int i)
{
    const struct profile_write *w = &c->p->writes[i];
    check_new_name(c, "writes", i, c->p->writes[0].name, sizeof *w);
    if (!w->set_count == !*w->edge)
        check_says(c, check_at("writes[%d]", i), "what it sets, or the edge of a bit: one of both");
    check_set(c, i, w);
    check_edge(c, i, w);
    if (*w->release && !*w->edge)
        check_says(c, check_at("writes[%d].release", i), "only an edge is taken back");
    check_sent_name(c, check_at("writes[%d].release", i), w->release);
    check_condition(c, check_at("writes[%d].verify", i), w->verify);
    check_then(c, check_at("writes[%d].then", i), w->then);
}

void check_registers(struct checking *c)
{
    if (c->p->protocol != PROFILE_MODBUS)
        return;
    check_no_messages(c);
    for (int i = 0; i < c->p->values_count; i++)
        check_register(c, i);
    for (int i = 0; i < c->p->writes_count; i++)
        check_write(c, i);
}
