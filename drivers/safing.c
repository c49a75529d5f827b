// SPDX-License-Identifier: MIT
#include "drivers/safing.h"

#include "base/clk.h"
#include "drivers/checksum.h"
#include "drivers/link.h"
#include "drivers/profile_data.h"
#include "drivers/profile_text.h"
#include "drivers/profile_when.h"

#include <regex.h>
#include <stdio.h>
#include <string.h>

#define REOPEN_NS CLK_MS(500)
enum { WHOLE_MOST = 256, NIBBLES = 8 };

// --- commands ------------------------------------------------------------------------------------

// A command as message.c sends it: with its checksum and terminator; begin stands before it.
static int bytes_of(const struct profile *p, const char *begin, const char *text,
                    struct guard_bytes *ret_bytes, struct gon_error *err)
{
    const char *end = p->framing.end_out;
    char line[256];
    size_t size = strlen(text);
    if (size + 32 > sizeof line)
        return gon_fail(err, GON_E_INPUT, "the command '%s' is too long for the guard", text);
    memcpy(line, text, size + 1);
    if (p->checksum.kind != PROFILE_NO_SUM) {
        int rc = checksum_append(&p->checksum, line, size, sizeof line, &size, err);
        if (rc < 0)
            return rc;
    }
    if (strlen(begin) + size + strlen(end) > sizeof ret_bytes->at)
        return gon_fail(err, GON_E_INPUT, "the command '%s' is too long for the guard", text);
    ret_bytes->size = (uint8_t)(strlen(begin) + size + strlen(end));
    memcpy(ret_bytes->at, begin, strlen(begin));
    memcpy(ret_bytes->at + strlen(begin), line, size);
    memcpy(ret_bytes->at + strlen(begin) + size, end, strlen(end));
    return 0;
}

// With what ends half a command before it; over USB there are none.
static int take_offs(const struct profile *p, struct guard_record *r, struct gon_error *err)
{
    int rc = 0;
    r->offs = (uint8_t)p->laser.off_count;
    for (int i = 0; i < r->offs && rc == 0; i++) {
        const char *text = p->laser.off[i];
        const bool begins = *text == '\r' || *text == '\n';
        rc = bytes_of(p, begins || r->framed ? "" : p->framing.end_out, text, &r->off[i], err);
    }
    return rc;
}

// What each command that may bring light begins with.
static int take_ons(const struct profile *p, struct guard_record *r, struct gon_error *err)
{
    for (int i = 0; i < p->laser.on.count; i++) {
        const int x = profile_exchange(p, p->laser.on.rule[i].send);
        const char *send = x < 0 ? "" : p->exchanges[x].send;
        const size_t size = strcspn(send, "{");
        if (size == 0 || size > GUARD_COMMAND || r->ons == GUARD_ONS)
            return gon_fail(err, GON_E_INPUT,
                            "how it is switched on ('%s') cannot be recognized by the guard",
                            p->laser.on.rule[i].send);
        r->on[r->ons].size = (uint8_t)size;
        memcpy(r->on[r->ons++].at, send, size);
    }
    return r->ons ? 0
                  : gon_fail(err, GON_E_INPUT,
                             "nothing in its profile switches it on, so that the "
                             "guard could not see when it may emit");
}

// --- answers -------------------------------------------------------------------------------------

struct writer {
    char *at;
    size_t left;
};

static void add(struct writer *w, const char *text, size_t size)
{
    const size_t fits = size < w->left ? size : w->left;
    memcpy(w->at, text, fits);
    w->at += fits;
    w->left -= fits;
}

static void add_text(struct writer *w, const char *text)
{
    add(w, text, strlen(text));
}

static void add_quoted(struct writer *w, const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        if (text[i] == ' ')
            add_text(w, "[ \t]*");
        else if (strchr(".[]{}()\\*+?^$|", text[i]))
            add(w, (char[]){'\\', text[i]}, 2);
        else
            add(w, &text[i], 1);
    }
}

// The terms of is_off that speak of a value, as one condition; err: of that value and another.
static int terms_of(const struct profile *p, int value, char *ret_terms, size_t size,
                    struct gon_error *err)
{
    const char *at = p->laser.is_off;
    *ret_terms = 0;
    while (at) {
        bool uses[PROFILE_VALUES] = {false};
        char term[PROFILE_TEXT];
        int others = 0;
        const char *next = strstr(at, " and ");
        snprintf(term, sizeof term, "%.*s", (int)(next ? (size_t)(next - at) : strlen(at)), at);
        at = next ? next + 5 : NULL;
        profile_when_uses(p, term, uses);
        for (int i = 0; i < p->values_count; i++)
            others += uses[i] && i != value;
        if (!uses[value])
            continue;
        if (others)
            return gon_fail(err, GON_E_INPUT, "is_off: the guard cannot compare two values: '%s'",
                            term);
        const size_t used = strlen(ret_terms);
        snprintf(ret_terms + used, size - used, "%s%s", used ? " and " : "", term);
    }
    return 0;
}

