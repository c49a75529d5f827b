// SPDX-License-Identifier: MIT
#include "drivers/profile_check.h"

#include "drivers/profile_check_inside.h"
#include "drivers/profile_text.h"

#include <ctype.h>
#include <stdarg.h>
#include <string.h>

// --- saying --------------------------------------------------------------------------------------

struct place check_at(const char *fmt, ...)
{
    struct place at;
    va_list args;
    va_start(args, fmt);
    vsnprintf(at.path, sizeof at.path, fmt, args);
    va_end(args);
    return at;
}

void check_says(struct checking *c, struct place at, const char *fmt, ...)
{
    char text[400];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    c->mistakes += cfg_complain(c->f, at.path, "%s", text);
}

bool check_given(struct checking *c, struct place at, const char *text, const char *what)
{
    if (!*text)
        check_says(c, at, "missing; it says %s", what);
    return *text;
}

// --- names ---------------------------------------------------------------------------------------

static bool is_name(const char *name)
{
    static const char *const reserved[] = {"and",   "not",  "has",     "lacks",
                                           "known", "over", "unknown", NULL};
    const char *const *word = reserved;
    while (*word && strcmp(*word, name) != 0)
        word++;
    if (*word || !(isalpha((unsigned char)name[0]) || name[0] == '_'))
        return false;
    while (isalnum((unsigned char)*name) || *name == '_')
        name++;
    return *name == 0;
}

void check_new_name(struct checking *c, const char *list, int index, const char *first,
                    size_t stride)
{
    const char *name = first + (size_t)index * stride;
    if (!is_name(name))
        check_says(c, check_at("%s[%d].name", list, index),
                   "not a name: a letter, then letters, digits and _; no word of conditions");
    for (int i = 0; i < index; i++)
        if (strcmp(first + (size_t)i * stride, name) == 0) {
            check_says(c, check_at("%s[%d].name", list, index), "is the name of %s[%d], too", list,
                       i);
            return;
        }
}

bool check_value_name(struct checking *c, struct place at, const char *name)
{
    const bool is = !*name || profile_value(c->p, name) >= 0;
    if (!is)
        check_says(c, at, "there is no such value");
    return is;
}

bool check_asked_name(struct checking *c, struct place at, const char *name)
{
    const struct profile *p = c->p;
    const bool modbus = p->protocol == PROFILE_MODBUS;
    const int i = modbus ? profile_value(p, name) : profile_exchange(p, name);
    if (!*name)
        return true;
    if (i < 0)
        check_says(c, at, "there is no such %s to ask for", modbus ? "value" : "exchange");
    else if (modbus && p->values[i].table == PROFILE_NO_TABLE)
        check_says(c, at, "has no register (table), and cannot be asked for");
    else if (modbus && p->values[i].access == PROFILE_WRITE)
        check_says(c, at, "is only written (access), and cannot be asked for");
    else if (!modbus && !*p->exchanges[i].answer)
        check_says(c, at, "is an exchange without an answer");
    else
        return true;
    return false;
}

bool check_sent_name(struct checking *c, struct place at, const char *name)
{
    const bool modbus = c->p->protocol == PROFILE_MODBUS;
    const bool is =
        !*name || (modbus ? profile_write(c->p, name) : profile_exchange(c->p, name)) >= 0;
    if (!is)
        check_says(c, at, "there is no such %s to send", modbus ? "write" : "exchange");
    return is;
}

void check_asks(struct checking *c, const char *path, const struct profile_asks *asks)
{
    for (int i = 0; i < asks->count; i++)
        check_asked_name(c, check_at("%s[%d]", path, i), asks->name[i]);
}

// --- texts ---------------------------------------------------------------------------------------

void check_condition(struct checking *c, struct place at, const char *condition)
{
    struct gon_error err;
    if (profile_when_check(c->p, condition, &err) < 0)
        check_says(c, at, "%s", err.text);
}

void check_pattern(struct checking *c, struct place at, const char *pattern, bool reading)
{
    struct gon_error err;
    if (profile_text_check(c->p, pattern, reading, &err) < 0)
        check_says(c, at, "%s", err.text);
}

struct assigning {
    const struct profile *p;
    const bool *may_be;
    const char *not_so;
};

static int see_assignment(void *ctx, int value, double number, const char *text,
                          struct gon_error *err)
{
    const struct assigning *a = ctx;
    (void)number, (void)text;
    if (!a->may_be[value])
        return gon_fail(err, GON_E_INPUT, "%s %s", a->p->values[value].name, a->not_so);
    return 0;
}

void check_assignments(struct checking *c, struct place at, const char *text,
                       const bool may_be[PROFILE_VALUES], const char *not_so)
{
    struct assigning a = {c->p, may_be, not_so};
    struct gon_error err;
    if (profile_assign(c->p, text, NULL, see_assignment, &a, &err) < 0)
        check_says(c, at, "%s", err.text);
}

