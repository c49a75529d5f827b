// SPDX-License-Identifier: MIT
// A session over a text link: exchanges of the profile as commands and answers.
#include "drivers/session_inside.h"

#include "drivers/message.h"
#include "drivers/profile_text.h"
#include "drivers/profile_when.h"

#include <fnmatch.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TRIES 3
#define BUSY_TRIES 10
#define BUSY_NS CLK_MS(100)
#define ERRORS_MOST 32 // of a queue that is emptied
#define SYNC_LEAST 3   // characters: a shorter answer could be one to another question

enum { COMMAND = 200, ANSWER = 400 };

struct text_session {
    struct session session; // first
    struct message *m;
    struct message_format format;
    const struct profile_exchange *sync; // NULL: none
    bool learning;                       // its next answer is remembered
    char sync_send[COMMAND], sync_begins[ANSWER];
};

static struct text_session *text_of(struct session *s)
{
    return (struct text_session *)s;
}

static const char *text_link(const struct session *s)
{
    return transport_link(message_transport(((const struct text_session *)s)->m));
}

static struct clk *clk_of(const struct text_session *t)
{
    return transport_clk(message_transport(t->m));
}

static int pause_ns(struct text_session *t, int64_t duration_ns, struct gon_error *err)
{
    if (duration_ns > 0 &&
        clk_sleep(clk_of(t), duration_ns, transport_cancel(message_transport(t->m))) < 0)
        return gon_fail(err, GON_E_CANCELED, "%s: stopped", text_link(&t->session));
    return 0;
}

static int find(struct text_session *t, const char *name, const struct profile_exchange **ret,
                struct gon_error *err)
{
    const struct profile *p = t->session.profile;
    const int i = profile_exchange(p, name);
    if (i < 0)
        return gon_fail(err, GON_E_INPUT, "profile %s has no exchange '%s'", p->name, name);
    *ret = &p->exchanges[i];
    return 0;
}

// --- getting into step ---------------------------------------------------------------------------

// What every answer to the pattern begins with.
static void literal_beginning(const char *pattern, char *out, size_t size)
{
    const size_t length = strcspn(pattern, "{}[] ");
    snprintf(out, size, "%.*s", (int)length, pattern);
}

// Until its answer was heard from this very instrument, only what all of them say is known of it.
static void forget_sync(struct session *s)
{
    struct text_session *t = text_of(s);
    t->format.sync_query = NULL;
    if (!t->sync)
        return;
    t->learning = true;
    literal_beginning(t->sync->answer, t->sync_begins, sizeof t->sync_begins);
    if (*t->sync_begins)
        t->format.sync_query = t->sync_send;
}

static void learn_sync(struct text_session *t, const char *answer)
{
    t->learning = false;
    if (strlen(answer) < SYNC_LEAST)
        return;
    snprintf(t->sync_begins, sizeof t->sync_begins, "%s", answer);
    t->format.sync_query = t->sync_send;
}

// --- refusals ------------------------------------------------------------------------------------

// The refusal that an answer is like; NULL: none, or one that means nothing bad.
static const struct profile_refusal *refusal_of(const struct profile *p, const char *answer)
{
    for (int i = 0; i < p->refusals_count; i++)
        if (fnmatch(p->refusals[i].like, answer, FNM_CASEFOLD) == 0)
            return p->refusals[i].means == PROFILE_FINE ? NULL : &p->refusals[i];
    return NULL;
}

static bool is_refusal(const void *ctx, const char *line)
{
    return refusal_of(ctx, line) != NULL;
}

static int nonsense(struct text_session *t, const char *command, const char *answer,
                    const char *why, struct gon_error *err)
{
    message_out_of_step(t->m, "not what was asked");
    return gon_fail(err, GON_E_LINK, "%s: '%s' was answered '%.80s': %s", text_link(&t->session),
                    command, answer, why);
}

// --- one exchange --------------------------------------------------------------------------------

// A condition about something that nobody asked yet cannot be held against an answer.
static bool is_believed(const struct profile *p, const struct profile_exchange *x,
                        const struct profile_data *now)
{
    bool uses[PROFILE_VALUES] = {false};
    profile_when_uses(p, x->believe, uses);
    for (int i = 0; i < p->values_count; i++)
        if (uses[i] && !now->known[i])
            return true;
    return profile_when(p, x->believe, now);
}

static bool is_repeated(const struct profile *p, const struct profile_data *then,
                        const struct profile_data *now, const bool fresh[PROFILE_VALUES])
{
    for (int i = 0; i < p->values_count; i++)
        if (p->values[i].changes && fresh[i] && then->known[i] && now->known[i] &&
            now->number[i] == then->number[i])
            return true;
    return false;
}

