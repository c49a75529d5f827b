// SPDX-License-Identifier: MIT
#include "drivers/profile_when.h"

#include "drivers/profile_token.h"

#include <fnmatch.h>
#include <math.h>
#include <string.h>

#define SAME 1e-9 // relative: numbers that differ by less are the same

enum test { TEST_COMPARE, TEST_BITS, TEST_GLOB, TEST_KNOWN };
enum sign { SIGN_EQUAL, SIGN_UNEQUAL, SIGN_LESS, SIGN_LESS_EQUAL, SIGN_MORE, SIGN_MORE_EQUAL };

struct term {
    enum test test;
    int value;
    bool contrary; // not, lacks, !~, unknown
    bool absolute; // | |
    enum sign sign;
    double number; // to compare with, or a factor
    int other;     // value to compare with; -1: the number
    uint64_t bits; // any of them
    char glob[PROFILE_TEXT];
};

// --- reading -------------------------------------------------------------------------------------

struct reader {
    const struct profile *p;
    const char *at;
    struct profile_token t;
    struct gon_error *err;
};

static void next(struct reader *r)
{
    r->t = profile_token_next(&r->at);
}

static bool take(struct reader *r, const char *text)
{
    const bool is = profile_token_is(&r->t, text);
    if (is)
        next(r);
    return is;
}

static int read_name(struct reader *r, int *ret_value)
{
    const int value = r->t.kind == PROFILE_TOKEN_WORD ? profile_value(r->p, r->t.text) : -1;
    if (r->t.kind == PROFILE_TOKEN_END)
        return gon_fail(r->err, GON_E_INPUT, "a value's name is missing at its end");
    if (value < 0)
        return gon_fail(r->err, GON_E_INPUT, "there is no value '%s'", r->t.text);
    next(r);
    *ret_value = value;
    return 0;
}

// "status.fault"; the caller has seen the dot.
static int read_bit(struct reader *r, struct term *ret_term)
{
    char *bit = strchr(r->t.text, '.');
    *bit++ = 0;
    const int value = profile_value(r->p, r->t.text);
    if (value < 0)
        return gon_fail(r->err, GON_E_INPUT, "there is no value '%s'", r->t.text);
    const struct profile_value *v = &r->p->values[value];
    for (int i = 0; i < v->bits_count; i++)
        if (strcmp(v->bits[i].name, bit) == 0) {
            ret_term->test = TEST_BITS;
            ret_term->value = value;
            ret_term->bits = UINT64_C(1) << v->bits[i].bit;
            next(r);
            return 0;
        }
    return gon_fail(r->err, GON_E_INPUT, "%s has no bit '%s'", v->name, bit);
}

static int read_mask(struct reader *r, struct term *t)
{
    const struct profile_value *v = &r->p->values[t->value];
    double mask;
    if (v->type == PROFILE_STRING || v->type == PROFILE_WORD)
        return gon_fail(r->err, GON_E_INPUT, "%s has no bits", v->name);
    if (r->t.kind != PROFILE_TOKEN_WORD || profile_literal(NULL, r->t.text, &mask, NULL) < 0 ||
        !(mask >= 1 && mask <= UINT32_MAX && mask == floor(mask)))
        return gon_fail(r->err, GON_E_INPUT, "'%s' is no set of bits", r->t.text);
    t->test = TEST_BITS;
    t->bits = (uint64_t)mask;
    next(r);
    return 0;
}

static int read_glob(struct reader *r, struct term *t)
{
    const struct profile_value *v = &r->p->values[t->value];
    if (v->type != PROFILE_STRING && !v->words_count)
        return gon_fail(r->err, GON_E_INPUT, "%s is not a text", v->name);
    if (r->t.kind != PROFILE_TOKEN_QUOTED)
        return gon_fail(r->err, GON_E_INPUT, "what %s is compared with stands in '...'", v->name);
    t->test = TEST_GLOB;
    memcpy(t->glob, r->t.text, sizeof t->glob);
    next(r);
    return 0;
}

static bool is_number(const struct profile *p, int value)
{
    return p->values[value].type != PROFILE_STRING;
}

// "name", or "1.5 * name".
static int read_other(struct reader *r, struct term *t)
{
    const struct profile_value *v = &r->p->values[t->value];
    int other = r->t.kind == PROFILE_TOKEN_WORD ? profile_value(r->p, r->t.text) : -1;
    if (other < 0)
        return gon_fail(r->err, GON_E_INPUT,
                        "'%s' is neither a number nor a word of %s nor a value", r->t.text,
                        v->name);
    if (!is_number(r->p, other))
        return gon_fail(r->err, GON_E_INPUT, "%s is a text, not a number",
                        r->p->values[other].name);
    next(r);
    t->other = other;
    return 0;
}

static int read_compared(struct reader *r, struct term *t)
{
    const struct profile_value *v = &r->p->values[t->value];
    if (!is_number(r->p, t->value))
        return gon_fail(r->err, GON_E_INPUT, "%s is a text; it is compared by ~ '...'", v->name);
    if (v->type == PROFILE_WORD && t->sign > SIGN_UNEQUAL)
        return gon_fail(r->err, GON_E_INPUT, "%s is a word; it is compared by = or !=", v->name);
    t->test = TEST_COMPARE;
    t->other = -1;
    if (r->t.kind == PROFILE_TOKEN_END || r->t.kind == PROFILE_TOKEN_SIGN ||
        r->t.kind == PROFILE_TOKEN_BAD)
        return gon_fail(r->err, GON_E_INPUT, "%s is compared with nothing", v->name);
    if (profile_literal(v, r->t.text, &t->number, NULL) < 0) {
        t->number = 1;
        return read_other(r, t);
    }
    next(r);
    return take(r, "*") ? read_other(r, t) : 0;
}

