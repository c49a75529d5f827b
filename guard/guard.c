// SPDX-License-Identifier: MIT
#include "guard/guard.h"

#include "base/err.h"

#include <assert.h>
#include <regex.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

// --- what is to be done --------------------------------------------------------------------------

static struct guard_act *act(struct guard_acts *acts, enum guard_act_kind kind, const void *bytes,
                             size_t size)
{
    assert(acts->count < GUARD_ACTS && size <= sizeof acts->act->bytes);
    struct guard_act *a = &acts->act[acts->count++];
    *a = (struct guard_act){.kind = kind, .size = size};
    memcpy(a->bytes, bytes, size);
    return a;
}

static void tell(const struct guard *g, struct guard_acts *acts, char kind, const void *bytes,
                 size_t size)
{
    if (!g->client)
        return;
    struct guard_act *a = act(acts, GUARD_TELL, &kind, 1);
    memcpy(a->bytes + 1, bytes, size);
    a->size += size;
}

static void say(const struct guard *g, struct guard_acts *acts, const char *text)
{
    struct guard_act *a = act(acts, GUARD_SAY, "", 0);
    a->size = (size_t)snprintf(a->bytes, sizeof a->bytes, "%s%s\n", text, g->record.link);
}

// What came of what the client waits for.
static void answer(struct guard *g, struct guard_acts *acts, int code, const char *text)
{
    struct guard_no no = {.code = code};
    snprintf(no.text, sizeof no.text, "%s", code < 0 ? text : "");
    tell(g, acts, code < 0 ? 'e' : 'd', &no, code < 0 ? sizeof no : 0);
    g->waits = false;
}

// --- switching off -------------------------------------------------------------------------------

static void write_bytes(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                        const struct guard_bytes *b)
{
    act(acts, GUARD_WRITE, b->at, b->size);
    g->ready_ns = now_ns + g->record.gap_ns + GUARD_LATE_NS;
}

static void go_to(struct guard *g, enum guard_step step, int64_t due_ns)
{
    g->status.phase = GUARD_SAFING;
    g->step = step;
    g->due_ns = due_ns;
}

// At once, whatever the gap.
static void fire(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    write_bytes(g, acts, now_ns, &g->record.off[0]);
    g->round = 0;
    go_to(g, GUARD_STEP_OFF, g->ready_ns);
}

static void begin(struct guard *g, struct guard_acts *acts, int64_t now_ns, enum guard_why why)
{
    g->status.why = (uint8_t)why;
    if (g->open && g->status.phase == GUARD_SAFING)
        return; // it goes on
    g->status.seen = GUARD_SEEN_NOTHING;
    if (g->open)
        fire(g, acts, now_ns);
    else
        go_to(g, GUARD_STEP_OPEN, now_ns);
}

static void confirmed(struct guard *g, struct guard_acts *acts)
{
    g->status.phase = GUARD_DARK;
    g->status.seen = GUARD_SEEN_OFF;
    g->status.done = g->asked;
    say(g, acts, "laser off: read back from ");
    if (!g->client)
        act(acts, GUARD_END, "", 0);
}

static void send_off(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    write_bytes(g, acts, now_ns, &g->record.off[g->round++ % g->record.offs]);
    g->ask = 0;
    go_to(g, GUARD_STEP_ASK, g->ready_ns + (g->owed ? g->record.quiet_ns : 0));
    g->owed = false;
}

static void send_ask(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    g->have = 0;
    g->heard = false;
    go_to(g, GUARD_STEP_ANSWER, now_ns + g->record.timeout_ns);
    if (g->record.framed)
        act(acts, GUARD_CLEAR, "", 0);
    write_bytes(g, acts, now_ns, &g->record.ask[g->ask].question);
    if (g->record.framed)
        act(acts, GUARD_READ, "", 0)->wait_ns = g->record.timeout_ns;
}

// Once more, and then the questions again.
static void again(struct guard *g, int64_t now_ns)
{
    if (!g->heard)
        g->status.seen = GUARD_SEEN_SILENCE;
    go_to(g, GUARD_STEP_OFF, now_ns > g->ready_ns ? now_ns : g->ready_ns);
}

static bool says_off(const struct guard_ask *ask, const char *line)
{
    regex_t regex;
    if (regcomp(&regex, ask->off, REG_EXTENDED | REG_ICASE | REG_NOSUB))
        return false;
    const int rc = regexec(&regex, line, 0, NULL, 0);
    regfree(&regex);
    return rc == 0;
}