static int read_answer(struct text_session *t, const struct profile_exchange *x,
                       const char *command, const char *answer, struct gon_error *err)
{
    struct session *s = &t->session;
    const struct profile *p = s->profile;
    const struct profile_refusal *no =
        strcmp(x->name, p->errors.ask) == 0 ? NULL : refusal_of(p, answer);
    bool fresh[PROFILE_VALUES] = {false};
    struct profile_data now = s->data;
    struct gon_error why = {0};
    if (no)
        return session_refused(s, (enum profile_meaning)no->means, err, "%s: refuses '%s': %s",
                               text_link(s), command, answer);
    if (profile_text_read(p, x->answer, answer, &now, &why) < 0)
        return nonsense(t, command, answer, why.text, err);
    profile_text_uses(p, x->answer, fresh);
    session_doubt(p, &now, fresh);
    if (!is_believed(p, x, &now))
        return nonsense(t, command, answer, "that cannot be", err);
    if (is_repeated(p, &s->data, &now, fresh))
        return nonsense(t, command, answer, "that is the last answer once more", err);
    s->data = now;
    session_saw(s, fresh);
    if (t->learning && x == t->sync)
        learn_sync(t, answer);
    return 0;
}

static bool is_answered(const struct profile *p, const struct profile_exchange *x)
{
    return *x->answer || *p->framing.echo_end || *p->framing.ok_line;
}

static int exchange(struct text_session *t, const struct profile_exchange *x, struct gon_error *err)
{
    const struct profile *p = t->session.profile;
    char command[COMMAND], answer[ANSWER];
    struct gon_error why = {0};
    int rc = profile_text_write(p, x->send, &t->session.data, command, sizeof command, &why);
    if (rc < 0)
        return gon_fail(err, rc, "%s: %s: %s", text_link(&t->session), x->name, why.text);
    const double timeout_ms = x->timeout_ms > 0 ? x->timeout_ms : p->framing.timeout_ms;
    t->format.timeout_ns = CLK_S(timeout_ms * 1e-3);
    if (!is_answered(p, x))
        return message_send(t->m, command, err);
    rc = message_query(t->m, command, answer, sizeof answer, err);
    return rc < 0 ? rc : read_answer(t, x, command, answer, err);
}

// "Busy" says that it was not carried out.
static int exchange_when_free(struct text_session *t, const struct profile_exchange *x,
                              struct gon_error *err)
{
    int rc = exchange(t, x, err);
    for (int i = 0; i < BUSY_TRIES && rc == GON_E_REFUSED && t->session.meaning == PROFILE_BUSY;
         i++) {
        rc = pause_ns(t, BUSY_NS, err);
        if (rc == 0)
            rc = exchange(t, x, err);
    }
    return rc;
}

// --- errors that the instrument keeps ------------------------------------------------------------

static const struct profile_code *code_of(const struct profile_errors *e, double code)
{
    for (int i = 0; i < e->codes_count; i++)
        if (e->codes[i].code == (int)code)
            return &e->codes[i];
    return NULL;
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
        for (int b = 0; b < v->bits_count; b++)
            if ((uint64_t)s->data.number[i] >> v->bits[b].bit & 1) {
                used = strlen(out);
                snprintf(out + used, size - used, " (%s)",
                         *v->bits[b].help ? v->bits[b].help : v->bits[b].name);
            }
    }
}

static int ask(struct text_session *t, const struct profile_exchange *x, int tries,
               struct gon_error *err);

// Asks until nothing is left; text is that of the first error, and means its kind.
static int take_errors(struct text_session *t, char *text, size_t size,
                       enum profile_meaning *ret_means, struct gon_error *err)
{
    struct session *s = &t->session;
    const struct profile_errors *e = &s->profile->errors;
    const struct profile_exchange *x = NULL;
    *ret_means = PROFILE_FINE;
    *text = 0;
    int rc = find(t, e->ask, &x, err);
    for (int i = 0; rc == 0 && i < ERRORS_MOST; i++) {
        rc = ask(t, x, TRIES, err);
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
                                const struct profile_data *d, char text[COMMAND])
{
    return profile_text_write(p, x->send, d, text, COMMAND, NULL) == 0 ? text : x->name;
}

static int check_errors(struct text_session *t, const struct profile_exchange *x,
                        struct gon_error *err)
{
    struct session *s = &t->session;
    char text[200], command[COMMAND];
    enum profile_meaning means;
    int rc = take_errors(t, text, sizeof text, &means, err);
    if (rc < 0 || means == PROFILE_FINE)
        return rc;
    return session_refused(s, means, err, "%s: refuses '%s' (%s)", text_link(s),
                           command_text(s->profile, x, &s->data, command), text);
}

// --- asking --------------------------------------------------------------------------------------

static int ask(struct text_session *t, const struct profile_exchange *x, int tries,
               struct gon_error *err)
{
    struct gon_error why = {0};
    int rc = GON_E_LINK;
    for (int i = 0; i < tries && rc == GON_E_LINK; i++)
        rc = exchange_when_free(t, x, &why);
    if (rc == 0 && x->check)
        rc = check_errors(t, x, &why);
    return rc < 0 ? gon_fail(err, rc, "%s", why.text) : 0;
}

static int text_ask(struct session *s, const struct profile_asks *asks, bool once,
                    struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; i < asks->count && rc == 0; i++) {
        const struct profile_exchange *x = NULL;
        rc = find(text_of(s), asks->name[i], &x, err);
        if (rc == 0)
            rc = ask(text_of(s), x, once ? 1 : TRIES, err);
    }
    return rc;
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
    char kept[200] = "", command[COMMAND];
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
    int rc = find(t, x->verify, &back, err);
    if (rc == 0)
        rc = ask(t, back, TRIES, err);
    return rc < 0 ? rc : compare(t, x, back->answer, w, err);
}

