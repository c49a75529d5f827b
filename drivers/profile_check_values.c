// SPDX-License-Identifier: MIT
#include "drivers/profile_check_inside.h"

#include <string.h>
#include <strings.h>

static bool is_whole(const struct profile_value *v)
{
    return v->type == PROFILE_INT || v->type == PROFILE_HEX;
}

static void check_words(struct checking *c, int i, const struct profile_value *v)
{
    if (v->type == PROFILE_WORD && !v->words_count)
        check_says(c, check_at("values[%d].type", i), "a word needs its list of words");
    if (v->words_count && v->type != PROFILE_WORD && !is_whole(v))
        check_says(c, check_at("values[%d].words", i), "only a word or a whole number has words");
    if (v->words_count && v->ladder_count)
        check_says(c, check_at("values[%d].ladder", i), "words or a ladder, not both");
    for (int k = 0; k < v->words_count; k++)
        for (int j = 0; j < k; j++)
            if (strcasecmp(v->words[j], v->words[k]) == 0)
                check_says(c, check_at("values[%d].words[%d]", i, k), "is in the list already");
}

static void check_ladder(struct checking *c, int i, const struct profile_value *v)
{
    if (v->ladder_count && (v->scale != 1 || v->offset != 0 || v->inverse))
        check_says(c, check_at("values[%d].ladder", i),
                   "a ladder's numbers are listed as they are, without scale and offset");
    if (v->ladder_count && (v->type == PROFILE_STRING || v->type == PROFILE_WORD))
        check_says(c, check_at("values[%d].ladder", i), "only a number has a ladder");
    for (int k = 0; k < v->ladder_count; k++) {
        if (v->min != v->max && (v->ladder[k] < v->min || v->ladder[k] > v->max))
            check_says(c, check_at("values[%d].ladder[%d]", i, k), "is not within min..max");
        for (int j = 0; j < k; j++)
            if (v->ladder[j] == v->ladder[k])
                check_says(c, check_at("values[%d].ladder[%d]", i, k), "is in the ladder already");
    }
}

// Bits of the number that the wire carries.
static int width_of(const struct profile *p, const struct profile_value *v)
{
    if (p->protocol == PROFILE_MESSAGE)
        return 32;
    if (v->table == PROFILE_COIL || v->table == PROFILE_DISCRETE)
        return 1;
    return v->format == PROFILE_U16 || v->format == PROFILE_S16 ? 16 : 32;
}

static void check_bits(struct checking *c, int i, const struct profile_value *v)
{
    const int width = width_of(c->p, v);
    if (v->bits_count && (!is_whole(v) || v->ladder_count || v->scale != 1 || v->offset != 0 ||
                          (c->p->protocol == PROFILE_MODBUS && v->format == PROFILE_F32)))
        check_says(c, check_at("values[%d].bits", i),
                   "only a whole number (int, hex) as the wire carries it has bits");
    for (int k = 0; k < v->bits_count; k++) {
        check_new_name(c, check_at("values[%d].bits", i).path, k, v->bits[0].name, sizeof *v->bits);
        if (v->bits[k].bit >= width)
            check_says(c, check_at("values[%d].bits[%d].bit", i, k), "its format has bits 0..%d",
                       width - 1);
        for (int j = 0; j < k; j++)
            if (v->bits[j].bit == v->bits[k].bit)
                check_says(c, check_at("values[%d].bits[%d].bit", i, k),
                           "has the name '%s' already", v->bits[j].name);
    }
}

void check_values(struct checking *c)
{
    for (int i = 0; i < c->p->values_count; i++) {
        const struct profile_value *v = &c->p->values[i];
        check_new_name(c, "values", i, c->p->values[0].name, sizeof *v);
        if (v->scale == 0)
            check_says(c, check_at("values[%d].scale", i), "makes every number the same");
        if (v->min > v->max)
            check_says(c, check_at("values[%d].min", i), "is above max = %g%s", v->max,
                       v->max == 0 ? ", which is 0 where it is not given" : "");
        check_words(c, i, v);
        check_ladder(c, i, v);
        check_bits(c, i, v);
        check_condition(c, check_at("values[%d].valid", i), v->valid);
    }
}
