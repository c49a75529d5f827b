// SPDX-License-Identifier: MIT
#include "sim/actor_text.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- fields --------------------------------------------------------------------------------------

struct field {
    int value; // -1: {}
    bool zeros;
    int width, precision; // -1: none was said
    char as;              // printf's letter; 0: as the type says
};

// "{name:05.2f}" at *at, which is moved behind it.
static struct field field(const struct actor_values *v, const char **at)
{
    const char *p = *at + 1;
    size_t size = strcspn(p, ":}");
    struct field f = {.value = actor_values_find(v, p, size), .precision = -1};
    p += size;
    if (*p == ':') {
        char *end;
        p++;
        f.zeros = *p == '0';
        f.width = (int)strtol(p, &end, 10);
        if (*end == '.')
            f.precision = (int)strtol(end + 1, &end, 10);
        f.as = *end == '}' ? 0 : *end;
        p = end;
    }
    p += strcspn(p, "}");
    *at = p + (*p == '}');
    return f;
}

static bool doubled(const char *p)
{
    return strchr("{}[]", *p) && p[1] == *p && *p;
}

static bool begins_field(const char *p)
{
    return *p == '{' && p[1] != '{';
}

bool actor_text_has_values(const char *pattern)
{
    for (const char *p = pattern; *p; p += doubled(p) ? 2 : 1)
        if (begins_field(p))
            return true;
    return false;
}

// --- matching ------------------------------------------------------------------------------------

// As much of the line as looks like a decimal number; strtod would also take nan, inf and 0x.
static size_t decimal(const char *line)
{
    const char *p = line + (*line == '-' || *line == '+');
    size_t digits = strspn(p, "0123456789"), more = 0;
    p += digits;
    if (*p == '.') {
        more = strspn(p + 1, "0123456789");
        p += digits + more > 0 ? 1 + more : 0;
    }
    if (digits + more == 0)
        return 0;
    if (*p == 'e' || *p == 'E') {
        const char *power = p + 1 + (p[1] == '-' || p[1] == '+');
        size_t tens = strspn(power, "0123456789");
        p = tens > 0 ? power + tens : p;
    }
    return (size_t)(p - line);
}

static size_t longest_word(const struct actor_values *v, int value, const char *line, int *ret_word)
{
    const struct profile_value *p = &v->profile->values[value];
    size_t longest = 0;
    for (int i = 0; i < p->words_count; i++) {
        size_t size = strlen(p->words[i]);
        if (size > longest && strncmp(p->words[i], line, size) == 0) {
            longest = size;
            *ret_word = p->ladder_first + i;
        }
    }
    return longest;
}

static size_t take_text(struct actor_values *v, int value, const char *line, char stop)
{
    size_t size = stop ? strcspn(line, (char[]){stop, 0}) : strlen(line);
    snprintf(v->text[value], ACTOR_TEXT, "%.*s", size < ACTOR_TEXT ? (int)size : ACTOR_TEXT - 1,
             line);
    return size;
}

// Takes a field's value from the line: how much of it, 0 when it is none. stop: what follows the
// field in the pattern.
static size_t take(struct actor_values *v, struct field f, const char *line, char stop,
                   bool *ret_beyond)
{
    const struct profile_value *p = &v->profile->values[f.value];
    int word = 0;
    size_t size;
    double wire;
    if (p->type == PROFILE_STRING)
        return take_text(v, f.value, line, stop);
    if (p->type == PROFILE_WORD) {
        size = longest_word(v, f.value, line, &word);
        v->number[f.value] = word;
        return size;
    }
    if (p->type == PROFILE_HEX || f.as == 'x' || f.as == 'X') {
        size = strspn(line, "0123456789abcdefABCDEF");
        wire = (double)strtoull(line, NULL, 16);
    } else {
        size = decimal(line);
        wire = strtod(line, NULL);
    }
    bool broken = p->type == PROFILE_INT && wire != floor(wire);
    *ret_beyond |= size > 0 && (broken || !actor_values_take(v, f.value, wire));
    return size;
}