// Sent once. Where its answer was lost the read-back tells whether it arrived.
static int tell(struct text_session *t, const struct profile_exchange *x, const struct wish *w,
                struct gon_error *err)
{
    int rc = exchange_when_free(t, x, err);
    const bool lost = rc == GON_E_LINK && *x->verify;
    if (rc < 0 && !lost)
        return rc;
    rc = pause_ns(t, CLK_S(x->settle_ms * 1e-3), err);
    if (rc == 0 && x->echoes && !lost)
        rc = compare(t, x, x->answer, w, err);
    else if (rc == 0 && *x->verify)
        rc = verify(t, x, w, err);
    return rc == 0 && x->check ? check_errors(t, x, err) : rc;
}

static int text_send(struct session *s, const char *name, const struct profile_param *params,
                     struct gon_error *err)
{
    struct text_session *t = text_of(s);
    const struct profile_exchange *x = NULL;
    struct wish w = {.data = s->data};
    (void)params; // of registers only
    int rc = find(t, name, &x, err);
    if (rc < 0)
        return rc;
    profile_text_uses(s->profile, x->send, w.sent);
    rc = tell(t, x, &w, err);
    for (int i = 0; rc < 0 && i < s->profile->values_count; i++)
        if (w.sent[i])
            s->data.known[i] = false; // nobody knows what it is now
    return rc;
}

static int text_send_blind(struct session *s, const char *text, bool at_once, struct gon_error *err)
{
    return message_send_blind(text_of(s)->m, text, at_once, err);
}

// --- life ----------------------------------------------------------------------------------------

static int text_reopen(struct session *s, struct gon_error *err)
{
    return message_reopen(text_of(s)->m, err);
}

static struct message *text_message(const struct session *s)
{
    return ((const struct text_session *)s)->m;
}

static void text_free(struct session *s)
{
    message_free(text_of(s)->m);
    free(s);
}

static void set_format(struct text_session *t, const struct profile *p)
{
    const struct profile_framing *f = &p->framing;
    const int sync = *f->sync ? profile_exchange(p, f->sync) : -1;
    t->format = (struct message_format){
        .end_out = f->end_out,
        .end_in = f->end_in,
        .min_gap_ns = CLK_S(f->gap_ms * 1e-3),
        .timeout_ns = CLK_S(f->timeout_ms * 1e-3),
        .quiet_ns = CLK_S(f->quiet_ms * 1e-3),
        .sync_begins = t->sync_begins,
        .echo_end = f->echo_end,
        .ok_line = f->ok_line,
        .empty = f->empty,
        .alone = is_refusal,
        .ctx = p,
        .checksum = p->checksum.kind == PROFILE_NO_SUM ? NULL : &p->checksum,
    };
    if (sync >= 0 && profile_text_write(p, p->exchanges[sync].send, &t->session.data, t->sync_send,
                                        sizeof t->sync_send, NULL) == 0)
        t->sync = &p->exchanges[sync];
    forget_sync(&t->session);
}

int session_open(const struct profile *p, const char *link, struct clk *clk,
                 const struct cancel *cancel, struct session **ret_session, struct gon_error *err)
{
    static const struct session_ops ops = {
        text_ask,    text_send, text_send_blind, text_reopen,
        forget_sync, text_link, text_message,    text_free,
    };
    struct transport *transport;
    if (p->protocol != PROFILE_MESSAGE)
        return gon_fail(err, GON_E_INPUT, "%s: profile %s is of an instrument on a Modbus bus",
                        link, p->name);
    int rc = transport_open(link, clk, cancel, &transport, err);
    if (rc < 0)
        return rc;
    struct text_session *t = calloc(1, sizeof *t);
    if (!t) {
        transport_close(transport);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    session_init(&t->session, &ops, p);
    set_format(t, p);
    if (!(t->m = message_new(transport, &t->format))) {
        free(t);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    *ret_session = &t->session;
    return 0;
}