static bool take_sign(struct reader *r, enum sign *ret_sign)
{
    static const char *const signs[] = {"=", "!=", "<", "<=", ">", ">="};
    for (int i = 0; i < (int)(sizeof signs / sizeof *signs); i++)
        if (take(r, signs[i])) {
            *ret_sign = (enum sign)i;
            return true;
        }
    return false;
}

static int read_test(struct reader *r, struct term *t)
{
    if (take_sign(r, &t->sign))
        return read_compared(r, t);
    if (t->absolute)
        return gon_fail(r->err, GON_E_INPUT, "|%s| is compared with nothing",
                        r->p->values[t->value].name);
    if ((t->contrary = take(r, "lacks")) || take(r, "has"))
        return read_mask(r, t);
    if ((t->contrary = take(r, "!~")) || take(r, "~"))
        return read_glob(r, t);
    if ((t->contrary = take(r, "unknown")) || take(r, "known")) {
        t->test = TEST_KNOWN;
        return 0;
    }
    return gon_fail(r->err, GON_E_INPUT, "nothing is said about %s", r->p->values[t->value].name);
}

static int read_term(struct reader *r, struct term *ret_term)
{
    struct term t = {.other = -1};
    const bool negated = take(r, "not");
    int rc;
    if (r->t.kind == PROFILE_TOKEN_WORD && strchr(r->t.text, '.')) {
        rc = read_bit(r, &t);
        t.contrary = negated;
    } else if (negated) {
        return gon_fail(r->err, GON_E_INPUT, "behind not stands a bit, VALUE.NAME");
    } else {
        t.absolute = take(r, "|");
        rc = read_name(r, &t.value);
        if (rc == 0 && t.absolute && !take(r, "|"))
            return gon_fail(r->err, GON_E_INPUT, "the second | is missing behind %s",
                            r->p->values[t.value].name);
        if (rc == 0)
            rc = read_test(r, &t);
    }
    if (rc == 0)
        *ret_term = t;
    return rc;
}

// Gives each term to see, until it says false.
static int each_term(const struct profile *p, const char *condition,
                     bool (*see)(void *ctx, const struct term *t), void *ctx, struct gon_error *err)
{
    struct reader r = {.p = p, .at = condition, .err = err};
    struct term t;
    next(&r);
    if (r.t.kind == PROFILE_TOKEN_END)
        return 0;
    for (;;) {
        int rc = read_term(&r, &t);
        if (rc < 0 || !see(ctx, &t) || r.t.kind == PROFILE_TOKEN_END)
            return rc;
        if (!take(&r, "and"))
            return gon_fail(err, GON_E_INPUT, "'and' is missing before '%s'", r.t.text);
    }
}

// --- judging -------------------------------------------------------------------------------------

static bool compare(enum sign sign, double a, double b)
{
    const bool same = a == b || fabs(a - b) <= SAME * fmin(fabs(a), fabs(b));
    switch (sign) {
    case SIGN_EQUAL: return same;
    case SIGN_UNEQUAL: return !same;
    case SIGN_LESS: return a < b && !same;
    case SIGN_LESS_EQUAL: return a < b || same;
    case SIGN_MORE: return a > b && !same;
    case SIGN_MORE_EQUAL:
    default: return a > b || same;
    }
}

static bool has_bits(double number, uint64_t bits)
{
    return fabs(number) < 0x1p53 && ((uint64_t)(int64_t)number & bits) != 0;
}

struct judge {
    const struct profile_data *d;
    bool holds;
};

static bool judge(void *ctx, const struct term *t)
{
    struct judge *j = ctx;
    const struct profile_data *d = j->d;
    const double number = t->absolute ? fabs(d->number[t->value]) : d->number[t->value];
    if (t->test == TEST_KNOWN)
        return j->holds = d->known[t->value] != t->contrary;
    if (!d->known[t->value] || (t->test == TEST_COMPARE && t->other >= 0 && !d->known[t->other]))
        return j->holds = false;
    switch (t->test) {
    case TEST_COMPARE:
        j->holds =
            compare(t->sign, number, t->other < 0 ? t->number : t->number * d->number[t->other]);
        break;
    case TEST_BITS: j->holds = isfinite(number) && has_bits(number, t->bits) != t->contrary; break;
    case TEST_GLOB:
        j->holds =
            fnmatch(t->glob, d->text[t->value], FNM_CASEFOLD) == (t->contrary ? FNM_NOMATCH : 0);
        break;
    case TEST_KNOWN:
    default: break;
    }
    return j->holds;
}

bool profile_when(const struct profile *p, const char *condition, const struct profile_data *d)
{
    struct judge j = {.d = d, .holds = true};
    return each_term(p, condition, judge, &j, NULL) == 0 && j.holds;
}

static bool go_on(void *ctx, const struct term *t)
{
    (void)ctx, (void)t;
    return true;
}

int profile_when_check(const struct profile *p, const char *condition, struct gon_error *err)
{
    return each_term(p, condition, go_on, NULL, err);
}

static bool mark(void *ctx, const struct term *t)
{
    bool *uses = ctx;
    uses[t->value] = true;
    if (t->test == TEST_COMPARE && t->other >= 0)
        uses[t->other] = true;
    return true;
}

void profile_when_uses(const struct profile *p, const char *condition,
                       bool ret_uses[PROFILE_VALUES])
{
    each_term(p, condition, mark, ret_uses, NULL);
}