enum actor_fit actor_text_match(struct actor_values *v, const char *pattern, const char *line)
{
    bool beyond = false;
    for (const char *p = pattern; *p;) {
        if (begins_field(p)) {
            struct field f = field(v, &p);
            size_t size = f.value < 0 ? 0 : take(v, f, line, *p, &beyond);
            if (size == 0)
                return ACTOR_OTHER;
            line += size;
        } else if (*p == ' ') {
            line += strspn(line, " ");
            p++;
        } else {
            p += doubled(p);
            if (*p++ != *line++)
                return ACTOR_OTHER;
        }
    }
    line += strspn(line, " ");
    return *line ? ACTOR_OTHER : beyond ? ACTOR_BEYOND : ACTOR_FITS;
}

// --- writing -------------------------------------------------------------------------------------

struct out {
    char *text;
    size_t size, used;
};

static void put(struct out *o, char c)
{
    if (o->used + 1 < o->size)
        o->text[o->used++] = c;
}

static void put_padded(struct out *o, struct field f, const char *text)
{
    int lack = f.width - (int)strlen(text);
    if (f.zeros && (*text == '-' || *text == '+'))
        put(o, *text++);
    for (; lack > 0; lack--)
        put(o, f.zeros ? '0' : ' ');
    while (*text)
        put(o, *text++);
}

static char letter(const struct profile_value *p, struct field f)
{
    if (f.as)
        return f.as;
    return p->type == PROFILE_HEX ? 'X' : p->type == PROFILE_INT || p->ladder_count > 0 ? 'd' : 0;
}

static void put_number(struct out *o, const struct profile_value *p, struct field f, double wire)
{
    char text[400];
    int precision = f.precision < 0 ? 6 : f.precision;
    switch (letter(p, f)) {
    case 'd': snprintf(text, sizeof text, "%.0f", wire); break;
    case 'x': snprintf(text, sizeof text, "%llx", (unsigned long long)llround(wire)); break;
    case 'X': snprintf(text, sizeof text, "%llX", (unsigned long long)llround(wire)); break;
    case 'f': snprintf(text, sizeof text, "%.*f", precision, wire); break;
    case 'e': snprintf(text, sizeof text, "%.*e", precision, wire); break;
    case 'g': snprintf(text, sizeof text, "%.*g", precision, wire); break;
    default: snprintf(text, sizeof text, "%.10g", wire); break;
    }
    put_padded(o, f, text);
}

static void put_value(struct out *o, const struct actor_values *v, struct field f)
{
    if (f.value < 0) {
        put(o, '0');
        return;
    }
    const struct profile_value *p = &v->profile->values[f.value];
    const char *word = actor_values_name(v, f.value, v->number[f.value]);
    if (p->type == PROFILE_STRING)
        put_padded(o, f, v->text[f.value]);
    else if (p->type == PROFILE_WORD)
        put_padded(o, f, word ? word : "");
    else
        put_number(o, p, f, actor_values_wire(v, f.value));
}

void actor_text_write(const struct actor_values *v, const char *pattern, char *ret_text,
                      size_t size)
{
    struct out o = {.text = ret_text, .size = size};
    bool optional = false;
    for (const char *p = pattern; *p;) {
        if (begins_field(p)) {
            struct field f = field(v, &p);
            if (f.value >= 0 || !optional)
                put_value(&o, v, f);
        } else if ((*p == '[' || *p == ']') && !doubled(p)) {
            optional = *p++ == '[';
        } else {
            p += doubled(p);
            put(&o, *p++);
        }
    }
    ret_text[o.used] = 0;
}

void actor_text_unglob(const char *glob, char *ret_text, size_t size)
{
    struct out o = {.text = ret_text, .size = size};
    for (; *glob; glob++)
        if (*glob != '*')
            put(&o, *glob);
    ret_text[o.used] = 0;
}
