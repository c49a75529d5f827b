// SPDX-License-Identifier: MIT
#include "drivers/profile_text.h"

#include "drivers/message.h"

#include <ctype.h>
#include <math.h>
#include <string.h>
#include <strings.h>

// --- the parts of a pattern ----------------------------------------------------------------------

enum part_kind { PART_END, PART_CHAR, PART_BLANK, PART_VALUE, PART_OPEN, PART_CLOSE, PART_BAD };

struct part {
    enum part_kind kind;
    char c;           // PART_CHAR
    int value;        // PART_VALUE; -1: any text
    char format[16];  // of printf between % and its letter: "05.2"
    char letter;      // d x X f e g s; 0: as the type says
    const char *next; // behind it
};

static struct part bad(struct gon_error *err, const char *why, const char *at)
{
    gon_fail(err, GON_E_INPUT, "%s at '%.20s'", why, at);
    return (struct part){.kind = PART_BAD};
}

static bool is_format(const char *format)
{
    format += strspn(format, "0123456789");
    if (*format == '.')
        format += 1 + strspn(format + 1, "0123456789");
    return *format == 0;
}

// What stands behind the colon.
static bool read_format(const char *text, size_t size, struct part *part)
{
    if (size == 0 || size > 6 || !strchr("dxXfegs", text[size - 1]))
        return false;
    part->letter = text[size - 1];
    memcpy(part->format, text, size - 1);
    return is_format(part->format);
}

static struct part read_value(const struct profile *p, const char *at, struct gon_error *err)
{
    const char *end = strchr(at, '}');
    struct part part = {.kind = PART_VALUE, .value = -1};
    char name[PROFILE_NAME];
    if (!end)
        return bad(err, "'}' is missing", at);
    part.next = end + 1;
    const size_t inside = (size_t)(end - at - 1), size = strcspn(at + 1, ":}");
    if (inside == 0)
        return part;
    if (size < inside && !read_format(at + 1 + size + 1, inside - size - 1, &part))
        return bad(err, "not a format (0, width, .digits, one of d x X f e g s; no + or -)", at);
    snprintf(name, sizeof name, "%.*s", (int)size, at + 1);
    part.value = size < sizeof name ? profile_value(p, name) : -1;
    return part.value >= 0 ? part : bad(err, "there is no such value", at);
}

static struct part part_at(const struct profile *p, const char *at, struct gon_error *err)
{
    struct part part = {.kind = PART_CHAR, .c = *at, .next = at + 1};
    if (*at && strchr("{}[]", *at) && at[1] == *at) {
        part.next = at + 2;
        return part;
    }
    switch (*at) {
    case 0: part.kind = PART_END; return part;
    case ' ': part.kind = PART_BLANK; return part;
    case '[': part.kind = PART_OPEN; return part;
    case ']': part.kind = PART_CLOSE; return part;
    case '{': return read_value(p, at, err);
    case '}': return bad(err, "'{' is missing before '}'", at);
    default: return part;
    }
}

// --- checking ------------------------------------------------------------------------------------

struct checked {
    bool reading, in_group, after_value;
    bool seen[PROFILE_VALUES];
};

static bool on_wire_whole(const struct profile_value *v)
{
    return v->type == PROFILE_INT || v->type == PROFILE_HEX || v->ladder_count > 0;
}

static int check_value(const struct profile *p, const struct part *part, struct checked *c,
                       struct gon_error *err)
{
    if (part->value < 0 && !c->reading)
        return gon_fail(err, GON_E_INPUT, "{} only stands in an answer");
    if (c->reading && c->after_value)
        return gon_fail(err, GON_E_INPUT,
                        "nothing stands between two values, so where does the "
                        "first one end?");
    if (part->value < 0)
        return 0;
    const struct profile_value *v = &p->values[part->value];
    const bool is_text = v->type == PROFILE_STRING || v->type == PROFILE_WORD;
    if (c->reading && c->seen[part->value])
        return gon_fail(err, GON_E_INPUT, "{%s} stands twice in it", v->name);
    if (part->letter && is_text != (part->letter == 's'))
        return gon_fail(err, GON_E_INPUT, "{%s:%s%c}: %s", v->name, part->format, part->letter,
                        is_text ? "a text is written by s" : "a number is not written by s");
    if (part->letter && strchr("dxX", part->letter) && v->type == PROFILE_REAL && !v->ladder_count)
        return gon_fail(err, GON_E_INPUT, "{%s:%s%c}: it is real, and written by f, e or g",
                        v->name, part->format, part->letter);
    c->seen[part->value] = true;
    return 0;
}