void check_gives(const struct profile *p, const struct profile_asks *asks,
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

void check_covered(struct checking *c, struct place at, const char *condition,
                   const bool gives[PROFILE_VALUES])
{
    bool uses[PROFILE_VALUES] = {false};
    check_condition(c, at, condition);
    profile_when_uses(c->p, condition, uses);
    for (int i = 0; i < c->p->values_count; i++)
        if (uses[i] && !gives[i])
            check_says(c, at, "nothing that is asked for it brings %s", c->p->values[i].name);
}

void check_codes(struct checking *c, const char *path, const struct profile_code *codes, int count)
{
    for (int i = 0; i < count; i++)
        for (int j = 0; j < i; j++)
            if (codes[i].code == codes[j].code)
                check_says(c, check_at("%s[%d].code", path, i), "is explained by %s[%d], too", path,
                           j);
}

// --- who it is, and what is known of it ----------------------------------------------------------

static void check_identify(struct checking *c)
{
    const struct profile_identify *id = &c->p->identify;
    bool gives[PROFILE_VALUES] = {false}, uses[PROFILE_VALUES] = {false};
    check_asks(c, "identify.asks", &id->asks);
    check_gives(c->p, &id->asks, gives);
    for (int i = 0; i < id->refuse.count; i++) {
        check_covered(c, check_at("identify.refuse[%d].when", i), id->refuse.rule[i].when, gives);
        check_given(c, check_at("identify.refuse[%d].text", i), id->refuse.rule[i].text,
                    "why it is refused");
    }
    check_pattern(c, check_at("identify.title"), id->title, false);
    profile_text_uses(c->p, id->title, uses);
    for (int i = 0; i < c->p->values_count; i++)
        if (uses[i] && !gives[i])
            check_says(c, check_at("identify.title"), "nothing in identify.asks brings %s",
                       c->p->values[i].name);
    if (check_value_name(c, check_at("identify.serial"), id->serial) && *id->serial &&
        !gives[profile_value(c->p, id->serial)])
        check_says(c, check_at("identify.serial"), "nothing in identify.asks brings it");
    check_condition(c, check_at("identify.restarted"), id->restarted);
}

static void check_golden_message(struct checking *c, int i, const struct profile_golden *g)
{
    const int exchange = profile_exchange(c->p, g->does);
    bool sends[PROFILE_VALUES] = {false}, gives[PROFILE_VALUES] = {false};
    if (exchange >= 0) {
        profile_text_uses(c->p, c->p->exchanges[exchange].send, sends);
        profile_text_uses(c->p, c->p->exchanges[exchange].answer, gives);
    }
    check_given(c, check_at("golden[%d].does", i), g->does, "which exchange it shows");
    check_assignments(c, check_at("golden[%d].with", i), g->with, sends, "is not in what is sent");
    check_assignments(c, check_at("golden[%d].gives", i), g->gives, gives, "is not in the answer");
}

static void check_golden_modbus(struct checking *c, int i, const struct profile_golden *g)
{
    struct profile_asks asks = {.count = g->asks_count};
    bool gives[PROFILE_VALUES] = {false};
    memcpy(asks.name, g->asks, sizeof g->asks);
    check_asks(c, check_at("golden[%d].asks", i).path, &asks);
    check_gives(c->p, &asks, gives);
    if (!*g->does && !g->asks_count)
        check_says(c, check_at("golden[%d].does", i),
                   "missing; it says which write, or asks values");
    if (*g->does && g->asks_count)
        check_says(c, check_at("golden[%d].asks", i),
                   "a write (does), or values asked for; not both");
    check_assignments(c, check_at("golden[%d].gives", i), g->gives, gives, "is not asked for");
}

static void check_golden(struct checking *c)
{
    for (int i = 0; i < c->p->golden_count; i++) {
        const struct profile_golden *g = &c->p->golden[i];
        check_sent_name(c, check_at("golden[%d].does", i), g->does);
        check_given(c, check_at("golden[%d].source", i), g->source, "where these bytes are shown");
        if (c->p->protocol == PROFILE_MESSAGE)
            check_golden_message(c, i, g);
        else
            check_golden_modbus(c, i, g);
    }
}

int profile_check(struct cfg_file *f, const struct profile *p)
{
    struct checking c = {.f = f, .p = p};
    if (!is_name(p->name) &&
        strspn(p->name, "abcdefghijklmnopqrstuvwxyz0123456789-") != strlen(p->name))
        check_says(&c, check_at("profile.name"), "allowed: a..z, 0..9 and -");
    check_values(&c);
    check_messages(&c);
    check_registers(&c);
    check_identify(&c);
    check_roles(&c);
    check_golden(&c);
    check_simulate(&c);
    return c.mistakes;
}
