// SPDX-License-Identifier: MIT
#include "drivers/profile_use.h"

#include "drivers/profile_text.h"
#include "drivers/profile_token.h"
#include "drivers/profile_when.h"
#include "drivers/registers.h"

#include <string.h>

static bool has_any(const bool uses[PROFILE_VALUES])
{
    for (int i = 0; i < PROFILE_VALUES; i++)
        if (uses[i])
            return true;
    return false;
}

// --- what roles send -----------------------------------------------------------------------------

static bool is_in(const struct profile_rules *r, const char *name)
{
    for (int i = 0; i < r->count; i++)
        if (strcmp(r->rule[i].send, name) == 0)
            return true;
    return false;
}

static bool moves(const struct profile *p, const char *name)
{
    const struct profile_axis *a = &p->axis;
    const char *const writes[] = {a->move, a->stop, a->home, a->reset, a->enable, a->clear};
    for (size_t i = 0; i < sizeof writes / sizeof *writes; i++)
        if (strcmp(writes[i], name) == 0)
            return true;
    for (int i = 0; i < p->selector.positions_count; i++)
        if (strcmp(p->selector.positions[i].send, name) == 0)
            return true;
    return false;
}

static bool is_sent_by_role(const struct profile *p, const char *name)
{
    const struct profile_laser *l = &p->laser;
    return moves(p, name) || is_in(&l->on, name) || is_in(&l->prepare, name) ||
           strcmp(l->set_power, name) == 0 || strcmp(l->keepalive.send, name) == 0 ||
           is_in(&p->detector.setup, name) || strcmp(p->detector.set_range, name) == 0 ||
           is_in(&p->selector.setup, name);
}

bool profile_only_asks(const struct profile *p, int exchange)
{
    const struct profile_exchange *x = &p->exchanges[exchange];
    bool sends[PROFILE_VALUES] = {false}, gives[PROFILE_VALUES] = {false};
    profile_text_uses(p, x->send, sends);
    profile_text_uses(p, x->answer, gives);
    return has_any(gives) && !has_any(sends) && !*x->verify && !x->echoes &&
           !is_sent_by_role(p, x->name) && !profile_switches_on(p, x->name, NULL);
}

bool profile_is_readable(const struct profile *p, int value)
{
    const struct profile_value *v = &p->values[value];
    int address;
    return v->table != PROFILE_NO_TABLE && v->access != PROFILE_WRITE &&
           registers_address(p, v, &address, NULL) == 0;
}

// --- setting -------------------------------------------------------------------------------------

// How many values and $NAMEs a write takes from outside; 0: not this one.
static int needs_of_write(const struct profile_write *w, const char *name)
{
    int needs = 0;
    bool has = false;
    for (int i = 0; i < w->set_count; i++) {
        const char *at = w->set[i];
        for (struct profile_token t = profile_token_next(&at); t.kind != PROFILE_TOKEN_END;) {
            const struct profile_token next = profile_token_next(&at);
            struct profile_token right = next;
            const bool given = profile_token_is(&next, "=");
            if (given)
                right = profile_token_next(&at);
            const bool open = !given || right.text[0] == '$';
            needs += open;
            has = has || (open && strcmp(t.text, name) == 0 &&
                          (!given || strcmp(right.text + 1, name) == 0));
            const struct profile_token comma = given ? profile_token_next(&at) : next;
            t = comma.kind == PROFILE_TOKEN_END ? comma : profile_token_next(&at);
        }
    }
    return has ? needs : 0;
}

static int needs_of_exchange(const struct profile *p, const struct profile_exchange *x, int value)
{
    bool sends[PROFILE_VALUES] = {false};
    int needs = 0;
    profile_text_uses(p, x->send, sends);
    for (int i = 0; i < p->values_count; i++)
        needs += sends[i];
    return sends[value] ? needs : 0;
}