static int check_part(const struct profile *p, const struct part *part, struct checked *c,
                      struct gon_error *err)
{
    int rc = 0;
    switch (part->kind) {
    case PART_BAD: return GON_E_INPUT;
    case PART_OPEN:
        if (!c->reading || c->in_group)
            return gon_fail(err, GON_E_INPUT,
                            c->reading ? "a [ ] inside another" : "[ ] only stands in an answer");
        c->in_group = true;
        return 0;
    case PART_CLOSE:
        if (!c->in_group)
            return gon_fail(err, GON_E_INPUT, "'[' is missing before ']'");
        c->in_group = false;
        return 0;
    case PART_VALUE: rc = check_value(p, part, c, err); break;
    case PART_END:
        if (c->in_group)
            return gon_fail(err, GON_E_INPUT, "']' is missing");
        break;
    case PART_CHAR:
    case PART_BLANK:
    default: break;
    }
    c->after_value = part->kind == PART_VALUE;
    return rc;
}

int profile_text_check(const struct profile *p, const char *pattern, bool reading,
                       struct gon_error *err)
{
    struct checked c = {.reading = reading};
    struct part part = {.next = pattern};
    do {
        part = part_at(p, part.next, err);
        int rc = check_part(p, &part, &c, err);
        if (rc < 0)
            return rc;
    } while (part.kind != PART_END);
    return 0;
}

void profile_text_uses(const struct profile *p, const char *pattern, bool ret_uses[PROFILE_VALUES])
{
    struct part part = {.next = pattern};
    do {
        part = part_at(p, part.next, NULL);
        if (part.kind == PART_VALUE && part.value >= 0)
            ret_uses[part.value] = true;
    } while (part.kind != PART_END && part.kind != PART_BAD);
}

// --- writing -------------------------------------------------------------------------------------

static int write_text(const struct profile_value *v, const struct part *part, const char *text,
                      char *ret_text, size_t size, struct gon_error *err)
{
    char format[24];
    for (const char *c = text; *c; c++)
        if (iscntrl((unsigned char)*c))
            return gon_fail(err, GON_E_INPUT, "%s contains a control character", v->name);
    snprintf(format, sizeof format, "%%%ss", part->format);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral" // read_format has seen it
    return snprintf(ret_text, size, format, text);
#pragma GCC diagnostic pop
}

static char letter_of(const struct profile_value *v, const struct part *part)
{
    if (part->letter)
        return part->letter;
    if (v->type == PROFILE_HEX)
        return 'X';
    return on_wire_whole(v) ? 'd' : 'g';
}

static int write_number(const struct profile_value *v, const struct part *part, double wire,
                        char *ret_text, size_t size, struct gon_error *err)
{
    char format[24];
    const char letter = letter_of(v, part);
    const bool whole = strchr("dxX", letter) != NULL;
    if (whole && (wire != round(wire) || fabs(wire) >= 0x1p53 || (letter != 'd' && wire < 0)))
        return gon_fail(err, GON_E_INPUT, "%s: %.10g cannot be written as a %s number", v->name,
                        wire, letter == 'd' ? "whole" : "hexadecimal");
    snprintf(format, sizeof format, "%%%s%s%c", part->letter || whole ? part->format : ".10",
             whole ? "ll" : "", letter);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral" // read_format has seen it
    return whole ? snprintf(ret_text, size, format, (long long)wire)
                 : snprintf(ret_text, size, format, wire);
#pragma GCC diagnostic pop
}

