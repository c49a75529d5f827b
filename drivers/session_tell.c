// SPDX-License-Identifier: MIT
// A session over a text link: what is set, whether it was taken, and the errors that an instrument
// keeps.
#include "drivers/session_text_inside.h"

#include "drivers/profile_text.h"

#include <stdio.h>
#include <string.h>

#define ERRORS_MOST 32 // of a queue that is emptied

// --- errors that the instrument keeps ------------------------------------------------------------

static const struct profile_code *code_of(const struct profile_errors *e, double code)
{
    for (int i = 0; i < e->codes_count; i++)
        if (e->codes[i].code == (int)code)
            return &e->codes[i];
    return NULL;
}

static void describe_bits(const struct profile_value *v, double number, char *out, size_t size)
{
    for (int b = 0; b < v->bits_count && number >= 0; b++)
        if ((uint64_t)number >> v->bits[b].bit & 1) {
            const size_t used = strlen(out);
            snprintf(out + used, size - used, " (%s)",
                     *v->bits[b].help ? v->bits[b].help : v->bits[b].name);
        }
}

// "esr is 16 (bad parameter)", "code is -113, text is Undefined header".
static void describe(const struct session *s, const struct profile_exchange *x, char *out,
                     size_t size)
{
    const struct profile *p = s->profile;
    bool gives[PROFILE_VALUES] = {false};
    size_t used = 0;
    *out = 0;
    profile_text_uses(p, x->answer, gives);
    for (int i = 0; i < p->values_count && used + 1 < size; i++) {
        const struct profile_value *v = &p->values[i];
        if (!gives[i] || !s->data.known[i])
            continue;
        used = strlen(out);
        if (v->type == PROFILE_STRING || v->type == PROFILE_WORD)
            snprintf(out + used, size - used, "%s%s is %s", used ? ", " : "", v->name,
                     s->data.text[i]);
        else
            snprintf(out + used, size - used, "%s%s is %.10g", used ? ", " : "", v->name,
                     s->data.number[i]);
        describe_bits(v, s->data.number[i], out, size);
    }
}

// Asks until nothing is left; text is that of the first error, and means its kind.
static int take_errors(struct text_session *t, char *text, size_t size,
                       enum profile_meaning *ret_means, struct gon_error *err)
{
    struct session *s = &t->session;
    const struct profile_errors *e = &s->profile->errors;
    const struct profile_exchange *x = NULL;
    *ret_means = PROFILE_FINE;
    *text = 0;
    int rc = text_find(t, e->ask, &x, err);
    for (int i = 0; rc == 0 && i < ERRORS_MOST; i++) {
        rc = text_ask_exchange(t, x, TEXT_TRIES, err);
        if (rc < 0)
            return rc;
        if (i == 0)
            describe(s, x, text, size);
        if (session_holds(s, e->fine))
            return 0;
        const struct profile_code *code = code_of(e, session_number(s, e->code));
        if (*ret_means != PROFILE_FINE || (code && code->means == PROFILE_FINE))
            continue;
        *ret_means = code ? (enum profile_meaning)code->means : PROFILE_REFUSED;
        describe(s, x, text, size);
        const size_t used = strlen(text);
        if (code)
            snprintf(text + used, size - used, " (%s)", code->text);
    }
    return rc;
}

// The command as it went out with these values.
static const char *command_text(const struct profile *p, const struct profile_exchange *x,
                                const struct profile_data *d, char text[TEXT_COMMAND])
{
    return profile_text_write(p, x->send, d, text, TEXT_COMMAND, NULL) == 0 ? text : x->name;
}

int text_check_errors(struct text_session *t, const struct profile_exchange *x,
                      struct gon_error *err)
{
    struct session *s = &t->session;
    char text[200], command[TEXT_COMMAND];
    enum profile_meaning means;
    int rc = take_errors(t, text, sizeof text, &means, err);
    if (rc < 0 || means == PROFILE_FINE)
        return rc;
    return session_refused(s, means, err, "%s: refuses '%s' (%s)", text_link(s),
                           command_text(s->profile, x, &s->data, command), text);
}

// --- telling -------------------------------------------------------------------------------------

// What was to be set, to compare with what is read back.
struct wish {
    bool sent[PROFILE_VALUES];
    struct profile_data data;
};

