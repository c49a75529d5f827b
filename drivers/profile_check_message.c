// SPDX-License-Identifier: MIT
#include "drivers/profile_check_inside.h"
#include "drivers/profile_text.h"

#include <string.h>

static void check_framing(struct checking *c)
{
    const struct profile_framing *f = &c->p->framing;
    check_given(c, check_at("framing.end_out"), f->end_out, "what ends a command");
    check_given(c, check_at("framing.end_in"), f->end_in, "what ends an answer");
    if (f->quiet_ms < f->timeout_ms)
        check_says(c, check_at("framing.quiet_ms"),
                   "below timeout_ms: an answer that is waited for may come later than this");
    if (*f->echo_end && *f->end_in && strstr(f->echo_end, f->end_in))
        check_says(c, check_at("framing.echo_end"),
                   "has end_in in it, so that the repeated command would be taken for the answer; "
                   "of an instrument that repeats it as a line of its own switch the echo off");
    check_asked_name(c, check_at("framing.sync"), f->sync);
}

static void check_checksum(struct checking *c)
{
    const struct profile_checksum *s = &c->p->checksum;
    if (s->kind == PROFILE_NO_SUM)
        return;
    if (s->width != 8 && s->width != 16 && s->width != 32)
        check_says(c, check_at("checksum.width"), "allowed: 8, 16, 32");
    if (s->kind == PROFILE_CRC && !s->polynomial)
        check_says(c, check_at("checksum.polynomial"), "missing; a crc has one");
    if (s->width < 32 &&
        (s->polynomial >> s->width || s->initial >> s->width || s->xor_out >> s->width))
        check_says(c, check_at("checksum.width"), "polynomial, initial and xor_out are wider");
    if ((s->kind == PROFILE_LRC || s->kind == PROFILE_XOR) && s->width != 8)
        check_says(c, check_at("checksum.width"), "an lrc or xor has 8 bits");
}

static bool share_one(const bool a[PROFILE_VALUES], const bool b[PROFILE_VALUES])
{
    for (int i = 0; i < PROFILE_VALUES; i++)
        if (a[i] && b[i])
            return true;
    return false;
}

static bool any_of(const bool a[PROFILE_VALUES])
{
    return share_one(a, a);
}

static void check_verify(struct checking *c, int i, const struct profile_exchange *e,
                         const bool sends[PROFILE_VALUES])
{
    bool reads[PROFILE_VALUES] = {false};
    if (!*e->verify || !check_asked_name(c, check_at("exchanges[%d].verify", i), e->verify))
        return;
    profile_text_uses(c->p, c->p->exchanges[profile_exchange(c->p, e->verify)].answer, reads);
    if (!share_one(sends, reads))
        check_says(c, check_at("exchanges[%d].verify", i),
                   "reads back nothing that this one sends");
}

static void check_exchange(struct checking *c, int i)
{
    const struct profile_exchange *e = &c->p->exchanges[i];
    bool sends[PROFILE_VALUES] = {false}, gives[PROFILE_VALUES] = {false};
    bool believes[PROFILE_VALUES] = {false};
    check_new_name(c, "exchanges", i, c->p->exchanges[0].name, sizeof *e);
    check_given(c, check_at("exchanges[%d].send", i), e->send, "the command");
    check_pattern(c, check_at("exchanges[%d].send", i), e->send, false);
    check_pattern(c, check_at("exchanges[%d].answer", i), e->answer, true);
    profile_text_uses(c->p, e->send, sends);
    profile_text_uses(c->p, e->answer, gives);
    for (int v = 0; v < c->p->values_count; v++)
        if (sends[v] && c->p->values[v].access == PROFILE_READ)
            check_says(c, check_at("exchanges[%d].send", i), "%s is only read (access)",
                       c->p->values[v].name);
    check_condition(c, check_at("exchanges[%d].believe", i), e->believe);
    profile_when_uses(c->p, e->believe, believes);
    if (any_of(believes) && !share_one(believes, gives))
        check_says(c, check_at("exchanges[%d].believe", i), "says nothing about what comes");
    if (e->echoes && !share_one(sends, gives))
        check_says(c, check_at("exchanges[%d].echoes", i), "nothing that is sent comes back");
    check_verify(c, i, e, sends);
    if (e->settle_ms > 0 && !*e->verify && !e->check)
        check_says(c, check_at("exchanges[%d].settle_ms", i), "nothing is asked afterwards");
    if (e->check && !*c->p->errors.ask)
        check_says(c, check_at("exchanges[%d].check", i), "there is no errors.ask to ask by");
    check_then(c, check_at("exchanges[%d].then", i), e->then);
}

static void check_errors(struct checking *c)
{
    const struct profile_errors *e = &c->p->errors;
    check_asked_name(c, check_at("errors.ask"), e->ask);
    check_condition(c, check_at("errors.fine"), e->fine);
    check_value_name(c, check_at("errors.code"), e->code);
    check_codes(c, "errors.codes", e->codes, e->codes_count);
}

static void check_no_registers(struct checking *c)
{
    for (int i = 0; i < c->p->values_count; i++)
        if (c->p->values[i].address || c->p->values[i].alone)
            check_says(c, check_at("values[%d].address", i),
                       "a message instrument has no registers");
    if (c->p->writes_count)
        check_says(c, check_at("writes"), "a message instrument has exchanges instead of writes");
}

void check_messages(struct checking *c)
{
    const struct profile *p = c->p;
    if (p->protocol != PROFILE_MESSAGE)
        return;
    check_no_registers(c);
    check_framing(c);
    check_checksum(c);
    for (int i = 0; i < p->exchanges_count; i++)
        check_exchange(c, i);
    for (int i = 0; i < p->refusals_count; i++)
        if (strspn(p->refusals[i].like, "*") == strlen(p->refusals[i].like))
            check_says(c, check_at("refusals[%d].like", i), "fits every answer");
    check_errors(c);
}