// The answer to the question, behind whatever else may come.
static void take_line(struct guard *g, struct guard_acts *acts, int64_t now_ns, const char *line)
{
    if (!says_off(&g->record.ask[g->ask], line))
        g->status.seen = GUARD_SEEN_ON; // as far as we can tell
    else if (++g->ask < g->record.asks)
        go_to(g, GUARD_STEP_ASK, now_ns + g->record.gap_ns);
    else
        confirmed(g, acts);
}

static void collect(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                    const struct guard_event *e)
{
    char line[GUARD_DATA];
    for (size_t i = 0; i < e->size && g->step == GUARD_STEP_ANSWER; i++) {
        const struct guard_bytes *end = &g->record.end_in;
        g->in[g->have++] = ((const char *)e->bytes)[i];
        const bool is_end =
            g->have >= end->size && memcmp(g->in + g->have - end->size, end->at, end->size) == 0;
        if (!is_end && !(e->ended && i + 1 == e->size) && g->have < sizeof g->in)
            continue;
        const size_t cut = (is_end ? end->size : 0u) + g->record.tail;
        snprintf(line, sizeof line, "%.*s", (int)(g->have > cut ? g->have - cut : 0), g->in);
        take_line(g, acts, now_ns, line);
        g->have = 0;
        g->heard = true;
    }
}

static void lose(struct guard *g, int64_t now_ns)
{
    g->open = false;
    g->status.seen = GUARD_SEEN_NO_PORT;
    if (g->status.phase != GUARD_DARK)
        go_to(g, GUARD_STEP_OPEN, now_ns + g->record.reopen_ns);
}

static void take_step(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    if (g->step == GUARD_STEP_OPEN) {
        go_to(g, GUARD_STEP_OPEN, now_ns + g->record.reopen_ns);
        act(acts, GUARD_OPEN, "", 0);
    } else if (g->step == GUARD_STEP_OFF) {
        send_off(g, acts, now_ns);
    } else if (g->step == GUARD_STEP_ASK) {
        send_ask(g, acts, now_ns);
    } else {
        again(g, now_ns);
    }
}

// --- the client ----------------------------------------------------------------------------------

static void take_record(struct guard *g, struct guard_acts *acts, int64_t now_ns, const char *bytes,
                        size_t size)
{
    const bool same = strncmp(bytes, g->record.link, sizeof g->record.link) == 0;
    const bool safe = g->status.phase == GUARD_EMPTY || g->status.phase == GUARD_DARK;
    if (size != sizeof g->record || (!same && !safe)) {
        answer(g, acts, GON_E_REFUSED,
               same ? "goniod and gonio-guard are of different versions"
                    : "the laser before is not off yet");
        return;
    }
    memcpy(&g->record, bytes, size);
    g->open = g->open && same;
    g->status.latched = false;
    g->waits = true;
    begin(g, acts, now_ns, GUARD_START);
    if (g->open)
        answer(g, acts, 0, NULL);
    else
        take_step(g, acts, now_ns);
}

// At the beginning of any line or of any command in it.
static bool brings_light(const struct guard_record *r, const char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        for (int k = 0; k < r->ons && (i == 0 || strchr("\r\n; \t", bytes[i - 1])); k++)
            if (r->on[k].size <= size - i &&
                strncasecmp(bytes + i, r->on[k].at, r->on[k].size) == 0)
                return true;
    return false;
}

static int may_pass(const struct guard *g, char kind, const char *bytes, size_t size)
{
    const struct guard_bytes *end = &g->record.end_out;
    if (g->status.phase == GUARD_EMPTY || g->status.latched)
        return GON_E_REFUSED;
    if (!g->open)
        return GON_E_GONE;
    if (g->status.phase == GUARD_SAFING)
        return g->status.seen == GUARD_SEEN_ON ? GON_E_DEVICE : GON_E_LINK;
    if (kind == 'D' ? size <= end->size || memcmp(bytes + size - end->size, end->at, end->size)
                    : size != sizeof(int64_t))
        return GON_E_INPUT; // half a command
    return 0;
}

static void pass(struct guard *g, struct guard_acts *acts, int64_t now_ns, char kind,
                 const char *bytes, size_t size)
{
    const int code = may_pass(g, kind, bytes, size);
    g->waits = true;
    if (code < 0) {
        answer(g, acts, code, "");
    } else if (kind == 'D') {
        if (brings_light(&g->record, bytes, size)) {
            g->status.phase = GUARD_LIT;
            g->lease_ns = now_ns + GUARD_LEASE_NS;
        }
        g->owed = true;
        g->ready_ns = now_ns + g->record.gap_ns + GUARD_LATE_NS;
        act(acts, GUARD_WRITE, bytes, size);
    } else {
        memcpy(&act(acts, kind == 'A' ? GUARD_READ : GUARD_CLEAR, "", 0)->wait_ns, bytes, size);
    }
}

