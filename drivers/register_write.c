// SPDX-License-Identifier: MIT
#include "drivers/register_write.h"

#include "drivers/registers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- what is set ---------------------------------------------------------------------------------

static int take(void *ctx, int value, double number, const char *text, struct gon_error *err)
{
    struct register_write *t = ctx;
    if (text)
        return gon_fail(err, GON_E_INPUT, "'%s' cannot be in registers", text);
    if (t->items == PROFILE_ITEMS)
        return gon_fail(err, GON_E_INPUT, "sets more than %d values", PROFILE_ITEMS);
    t->item[t->items].value = value;
    t->item[t->items++].number = number;
    return 0;
}

// A name alone: as it is known.
static int take_known(const struct profile *p, const char *name, const struct profile_data *d,
                      struct register_write *t, struct gon_error *err)
{
    const int value = profile_value(p, name);
    if (value < 0)
        return gon_fail(err, GON_E_INPUT, "there is no value '%s'", name);
    if (!d || !d->known[value])
        return gon_fail(err, GON_E_INPUT, "%s is not known and cannot be set", name);
    return take(t, value, d->number[value], NULL, err);
}

static int collect(const struct profile *p, const struct profile_write *w,
                   const struct profile_param *params, const struct profile_data *d,
                   struct register_write *t, struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; i < w->set_count && rc == 0; i++)
        rc = strchr(w->set[i], '=') ? profile_assign(p, w->set[i], params, take, t, err)
                                    : take_known(p, w->set[i], d, t, err);
    if (rc == 0 && t->items == 0)
        return gon_fail(err, GON_E_INPUT, "sets nothing");
    return rc;
}

// --- where it goes -------------------------------------------------------------------------------

static void sort_by_address(const struct profile *p, struct register_write *t)
{
    for (int i = 1; i < t->items; i++)
        for (int j = i;
             j > 0 && p->values[t->item[j].value].address < p->values[t->item[j - 1].value].address;
             j--) {
            const int value = t->item[j].value;
            const double number = t->item[j].number;
            t->item[j] = t->item[j - 1];
            t->item[j - 1].value = value;
            t->item[j - 1].number = number;
        }
}

static int place(const struct profile *p, struct register_write *t, int item, struct gon_error *err)
{
    const struct profile_value *v = &p->values[t->item[item].value];
    int address;
    double wire;
    if (v->access == PROFILE_READ || v->table == PROFILE_INPUT || v->table == PROFILE_DISCRETE)
        return gon_fail(err, GON_E_INPUT, "%s can only be read", v->name);
    int rc = registers_address(p, v, &address, err);
    if (rc == 0)
        rc = profile_wire(v, t->item[item].number, &wire, err);
    if (rc < 0)
        return rc;
    if (item == 0) {
        t->table = v->table;
        t->address = address;
    }
    if (v->table != t->table || address != t->address + t->count)
        return gon_fail(err, GON_E_INPUT,
                        "%s does not follow the registers before it: one write has no gaps",
                        v->name);
    rc = registers_put(p, v, wire, t->registers + t->count, err);
    t->count += registers_count(v);
    return rc;
}

static int place_all(const struct profile *p, struct register_write *t, struct gon_error *err)
{
    int rc = 0;
    sort_by_address(p, t);
    for (int i = 0; i < t->items && rc == 0; i++)
        rc = place(p, t, i, err);
    return rc;
}

int register_write_set(const struct profile *p, const struct profile_write *w,
                       const struct profile_param *params, const struct profile_data *d,
                       struct register_write *ret_write, struct gon_error *err)
{
    struct register_write t = {0};
    int rc = collect(p, w, params, d, &t, err);
    if (rc == 0)
        rc = place_all(p, &t, err);
    if (rc == 0)
        *ret_write = t;
    return rc;
}

int register_write_one(const struct profile *p, int value, double number,
                       struct register_write *ret_write, struct gon_error *err)
{
    struct register_write t = {.items = 1, .item = {{value, number}}};
    int rc = place_all(p, &t, err);
    if (rc == 0)
        *ret_write = t;
    return rc;
}

int register_write_edge(const struct profile *p, const struct profile_write *w, int *ret_value,
                        double *ret_number, struct gon_error *err)
{
    char name[PROFILE_TEXT];
    snprintf(name, sizeof name, "%s", w->edge);
    char *dot = strchr(name, '.');
    if (dot)
        *dot++ = 0;
    const int value = profile_value(p, name);
    for (int i = 0; dot && value >= 0 && i < p->values[value].bits_count; i++) {
        const struct profile_bit *bit = &p->values[value].bits[i];
        if (strcmp(bit->name, dot) == 0) {
            *ret_value = value;
            *ret_number = ldexp(1, bit->bit);
            return 0;
        }
    }
    return gon_fail(err, GON_E_INPUT, "edge \"%s\" names no bit: VALUE.BIT", w->edge);
}
