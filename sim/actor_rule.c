// SPDX-License-Identifier: MIT
#include "sim/actor_rule.h"

#include <ctype.h>
#include <fnmatch.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum kind { END, NAME, NUMBER, QUOTED, SIGN };

struct scan {
    const struct actor_values *v;
    const char *at; // behind the token
    enum kind kind; // of the token
    char text[PROFILE_TEXT];
    double number;
    bool wrong; // what was read is no condition
};

// --- tokens --------------------------------------------------------------------------------------

static bool in_name(const char *p)
{
    return isalnum((unsigned char)*p) || *p == '_' || *p == '.' || *p == '$' ||
           (*p == '-' && isalnum((unsigned char)p[1]));
}

static void keep(struct scan *s, enum kind kind, size_t size)
{
    s->kind = kind;
    snprintf(s->text, sizeof s->text, "%.*s", (int)size, s->at);
    s->at += size;
}

static void number(struct scan *s)
{
    char *end;
    bool hex = s->at[0] == '0' && (s->at[1] == 'x' || s->at[1] == 'X');
    s->number = hex ? (double)strtoull(s->at, &end, 16) : strtod(s->at, &end);
    s->kind = NUMBER;
    s->at = end;
}

static void next(struct scan *s)
{
    while (*s->at == ' ')
        s->at++;
    const char *p = s->at;
    bool minus = (*p == '-' || *p == '+') && (isdigit((unsigned char)p[1]) || p[1] == '.');
    if (*p == 0) {
        keep(s, END, 0);
    } else if (isdigit((unsigned char)*p) || *p == '.' || minus) {
        number(s);
    } else if (*p == '\'') {
        s->at++;
        keep(s, QUOTED, strcspn(s->at, "'"));
        s->at += *s->at == '\'';
    } else if (in_name(p)) {
        size_t size = 1;
        while (in_name(p + size))
            size++;
        keep(s, NAME, size);
    } else {
        bool two = strchr("<>!", *p) && (p[1] == '=' || p[1] == '~');
        keep(s, SIGN, two ? 2 : 1);
    }
}

static bool is(const struct scan *s, enum kind kind, const char *text)
{
    return s->kind == kind && strcmp(s->text, text) == 0;
}

static struct scan scan(const struct actor_values *v, const char *text)
{
    struct scan s = {.v = v, .at = text};
    next(&s);
    return s;
}

// --- operands ------------------------------------------------------------------------------------

struct operand {
    double number; // NAN: not known
    int value;     // it is a value's; else -1
    char text[PROFILE_TEXT];
    bool is_text;
};

static struct operand text_operand(const char *text)
{
    struct operand o = {.number = (double)NAN, .value = -1, .is_text = true};
    snprintf(o.text, sizeof o.text, "%s", text);
    return o;
}

static bool holds_text(const struct scan *s, int value)
{
    return value >= 0 && s->v->profile->values[value].type == PROFILE_STRING;
}

static struct operand named(struct scan *s, int beside)
{
    struct operand o = {.value = -1};
    int bit, word = beside >= 0 ? actor_values_word(s->v, beside, s->text) : -1;
    if (word >= 0) {
        o.number = word;
    } else if (is(s, NAME, "over")) {
        o.number = (double)INFINITY;
    } else if (actor_values_part(s->v, s->text, &o.value, &bit)) {
        if (holds_text(s, o.value)) {
            int value = o.value;
            o = text_operand(s->v->text[value]);
            o.value = value;
        } else {
            o.number = actor_values_bit(s->v, o.value, bit);
        }
    } else if (s->kind == QUOTED || holds_text(s, beside)) {
        o = text_operand(s->text);
    } else {
        s->wrong = true;
    }
    return o;
}

// beside: the value on the other side, whose words may be meant; -1.
static struct operand operand(struct scan *s, int beside)
{
    struct operand o = {.value = -1};
    if (is(s, SIGN, "|")) {
        next(s);
        o = operand(s, -1);
        o.number = fabs(o.number);
        s->wrong |= !is(s, SIGN, "|");
    } else if (s->kind == NUMBER) {
        o.number = s->number;
        next(s);
        if (!is(s, SIGN, "*"))
            return o;
        next(s);
        double factor = o.number;
        o = operand(s, -1);
        o.number *= factor;
        return o;
    } else if (s->kind == NAME || s->kind == QUOTED) {
        o = named(s, beside);
    } else {
        s->wrong = true;
    }
    next(s);
    return o;
}

double actor_number(const struct actor_values *v, const char *text, int beside)
{
    struct scan s = scan(v, text);
    struct operand o = operand(&s, beside);
    return s.wrong || s.kind != END ? (double)NAN : o.number;
}

// --- conditions ----------------------------------------------------------------------------------

static bool same(const struct operand *a, const struct operand *b)
{
    return a->is_text && b->is_text ? strcmp(a->text, b->text) == 0 : a->number == b->number;
}

