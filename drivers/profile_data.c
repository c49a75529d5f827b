// SPDX-License-Identifier: MIT
#include "drivers/profile_data.h"

#include "drivers/message.h"
#include "drivers/profile_token.h"

#include <math.h>
#include <string.h>
#include <strings.h>

#define LADDER_NEAR 1e-6 // relative: what a number written with some digits may be off
#define SAME 1e-9        // relative: what computing may cost

static bool near(double a, double b, double relative)
{
    return fabs(a - b) <= relative * fmax(fabs(a), fabs(b));
}

static bool is_whole(const struct profile_value *v)
{
    return v->type == PROFILE_INT || v->type == PROFILE_HEX;
}

static double scale_of(const struct profile_value *v)
{
    return v->scale != 0 ? v->scale : 1;
}

static bool in_range(const struct profile_value *v, double number)
{
    return v->min == v->max || (number >= v->min && number <= v->max);
}

// --- words and literals --------------------------------------------------------------------------

const char *profile_word(const struct profile_value *v, double number)
{
    const double at = number - v->ladder_first;
    return at >= 0 && at < v->words_count && at == floor(at) ? v->words[(int)at] : NULL;
}

static int read_hex(const char *digits, double *ret_number)
{
    uint64_t n = 0;
    const size_t length = strlen(digits);
    if (length == 0 || length > 12 || strspn(digits, "0123456789abcdefABCDEF") != length)
        return -1;
    for (; *digits; digits++)
        n = 16 * n + (uint64_t)(*digits <= '9' ? *digits - '0' : (*digits & 7) + 9);
    *ret_number = (double)n;
    return 0;
}

int profile_literal(const struct profile_value *v, const char *text, double *ret_number,
                    struct gon_error *err)
{
    for (int i = 0; v && i < v->words_count; i++)
        if (strcasecmp(v->words[i], text) == 0) {
            *ret_number = v->ladder_first + i;
            return 0;
        }
    if (strcmp(text, "over") == 0) {
        *ret_number = (double)INFINITY;
        return 0;
    }
    if (text[0] == '0' && (text[1] == 'x' || text[1] == 'X') && read_hex(text + 2, ret_number) == 0)
        return 0;
    if (!(v && v->type == PROFILE_WORD) && message_decimal(text, ret_number, NULL) == 0)
        return 0;
    return gon_fail(err, GON_E_INPUT,
                    v && v->words_count ? "'%.40s' is no word of %s"
                                        : "'%.40s' is not a number%.0s",
                    text, v ? v->name : "");
}

// --- data ----------------------------------------------------------------------------------------

void profile_data_clear(struct profile_data *d)
{
    memset(d, 0, sizeof *d);
}

void profile_data_set(const struct profile *p, struct profile_data *d, int value, double number)
{
    const struct profile_value *v = &p->values[value];
    const char *word = profile_word(v, number);
    d->known[value] =
        !isnan(number) && v->type != PROFILE_STRING && (word || v->type != PROFILE_WORD);
    d->number[value] = d->known[value] ? number : (double)NAN;
    snprintf(d->text[value], sizeof d->text[value], "%s", word ? word : "");
}

int profile_data_set_text(const struct profile *p, struct profile_data *d, int value,
                          const char *text, struct gon_error *err)
{
    const struct profile_value *v = &p->values[value];
    double number;
    if (v->type != PROFILE_STRING) {
        int rc = profile_literal(v, text, &number, err);
        if (rc == 0)
            profile_data_set(p, d, value, number);
        return rc;
    }
    if (strlen(text) >= sizeof d->text[value])
        return gon_fail(err, GON_E_INPUT, "%s: '%.40s...' is longer than %d characters", v->name,
                        text, PROFILE_DATA_TEXT - 1);
    d->known[value] = true;
    d->number[value] = (double)NAN;
    strcpy(d->text[value], text);
    return 0;
}

