// SPDX-License-Identifier: MIT
#include "drivers/profile_check_inside.h"
#include "drivers/profile_token.h"

#include <stdlib.h>
#include <string.h>

// --- then ----------------------------------------------------------------------------------------

// "mode" or "output.moving".
static int read_left(const struct profile *p, struct profile_token t, int *ret_value,
                     struct gon_error *err)
{
    char *bit = strchr(t.text, '.');
    struct gon_error why;
    if (bit && t.kind == PROFILE_TOKEN_WORD && profile_when_check(p, t.text, &why) < 0)
        return gon_fail(err, GON_E_INPUT, "%s", why.text);
    if (bit)
        *bit = 0;
    const int value = t.kind == PROFILE_TOKEN_WORD ? profile_value(p, t.text) : -1;
    if (value < 0)
        return gon_fail(err, GON_E_INPUT, "there is no value '%s'", t.text);
    *ret_value = value;
    return 0;
}

// A number, word or text, another value, or not and a value.
static int read_right(const struct profile *p, const char **at, int value, struct gon_error *err)
{
    struct profile_token t = profile_token_next(at);
    double number;
    if (profile_token_is(&t, "not")) {
        t = profile_token_next(at);
        if (profile_value(p, t.text) < 0)
            return gon_fail(err, GON_E_INPUT, "there is no value '%s'", t.text);
        return 0;
    }
    if (t.kind != PROFILE_TOKEN_WORD && t.kind != PROFILE_TOKEN_QUOTED)
        return gon_fail(err, GON_E_INPUT, "%s = what?", p->values[value].name);
    if (p->values[value].type == PROFILE_STRING || profile_value(p, t.text) >= 0)
        return 0;
    return profile_literal(&p->values[value], t.text, &number, err);
}

static int read_then(const struct profile *p, const char *text, struct gon_error *err)
{
    const char *at = text;
    struct profile_token t = profile_token_next(&at);
    while (t.kind != PROFILE_TOKEN_END) {
        int value = -1;
        int rc = read_left(p, t, &value, err);
        if (rc < 0)
            return rc;
        t = profile_token_next(&at);
        if (!profile_token_is(&t, "="))
            return gon_fail(err, GON_E_INPUT, "'=' is missing behind %s", p->values[value].name);
        rc = read_right(p, &at, value, err);
        if (rc < 0)
            return rc;
        t = profile_token_next(&at);
        if (t.kind != PROFILE_TOKEN_END && !profile_token_is(&t, ","))
            return gon_fail(err, GON_E_INPUT, "a comma is missing before '%s'", t.text);
        if (t.kind != PROFILE_TOKEN_END)
            t = profile_token_next(&at);
    }
    return 0;
}

void check_then(struct checking *c, struct place at, const char *text)
{
    struct gon_error err;
    if (read_then(c->p, text, &err) < 0)
        check_says(c, at, "%s", err.text);
}

// --- simulate ------------------------------------------------------------------------------------

static void check_deny(struct checking *c, int i, const struct profile_deny *d)
{
    check_sent_name(c, check_at("simulate.deny[%d].does", i), d->does);
    check_condition(c, check_at("simulate.deny[%d].when", i), d->when);
    if (c->p->protocol == PROFILE_MESSAGE)
        check_pattern(c, check_at("simulate.deny[%d].answer", i), d->answer, false);
    check_then(c, check_at("simulate.deny[%d].then", i), d->then);
}

static void check_literal(struct checking *c, struct place at, int value, const char *text)
{
    struct profile_data *d = calloc(1, sizeof *d);
    struct gon_error err;
    if (d && profile_data_set_text(c->p, d, value, text, &err) < 0)
        check_says(c, at, "%s", err.text);
    free(d);
}

// An empty name is none here, where other settings may be left out.
static bool check_changed(struct checking *c, struct place at, const char *name)
{
    if (!*name)
        check_says(c, at, "missing; it says which value");
    return *name && check_value_name(c, at, name);
}

void check_simulate(struct checking *c)
{
    const struct profile_simulate *s = &c->p->simulate;
    for (int i = 0; i < s->start_count; i++)
        if (check_changed(c, check_at("simulate.start[%d].value", i), s->start[i].value))
            check_literal(c, check_at("simulate.start[%d].is", i),
                          profile_value(c->p, s->start[i].value), s->start[i].is);
    for (int i = 0; i < s->drift_count; i++) {
        const struct profile_drift *d = &s->drift[i];
        const bool known = check_changed(c, check_at("simulate.drift[%d].value", i), d->value);
        check_condition(c, check_at("simulate.drift[%d].when", i), d->when);
        if (known && profile_value(c->p, d->to) < 0)
            check_literal(c, check_at("simulate.drift[%d].to", i), profile_value(c->p, d->value),
                          d->to);
        check_value_name(c, check_at("simulate.drift[%d].rate_value", i), d->rate_value);
        check_then(c, check_at("simulate.drift[%d].then", i), d->then);
    }
    for (int i = 0; i < s->follows_count; i++) {
        check_condition(c, check_at("simulate.follows[%d].when", i), s->follows[i].when);
        check_then(c, check_at("simulate.follows[%d].then", i), s->follows[i].then);
    }
    check_condition(c, check_at("simulate.shines"), s->shines);
    for (int i = 0; i < s->deny_count; i++)
        check_deny(c, i, &s->deny[i]);
}
