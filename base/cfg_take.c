// SPDX-License-Identifier: MIT
// A parsed file against its table. The same code runs twice: first with a NULL target, where it
// only counts and reports mistakes; and when there are none, again to write.
#include "base/cfg.h"
#include "base/cfg_file.h"
#include "base/options.h"

#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct place {
    struct cfg_file *file;
    char *target; // of the struct that the rows describe; NULL: only check
    char path[CFG_PATH];
};

static int take_group(const struct place *at, const config_setting_t *group,
                      const struct cfg_row *rows);

static void *member(const struct place *at, size_t offset)
{
    return at->target ? at->target + offset : NULL;
}

// The place of a member, or with an index of an element.
static struct place inner(const struct place *at, const char *name, int index, char *target)
{
    struct place in = {.file = at->file, .target = target};
    if (name)
        snprintf(in.path, sizeof in.path, "%.150s%s%.80s", at->path, *at->path ? "." : "", name);
    else
        snprintf(in.path, sizeof in.path, "%.220s[%d]", at->path, index);
    return in;
}

static int wrong(const struct place *at, const config_setting_t *s, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

static int wrong(const struct place *at, const config_setting_t *s, const char *fmt, ...)
{
    char text[500], value[CFG_VALUE];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    cfg_show(at->file, s, value, sizeof value);
    return cfg_say(at->file, cfg_line(s), "%s = %s: %s", at->path, value, text);
}

// --- numbers -------------------------------------------------------------------------------------

static bool limited(const struct cfg_row *row)
{
    return row->min != row->max;
}

static bool whole(const struct cfg_row *row)
{
    return row->type == CFG_INT || row->type == CFG_HEX;
}

static void allowed(const struct cfg_row *row, char *text, size_t size)
{
    const char *unit = row->unit ? row->unit : "", *space = row->unit ? " " : "";
    int digits = whole(row) ? 17 : 9; // whole numbers to the last digit
    if (isinf(row->max))
        snprintf(text, size, "at least %.*g%s%s", digits, row->min, space, unit);
    else if (isinf(row->min))
        snprintf(text, size, "at most %.*g%s%s", digits, row->max, space, unit);
    else
        snprintf(text, size, "%.*g..%.*g%s%s", digits, row->min, digits, row->max, space, unit);
}

// What libconfig kept of a hexadecimal number is its low half: the number is that of the text.
static double hexadecimal(const struct place *at, const config_setting_t *s)
{
    char text[CFG_VALUE];
    cfg_show(at->file, s, text, sizeof text);
    return (double)strtoull(text, NULL, 16);
}

static int take_number(const struct place *at, const config_setting_t *s, const struct cfg_row *row,
                       double *ret_value)
{
    double value;
    switch (config_setting_type(s)) {
    case CONFIG_TYPE_INT:
    case CONFIG_TYPE_INT64:
        value = (double)config_setting_get_int64(s);
        break;
    case CONFIG_TYPE_FLOAT:
        value = config_setting_get_float(s);
        break;
    default:
        return wrong(at, s, "not a number%s",
                     row->type == CFG_REALS ? " or a list of numbers" : "");
    }
    char range[80];
    allowed(row, range, sizeof range);
    if (config_setting_get_format(s) == CONFIG_FORMAT_HEX) { // cut to 32 bits without a word
        if (row->type != CFG_HEX)
            return wrong(at, s, "hexadecimal; write a decimal number");
        value = hexadecimal(at, s);
    }
    if (whole(row) && value != floor(value))
        return wrong(at, s, "not a whole number");
    if (!isfinite(value) || (limited(row) && !(value >= row->min && value <= row->max)))
        return wrong(at, s, "out of range%s%s", limited(row) ? "; allowed " : "",
                     limited(row) ? range : "");
    if ((row->type == CFG_INT && !(value >= INT_MIN && value <= INT_MAX)) ||
        (row->type == CFG_HEX && !(value >= 0 && value <= UINT32_MAX)))
        return wrong(at, s, "out of range");
    *ret_value = value;
    return 0;
}

static void put_number(const struct place *at, const struct cfg_row *row, double value)
{
    if (at->target && row->type == CFG_INT)
        *(int *)member(at, row->offset) = (int)value;
    else if (at->target && row->type == CFG_HEX)
        *(uint32_t *)member(at, row->offset) = (uint32_t)value;
    else if (at->target)
        *(double *)member(at, row->offset) = value;
}

static int take_reals(const struct place *at, const config_setting_t *s, const struct cfg_row *row)
{
    bool list = config_setting_is_array(s) || config_setting_is_list(s);
    int count = list ? config_setting_length(s) : 1, mistakes = 0;
    double *values = member(at, row->offset);
    if ((size_t)count > row->size)
        return wrong(at, s, "%d numbers; at most %zu are allowed", count, row->size);
    if (count == 0 && !row->fallback)
        return wrong(at, s, "an empty list; give at least one number");
    for (int i = 0; i < count; i++) {
        const struct place element = inner(at, NULL, i, NULL);
        double value = (double)NAN;
        mistakes += take_number(list ? &element : at,
                                list ? config_setting_get_elem(s, (unsigned)i) : s, row, &value);
        if (values)
            values[i] = value;
    }
    if (at->target)
        *(int *)member(at, row->count_offset) = count;
    return mistakes;
}

static int take_pairs(const struct place *at, const config_setting_t *s, const struct cfg_row *row)
{
    if (!config_setting_is_list(s))
        return wrong(at, s, "not a list of pairs; write ( (a, b), (a, b) )");
    int count = config_setting_length(s), mistakes = 0;
    double *values = member(at, row->offset);
    if ((size_t)count > row->size)
        return wrong(at, s, "%d pairs; at most %zu are allowed", count, row->size);
    if (count == 0 && !row->fallback)
        return wrong(at, s, "an empty list; give at least one pair");
    for (int i = 0; i < count; i++) {
        const config_setting_t *pair = config_setting_get_elem(s, (unsigned)i);
        const struct place element = inner(at, NULL, i, NULL);
        const bool list = config_setting_is_list(pair) || config_setting_is_array(pair);
        if (!list || config_setting_length(pair) != 2) {
            mistakes += wrong(&element, pair, "not a pair of numbers; write (a, b)");
            continue;
        }
        for (int k = 0; k < 2; k++) {
            const struct place number = inner(&element, NULL, k, NULL);
            double value = (double)NAN;
            mistakes +=
                take_number(&number, config_setting_get_elem(pair, (unsigned)k), row, &value);
            if (values)
                values[2 * i + k] = value;
        }
    }
    if (at->target)
        *(int *)member(at, row->count_offset) = count;
    return mistakes;
}

// --- words ---------------------------------------------------------------------------------------

// Length of the UTF-8 sequence at p, 0 when it is none. No overlong forms, no surrogates.
static int utf8_length(const unsigned char *p)
{
    if (p[0] < 0x80)
        return 1;
    int n = p[0] >= 0xc2 && p[0] < 0xe0   ? 2
            : p[0] >= 0xe0 && p[0] < 0xf0 ? 3
            : p[0] >= 0xf0 && p[0] < 0xf5 ? 4
                                          : 0;
    for (int i = 1; i < n; i++)
        if ((p[i] & 0xc0) != 0x80)
            return 0;
    bool bad = (p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] > 0x9f) ||
               (p[0] == 0xf0 && p[1] < 0x90) || (p[0] == 0xf4 && p[1] > 0x8f);
    return bad ? 0 : n;
}