static bool compared(const struct operand *a, const char *sign, const struct operand *b, bool *ret)
{
    bool known = (a->is_text && b->is_text) || (!isnan(a->number) && !isnan(b->number));
    if (strcmp(sign, "=") == 0)
        *ret = known && same(a, b);
    else if (strcmp(sign, "!=") == 0)
        *ret = known && !same(a, b);
    else if (strcmp(sign, "<") == 0)
        *ret = a->number < b->number;
    else if (strcmp(sign, "<=") == 0)
        *ret = a->number <= b->number;
    else if (strcmp(sign, ">") == 0)
        *ret = a->number > b->number;
    else if (strcmp(sign, ">=") == 0)
        *ret = a->number >= b->number;
    else
        return false;
    return true;
}

static bool masked(struct scan *s, const struct operand *a, bool has)
{
    next(s);
    uint64_t mask = s->kind == NUMBER && s->number >= 0 ? (uint64_t)s->number : 0;
    s->wrong |= s->kind != NUMBER;
    next(s);
    if (isnan(a->number) || isinf(a->number))
        return false;
    return (((uint64_t)llround(a->number) & mask) != 0) == has;
}

static bool globbed(struct scan *s, const struct operand *a, bool like)
{
    next(s);
    bool fits = fnmatch(s->text, a->text, FNM_CASEFOLD) == 0;
    s->wrong |= s->kind != QUOTED || !a->is_text;
    next(s);
    return fits == like;
}

static bool term(struct scan *s)
{
    bool result = false, no = is(s, NAME, "not");
    if (no)
        next(s);
    struct operand a = operand(s, -1);
    char sign[PROFILE_TEXT];
    strcpy(sign, s->text);
    if (s->kind == END || is(s, NAME, "and"))
        return !isnan(a.number) && (a.number != 0) != no;
    s->wrong |= no;
    if (is(s, NAME, "has") || is(s, NAME, "lacks"))
        return masked(s, &a, *sign == 'h');
    if (is(s, SIGN, "~") || is(s, SIGN, "!~"))
        return globbed(s, &a, *sign == '~');
    next(s);
    if (strcmp(sign, "known") == 0 || strcmp(sign, "unknown") == 0)
        return (a.is_text || !isnan(a.number)) == (*sign == 'k');
    struct operand b = operand(s, a.value);
    s->wrong |= !compared(&a, sign, &b, &result);
    return result;
}

bool actor_when(const struct actor_values *v, const char *condition)
{
    struct scan s = scan(v, condition);
    if (s.kind == END)
        return true;
    bool all = term(&s);
    while (is(&s, NAME, "and")) {
        next(&s);
        all &= term(&s);
    }
    return all && !s.wrong && s.kind == END;
}

// --- assignments ---------------------------------------------------------------------------------

static void assign(struct actor_values *v, struct scan *s, int value, int bit)
{
    bool no = is(s, NAME, "not");
    if (no)
        next(s);
    struct operand o = operand(s, value);
    s->wrong |= o.is_text != holds_text(s, value);
    if (no)
        o.number = o.number == 0;
    if (o.is_text)
        snprintf(v->text[value], ACTOR_TEXT, "%.*s", ACTOR_TEXT - 1, o.text);
    else
        actor_values_set_bit(v, value, bit, o.number);
}

int actor_then(struct actor_values *v, const char *assignments, struct gon_error *err)
{
    struct actor_values draft = *v;
    struct scan s = scan(&draft, assignments);
    while (s.kind != END) {
        int value, bit;
        const char *at = s.at - strlen(s.text);
        if (s.kind != NAME || !actor_values_part(v, s.text, &value, &bit))
            return gon_fail(err, GON_E_INPUT, "'%s': there is no value '%s'", assignments, s.text);
        next(&s);
        s.wrong = !is(&s, SIGN, "=");
        next(&s);
        assign(&draft, &s, value, bit);
        if (s.wrong || (s.kind != END && !is(&s, SIGN, ",")))
            return gon_fail(err, GON_E_INPUT, "'%s': cannot be read from '%s' on", assignments, at);
        if (s.kind != END)
            next(&s);
    }
    *v = draft;
    return 0;
}

bool actor_item(const struct actor_values *v, const char *item, int *ret_value, bool *ret_fits)
{
    struct scan s = scan(v, item);
    int bit;
    if (s.kind != NAME || !actor_values_part(v, s.text, ret_value, &bit))
        return false;
    next(&s);
    *ret_fits = s.kind == END;
    if (*ret_fits)
        return true;
    s.wrong = !is(&s, SIGN, "=");
    next(&s);
    *ret_fits = s.kind == NAME && *s.text == '$';
    if (!*ret_fits)
        *ret_fits = operand(&s, *ret_value).number == actor_values_bit(v, *ret_value, bit);
    return !s.wrong;
}
