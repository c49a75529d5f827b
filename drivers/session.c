// SPDX-License-Identifier: MIT
#include "drivers/session_inside.h"

#include "drivers/message.h"
#include "drivers/profile_text.h"
#include "drivers/profile_when.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define UNKNOWN_RESOLUTION 1e-3 // of the value: what a read-back may differ by
#define ROUNDING 1e-6

// --- for session_text.c and session_bus.c --------------------------------------------------------

void session_init(struct session *s, const struct session_ops *ops, const struct profile *p)
{
    s->ops = ops;
    s->profile = p;
    s->meaning = PROFILE_FINE;
    s->restarted = false;
    profile_data_clear(&s->data);
}

void session_doubt(const struct profile *p, struct profile_data *d,
                   const bool fresh[PROFILE_VALUES])
{
    for (int i = 0; i < p->values_count; i++)
        if (fresh[i] && *p->values[i].valid && !profile_when(p, p->values[i].valid, d))
            d->known[i] = false;
}

// A condition that held before and speaks of nothing new tells nothing new.
void session_saw(struct session *s, const bool fresh[PROFILE_VALUES])
{
    const struct profile *p = s->profile;
    bool uses[PROFILE_VALUES] = {false};
    bool new = false;
    if (!*p->identify.restarted)
        return;
    profile_when_uses(p, p->identify.restarted, uses);
    for (int i = 0; i < p->values_count; i++)
        new = new || (uses[i] && fresh[i]);
    if (new &&profile_when(p, p->identify.restarted, &s->data))
        s->restarted = true;
}

int session_refused(struct session *s, enum profile_meaning means, struct gon_error *err,
                    const char *format, ...)
{
    char text[sizeof err->text];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    s->meaning = means;
    if (session_message(s))
        message_refused(session_message(s));
    const bool may_change =
        means == PROFILE_BUSY || means == PROFILE_OPEN_INTERLOCK || means == PROFILE_KEY;
    return gon_fail(err, may_change ? GON_E_REFUSED : GON_E_DEVICE, "%s", text);
}

bool session_same(const struct profile_value *v, double set, double now)
{
    const bool exact = v->ladder_count || v->words_count || v->type == PROFILE_INT ||
                       v->type == PROFILE_HEX || v->type == PROFILE_WORD;
    const double rounding = ROUNDING * fabs(set);
    if (exact)
        return fabs(now - set) <= rounding;
    return fabs(now - set) <=
           rounding + (v->resolution > 0 ? v->resolution : UNKNOWN_RESOLUTION * fabs(set));
}

// --- life ----------------------------------------------------------------------------------------

void session_free(struct session *s)
{
    if (s)
        s->ops->free(s);
}

int session_reopen(struct session *s, struct gon_error *err)
{
    profile_data_clear(&s->data);
    s->restarted = false;
    if (s->ops->forget)
        s->ops->forget(s);
    return s->ops->reopen(s, err);
}

const struct profile *session_profile(const struct session *s)
{
    return s->profile;
}

const char *session_link(const struct session *s)
{
    return s->ops->link(s);
}

struct message *session_message(const struct session *s)
{
    return s->ops->message ? s->ops->message(s) : NULL;
}

// --- values --------------------------------------------------------------------------------------

struct profile_data *session_data(struct session *s)
{
    return &s->data;
}

void session_put(struct session *s, const char *name, double number)
{
    const int i = *name ? profile_value(s->profile, name) : -1;
    if (i >= 0)
        profile_data_set(s->profile, &s->data, i, number);
}

double session_number(const struct session *s, const char *name)
{
    return profile_data_number(s->profile, &s->data, name);
}

bool session_holds(const struct session *s, const char *condition)
{
    return profile_when(s->profile, condition, &s->data);
}

void session_gives(const struct profile *p, const struct profile_asks *asks,
                   bool ret_gives[PROFILE_VALUES])
{
    for (int i = 0; i < asks->count; i++) {
        const int value = profile_value(p, asks->name[i]);
        const int exchange = profile_exchange(p, asks->name[i]);
        if (p->protocol == PROFILE_MESSAGE && exchange >= 0)
            profile_text_uses(p, p->exchanges[exchange].answer, ret_gives);
        else if (p->protocol == PROFILE_MODBUS && value >= 0)
            ret_gives[value] = true;
    }
}

// --- asking and telling --------------------------------------------------------------------------

int session_ask(struct session *s, const struct profile_asks *asks, struct gon_error *err)
{
    return s->ops->ask(s, asks, false, err);
}

int session_ask_once(struct session *s, const struct profile_asks *asks, struct gon_error *err)
{
    return s->ops->ask(s, asks, true, err);
}

int session_ask_one(struct session *s, const char *name, struct gon_error *err)
{
    struct profile_asks asks = {.count = 1};
    snprintf(asks.name[0], sizeof asks.name[0], "%s", name);
    return s->ops->ask(s, &asks, false, err);
}

int session_send(struct session *s, const char *name, const struct profile_param *params,
                 struct gon_error *err)
{
    s->meaning = PROFILE_FINE;
    return s->ops->send(s, name, params, err);
}

int session_send_blind(struct session *s, const char *text, bool at_once, struct gon_error *err)
{
    if (!s->ops->send_blind)
        return gon_fail(err, GON_E_INPUT, "%s: nothing can be sent blind over a bus",
                        session_link(s));
    return s->ops->send_blind(s, text, at_once, err);
}

enum profile_meaning session_meaning(const struct session *s)
{
    return s->meaning;
}

// --- who it is -----------------------------------------------------------------------------------

int session_identify(struct session *s, char *ret_title, size_t size, struct gon_error *err)
{
    const struct profile *p = s->profile;
    struct gon_error why = {0};
    char title[160];
    if (s->ops->forget)
        s->ops->forget(s);
    int rc = session_ask(s, &p->identify.asks, &why);
    if (rc == GON_E_DEVICE)
        return gon_fail(err, rc, "%s; is it a %s?", why.text, p->title);
    if (rc == 0)
        rc = profile_text_write(p, p->identify.title, &s->data, title, sizeof title, &why);
    if (rc < 0)
        return gon_fail(err, rc, "%s", why.text);
    for (int i = 0; i < p->identify.refuse.count; i++) {
        const struct profile_rule *r = &p->identify.refuse.rule[i];
        if (session_holds(s, r->when))
            return *title ? gon_fail(err, GON_E_DEVICE, "%s: is '%s': %s", session_link(s), title,
                                     r->text)
                          : gon_fail(err, GON_E_DEVICE, "%s %s", session_link(s), r->text);
    }
    snprintf(ret_title, size, "%s", title);
    return 0;
}

bool session_restarted(struct session *s)
{
    const bool was = s->restarted;
    s->restarted = false;
    return was;
}