// The length of what it is; size may be too small for it.
static int write_value(const struct profile *p, const struct part *part,
                       const struct profile_data *d, char *ret_text, size_t size,
                       struct gon_error *err)
{
    const struct profile_value *v = &p->values[part->value];
    double wire;
    if (!d->known[part->value])
        return gon_fail(err, GON_E_INPUT, "%s is not known", v->name);
    if (v->type == PROFILE_STRING)
        return write_text(v, part, d->text[part->value], ret_text, size, err);
    int rc = profile_wire(v, d->number[part->value], &wire, err);
    if (rc < 0)
        return rc;
    if (v->type == PROFILE_WORD)
        return write_text(v, part, profile_word(v, wire), ret_text, size, err);
    return write_number(v, part, wire, ret_text, size, err);
}

int profile_text_write(const struct profile *p, const char *pattern, const struct profile_data *d,
                       char *ret_text, size_t size, struct gon_error *err)
{
    char text[PROFILE_ANSWER];
    size_t have = 0;
    struct part part = {.next = pattern};
    for (;;) {
        part = part_at(p, part.next, err);
        int more = 1;
        if (part.kind == PART_END)
            break;
        if (part.kind == PART_CHAR || part.kind == PART_BLANK)
            text[have] = part.c;
        else if (part.kind == PART_VALUE && part.value >= 0)
            more = write_value(p, &part, d, text + have, sizeof text - have, err);
        else if (part.kind == PART_BAD)
            return GON_E_INPUT;
        else
            return gon_fail(err, GON_E_INPUT, "'%.80s' cannot be sent: it is an answer", pattern);
        if (more < 0)
            return more;
        have += (size_t)more;
        if (have >= size || have >= sizeof text)
            return gon_fail(err, GON_E_INPUT, "'%.80s': longer than %zu characters", pattern,
                            size - 1);
    }
    memcpy(ret_text, text, have);
    ret_text[have] = 0;
    return 0;
}

// --- reading -------------------------------------------------------------------------------------

struct span {
    const char *at; // NULL: not in the answer
    size_t size;
    bool hex;
};

struct match {
    const struct profile *p;
    const char *pattern, *answer;
    const char *furthest; // where it did not fit
    struct span span[PROFILE_VALUES];
    // Pairs of places in pattern and answer from which it is known not to fit; without it a hostile
    // answer could take for ever.
    uint8_t failed[PROFILE_TEXT][PROFILE_ANSWER / 8 + 1];
};

static bool fits(struct match *m, const char *at, const char *text);

// The number of characters from which a number can be read, at most.
static size_t number_run(const char *text, bool hex)
{
    return strspn(text, hex ? "0123456789abcdefABCDEFxX" : "0123456789+-.eE");
}

static int read_hex(const struct span *s, double *ret_wire)
{
    char text[16];
    const bool prefixed = s->size > 2 && s->at[0] == '0' && (s->at[1] | 32) == 'x';
    const char *digits = prefixed ? s->at + 2 : s->at;
    snprintf(text, sizeof text, "0x%.*s", (int)(s->at + s->size - digits), digits);
    return profile_literal(NULL, text, ret_wire, NULL);
}

static int read_number(const struct span *s, double *ret_wire)
{
    char text[64];
    if (s->hex)
        return read_hex(s, ret_wire);
    if (s->size >= sizeof text)
        return GON_E_LINK;
    snprintf(text, sizeof text, "%.*s", (int)s->size, s->at);
    return message_decimal(text, ret_wire, NULL);
}

static bool fits_number(struct match *m, struct span s, const char *after, struct span *ret_span)
{
    double wire;
    for (s.size = number_run(s.at, s.hex); s.size > 0; s.size--)
        if (read_number(&s, &wire) == 0 && fits(m, after, s.at + s.size)) {
            *ret_span = s;
            return true;
        }
    return false;
}

static bool fits_word(struct match *m, const struct profile_value *v, struct span s,
                      const char *after, struct span *ret_span)
{
    for (int i = 0; i < v->words_count; i++) {
        s.size = strlen(v->words[i]);
        if (strncasecmp(s.at, v->words[i], s.size) == 0 && fits(m, after, s.at + s.size)) {
            *ret_span = s;
            return true;
        }
    }
    return false;
}

static bool fits_text(struct match *m, struct span s, const char *after, size_t least,
                      struct span *ret_span)
{
    const size_t most = strlen(s.at);
    for (s.size = least; s.size <= most; s.size++)
        if (fits(m, after, s.at + s.size)) {
            *ret_span = s;
            return true;
        }
    return false;
}

