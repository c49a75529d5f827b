// SPDX-License-Identifier: MIT
// A session over a text link: exchanges of the profile as commands and answers.
#include "drivers/session_text_inside.h"

#include "drivers/profile_text.h"
#include "drivers/profile_when.h"

#include <fnmatch.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BUSY_TRIES 10
#define BUSY_NS CLK_MS(100)
#define SYNC_LEAST 3 // characters: a shorter answer could be one to another question

const char *text_link(const struct session *s)
{
    return transport_link(message_transport(((const struct text_session *)s)->m));
}

static struct clk *clk_of(const struct text_session *t)
{
    return transport_clk(message_transport(t->m));
}

int text_pause(struct text_session *t, int64_t duration_ns, struct gon_error *err)
{
    if (duration_ns > 0 &&
        clk_sleep(clk_of(t), duration_ns, transport_cancel(message_transport(t->m))) < 0)
        return gon_fail(err, GON_E_CANCELED, "%s: stopped", text_link(&t->session));
    return 0;
}

int text_find(struct text_session *t, const char *name, const struct profile_exchange **ret,
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
    char command[TEXT_COMMAND], answer[TEXT_ANSWER];
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
int text_exchange(struct text_session *t, const struct profile_exchange *x, struct gon_error *err)
{
    int rc = exchange(t, x, err);
    for (int i = 0; i < BUSY_TRIES && rc == GON_E_REFUSED && t->session.meaning == PROFILE_BUSY;
         i++) {
        rc = text_pause(t, BUSY_NS, err);
        if (rc == 0)
            rc = exchange(t, x, err);
    }
    return rc;
}

// --- asking --------------------------------------------------------------------------------------

int text_ask_exchange(struct text_session *t, const struct profile_exchange *x, int tries,
                      struct gon_error *err)
{
    struct gon_error why = {0};
    int rc = GON_E_LINK;
    for (int i = 0; i < tries && rc == GON_E_LINK; i++)
        rc = text_exchange(t, x, &why);
    if (rc == 0 && x->check && strcmp(x->name, t->session.profile->errors.ask) != 0)
        rc = text_check_errors(t, x, &why);
    return rc < 0 ? gon_fail(err, rc, "%s", why.text) : 0;
}

static int text_ask(struct session *s, const struct profile_asks *asks, bool once,
                    struct gon_error *err)
{
    int rc = 0;
    for (int i = 0; i < asks->count && rc == 0; i++) {
        const struct profile_exchange *x = NULL;
        rc = text_find(text_of(s), asks->name[i], &x, err);
        if (rc == 0)
            rc = text_ask_exchange(text_of(s), x, once ? 1 : TEXT_TRIES, err);
    }
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

static int check_protocol(const struct profile *p, const char *link, struct gon_error *err)
{
    if (p->protocol != PROFILE_MESSAGE)
        return gon_fail(err, GON_E_INPUT, "%s: profile %s is of an instrument on a Modbus bus",
                        link, p->name);
    return 0;
}

int session_over(const struct profile *p, struct transport *transport,
                 struct session **ret_session, struct gon_error *err)
{
    static const struct session_ops ops = {
        text_ask,    text_send, text_send_blind, text_reopen,
        forget_sync, text_link, text_message,    text_free,
    };
    int rc = check_protocol(p, transport_link(transport), err);
    struct text_session *t = rc == 0 ? calloc(1, sizeof *t) : NULL;
    if (!t) {
        transport_close(transport);
        return rc < 0 ? rc : gon_fail(err, GON_E_SYSTEM, "profile %s: out of memory", p->name);
    }
    session_init(&t->session, &ops, p);
    set_format(t, p);
    if (!(t->m = message_new(transport, &t->format))) {
        free(t);
        return gon_fail(err, GON_E_SYSTEM, "profile %s: out of memory", p->name);
    }
    *ret_session = &t->session;
    return 0;
}

int session_open(const struct profile *p, const char *link, struct clk *clk,
                 const struct cancel *cancel, struct session **ret_session, struct gon_error *err)
{
    struct transport *transport;
    int rc = check_protocol(p, link, err);
    if (rc == 0)
        rc = transport_open(link, clk, cancel, &transport, err);
    return rc < 0 ? rc : session_over(p, transport, ret_session, err);
}
