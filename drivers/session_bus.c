// SPDX-License-Identifier: MIT
// A session with one unit of a Modbus bus. Reads follow the block plan (blocks.h); writes are one
// transaction each (register_write.h) and sent once, unless the profile says that repeating does
// no harm.
#include "drivers/session_inside.h"

#include "drivers/blocks.h"
#include "drivers/bus.h"
#include "drivers/profile_when.h"
#include "drivers/register_write.h"
#include "drivers/registers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { TRIES = 3, REGISTERS_MOST = 125, BUSY = 6, ACKNOWLEDGE = 5 };

// Of a value with command bits. One that may be left set would leave the next without an edge.
enum edge { EDGE_UNKNOWN, EDGE_CLEAR, EDGE_LEFT };

struct bus_session {
    struct session session; // first
    struct bus *bus;
    int unit;
    char link[160];
    enum edge edge[PROFILE_VALUES];
};

static struct bus_session *bus_of(struct session *s)
{
    return (struct bus_session *)s;
}

static int note(struct bus_session *z, int rc)
{
    const int exception = bus_exception(z->bus);
    if (rc == GON_E_DEVICE)
        z->session.meaning =
            exception == BUSY || exception == ACKNOWLEDGE ? PROFILE_BUSY : PROFILE_REFUSED;
    return rc;
}

// --- asking --------------------------------------------------------------------------------------

static int decode(struct bus_session *z, const struct block_plan *plan, int block,
                  const uint16_t *registers, struct profile_data *d, struct gon_error *err)
{
    const struct profile *p = z->session.profile;
    for (int i = 0; i < plan->asks; i++) {
        struct gon_error why;
        const int value = plan->ask[i].value;
        if (plan->ask[i].block != block)
            continue;
        const double wire = registers_wire(p, &p->values[value], registers + plan->ask[i].at);
        double number = (double)NAN;
        if (!isnan(wire) && profile_number(&p->values[value], wire, &number, &why) < 0)
            return gon_fail(err, GON_E_LINK, "%s: %s", z->link, why.text);
        profile_data_set(p, d, value, number);
    }
    return 0;
}

static int read_block(struct bus_session *z, const struct block_plan *plan, int block, int tries,
                      struct profile_data *d, struct gon_error *err)
{
    const struct block *b = &plan->block[block];
    uint16_t registers[REGISTERS_MOST];
    int rc = GON_E_LINK;
    for (int i = 0; i < tries && rc == GON_E_LINK; i++) {
        rc = bus_read_table(z->bus, z->unit, (enum bus_table)b->table, b->address, b->count, tries,
                            registers, err);
        if (rc < 0)
            return note(z, rc);
        rc = decode(z, plan, block, registers, d, err);
    }
    return rc;
}

static int ask(struct session *s, const struct profile_asks *asks, bool once, struct gon_error *err)
{
    struct bus_session *z = bus_of(s);
    struct block_plan plan;
    struct profile_data d = s->data;
    bool fresh[PROFILE_VALUES] = {false};
    int rc = blocks_plan(s->profile, asks, &plan, err);
    for (int i = 0; rc == 0 && i < plan.count; i++)
        rc = read_block(z, &plan, i, once ? 1 : TRIES, &d, err);
    if (rc < 0)
        return rc;
    for (int i = 0; i < plan.asks; i++)
        fresh[plan.ask[i].value] = true;
    session_doubt(s->profile, &d, fresh);
    s->data = d;
    session_saw(s, fresh);
    return 0;
}

// --- telling -------------------------------------------------------------------------------------

static int transact(struct bus_session *z, const struct register_write *t, int tries,
                    struct gon_error *err)
{
    int rc = GON_E_LINK;
    for (int i = 0; i < tries && rc == GON_E_LINK; i++)
        rc = bus_write_table(z->bus, z->unit, (enum bus_table)t->table, t->address, t->count,
                             z->session.profile->registers.single, t->registers, err);
    return note(z, rc);
}

