// SPDX-License-Identifier: MIT
// What session_text.c (exchanges, questions, life) and session_tell.c (settings, errors that the
// instrument keeps) share; nobody else includes it.
#pragma once
#include "drivers/message.h"
#include "drivers/session_inside.h"

#define TEXT_TRIES 3

enum { TEXT_COMMAND = 200, TEXT_ANSWER = 400 };

struct text_session {
    struct session session; // first
    struct message *m;
    struct message_format format;
    const struct profile_exchange *sync; // NULL: none
    bool learning;                       // its next answer is remembered
    char sync_send[TEXT_COMMAND], sync_begins[TEXT_ANSWER];
};

static inline struct text_session *text_of(struct session *s)
{
    return (struct text_session *)s;
}

const char *text_link(const struct session *s);
// Sleeps, gives the clock its turn; GON_E_CANCELED.
int text_pause(struct text_session *t, int64_t duration_ns, struct gon_error *err);
int text_find(struct text_session *t, const char *name, const struct profile_exchange **ret,
              struct gon_error *err);
// The command and its answer into data, once; "busy", which says that it was not carried out, is
// waited out.
int text_exchange(struct text_session *t, const struct profile_exchange *x, struct gon_error *err);
// Up to tries times while the link fails; then its errors, where the profile says so.
int text_ask_exchange(struct text_session *t, const struct profile_exchange *x, int tries,
                      struct gon_error *err);

// Asks for errors until none is left: GON_E_DEVICE or GON_E_REFUSED with the first one.
int text_check_errors(struct text_session *t, const struct profile_exchange *x,
                      struct gon_error *err);
int text_send(struct session *s, const char *name, const struct profile_param *params,
              struct gon_error *err);
