// SPDX-License-Identifier: MIT
#include "sim/actor_message.h"
#include "sim/actor_sum.h"
#include "sim/actor_text.h"

#include <string.h>

enum { REPLY = 1024 };

struct reply {
    char bytes[REPLY];
    size_t size;
};

static const struct profile *the(const struct actor *a)
{
    return a->now.profile;
}

// --- what is said --------------------------------------------------------------------------------

static void add(struct reply *r, const char *text)
{
    size_t size = strlen(text);
    if (r->size + size < REPLY) {
        memcpy(r->bytes + r->size, text, size);
        r->size += size;
    }
}

static void add_line(struct reply *r, const struct profile *p, const char *text)
{
    char line[ACTOR_LINE + ACTOR_SUM_MOST];
    size_t size = strlen(text);
    memcpy(line, text, size);
    size = actor_sum_add(&p->checksum, line, size);
    if (r->size + size < REPLY) {
        memcpy(r->bytes + r->size, line, size);
        r->size += size;
    }
    add(r, p->framing.end_in);
}

// Text: the answer; "": none. The command is repeated before it where there is an echo, also alone.
static void say(struct reply *r, const struct profile *p, const char *command, const char *text,
                bool good)
{
    const struct profile_framing *f = &p->framing;
    bool ok = good && *f->ok_line;
    if (*f->echo_end) {
        add(r, command);
        add(r, *text || ok ? f->echo_end : f->end_in);
    }
    if (*text)
        add_line(r, p, text);
    if (ok && strcmp(text, f->ok_line) != 0) {
        add(r, f->ok_line);
        add(r, f->end_in);
    }
}

// --- what is understood --------------------------------------------------------------------------

struct heard {
    int exchange; // -1: none like it
    enum actor_fit fit;
    struct actor_values then; // with what the command carried
};

static bool better(const struct profile *p, int exchange, enum actor_fit fit, const struct heard *h)
{
    bool plain = !actor_text_has_values(p->exchanges[exchange].send);
    if (h->exchange < 0 || fit != h->fit)
        return h->exchange < 0 || fit > h->fit;
    return plain && actor_text_has_values(p->exchanges[h->exchange].send);
}

// A command that stands there in full goes before one with values, and one that fits before one
// whose values cannot be.
static void hear(const struct actor *a, const char *command, struct heard *ret)
{
    ret->exchange = -1;
    for (int i = 0; i < the(a)->exchanges_count; i++) {
        struct actor_values v = a->now;
        enum actor_fit fit = actor_text_match(&v, the(a)->exchanges[i].send, command);
        if (fit == ACTOR_OTHER || !better(the(a), i, fit, ret))
            continue;
        ret->exchange = i;
        ret->fit = fit;
        ret->then = v;
    }
}

static bool shares(const struct profile *p, int exchange, int other)
{
    return strcmp(p->exchanges[exchange].send, p->exchanges[other].send) == 0;
}

static const struct profile_deny *denied(const struct profile *p, const struct heard *h)
{
    const struct profile_deny *deny = NULL;
    for (int i = 0; i < p->exchanges_count && !deny; i++)
        if (shares(p, i, h->exchange))
            deny = actor_denies(&h->then, p->exchanges[i].name);
    return deny;
}

// --- what is done --------------------------------------------------------------------------------

static void refuse(struct actor *a, const char *command, const struct profile_deny *deny,
                   struct reply *r)
{
    const struct profile *p = the(a);
    char text[ACTOR_LINE] = "";
    a->refused++;
    if (deny)
        actor_text_write(&a->now, deny->answer, text, sizeof text);
    for (int i = 0; i < p->refusals_count && !deny && !*text; i++)
        if (p->refusals[i].means == PROFILE_REFUSED)
            actor_text_unglob(p->refusals[i].like, text, sizeof text);
    say(r, p, command, text, false);
    if (deny)
        actor_do(a, deny->then);
}