static bool is_utf8(const char *text, bool control)
{
    for (const unsigned char *p = (const unsigned char *)text; *p;) {
        int n = utf8_length(p);
        if (n == 0 || (!control && ((*p < 0x20 && *p != '\n' && *p != '\t') || *p == 0x7f)))
            return false;
        p += n;
    }
    return true;
}

// Into to, which holds size bytes; NULL: only check.
static int take_text(const struct place *at, const config_setting_t *s, bool control, char *to,
                     size_t size)
{
    if (config_setting_type(s) != CONFIG_TYPE_STRING)
        return wrong(at, s, "not a text; write it in double quotes");
    const char *text = config_setting_get_string(s);
    if (strlen(text) >= size)
        return wrong(at, s, "%zu bytes long; at most %zu are allowed", strlen(text), size - 1);
    if (!is_utf8(text, control))
        return cfg_say(at->file, cfg_line(s), "%s: not UTF-8 text%s", at->path,
                       control ? "" : ", or with control characters in it");
    if (to)
        strncpy(to, text, size); // fills the rest with zeros
    return 0;
}

static int take_strings(const struct place *at, const config_setting_t *s,
                        const struct cfg_row *row)
{
    bool list = config_setting_is_array(s) || config_setting_is_list(s);
    int count = list ? config_setting_length(s) : 1, mistakes = 0;
    char *texts = member(at, row->offset);
    if ((size_t)count > row->size)
        return wrong(at, s, "%d texts; at most %zu are allowed", count, row->size);
    if (count == 0 && !row->fallback)
        return wrong(at, s, "an empty list; give at least one text");
    for (int i = 0; i < count; i++) {
        const struct place element = inner(at, NULL, i, NULL);
        mistakes += take_text(list ? &element : at,
                              list ? config_setting_get_elem(s, (unsigned)i) : s, true,
                              texts ? texts + (size_t)i * row->stride : NULL, row->stride);
    }
    if (at->target)
        *(int *)member(at, row->count_offset) = count;
    return mistakes;
}