static bool fits_value(struct match *m, const struct part *part, const char *text)
{
    struct span s = {.at = text}, dropped;
    if (part->value < 0)
        return fits_text(m, s, part->next, 0, &dropped);
    const struct profile_value *v = &m->p->values[part->value];
    struct span *into = &m->span[part->value];
    if (v->type == PROFILE_STRING)
        return fits_text(m, s, part->next, 1, into);
    s.at += strspn(s.at, " \t");
    if (v->type == PROFILE_WORD)
        return fits_word(m, v, s, part->next, into);
    s.hex = v->type == PROFILE_HEX || part->letter == 'x' || part->letter == 'X';
    return fits_number(m, s, part->next, into);
}

static const char *behind_group(const struct match *m, const char *at)
{
    struct part part = {.next = at};
    do
        part = part_at(m->p, part.next, NULL);
    while (part.kind != PART_CLOSE && part.kind != PART_END && part.kind != PART_BAD);
    return part.kind == PART_CLOSE ? part.next : at + strlen(at);
}

static bool fits_part(struct match *m, const char *at, const char *text)
{
    const struct part part = part_at(m->p, at, NULL);
    if (text > m->furthest)
        m->furthest = text;
    switch (part.kind) {
    case PART_END: return *text == 0;
    case PART_CHAR: return *text == part.c && fits(m, part.next, text + 1);
    case PART_BLANK: return fits(m, part.next, text + strspn(text, " \t"));
    case PART_OPEN: return fits(m, part.next, text) || fits(m, behind_group(m, part.next), text);
    case PART_CLOSE: return fits(m, part.next, text);
    case PART_VALUE: return fits_value(m, &part, text);
    case PART_BAD:
    default: return false;
    }
}

static bool fits(struct match *m, const char *at, const char *text)
{
    uint8_t *row = m->failed[at - m->pattern];
    const size_t place = (size_t)(text - m->answer);
    if (row[place / 8] & 1 << place % 8)
        return false;
    const bool fit = fits_part(m, at, text);
    if (!fit)
        row[place / 8] |= (uint8_t)(1 << place % 8);
    return fit;
}

static int take_span(const struct profile *p, int value, const struct span *s,
                     struct profile_data *d, struct gon_error *err)
{
    const struct profile_value *v = &p->values[value];
    char text[PROFILE_DATA_TEXT] = "";
    double wire, number = (double)NAN;
    int rc = 0;
    if (s->at && s->size >= sizeof text)
        return gon_fail(err, GON_E_LINK, "%s: longer than %zu characters", v->name,
                        sizeof text - 1);
    if (s->at)
        snprintf(text, sizeof text, "%.*s", (int)s->size, s->at);
    if (s->at && (v->type == PROFILE_STRING || v->type == PROFILE_WORD))
        return profile_data_set_text(p, d, value, text, err);
    if (s->at)
        rc = read_number(s, &wire);
    if (s->at && rc == 0)
        rc = profile_number(v, wire, &number, err);
    if (rc == 0)
        profile_data_set(p, d, value, number);
    return rc;
}

int profile_text_read(const struct profile *p, const char *pattern, const char *answer,
                      struct profile_data *d, struct gon_error *err)
{
    struct match m = {.p = p, .pattern = pattern, .answer = answer, .furthest = answer};
    bool uses[PROFILE_VALUES] = {false};
    if (strlen(answer) > PROFILE_ANSWER)
        return gon_fail(err, GON_E_LINK, "an answer of %zu characters; at most %d are read",
                        strlen(answer), PROFILE_ANSWER);
    if (!fits(&m, pattern, answer))
        return gon_fail(err, GON_E_LINK, "got '%.80s' / expected '%.80s' / at byte %td", answer,
                        pattern, m.furthest - answer);
    profile_text_uses(p, pattern, uses);
    struct profile_data data = *d;
    for (int value = 0; value < p->values_count; value++)
        if (uses[value]) {
            int rc = take_span(p, value, &m.span[value], &data, err);
            if (rc < 0)
                return rc;
        }
    *d = data;
    return 0;
}