static void take_message(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                         const struct guard_event *e)
{
    const char *bytes = e->bytes;
    const size_t size = e->size - 1;
    switch (*bytes++) {
    case 'R': take_record(g, acts, now_ns, bytes, size); break;
    case 'X':
        memcpy(&g->asked, bytes, size < sizeof g->asked ? size : sizeof g->asked);
        g->status.latched = false;
        if (g->status.phase == GUARD_EMPTY)
            g->status.done = g->asked; // there is nothing that could be on
        else
            begin(g, acts, now_ns, GUARD_ASKED);
        break;
    case 'L': g->lease_ns = now_ns + GUARD_LEASE_NS; break;
    default: pass(g, acts, now_ns, bytes[-1], bytes, size); break;
    }
}

// --- what happens --------------------------------------------------------------------------------

// Off, and the client is not heard until it asks for OFF itself.
static void revolt(struct guard *g, struct guard_acts *acts, int64_t now_ns, enum guard_why why)
{
    g->status.latched = g->status.phase != GUARD_EMPTY;
    if (g->status.latched)
        begin(g, acts, now_ns, why);
    else
        say(g, acts, "no laser was handed over");
}

static void client_gone(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    const bool safe = g->status.phase == GUARD_EMPTY || g->status.phase == GUARD_DARK;
    g->client = false;
    if (!safe)
        begin(g, acts, now_ns, GUARD_GONE);
    else if (g->open)
        write_bytes(g, acts, now_ns, &g->record.off[0]); // against what we did not understand
    if (safe)
        act(acts, GUARD_END, "", 0);
}

static void opened(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                   const struct guard_event *e)
{
    g->open = e->code >= 0;
    if (g->waits)
        answer(g, acts, e->code, e->text);
    if (g->open)
        fire(g, acts, now_ns);
    else
        g->status.seen = GUARD_SEEN_NO_PORT;
    if (!g->open && !g->client && g->record.brief)
        act(acts, GUARD_END, "", 0);
}

static void done(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                 const struct guard_event *e)
{
    if (g->waits)
        answer(g, acts, e->code, e->text);
    if (e->code == GON_E_GONE)
        lose(g, now_ns);
}

static void bytes_came(struct guard *g, struct guard_acts *acts, int64_t now_ns,
                       const struct guard_event *e)
{
    g->owed = false;
    if (g->status.phase == GUARD_SAFING) {
        collect(g, acts, now_ns, e);
        return;
    }
    tell(g, acts, 'b', e->ended ? "\1" : "", 1);
    if (g->client) {
        struct guard_act *a = &acts->act[0];
        memcpy(a->bytes + a->size, e->bytes, e->size);
        a->size += e->size;
    }
    g->waits = false;
}

static void time_came(struct guard *g, struct guard_acts *acts, int64_t now_ns)
{
    if (now_ns < guard_next_ns(g))
        return;
    if (g->status.phase == GUARD_LIT)
        revolt(g, acts, now_ns, GUARD_LEASE);
    else
        take_step(g, acts, now_ns);
}

void guard_init(struct guard *g)
{
    memset(g, 0, sizeof *g);
    g->client = true;
}

int64_t guard_next_ns(const struct guard *g)
{
    return g->status.phase == GUARD_LIT      ? g->lease_ns
           : g->status.phase == GUARD_SAFING ? g->due_ns
                                             : INT64_MAX;
}

void guard_step(struct guard *g, int64_t now_ns, const struct guard_event *e,
                struct guard_acts *ret_acts)
{
    ret_acts->count = 0;
    switch (e->kind) {
    case GUARD_ON_MESSAGE: take_message(g, ret_acts, now_ns, e); break;
    case GUARD_ON_GONE: client_gone(g, ret_acts, now_ns); break;
    case GUARD_ON_STOP: revolt(g, ret_acts, now_ns, GUARD_STOP); break;
    case GUARD_ON_SIGNAL: revolt(g, ret_acts, now_ns, GUARD_SIGNAL); break;
    case GUARD_ON_OPENED: opened(g, ret_acts, now_ns, e); break;
    case GUARD_ON_DONE: done(g, ret_acts, now_ns, e); break;
    case GUARD_ON_BYTES: bytes_came(g, ret_acts, now_ns, e); break;
    default: time_came(g, ret_acts, now_ns); break;
    }
    if (memcmp(&g->status, &g->told, sizeof g->told) != 0) {
        g->told = g->status;
        tell(g, ret_acts, 's', &g->status, sizeof g->status);
    }
}