// ret_index gets the word's index; nothing when it is a mistake.
static int take_word(const struct place *at, const config_setting_t *s, const struct cfg_row *row,
                     int *ret_index)
{
    char list[200] = "";
    const char *text =
        config_setting_type(s) == CONFIG_TYPE_STRING ? config_setting_get_string(s) : NULL;
    for (int i = 0; row->choices[i]; i++) {
        if (text && !strcmp(text, row->choices[i])) {
            *ret_index = i;
            return 0;
        }
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s\"%s\"", i ? ", " : "", row->choices[i]);
    }
    const char *meant = text ? options_suggest(text, row->choices) : NULL;
    return wrong(at, s, "%s; allowed %s%s%s%s", text ? "unknown" : "not a text in double quotes",
                 list, meant ? "; did you mean \"" : "", meant ? meant : "", meant ? "\"?" : "");
}

static int take_choice(const struct place *at, const config_setting_t *s, const struct cfg_row *row)
{
    int index = 0, mistakes = take_word(at, s, row, &index);
    if (at->target)
        *(int *)member(at, row->offset) = index;
    return mistakes;
}

static int take_choices(const struct place *at, const config_setting_t *s,
                        const struct cfg_row *row)
{
    const bool list = config_setting_is_array(s) || config_setting_is_list(s);
    const int count = list ? config_setting_length(s) : 1;
    int *indices = member(at, row->offset), mistakes = 0;
    if ((size_t)count > row->size)
        return wrong(at, s, "%d words; at most %zu are allowed", count, row->size);
    if (count == 0)
        return wrong(at, s, "an empty list; give at least one word");
    for (int i = 0; i < count; i++) {
        const struct place element = inner(at, NULL, i, NULL);
        int index = 0;
        mistakes += take_word(list ? &element : at,
                              list ? config_setting_get_elem(s, (unsigned)i) : s, row, &index);
        if (indices)
            indices[i] = index;
    }
    if (at->target)
        *(int *)member(at, row->count_offset) = count;
    return mistakes;
}

// --- one row -------------------------------------------------------------------------------------

static int take_groups(const struct place *at, const config_setting_t *s, const struct cfg_row *row)
{
    if (!config_setting_is_list(s))
        return wrong(at, s, "not a list of groups; write ( { ... }, { ... } )");
    int count = config_setting_length(s), mistakes = 0;
    if ((size_t)count > row->size)
        return wrong(at, s, "%d groups; at most %zu are allowed", count, row->size);
    if (count == 0 && !row->fallback)
        return wrong(at, s, "an empty list; give at least one group");
    for (int i = 0; i < count; i++) {
        const config_setting_t *element = config_setting_get_elem(s, (unsigned)i);
        char *target = at->target ? at->target + row->offset + (size_t)i * row->stride : NULL;
        const struct place in = inner(at, NULL, i, target);
        mistakes += config_setting_is_group(element)
                        ? take_group(&in, element, row->rows)
                        : wrong(&in, element, "not a group; write { ... }");
    }
    if (at->target)
        *(int *)member(at, row->count_offset) = count;
    return mistakes;
}

