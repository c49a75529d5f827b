// SPDX-License-Identifier: MIT
// What sessions over text links (session_text.c) and over buses (session_bus.c) have in common; for
// session*.c only. Each has struct session as its first member and these calls; session.c does what
// does not depend on bytes or registers: names, conditions, who it is, restarts, meanings.
#pragma once
#include "drivers/session.h"

struct session_ops {
    // Brings all asked values into data, or fails; once: one try. A name that the profile lacks is
    // a bug of whoever checked the profile: GON_E_INPUT names it.
    int (*ask)(struct session *s, const struct profile_asks *asks, bool once,
               struct gon_error *err);
    int (*send)(struct session *s, const char *name, const struct profile_param *params,
                struct gon_error *err);
    int (*send_blind)(struct session *s, const char *text, bool at_once,
                      struct gon_error *err); // NULL: there is no such thing
    int (*reopen)(struct session *s, struct gon_error *err);
    void (*forget)(struct session *s); // before it is identified anew; NULL: nothing to forget
    const char *(*link)(const struct session *s);
    struct message *(*message)(const struct session *s); // NULL: has none
    void (*free)(struct session *s);
};

struct session {
    const struct session_ops *ops; // first
    const struct profile *profile;
    struct profile_data data;
    enum profile_meaning meaning; // of the last refusal
    bool restarted;
};

void session_init(struct session *s, const struct session_ops *ops, const struct profile *p);
// An answer brought these values: those whose "valid" does not hold become unknown.
void session_doubt(const struct profile *p, struct profile_data *d,
                   const bool fresh[PROFILE_VALUES]);
// They are believed and in data: looks whether they tell of a restart.
void session_saw(struct session *s, const bool fresh[PROFILE_VALUES]);
// The instrument said no: remembers the meaning; GON_E_REFUSED where a person can change it (busy,
// interlock, key), else GON_E_DEVICE.
int session_refused(struct session *s, enum profile_meaning means, struct gon_error *err,
                    const char *format, ...) __attribute__((format(printf, 4, 5)));
// Whether a value that was read back is the one that was set, as well as its resolution allows
// (0.1 % where that is not known; ladders and words exactly).
bool session_same(const struct profile_value *v, double set, double now);