static void carry_out(struct actor *a, const char *command, const struct heard *h, struct reply *r)
{
    const struct profile *p = the(a);
    char text[ACTOR_LINE] = "";
    a->now = h->then;
    for (int i = 0; i < p->exchanges_count && !*text; i++)
        if (shares(p, i, h->exchange))
            actor_text_write(&a->now, p->exchanges[i].answer, text, sizeof text);
    say(r, p, command, text, true);
    for (int i = 0; i < p->exchanges_count; i++)
        if (shares(p, i, h->exchange))
            actor_do(a, p->exchanges[i].then);
}

static void obey(struct actor *a, const char *command, struct reply *r)
{
    struct heard h;
    hear(a, command, &h);
    bool fits = h.exchange >= 0 && h.fit == ACTOR_FITS;
    const struct profile_deny *deny = fits ? denied(the(a), &h) : actor_denies(&a->now, "");
    if (fits && !deny)
        carry_out(a, command, &h, r);
    else
        refuse(a, command, deny, r);
}

// --- the port ------------------------------------------------------------------------------------

static void reply(struct actor_message *m, const struct reply *r, int64_t t_ns)
{
    int64_t due_ns = t_ns + (int64_t)(the(m->actor)->simulate.reply_ms * 1e6);
    for (size_t i = 0; i < r->size; i += PORT_REPLY_MOST) {
        size_t left = r->size - i;
        port_send(&m->port, r->bytes + i, left < PORT_REPLY_MOST ? left : PORT_REPLY_MOST, due_ns);
    }
}

static bool too_early(struct actor *a, int64_t t_ns)
{
    double gap_ns = the(a)->framing.gap_ms * 1e6;
    if (a->last_ns != INT64_MIN && (double)(t_ns - a->last_ns) < gap_ns) {
        a->too_early++;
        return true;
    }
    a->last_ns = t_ns;
    return false;
}

static void command(struct actor_message *m, char *line, size_t size, int64_t t_ns)
{
    struct actor *a = m->actor;
    struct reply r = {.size = 0};
    m->port.frames_in++;
    if (too_early(a, t_ns))
        return;
    int text = actor_sum_check(&the(a)->checksum, line, size);
    if (text < 0)
        return; // broken on its way
    line[text] = 0;
    a->commands++;
    actor_meet(a, t_ns);
    obey(a, line, &r);
    actor_meet(a, t_ns);
    reply(m, &r, t_ns);
}

// Raw bytes of a checksum may look like an end.
static bool ends(const struct actor_message *m, char byte)
{
    const struct profile *p = the(m->actor);
    bool raw = p->checksum.kind != PROFILE_NO_SUM && p->checksum.form >= PROFILE_RAW_HIGH;
    if (!byte || !strchr(p->framing.end_out, byte))
        return false;
    return !raw || actor_sum_check(&p->checksum, m->in, m->have) >= 0;
}

static void take(struct actor_message *m, int64_t t_ns)
{
    size_t blank = 0;
    while (blank < m->have && strchr(" \n", m->in[blank]) && m->in[blank])
        blank++;
    if (blank < m->have && m->have + 1 < sizeof m->in) // else too long to be one
        command(m, m->in + blank, m->have - blank, t_ns);
    m->have = 0;
}

static void feed(struct port *port, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct actor_message *m = (struct actor_message *)port;
    for (size_t i = 0; i < size; i++) {
        if (ends(m, (char)bytes[i]))
            take(m, t_ns);
        else if (m->have + 1 < sizeof m->in)
            m->in[m->have++] = (char)bytes[i];
    }
    if (!*the(m->actor)->framing.end_out)
        take(m, t_ns);
}

static void tick(struct port *port, int64_t t_ns)
{
    (void)port; // it never asks for one
    (void)t_ns;
}

static void hangup(struct port *port)
{
    (void)port; // half a command stays in the instrument's buffer, as on a real line
}

static const struct port_ops ops = {feed, tick, hangup};

void actor_message_init(struct actor_message *m, struct actor *actor)
{
    memset(m, 0, sizeof *m);
    port_init(&m->port, &ops);
    m->actor = actor;
}