static int find_write(const struct bus_session *z, const char *name,
                      const struct profile_write **ret_write, struct gon_error *err)
{
    const int i = profile_write(z->session.profile, name);
    if (i < 0)
        return gon_fail(err, GON_E_INPUT, "%s: there is no write \"%s\"", z->link, name);
    *ret_write = &z->session.profile->writes[i];
    return 0;
}

// Takes the bit back, whether or not it was set: that may be repeated.
static int release(struct bus_session *z, const struct profile_write *w, int value,
                   struct gon_error *err)
{
    const struct profile *p = z->session.profile;
    const struct profile_write *by = w;
    struct register_write t;
    int rc = *w->release ? find_write(z, w->release, &by, err) : 0;
    if (rc == 0)
        rc = by == w ? register_write_one(p, value, 0, &t, err)
                     : register_write_set(p, by, NULL, &z->session.data, &t, err);
    if (rc == 0)
        rc = transact(z, &t, TRIES, err);
    z->edge[value] = rc < 0 ? EDGE_LEFT : EDGE_CLEAR;
    return rc;
}

// Bits that earlier commands may have left set, such as a stop that forbids to move.
static int release_left(struct bus_session *z, struct gon_error *err)
{
    const struct profile *p = z->session.profile;
    int rc = 0;
    for (int i = 0; i < p->writes_count && rc == 0; i++) {
        const struct profile_write *w = &p->writes[i];
        int value;
        double number;
        if (*w->edge && register_write_edge(p, w, &value, &number, NULL) == 0 &&
            z->edge[value] == EDGE_LEFT)
            rc = release(z, w, value, err);
    }
    return rc;
}

// Sets the bit and takes it back, also when setting it failed: it may have arrived.
static int send_edge(struct bus_session *z, const struct profile_write *w, struct gon_error *err)
{
    const struct profile *p = z->session.profile;
    struct register_write t;
    int value, tries = w->repeat ? TRIES : 1;
    double number;
    int rc = register_write_edge(p, w, &value, &number, err);
    if (rc == 0)
        rc = register_write_one(p, value, number, &t, err);
    if (rc == 0 && z->edge[value] != EDGE_CLEAR)
        rc = release(z, w, value, err);
    if (rc < 0)
        return rc;
    do {
        z->edge[value] = EDGE_LEFT;
        rc = transact(z, &t, 1, err);
        const int released = release(z, w, value, rc < 0 ? NULL : err);
        rc = rc < 0 ? rc : released;
    } while (rc == GON_E_LINK && --tries > 0);
    return rc;
}

// Whether the write is what releases others; their bits are then known to be clear.
static bool releases(struct bus_session *z, const struct profile_write *by, bool done)
{
    const struct profile *p = z->session.profile;
    bool does = false;
    for (int i = 0; i < p->writes_count; i++) {
        const struct profile_write *w = &p->writes[i];
        int value;
        double number;
        if (!*w->edge || profile_write(p, w->release) != (int)(by - p->writes) ||
            register_write_edge(p, w, &value, &number, NULL) < 0)
            continue;
        does = true;
        if (done)
            z->edge[value] = EDGE_CLEAR;
    }
    return does;
}

static int send_set(struct bus_session *z, const struct profile_write *w,
                    const struct profile_param *params, struct register_write *t,
                    struct gon_error *err)
{
    struct gon_error why = {0};
    int rc = register_write_set(z->session.profile, w, params, &z->session.data, t, &why);
    if (rc < 0)
        return gon_fail(err, rc, "%s: %s: %s", z->link, w->name, why.text);
    if (!releases(z, w, false))
        rc = release_left(z, err);
    if (rc == 0)
        rc = transact(z, t, w->repeat ? TRIES : 1, err);
    releases(z, w, rc == 0);
    return rc;
}

// --- what became of it ---------------------------------------------------------------------------