double profile_data_number(const struct profile *p, const struct profile_data *d, const char *name)
{
    const int value = *name ? profile_value(p, name) : -1;
    return value >= 0 && d->known[value] ? d->number[value] : (double)NAN;
}

// --- the wire ------------------------------------------------------------------------------------

static int ladder_wire(const struct profile_value *v, double number, double *ret_wire,
                       struct gon_error *err)
{
    int best = 0;
    for (int i = 1; i < v->ladder_count; i++)
        if (fabs(v->ladder[i] - number) < fabs(v->ladder[best] - number))
            best = i;
    if (!near(v->ladder[best], number, LADDER_NEAR))
        return gon_fail(err, GON_E_INPUT, "%s = %g%s%s is not one of its settings; nearest: %g",
                        v->name, number, *v->unit ? " " : "", v->unit, v->ladder[best]);
    *ret_wire = v->ladder_first + best;
    return 0;
}

int profile_wire(const struct profile_value *v, double number, double *ret_wire,
                 struct gon_error *err)
{
    if (isinf(number) && number > 0 && v->over_count) {
        *ret_wire = v->over[0];
        return 0;
    }
    if (!isfinite(number) || !in_range(v, number))
        return gon_fail(err, GON_E_INPUT, "%s = %g%s%s; allowed: %g..%g", v->name, number,
                        *v->unit ? " " : "", v->unit, v->min, v->max);
    if (v->ladder_count)
        return ladder_wire(v, number, ret_wire, err);
    if (v->type == PROFILE_WORD && !profile_word(v, number))
        return gon_fail(err, GON_E_INPUT, "%s = %g has no word", v->name, number);
    const double shifted = number - v->offset;
    if (v->inverse && shifted == 0)
        return gon_fail(err, GON_E_INPUT, "%s = %g cannot be said: it would be 1/0", v->name,
                        number);
    double wire = v->inverse ? scale_of(v) / shifted : shifted / scale_of(v);
    if (is_whole(v)) {
        if (!near(wire, round(wire), SAME))
            return gon_fail(err, GON_E_INPUT, "%s = %.10g is not a whole number%s", v->name, number,
                            scale_of(v) != 1 ? " of its steps" : "");
        wire = round(wire);
    }
    *ret_wire = wire;
    return 0;
}

static bool is_one_of(const double *list, int count, double wire)
{
    for (int i = 0; i < count; i++)
        if (near(list[i], wire, LADDER_NEAR))
            return true;
    return false;
}

static int ladder_number(const struct profile_value *v, double wire, double *ret_number,
                         struct gon_error *err)
{
    const double at = wire - v->ladder_first;
    if (!(at >= 0 && at < v->ladder_count && at == floor(at)))
        return gon_fail(err, GON_E_LINK, "%s: %.10g is not in %d..%d", v->name, wire,
                        v->ladder_first, v->ladder_first + v->ladder_count - 1);
    *ret_number = v->ladder[(int)at];
    return 0;
}

int profile_number(const struct profile_value *v, double wire, double *ret_number,
                   struct gon_error *err)
{
    if (is_one_of(v->over, v->over_count, wire) || is_one_of(v->invalid, v->invalid_count, wire)) {
        *ret_number = is_one_of(v->over, v->over_count, wire) ? (double)INFINITY : (double)NAN;
        return 0;
    }
    if (!isfinite(wire))
        return gon_fail(err, GON_E_LINK, "%s: %g is not a number", v->name, wire);
    if (is_whole(v) && wire != floor(wire))
        return gon_fail(err, GON_E_LINK, "%s: %.10g is not a whole number", v->name, wire);
    if (v->ladder_count)
        return ladder_number(v, wire, ret_number, err);
    if (v->type == PROFILE_WORD && !profile_word(v, wire))
        return gon_fail(err, GON_E_LINK, "%s: %.10g is no word's number", v->name, wire);
    const double number = (v->inverse ? scale_of(v) / wire : wire * scale_of(v)) + v->offset;
    if (!isfinite(number) || !in_range(v, number))
        return gon_fail(err, GON_E_LINK, "%s: %.10g%s%s is not in %g..%g", v->name, number,
                        *v->unit ? " " : "", v->unit, v->min, v->max);
    *ret_number = number;
    return 0;
}

