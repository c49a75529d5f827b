// SPDX-License-Identifier: MIT
// What is known of an instrument: its profile's values as numbers and texts, and how a number
// becomes what the wire carries and back. Thread: any; the data belongs to its maker.
#pragma once
#include "drivers/profile.h"

enum { PROFILE_DATA_TEXT = 96 };

// number: a ladder's number, a word's index, INFINITY beyond the range; NAN for a text. text: of a
// text and of a word. Nothing counts while known is false.
struct profile_data {
    bool known[PROFILE_VALUES];
    double number[PROFILE_VALUES];
    char text[PROFILE_VALUES][PROFILE_DATA_TEXT];
};

void profile_data_clear(struct profile_data *d); // nothing is known
void profile_data_set(const struct profile *p, struct profile_data *d, int value, double number);
// A word's number is found; GON_E_INPUT for a word that is not in the list or a text too long.
int profile_data_set_text(const struct profile *p, struct profile_data *d, int value,
                          const char *text, struct gon_error *err);
// The number of a value by its name; NAN when the name is "" or it is not known.
double profile_data_number(const struct profile *p, const struct profile_data *d, const char *name);

// What the wire carries for a number: GON_E_INPUT beyond min..max, for a number that is not on its
// ladder (a ladder takes the nearest of its numbers within 1e-6 relative), or a whole number's
// fraction.
int profile_wire(const struct profile_value *v, double number, double *ret_wire,
                 struct gon_error *err);
// And back. INFINITY for an over, NAN for an invalid one; GON_E_LINK beyond min..max or the ladder:
// the device cannot have said that.
int profile_number(const struct profile_value *v, double wire, double *ret_number,
                   struct gon_error *err);
// The ladder's first number that is at least the one asked (within 1e-9), in the order of their
// sizes; GON_E_INPUT when all are smaller. Without a ladder the number itself.
int profile_at_least(const struct profile_value *v, double number, double *ret_number,
                     struct gon_error *err);

// "emission = 1, mode = warming, speed = $speed": each assignment is given to take. $NAME is looked
// up in params (NULL: none are allowed). GON_E_INPUT: unknown name, word or form; or what take
// returned.
struct profile_param {
    const char *name; // NULL ends the list
    double number;
};
int profile_assign(const struct profile *p, const char *text, const struct profile_param *params,
                   int (*take)(void *ctx, int value, double number, const char *text,
                               struct gon_error *err),
                   void *ctx, struct gon_error *err);
// The same into data; values that texts name are set as known.
int profile_assign_data(const struct profile *p, const char *text,
                        const struct profile_param *params, struct profile_data *d,
                        struct gon_error *err);