int profile_setter(const struct profile *p, int value)
{
    const bool modbus = p->protocol == PROFILE_MODBUS;
    int best = -1, least = PROFILE_VALUES + PROFILE_ITEMS;
    for (int i = 0; i < (modbus ? p->writes_count : p->exchanges_count); i++) {
        const char *name = modbus ? p->writes[i].name : p->exchanges[i].name;
        const int needs = modbus ? needs_of_write(&p->writes[i], p->values[value].name)
                                 : needs_of_exchange(p, &p->exchanges[i], value);
        if (needs > 0 && needs < least && !moves(p, name)) {
            best = i;
            least = needs;
        }
    }
    return best;
}

// --- switching on --------------------------------------------------------------------------------

static bool same_write(const struct profile_write *a, const struct profile_write *b)
{
    bool same = a->set_count == b->set_count && strcmp(a->edge, b->edge) == 0;
    for (int i = 0; i < a->set_count && same; i++)
        same = strcmp(a->set[i], b->set[i]) == 0;
    return same;
}

static bool sends_the_same(const struct profile *p, const char *a, const char *b)
{
    const int xa = profile_exchange(p, a), xb = profile_exchange(p, b);
    const int wa = profile_write(p, a), wb = profile_write(p, b);
    return strcmp(a, b) == 0 ||
           (xa >= 0 && xb >= 0 && strcmp(p->exchanges[xa].send, p->exchanges[xb].send) == 0) ||
           (wa >= 0 && wb >= 0 && same_write(&p->writes[wa], &p->writes[wb]));
}

static bool is_on_command(const struct profile *p, const char *does)
{
    const struct profile_laser *l = &p->laser;
    for (int i = 0; i < l->on.count; i++)
        if (sends_the_same(p, l->on.rule[i].send, does))
            return true;
    return *l->keepalive.send && sends_the_same(p, l->keepalive.send, does);
}

// "status.light = 1": bits are not assigned by profile_assign.
static bool sets_bit_of_light(const struct profile *p, const char *then)
{
    const char *at = then;
    bool uses[PROFILE_VALUES] = {false};
    profile_when_uses(p, p->laser.emitting, uses);
    for (struct profile_token t = profile_token_next(&at); t.kind != PROFILE_TOKEN_END;
         t = profile_token_next(&at)) {
        char *dot = strchr(t.text, '.');
        const int value = dot ? (*dot = 0, profile_value(p, t.text)) : -1;
        if (value < 0 || !uses[value])
            continue;
        profile_token_next(&at); // =
        t = profile_token_next(&at);
        if (strcmp(t.text, "0") != 0)
            return true;
    }
    return false;
}

// Only what it sends counts: what is known of now does not make a question switch anything.
static bool makes_light(const struct profile *p, const char *does, const struct profile_data *d)
{
    const int exchange = profile_exchange(p, does), write = profile_write(p, does);
    const char *then = exchange >= 0 ? p->exchanges[exchange].then
                       : write >= 0  ? p->writes[write].then
                                     : "";
    bool sends[PROFILE_VALUES] = {false};
    struct profile_data after;
    profile_data_clear(&after);
    if (exchange >= 0)
        profile_text_uses(p, p->exchanges[exchange].send, sends);
    for (int i = 0; i < p->values_count && d; i++)
        if (sends[i] && d->known[i])
            profile_data_set(p, &after, i, d->number[i]);
    for (int i = 0; write >= 0 && i < p->writes[write].set_count; i++)
        profile_assign_data(p, p->writes[write].set[i], NULL, &after, NULL);
    profile_assign_data(p, then, NULL, &after, NULL);
    return profile_when(p, p->laser.emitting, &after) || sets_bit_of_light(p, then);
}

bool profile_switches_on(const struct profile *p, const char *does, const struct profile_data *d)
{
    return p->role == PROFILE_LASER &&
           (is_on_command(p, does) || (*p->laser.emitting && makes_light(p, does, d)));
}