int profile_at_least(const struct profile_value *v, double number, double *ret_number,
                     struct gon_error *err)
{
    double least = v->ladder_count ? (double)INFINITY : number;
    for (int i = 0; i < v->ladder_count; i++)
        if (v->ladder[i] >= number - SAME * fabs(number))
            least = fmin(least, v->ladder[i]);
    if (!isfinite(least))
        return gon_fail(err, GON_E_INPUT, "%s: %g%s%s is more than its largest setting", v->name,
                        number, *v->unit ? " " : "", v->unit);
    *ret_number = least;
    return 0;
}

// --- assignments ---------------------------------------------------------------------------------

static int read_param(const struct profile_param *params, const char *name, double *ret_number,
                      struct gon_error *err)
{
    for (; params && params->name; params++)
        if (strcmp(params->name, name) == 0) {
            *ret_number = params->number;
            return 0;
        }
    return gon_fail(err, GON_E_INPUT, "there is no $%s here", name);
}

static int read_right(const struct profile_value *v, const struct profile_token *t,
                      const struct profile_param *params, double *ret_number, struct gon_error *err)
{
    if (t->kind != PROFILE_TOKEN_WORD && t->kind != PROFILE_TOKEN_QUOTED)
        return gon_fail(err, GON_E_INPUT, "%s = what?", v->name);
    if (t->kind == PROFILE_TOKEN_WORD && t->text[0] == '$')
        return read_param(params, t->text + 1, ret_number, err);
    if (v->type != PROFILE_STRING)
        return profile_literal(v, t->text, ret_number, err);
    *ret_number = (double)NAN;
    return 0;
}

int profile_assign(const struct profile *p, const char *text, const struct profile_param *params,
                   int (*take)(void *ctx, int value, double number, const char *text,
                               struct gon_error *err),
                   void *ctx, struct gon_error *err)
{
    const char *at = text;
    double number;
    struct profile_token left = profile_token_next(&at);
    while (left.kind != PROFILE_TOKEN_END) {
        const int value = left.kind == PROFILE_TOKEN_WORD ? profile_value(p, left.text) : -1;
        if (value < 0)
            return gon_fail(err, GON_E_INPUT, "there is no value '%s'", left.text);
        const struct profile_value *v = &p->values[value];
        const struct profile_token sign = profile_token_next(&at);
        if (!profile_token_is(&sign, "="))
            return gon_fail(err, GON_E_INPUT, "'=' is missing behind %s", v->name);
        const struct profile_token right = profile_token_next(&at);
        int rc = read_right(v, &right, params, &number, err);
        if (rc == 0)
            rc = take(ctx, value, number, v->type == PROFILE_STRING ? right.text : NULL, err);
        if (rc < 0)
            return rc;
        const struct profile_token comma = profile_token_next(&at);
        if (comma.kind == PROFILE_TOKEN_END)
            break;
        if (!profile_token_is(&comma, ","))
            return gon_fail(err, GON_E_INPUT, "a comma is missing before '%s'", comma.text);
        left = profile_token_next(&at);
        if (left.kind == PROFILE_TOKEN_END)
            return gon_fail(err, GON_E_INPUT, "nothing stands behind the last comma");
    }
    return 0;
}

struct into {
    const struct profile *p;
    struct profile_data *d;
};

static int take_into(void *ctx, int value, double number, const char *text, struct gon_error *err)
{
    const struct into *to = ctx;
    if (text)
        return profile_data_set_text(to->p, to->d, value, text, err);
    profile_data_set(to->p, to->d, value, number);
    return 0;
}

int profile_assign_data(const struct profile *p, const char *text,
                        const struct profile_param *params, struct profile_data *d,
                        struct gon_error *err)
{
    struct into to = {p, d};
    return profile_assign(p, text, params, take_into, &to, err);
}