static int ask_all(struct session *s, const bool uses[PROFILE_VALUES], struct gon_error *err)
{
    struct profile_asks asks = {.count = 0};
    int rc = 0;
    for (int i = 0; i < s->profile->values_count && rc == 0; i++) {
        if (uses[i])
            snprintf(asks.name[asks.count++], PROFILE_NAME, "%s", s->profile->values[i].name);
        if (asks.count == PROFILE_ASKS || (asks.count > 0 && i + 1 == s->profile->values_count)) {
            rc = ask(s, &asks, false, err);
            asks.count = 0;
        }
    }
    return rc;
}

// Says which value is not what it was set to.
static int compare(struct bus_session *z, const struct profile_write *w,
                   const struct register_write *t, struct gon_error *err)
{
    const struct profile *p = z->session.profile;
    for (int i = 0; w->readback && i < t->items; i++) {
        const struct profile_value *v = &p->values[t->item[i].value];
        const double now = session_number(&z->session, v->name);
        if (!isnan(now) && session_same(v, t->item[i].number, now))
            continue;
        return session_refused(&z->session, PROFILE_REFUSED, err,
                               "%s: %s was set to %.10g%s%s and reads back as %.10g", z->link,
                               v->name, t->item[i].number, *v->unit ? " " : "", v->unit, now);
    }
    if (*w->verify && !session_holds(&z->session, w->verify))
        return session_refused(&z->session, PROFILE_REFUSED, err,
                               "%s: it acknowledged %s, but then \"%s\" does not hold", z->link,
                               w->name, w->verify);
    return 0;
}

// rc: of the write. A lost answer that the read-back makes up for is none.
static int verify(struct bus_session *z, const struct profile_write *w,
                  const struct register_write *t, int rc, struct gon_error *err)
{
    bool uses[PROFILE_VALUES] = {false};
    if (*w->verify)
        profile_when_uses(z->session.profile, w->verify, uses);
    for (int i = 0; w->readback && i < t->items; i++)
        uses[t->item[i].value] = true;
    const int asked = ask_all(&z->session, uses, rc < 0 ? NULL : err);
    if (asked < 0)
        return rc < 0 ? rc : asked;
    const int compared = compare(z, w, t, rc < 0 ? NULL : err);
    return rc < 0 && compared < 0 ? rc : compared;
}

static int send(struct session *s, const char *name, const struct profile_param *params,
                struct gon_error *err)
{
    struct bus_session *z = bus_of(s);
    const struct profile_write *w = NULL;
    struct register_write t = {0};
    int rc = find_write(z, name, &w, err);
    if (rc < 0)
        return rc;
    rc = *w->edge ? send_edge(z, w, err) : send_set(z, w, params, &t, err);
    const bool looks = *w->verify || w->readback;
    return looks && (rc == 0 || rc == GON_E_LINK) ? verify(z, w, &t, rc, err) : rc;
}

// --- life ----------------------------------------------------------------------------------------

// Who opened the bus reopens it. What command bits there are set nobody knows then.
static int reopen(struct session *s, struct gon_error *err)
{
    (void)err;
    for (int i = 0; i < PROFILE_VALUES; i++)
        bus_of(s)->edge[i] = EDGE_UNKNOWN;
    return 0;
}

static const char *link_of(const struct session *s)
{
    return ((const struct bus_session *)s)->link;
}

static void bus_free(struct session *s)
{
    free(s);
}

struct session *session_on_bus(const struct profile *p, struct bus *bus, int unit)
{
    static const struct session_ops ops = {
        .ask = ask, .send = send, .reopen = reopen, .link = link_of, .free = bus_free};
    struct bus_session *z = calloc(1, sizeof *z);
    if (!z)
        return NULL;
    session_init(&z->session, &ops, p);
    z->bus = bus;
    z->unit = unit;
    bus_expect(bus, (int)p->registers.timeout_ms, (int)p->registers.quiet_ms);
    snprintf(z->link, sizeof z->link, "%s: unit %d", bus_link(bus), unit);
    return &z->session;
}
