// SPDX-License-Identifier: MIT
#include "cli/settings_doc.h"

#include "base/options.h"

#include <stdint.h>
#include <string.h>

void settings_code(FILE *out, const char *text, bool cell)
{
    if (!*text)
        return;
    fputc('`', out);
    for (; *text; text++)
        if (*text == '\r' || *text == '\n')
            fprintf(out, "\\%c", *text == '\r' ? 'r' : 'n');
        else if ((unsigned char)*text < ' ')
            fprintf(out, "\\x%02x", (unsigned)*text);
        else
            fprintf(out, "%s%c", cell && *text == '|' ? "\\" : "", *text);
    fputc('`', out);
}

const struct cfg_row *settings_group(const struct cfg_row *rows, const char *name)
{
    while (rows->name && strcmp(rows->name, name) != 0)
        rows++;
    return rows->rows;
}

// --- defaults ------------------------------------------------------------------------------------

static const void *member(const struct cfg_row *row, const void *at)
{
    return (const char *)at + row->offset;
}

static int count_of(const struct cfg_row *row, const void *at)
{
    return *(const int *)(const void *)((const char *)at + row->count_offset);
}

static double number_of(const struct cfg_row *row, const void *at)
{
    const void *m = member(row, at);
    return row->type == CFG_REAL  ? *(const double *)m
           : row->type == CFG_HEX ? (double)*(const uint32_t *)m
                                  : (double)*(const int *)m;
}

static bool is_word(const struct cfg_row *row, const char *word)
{
    const char *text = row->fallback ? row->fallback : "\"\"";
    const size_t quote = *text == '"', size = strlen(text) - 2 * quote;
    return strlen(word) == size && strncmp(text + quote, word, size) == 0;
}

// What must be given has no default, and is shown.
static bool is_default(const struct cfg_row *row, const void *at)
{
    double number = 0;
    switch (row->type) {
    case CFG_STRING:
    case CFG_BYTES: return !*(const char *)member(row, at) || is_word(row, member(row, at));
    case CFG_BOOL: return !*(const bool *)member(row, at);
    case CFG_CHOICE: return is_word(row, row->choices[*(const int *)member(row, at)]);
    case CFG_INT:
    case CFG_HEX:
    case CFG_REAL:
        return row->fallback && options_real(row->fallback, &number) == 0 &&
               number_of(row, at) == number;
    case CFG_REALS:
    case CFG_CHOICES:
    case CFG_STRINGS:
    case CFG_PAIRS:
    case CFG_GROUPS: return count_of(row, at) == 0;
    case CFG_GROUP: break;
    }
    for (const struct cfg_row *r = row->rows; r->name; r++)
        if (r->fallback && !is_default(r, member(row, at)))
            return false;
    return true;
}

// A group that was left out is all zeros, whatever its defaults; what must be given in it is "".
static bool is_left_out(const struct cfg_row *row, const void *at)
{
    const char *text = member(row, at);
    for (const struct cfg_row *r = row->rows; r->name; r++)
        if (!r->fallback && (r->type == CFG_STRING || r->type == CFG_BYTES))
            return !text[r->offset];
    return is_default(row, at);
}

static bool is_shown(const struct cfg_row *row, const void *at, const char *but)
{
    const size_t size = strlen(row->name);
    for (const char *p = but; (p = strstr(p, row->name)); p += size)
        if ((p == but || p[-1] == ' ') && (!p[size] || p[size] == ' '))
            return false;
    return row->type == CFG_GROUP ? !is_left_out(row, at) : !is_default(row, at);
}

// --- values --------------------------------------------------------------------------------------

static void print_numbers(FILE *out, const double *numbers, int count)
{
    for (int i = 0; i < count; i++)
        fprintf(out, "%s%.10g", i ? ", " : "", numbers[i]);
}

static void print_elements(FILE *out, const struct cfg_row *row, const void *at)
{
    const char *m = member(row, at);
    for (int i = 0; i < count_of(row, at); i++) {
        fprintf(out, "%s", i ? row->type == CFG_GROUPS ? "; " : ", " : "");
        if (row->type == CFG_STRINGS)
            settings_code(out, m + (size_t)i * row->stride, false);
        else if (row->type == CFG_CHOICES)
            fprintf(out, "%s", row->choices[((const int *)(const void *)m)[i]]);
        else if (row->type == CFG_PAIRS)
            print_numbers(out, (const double *)(const void *)m + 2 * i, 2);
        else
            settings_inline(out, row->rows, m + (size_t)i * row->stride, "");
    }
}

static void print_value(FILE *out, const struct cfg_row *row, const void *at)
{
    const void *m = member(row, at);
    switch (row->type) {
    case CFG_STRING:
    case CFG_BYTES: settings_code(out, m, false); break;
    case CFG_BOOL: fprintf(out, "yes"); break;
    case CFG_CHOICE: fprintf(out, "%s", row->choices[*(const int *)m]); break;
    case CFG_HEX: fprintf(out, "%Xh", (unsigned)*(const uint32_t *)m); break;
    case CFG_INT: fprintf(out, "%d", *(const int *)m); break;
    case CFG_REAL: fprintf(out, "%.10g", *(const double *)m); break;
    case CFG_REALS: print_numbers(out, m, count_of(row, at)); break;
    case CFG_CHOICES:
    case CFG_STRINGS:
    case CFG_PAIRS:
    case CFG_GROUPS: print_elements(out, row, at); break;
    case CFG_GROUP: settings_inline(out, row->rows, m, ""); break;
    }
    if (row->unit)
        fprintf(out, " %s", row->unit);
}

int settings_inline(FILE *out, const struct cfg_row *rows, const void *at, const char *but)
{
    int shown = 0;
    for (const struct cfg_row *r = rows; r->name; r++) {
        if (!is_shown(r, at, but))
            continue;
        fprintf(out, "%s%s ", shown++ ? ", " : "", r->name);
        print_value(out, r, at);
    }
    return shown;
}

// --- lists ---------------------------------------------------------------------------------------

void settings_list(FILE *out, const struct cfg_row *rows, const void *at, const char *but)
{
    for (const struct cfg_row *r = rows; r->name; r++) {
        const char *m = member(r, at);
        if (!is_shown(r, at, but))
            continue;
        fprintf(out, "- %s", r->name);
        if (r->type != CFG_GROUPS) {
            fprintf(out, " ");
            print_value(out, r, at);
        }
        fprintf(out, " (%s)\n", r->help);
        for (int i = 0; r->type == CFG_GROUPS && i < count_of(r, at); i++) {
            fprintf(out, "  - ");
            settings_inline(out, r->rows, m + (size_t)i * r->stride, "");
            fprintf(out, "\n");
        }
    }
}