static bool holds(const struct profile *p, int value, const char *terms, double number)
{
    struct profile_data d;
    profile_data_clear(&d);
    profile_data_set(p, &d, value, number);
    return profile_when(p, terms, &d);
}

static void add_choice(struct writer *w, int *count, const char *text)
{
    add_text(w, (*count)++ ? "|" : "(");
    add_quoted(w, text, strlen(text));
}

static int end_choices(struct writer *w, int count, const char *terms, struct gon_error *err)
{
    if (count == 0)
        return gon_fail(err, GON_E_INPUT, "is_off: no answer can mean off by '%s'", terms);
    add_text(w, ")");
    return 0;
}

static int add_words(const struct profile *p, int value, const char *terms, struct writer *w,
                     struct gon_error *err)
{
    const struct profile_value *v = &p->values[value];
    int count = 0;
    for (int i = 0; i < v->words_count; i++)
        if (holds(p, value, terms, i))
            add_choice(w, &count, v->words[i]);
    return end_choices(w, count, terms, err);
}

static int add_whole(const struct profile *p, int value, const char *terms, struct writer *w,
                     struct gon_error *err)
{
    const struct profile_value *v = &p->values[value];
    const double first = v->min < v->max ? v->min : 0;
    double wire, last = v->min < v->max ? v->max : WHOLE_MOST - 1;
    int count = 0;
    last = last < first + WHOLE_MOST ? last : first + WHOLE_MOST - 1;
    add_text(w, "[+]?0*");
    for (double n = first; n <= last; n++) {
        char text[32];
        if (!holds(p, value, terms, n) || profile_wire(v, n, &wire, NULL) < 0 || wire < 0)
            continue;
        snprintf(text, sizeof text, "%.0f", wire);
        add_choice(w, &count, text);
    }
    return end_choices(w, count, terms, err);
}

// Whether every term only says that bits are not set: then each digit can be looked at alone.
static bool only_lacks(const char *terms)
{
    for (const char *at = terms; at; at = strstr(at, " and ")) {
        at += strncmp(at, " and ", 5) == 0 ? 5 : 0;
        const char *end = strstr(at, " and "), *lacks = strstr(at, " lacks ");
        if (strncmp(at, "not ", 4) != 0 && !(lacks && (!end || lacks < end)))
            return false;
    }
    return true;
}

static int add_hex(const struct profile *p, int value, const char *terms, struct writer *w,
                   struct gon_error *err)
{
    if (!only_lacks(terms))
        return gon_fail(err, GON_E_INPUT,
                        "is_off: of %s the guard can only see missing bits, not '%s'",
                        p->values[value].name, terms);
    add_text(w, "(0x)?0*");
    for (int i = 1; i < NIBBLES; i++)
        add_text(w, "(");
    for (int i = NIBBLES - 1; i >= 0; i--) {
        add_text(w, "[");
        for (unsigned digit = 0; digit < 16; digit++)
            if (holds(p, value, terms, (double)((uint64_t)digit << (4 * i))))
                add(w, &"0123456789ABCDEF"[digit], 1);
        add_text(w, i ? "])?" : "]");
    }
    return 0;
}

static int add_value(const struct profile *p, int value, struct writer *w, struct gon_error *err)
{
    char terms[2 * PROFILE_TEXT];
    const struct profile_value *v = &p->values[value];
    int rc = terms_of(p, value, terms, sizeof terms, err);
    if (rc < 0)
        return rc;
    if (!*terms) {
        add_text(w, v->type == PROFILE_STRING ? ".+" : "[^ ]+");
        return 0;
    }
    switch (v->ladder_count ? PROFILE_REAL : v->type) {
    case PROFILE_WORD: return add_words(p, value, terms, w, err);
    case PROFILE_INT: return add_whole(p, value, terms, w, err);
    case PROFILE_HEX: return add_hex(p, value, terms, w, err);
    default:
        return gon_fail(err, GON_E_INPUT,
                        "is_off: the guard cannot judge the number or text '%s' (%s); say it by a "
                        "word, a whole number or missing bits",
                        v->name, terms);
    }
}

// "{name:...}" or "{}"; the end of it.
static const char *add_braces(const struct profile *p, const char *at, struct writer *w,
                              bool seen[PROFILE_VALUES], int *rc, struct gon_error *err)
{
    const char *end = strchr(at, '}');
    char name[PROFILE_NAME];
    snprintf(name, sizeof name, "%.*s", (int)strcspn(at + 1, ":}"), at + 1);
    const int value = *name ? profile_value(p, name) : -1;
    if (value < 0) {
        add_text(w, ".*");
    } else {
        seen[value] = true;
        *rc = add_value(p, value, w, err);
    }
    return end + 1;
}

