// SPDX-License-Identifier: MIT
// For profile_check*.c only: what they have in common.
#pragma once
#include "drivers/profile_when.h"

struct checking {
    struct cfg_file *f;
    const struct profile *p;
    int mistakes;
};

// Where in the file: "laser.states[2].when".
struct place {
    char path[120];
};
struct place check_at(const char *fmt, ...) __attribute__((format(printf, 1, 2)));
void check_says(struct checking *c, struct place at, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

// "" is never a mistake for these: what must be there is said by check_given.
bool check_given(struct checking *c, struct place at, const char *text, const char *what);
bool check_value_name(struct checking *c, struct place at, const char *name);
bool check_asked_name(struct checking *c, struct place at, const char *name);
bool check_sent_name(struct checking *c, struct place at, const char *name);
void check_asks(struct checking *c, const char *path, const struct profile_asks *asks);
void check_condition(struct checking *c, struct place at, const char *condition);
// may_be: the values that may stand in it, else not_so is said of them.
void check_assignments(struct checking *c, struct place at, const char *text,
                       const bool may_be[PROFILE_VALUES], const char *not_so);
// What the simulated instrument changes: "mode = 4, output.moving = 0, target = position,
// open = not open".
void check_then(struct checking *c, struct place at, const char *text);
void check_pattern(struct checking *c, struct place at, const char *pattern, bool reading);
// Letters, digits and _; not the same as one of the earlier names.
void check_new_name(struct checking *c, const char *list, int index, const char *first,
                    size_t stride);

// Values that the asks bring, besides those already true.
void check_gives(const struct profile *p, const struct profile_asks *asks,
                 bool ret_gives[PROFILE_VALUES]);
// A condition that speaks of a value that is not among them would never hold.
void check_covered(struct checking *c, struct place at, const char *condition,
                   const bool gives[PROFILE_VALUES]);
void check_codes(struct checking *c, const char *path, const struct profile_code *codes, int count);

void check_values(struct checking *c);
void check_messages(struct checking *c);
void check_registers(struct checking *c);
void check_roles(struct checking *c);
void check_simulate(struct checking *c);