static bool is_as_wished(const struct profile_value *v, const struct wish *w, int i,
                         const struct profile_data *now)
{
    if (!now->known[i])
        return false;
    return v->type == PROFILE_STRING ? strcmp(w->data.text[i], now->text[i]) == 0
                                     : session_same(v, w->data.number[i], now->number[i]);
}

// One that reads back another: also says what the instrument keeps as its error.
static int differs(struct text_session *t, const struct profile_exchange *x, const struct wish *w,
                   int value, struct gon_error *err)
{
    struct session *s = &t->session;
    const struct profile_value *v = &s->profile->values[value];
    char kept[200] = "", command[TEXT_COMMAND];
    const double now = s->data.number[value];
    enum profile_meaning means = PROFILE_FINE;
    if (x->check && take_errors(t, kept, sizeof kept, &means, NULL) < 0)
        *kept = 0;
    return session_refused(s, means == PROFILE_FINE ? PROFILE_REFUSED : means, err,
                           "%s: refuses '%s' (%s reads back %.10g %s%s%s)", text_link(s),
                           command_text(s->profile, x, &w->data, command), v->name, now, v->unit,
                           *kept ? ", " : "", kept);
}

// Whether what came with this answer is what was sent.
static int compare(struct text_session *t, const struct profile_exchange *x, const char *answer,
                   const struct wish *w, struct gon_error *err)
{
    const struct profile *p = t->session.profile;
    bool back[PROFILE_VALUES] = {false};
    profile_text_uses(p, answer, back);
    for (int i = 0; i < p->values_count; i++)
        if (back[i] && w->sent[i] && !is_as_wished(&p->values[i], w, i, &t->session.data))
            return differs(t, x, w, i, err);
    return 0;
}

static int verify(struct text_session *t, const struct profile_exchange *x, const struct wish *w,
                  struct gon_error *err)
{
    const struct profile_exchange *back = NULL;
    int rc = text_find(t, x->verify, &back, err);
    if (rc == 0)
        rc = text_ask_exchange(t, back, TEXT_TRIES, err);
    return rc < 0 ? rc : compare(t, x, back->answer, w, err);
}

// Where the answer was lost the read-back tells whether the command arrived: GON_E_LINK, it did
// not.
static int tell_once(struct text_session *t, const struct profile_exchange *x, const struct wish *w,
                     struct gon_error *err)
{
    struct gon_error why = {0};
    int rc = text_exchange(t, x, &why);
    const bool lost = rc == GON_E_LINK && *x->verify;
    if (rc < 0 && !lost)
        return gon_fail(err, rc, "%s", why.text);
    rc = text_pause(t, CLK_S(x->settle_ms * 1e-3), err);
    if (rc == 0 && x->echoes && !lost)
        rc = compare(t, x, x->answer, w, err);
    else if (rc == 0 && *x->verify)
        rc = verify(t, x, w, err);
    if (lost && (rc == GON_E_DEVICE || rc == GON_E_REFUSED))
        return gon_fail(err, GON_E_LINK, "%s", why.text);
    return rc == 0 && x->check ? text_check_errors(t, x, err) : rc;
}

static void put_back(struct profile_data *d, const struct wish *w)
{
    for (int i = 0; i < PROFILE_VALUES; i++) {
        if (!w->sent[i])
            continue;
        d->known[i] = w->data.known[i];
        d->number[i] = w->data.number[i];
        memcpy(d->text[i], w->data.text[i], sizeof d->text[i]);
    }
}

// Sent again only when it was seen that it did not arrive.
static int tell(struct text_session *t, const struct profile_exchange *x, const struct wish *w,
                struct gon_error *err)
{
    int rc = tell_once(t, x, w, err);
    for (int i = 1; i < TEXT_TRIES && rc == GON_E_LINK && *x->verify; i++) {
        put_back(&t->session.data, w);
        rc = tell_once(t, x, w, err);
    }
    return rc;
}

int text_send(struct session *s, const char *name, const struct profile_param *params,
              struct gon_error *err)
{
    struct text_session *t = text_of(s);
    const struct profile_exchange *x = NULL;
    struct wish w = {.data = s->data};
    (void)params; // of registers only
    int rc = text_find(t, name, &x, err);
    if (rc < 0)
        return rc;
    profile_text_uses(s->profile, x->send, w.sent);
    rc = tell(t, x, &w, err);
    for (int i = 0; rc < 0 && i < s->profile->values_count; i++)
        if (w.sent[i])
            s->data.known[i] = false; // nobody knows what it is now
    return rc;
}