// The pattern was checked when the profile was loaded.
static int add_pattern(const struct profile *p, const char *pattern, struct writer *w,
                       bool seen[PROFILE_VALUES], struct gon_error *err)
{
    int rc = 0;
    for (const char *at = pattern; *at && rc == 0;) {
        const bool twice = strchr("{}[]", *at) && at[1] == *at;
        if (*at == '{' && !twice) {
            at = add_braces(p, at, w, seen, &rc, err);
            continue;
        }
        if (*at == '[' && !twice)
            add_text(w, "(");
        else if (*at == ']' && !twice)
            add_text(w, ")?");
        else
            add_quoted(w, at, 1);
        at += twice ? 2 : 1;
    }
    return rc;
}

static void add_echo(const struct profile *p, const char *command, struct writer *w)
{
    const char *echo_end = p->framing.echo_end;
    if (!*echo_end || strstr(echo_end, p->framing.end_in))
        return; // none, or a line of its own, which is passed over
    add_quoted(w, command, strlen(command));
    add_quoted(w, echo_end, strlen(echo_end));
}

static int take_ask(const struct profile *p, const char *name, struct guard_ask *a,
                    bool seen[PROFILE_VALUES], struct gon_error *err)
{
    const int x = profile_exchange(p, name);
    struct profile_data nothing;
    struct writer w = {a->off, sizeof a->off - 1};
    char command[128];
    regex_t regex;
    profile_data_clear(&nothing);
    if (x < 0)
        return gon_fail(err, GON_E_INPUT, "there is no exchange '%s'", name);
    int rc = profile_text_write(p, p->exchanges[x].send, &nothing, command, sizeof command, err);
    if (rc == 0)
        rc = bytes_of(p, "", command, &a->question, err);
    if (rc < 0)
        return rc;
    add_text(&w, "^[ \t\r\n]*");
    add_echo(p, command, &w);
    rc = add_pattern(p, p->exchanges[x].answer, &w, seen, err);
    if (rc < 0)
        return rc;
    add_text(&w, "[ \t\r\n]*$");
    *w.at = 0;
    if (w.left == 0 || regcomp(&regex, a->off, REG_EXTENDED | REG_NOSUB))
        return gon_fail(err, GON_E_INPUT, "the answer to '%s' is too much for the guard", name);
    regfree(&regex);
    return 0;
}

static int take_asks(const struct profile *p, struct guard_record *r, struct gon_error *err)
{
    const struct profile_asks *asks = &p->laser.off_asks;
    bool seen[PROFILE_VALUES] = {false}, uses[PROFILE_VALUES] = {false};
    int rc = 0;
    if (asks->count > GUARD_ASKS)
        return gon_fail(err, GON_E_INPUT, "off_asks: the guard asks at most %d questions",
                        GUARD_ASKS);
    r->asks = (uint8_t)asks->count;
    for (int i = 0; i < asks->count && rc == 0; i++)
        rc = take_ask(p, asks->name[i], &r->ask[i], seen, err);
    profile_when_uses(p, p->laser.is_off, uses);
    for (int i = 0; i < p->values_count && rc == 0; i++)
        if (uses[i] && !seen[i])
            rc = gon_fail(err, GON_E_INPUT,
                          "is_off speaks of %s, which no question of off_asks brings",
                          p->values[i].name);
    return rc;
}

// --- all of it -----------------------------------------------------------------------------------

static uint8_t tail_of(const struct profile_checksum *c)
{
    const size_t digits = (size_t)(c->width / (c->form <= PROFILE_HEX_LOWER ? 4 : 8));
    return c->kind == PROFILE_NO_SUM ? 0 : (uint8_t)(strlen(c->before) + digits);
}

static void put(struct guard_bytes *b, const char *text)
{
    b->size = (uint8_t)strlen(text);
    memcpy(b->at, text, b->size);
}

int safing_of(const struct profile *p, const char *link, struct guard_record *ret_record,
              struct gon_error *err)
{
    const struct profile_framing *f = &p->framing;
    struct guard_record r = {.reopen_ns = REOPEN_NS};
    struct link parsed;
    int rc = link_parse(link, LINK_TEXT, &parsed, err);
    if (rc < 0)
        return rc;
    if (strlen(link) >= sizeof r.link || p->role != PROFILE_LASER || !p->laser.off_count ||
        !p->laser.off_asks.count || !*f->end_in)
        return gon_fail(err, GON_E_INPUT,
                        "profile %s does not say how to switch a laser off and to see it", p->name);
    snprintf(r.link, sizeof r.link, "%s", link);
    r.framed = parsed.kind == LINK_USBTMC;
    put(&r.end_out, f->end_out);
    put(&r.end_in, f->end_in);
    r.tail = tail_of(&p->checksum);
    r.gap_ns = CLK_S(f->gap_ms * 1e-3);
    r.timeout_ns = CLK_S(f->timeout_ms * 1e-3);
    r.quiet_ns = CLK_S(f->quiet_ms * 1e-3);
    rc = take_offs(p, &r, err);
    rc = rc < 0 ? rc : take_ons(p, &r, err);
    rc = rc < 0 ? rc : take_asks(p, &r, err);
    if (rc < 0)
        return gon_prefix(err, "profile %s", p->name), rc;
    *ret_record = r;
    return 0;
}
