// SPDX-License-Identifier: MIT
#include "sim/actor_values.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const struct profile_value *the(const struct actor_values *v, int value)
{
    return &v->profile->values[value];
}

int actor_values_find(const struct actor_values *v, const char *name, size_t size)
{
    for (int i = 0; i < v->profile->values_count; i++)
        if (strncmp(the(v, i)->name, name, size) == 0 && the(v, i)->name[size] == 0)
            return i;
    return -1;
}

bool actor_values_part(const struct actor_values *v, const char *name, int *ret_value, int *ret_bit)
{
    size_t size = strcspn(name, ".");
    int value = actor_values_find(v, name, size);
    if (value < 0)
        return false;
    int bit = -1;
    for (int i = 0; name[size] && i < the(v, value)->bits_count; i++)
        if (strcmp(the(v, value)->bits[i].name, name + size + 1) == 0)
            bit = the(v, value)->bits[i].bit;
    if (name[size] && bit < 0)
        return false;
    *ret_value = value;
    *ret_bit = bit;
    return true;
}

static uint64_t whole(double number)
{
    return isfinite(number) ? (uint64_t)llround(number) : 0;
}

double actor_values_bit(const struct actor_values *v, int value, int bit)
{
    double number = v->number[value];
    return bit < 0 || isnan(number) ? number : (double)(whole(number) >> bit & 1);
}

void actor_values_set_bit(struct actor_values *v, int value, int bit, double number)
{
    uint64_t mask = UINT64_C(1) << (bit < 0 ? 0 : bit);
    uint64_t bits = whole(v->number[value]);
    if (bit >= 0)
        number = (double)(number != 0 ? bits | mask : bits & ~mask);
    v->number[value] = number;
}

int actor_values_word(const struct actor_values *v, int value, const char *word)
{
    for (int i = 0; i < the(v, value)->words_count; i++)
        if (strcasecmp(the(v, value)->words[i], word) == 0)
            return the(v, value)->ladder_first + i;
    return -1;
}

const char *actor_values_name(const struct actor_values *v, int value, double number)
{
    double at = number - the(v, value)->ladder_first;
    return at >= 0 && at < the(v, value)->words_count ? the(v, value)->words[(int)at] : NULL;
}

// --- the start -----------------------------------------------------------------------------------

static double plausible(const struct profile_value *p)
{
    if (p->ladder_count > 0)
        return p->ladder[0];
    if (p->words_count > 0)
        return p->ladder_first;
    if (p->min >= p->max)
        return 0;
    return p->min > 0 ? p->min : p->max < 0 ? p->max : 0;
}

static void begin(struct actor_values *v, int value, const char *is)
{
    int word = actor_values_word(v, value, is);
    snprintf(v->text[value], ACTOR_TEXT, "%s", is);
    v->number[value] = word >= 0                   ? word
                       : strncmp(is, "0x", 2) == 0 ? (double)strtoull(is, NULL, 16)
                                                   : strtod(is, NULL);
}

void actor_values_start(struct actor_values *v, const struct profile *profile)
{
    *v = (struct actor_values){.profile = profile};
    for (int i = 0; i < profile->values_count; i++) {
        v->number[i] = plausible(the(v, i));
        snprintf(v->text[i], ACTOR_TEXT, "SIM-%s", profile->values[i].name);
    }
    for (int i = 0; i < profile->simulate.start_count; i++) {
        const struct profile_start *s = &profile->simulate.start[i];
        int value = actor_values_find(v, s->value, strlen(s->value));
        if (value >= 0)
            begin(v, value, s->is);
    }
}

// --- the wire ------------------------------------------------------------------------------------

static double scale(const struct profile_value *p)
{
    return p->scale != 0 ? p->scale : 1;
}

static double steps_of(const struct profile_value *p, double number)
{
    int best = 0;
    for (int i = 1; i < p->ladder_count; i++)
        if (fabs(p->ladder[i] - number) < fabs(p->ladder[best] - number))
            best = i;
    return p->ladder_first + best;
}

double actor_values_wire(const struct actor_values *v, int value)
{
    const struct profile_value *p = the(v, value);
    double number = v->number[value];
    if (isnan(number))
        return p->invalid_count > 0 ? p->invalid[0] : 0;
    if (isinf(number))
        return p->over_count > 0 ? p->over[0] : 9.9e37;
    if (p->ladder_count > 0)
        return steps_of(p, number);
    number -= p->offset;
    return p->inverse ? scale(p) / number : number / scale(p);
}

bool actor_values_take(struct actor_values *v, int value, double wire)
{
    const struct profile_value *p = the(v, value);
    double number = (p->inverse ? scale(p) / wire : wire * scale(p)) + p->offset;
    if (p->ladder_count > 0) {
        double step = wire - p->ladder_first;
        if (step != floor(step) || step < 0 || step >= p->ladder_count)
            return false;
        number = p->ladder[(int)step];
    }
    if (p->type == PROFILE_WORD && !actor_values_name(v, value, wire))
        return false;
    double grain = 1e-9 * fmax(fabs(p->min), fabs(p->max)); // what decimals cost
    if (!isfinite(number) ||
        (p->min < p->max && (number < p->min - grain || number > p->max + grain)))
        return false;
    v->number[value] = number;
    return true;
}