// at: the struct that holds the member; its path is already the member's own.
static int take_row(const struct place *at, const config_setting_t *s, const struct cfg_row *row)
{
    struct place in;
    double value = 0;
    int mistakes;
    switch (row->type) {
    case CFG_STRING:
    case CFG_BYTES:
        return take_text(at, s, row->type == CFG_BYTES, member(at, row->offset), row->size);
    case CFG_STRINGS:
        return take_strings(at, s, row);
    case CFG_CHOICE:
        return take_choice(at, s, row);
    case CFG_CHOICES:
        return take_choices(at, s, row);
    case CFG_REALS:
        return take_reals(at, s, row);
    case CFG_PAIRS: return take_pairs(at, s, row);
    case CFG_GROUPS:
        return take_groups(at, s, row);
    case CFG_INT:
    case CFG_HEX:
    case CFG_REAL:
        mistakes = take_number(at, s, row, &value);
        put_number(at, row, value);
        return mistakes;
    case CFG_BOOL:
        if (config_setting_type(s) != CONFIG_TYPE_BOOL)
            return wrong(at, s, "not true or false");
        if (at->target)
            *(bool *)member(at, row->offset) = config_setting_get_bool(s);
        return 0;
    case CFG_GROUP:
        if (!config_setting_is_group(s))
            return wrong(at, s, "not a group; write %s: { ... };", row->name);
        in = *at;
        in.target = member(at, row->offset);
        return take_group(&in, s, row->rows);
    }
    return 0;
}

// --- defaults ------------------------------------------------------------------------------------

static void fall_back_group(const struct place *at, const struct cfg_row *rows);

static void fall_back_word(const struct place *at, const struct cfg_row *row, const char *text)
{
    char word[CFG_PATH];
    size_t length = strlen(text);
    bool quoted = length >= 2 && text[0] == '"' && text[length - 1] == '"';
    snprintf(word, sizeof word, "%.*s", (int)(quoted ? length - 2 : length),
             quoted ? text + 1 : text);
    if (!row->choices) {
        strncpy(member(at, row->offset), word, row->size);
        return;
    }
    int i = 0;
    while (row->choices[i] && strcmp(row->choices[i], word))
        i++;
    assert(row->choices[i]);
    *(int *)member(at, row->offset) = i;
}

static double number(const char *text, size_t length)
{
    char word[40];
    double value = 0;
    snprintf(word, sizeof word, "%.*s", (int)length, text);
    int rc = options_real(word, &value);
    assert(rc == 0 || length == 0);
    return rc == 0 ? value : 0;
}

static void fall_back_reals(const struct place *at, const struct cfg_row *row, const char *text)
{
    static const char between[] = "[(, )]";
    double *values = member(at, row->offset);
    int count = 0;
    for (text += strspn(text, between); *text && count < (int)row->size;
         text += strspn(text, between)) {
        size_t length = strcspn(text, between);
        values[count++] = number(text, length);
        text += length;
    }
    *(int *)member(at, row->count_offset) = count;
}

