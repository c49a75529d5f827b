// SPDX-License-Identifier: MIT
// What an instrument made from a profile knows: each of the profile's values as a number and a
// text, and the number as the wire carries it. The simulator's own reading of a profile, apart from
// the drivers'. Thread: one.
#pragma once
#include "drivers/profile.h"

#include <stdbool.h>
#include <stddef.h>

enum { ACTOR_TEXT = 96 };

// number: a word's place in its list, a ladder's number, INFINITY beyond the range; NAN: nothing is
// measured. text: of a text only.
struct actor_values {
    const struct profile *profile;
    double number[PROFILE_VALUES];
    char text[PROFILE_VALUES][ACTOR_TEXT];
};

// As the power comes on: what the profile says, or something that the value can be.
void actor_values_start(struct actor_values *v, const struct profile *profile);
int actor_values_find(const struct actor_values *v, const char *name, size_t size); // -1: none
// The index of a value and of one of its bits (-1: the whole value) by "NAME" or "NAME.BIT".
bool actor_values_part(const struct actor_values *v, const char *name, int *ret_value,
                       int *ret_bit);
double actor_values_bit(const struct actor_values *v, int value, int bit); // bit -1: all of it
void actor_values_set_bit(struct actor_values *v, int value, int bit, double number);
// The number of one of its words (-1: none), whatever the letters' case, and the word of a number.
int actor_values_word(const struct actor_values *v, int value, const char *word);
const char *actor_values_name(const struct actor_values *v, int value, double number);

double actor_values_wire(const struct actor_values *v, int value);
// What the wire says, if the value can be that.
bool actor_values_take(struct actor_values *v, int value, double wire);