// Only while writing. A row without default is met inside an optional group that was left out:
// zero.
static void fall_back(const struct place *at, const struct cfg_row *row)
{
    const char *text = row->fallback ? row->fallback : "";
    struct place in = *at;
    switch (row->type) {
    case CFG_STRING:
    case CFG_BYTES:
        fall_back_word(at, row, text);
        break;
    case CFG_CHOICE:
        fall_back_word(at, row, *text ? text : row->choices[0]);
        break;
    case CFG_CHOICES:
        fall_back_word(at, row, *text ? text : row->choices[0]);
        *(int *)member(at, row->count_offset) = 1;
        break;
    case CFG_INT:
    case CFG_HEX:
    case CFG_REAL:
        put_number(at, row, number(text, strlen(text)));
        break;
    case CFG_BOOL:
        *(bool *)member(at, row->offset) = !strcmp(text, "true");
        break;
    case CFG_REALS:
        fall_back_reals(at, row, text);
        break;
    case CFG_PAIRS:
    case CFG_GROUPS:
    case CFG_STRINGS:
        *(int *)member(at, row->count_offset) = 0;
        break;
    case CFG_GROUP:
        in.target = member(at, row->offset);
        fall_back_group(&in, row->rows);
        break;
    }
}

static void fall_back_group(const struct place *at, const struct cfg_row *rows)
{
    for (; rows->name; rows++)
        fall_back(at, rows);
}

// --- groups --------------------------------------------------------------------------------------

enum { MOST_ROWS = 64, LONGEST_NAME = 48 };

// Names are compared with and without their unit: 'stpe' means 'step_deg'.
static const char *meant_name(const struct cfg_row *rows, const char *typed)
{
    static_assert(MOST_ROWS * LONGEST_NAME <= 4096, "on the stack");
    char bare[MOST_ROWS][LONGEST_NAME];
    const char *words[2 * MOST_ROWS + 1] = {NULL};
    int n = 0;
    for (; n < MOST_ROWS && rows[n].name; n++) {
        const char *end = strrchr(rows[n].name, '_');
        size_t length = end ? (size_t)(end - rows[n].name) : strlen(rows[n].name);
        assert(length < LONGEST_NAME);
        memcpy(bare[n], rows[n].name, length);
        bare[n][length] = 0;
        words[2 * n] = rows[n].name;
        words[2 * n + 1] = rows[n].unit && end ? bare[n] : rows[n].name;
    }
    const char *meant = options_suggest(typed, words);
    for (int i = 0; meant && i < 2 * n; i++)
        if (words[i] == meant)
            return rows[i / 2].name;
    return NULL;
}

static int unknown(const struct place *at, const config_setting_t *s, const struct cfg_row *rows)
{
    const char *name = config_setting_name(s), *meant = meant_name(rows, name);
    return cfg_say(at->file, cfg_line(s), "unknown setting '%.60s'%s%s%s%s%s", name,
                   *at->path ? " in " : "", at->path, meant ? "; did you mean '" : "",
                   meant ? meant : "", meant ? "'?" : "");
}

static int missing(const struct place *at, const config_setting_t *group, const struct cfg_row *row)
{
    const struct place in = inner(at, row->name, 0, NULL);
    return cfg_say(at->file, cfg_line(group), "%s: missing%s%s", in.path, row->help ? "; " : "",
                   row->help ? row->help : "");
}

static int take_group(const struct place *at, const config_setting_t *group,
                      const struct cfg_row *rows)
{
    int mistakes = 0;
    for (int i = 0; i < config_setting_length(group); i++) {
        const config_setting_t *s = config_setting_get_elem(group, (unsigned)i);
        const struct cfg_row *row = rows;
        while (row->name && strcmp(row->name, config_setting_name(s)))
            row++;
        const struct place in = inner(at, config_setting_name(s), 0, at->target);
        mistakes += row->name ? take_row(&in, s, row) : unknown(at, s, rows);
    }
    for (; rows->name; rows++) {
        if (config_setting_get_member(group, rows->name))
            continue;
        if (!rows->fallback)
            mistakes += missing(at, group, rows);
        else if (at->target)
            fall_back(at, rows);
    }
    return mistakes;
}

int cfg_take(struct cfg_file *f, const struct cfg_row *schema, void *target)
{
    const config_setting_t *root = config_root_setting(&f->tree);
    struct place at = {.file = f};
    int mistakes = take_group(&at, root, schema);
    if (mistakes)
        return mistakes;
    at.target = target;
    mistakes = take_group(&at, root, schema);
    assert(mistakes == 0);
    return mistakes;
}
