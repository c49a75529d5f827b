// SPDX-License-Identifier: MIT
#include "base/options.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_WORD = 40, MOST_ROWS = 40, WIDEST_LINE = 79 };

static int min3(int a, int b, int c)
{
    int m = a < b ? a : b;
    return m < c ? m : c;
}

// Levenshtein's distance; words longer than LONGEST_WORD are never near.
static int distance(const char *a, const char *b)
{
    size_t m = strlen(a), n = strlen(b);
    int row[LONGEST_WORD + 1];
    if (m > LONGEST_WORD || n > LONGEST_WORD)
        return LONGEST_WORD;
    for (size_t j = 0; j <= n; j++)
        row[j] = (int)j;
    for (size_t i = 1; i <= m; i++) {
        int diagonal = row[0];
        row[0] = (int)i;
        for (size_t j = 1; j <= n; j++) {
            int above = row[j];
            row[j] = min3(above + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1]));
            diagonal = above;
        }
    }
    return row[n];
}

const char *options_suggest(const char *typed, const char *const *words)
{
    const char *best = NULL;
    int least = (int)strlen(typed) / 3 + 2; // one mistake in short words, more in long ones
    for (; *words; words++) {
        bool begins = strlen(typed) >= 3 && !strncmp(typed, *words, strlen(typed));
        int d = begins ? 0 : distance(typed, *words);
        if (d < least) {
            least = d;
            best = *words;
        }
    }
    return best;
}

int options_real(const char *text, double *ret_value)
{
    locale_t c = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    if (!c)
        return GON_E_SYSTEM;
    char *end;
    double value = strtod_l(text, &end, c);
    freelocale(c);
    if (end == text || *end || !isfinite(value))
        return GON_E_INPUT;
    *ret_value = value;
    return GON_OK;
}

static const struct option_row *find(const struct option_row *rows, const char *name, size_t length)
{
    for (; rows->name; rows++)
        if (strlen(rows->name) == length && !strncmp(rows->name, name, length))
            return rows;
    return NULL;
}

static int unknown(const struct option_row *rows, const char *name, size_t length,
                   struct gon_error *err)
{
    char typed[2 * LONGEST_WORD];
    const char *words[MOST_ROWS + 1] = {NULL};
    snprintf(typed, sizeof typed, "%.*s", (int)length, name);
    for (int i = 0; i < MOST_ROWS && rows[i].name; i++)
        words[i] = rows[i].name;
    const char *meant = options_suggest(typed, words);
    if (!meant)
        return gon_fail(err, GON_E_INPUT, "unknown option '%s'; see --help", typed);
    return gon_fail(err, GON_E_INPUT, "unknown option '%s' (did you mean '%s'?)", typed,
                    meant); // in brackets: callers go on with "; see: ..."
}

static int take_number(const struct option_row *row, const char *text, void *target,
                       struct gon_error *err)
{
    double value;
    bool any = row->min == row->max;
    if (options_real(text, &value) < 0)
        return gon_fail(err, GON_E_INPUT, "%s '%s' is not a number", row->name, text);
    if (row->type == OPTION_INT && value != floor(value))
        return gon_fail(err, GON_E_INPUT, "%s '%s' is not a whole number", row->name, text);
    if (!any && !(value >= row->min && value <= row->max))
        return gon_fail(err, GON_E_INPUT, "%s %s is out of range; allowed %.*g..%.*g", row->name,
                        text, row->type == OPTION_INT ? 17 : 9, row->min,
                        row->type == OPTION_INT ? 17 : 9, row->max);
    if (row->type == OPTION_INT && fabs(value) > 9e15)
        return gon_fail(err, GON_E_INPUT, "%s %s is too large", row->name, text);
    if (row->type == OPTION_INT)
        *(long *)((char *)target + row->offset) = (long)value;
    else
        *(double *)((char *)target + row->offset) = value;
    return GON_OK;
}

static int take_value(const struct option_row *row, const char *text, void *target,
                      struct gon_error *err)
{
    if (row->type != OPTION_TEXT)
        return take_number(row, text, target, err);
    *(const char **)((char *)target + row->offset) = text;
    return GON_OK;
}

// One option at argv[i]; returns how many of argv it used.
static int take_option(int argc, char **argv, int i, const struct option_row *rows, void *target,
                       struct gon_error *err)
{
    const char *name = strcmp(argv[i], "-h") ? argv[i] : "--help";
    size_t length = strcspn(name, "=");
    const char *value = name[length] ? name + length + 1 : NULL;
    const struct option_row *row = find(rows, name, length);
    if (!row)
        return unknown(rows, name, length, err);
    if (row->type == OPTION_FLAG) {
        if (value)
            return gon_fail(err, GON_E_INPUT, "%s takes no value", row->name);
        *(bool *)((char *)target + row->offset) = true;
        return 1;
    }
    if (!value && i + 1 >= argc)
        return gon_fail(err, GON_E_INPUT, "%s needs a value: %s %s", row->name, row->name,
                        row->value);
    int rc = take_value(row, value ? value : argv[i + 1], target, err);
    return rc < 0 ? rc : value ? 1 : 2;
}

int options_take(int argc, char **argv, const struct option_row *rows, void *target,
                 const char **operands, int most, struct gon_error *err)
{
    int count = 0;
    bool ended = false;
    for (int i = 1; i < argc;) {
        bool option = !ended && argv[i][0] == '-' && argv[i][1];
        if (option && !strcmp(argv[i], "--")) {
            ended = true;
            i++;
        } else if (option) {
            int used = take_option(argc, argv, i, rows, target, err);
            if (used < 0)
                return used;
            i += used;
        } else if (count < most) {
            operands[count++] = argv[i++];
        } else {
            return gon_fail(err, GON_E_INPUT, "'%s' is one argument too many", argv[i]);
        }
    }
    return count;
}

void options_fill(FILE *out, const char *text, int column)
{
    int at = column;
    for (text += strspn(text, " \n"); *text; text += strspn(text, " \n")) {
        int length = (int)strcspn(text, " \n");
        if (at > column && at + 1 + length > WIDEST_LINE)
            at = fprintf(out, "\n%*s", column, "") - 1;
        else if (at > column)
            at += fprintf(out, " ");
        at += fprintf(out, "%.*s", length, text);
        text += length;
    }
    fputc('\n', out);
}

void options_describe(FILE *out, const struct option_row *rows)
{
    for (; rows->name; rows++) {
        char left[64];
        snprintf(left, sizeof left, "%s%s%s", rows->name, rows->value ? " " : "",
                 rows->value ? rows->value : "");
        options_fill(out, rows->help, fprintf(out, "  %-26s ", left));
    }
}

void options_manual(FILE *out, const struct option_row *rows)
{
    for (; rows->name; rows++) {
        fprintf(out, "*%s*", rows->name);
        if (rows->value)
            fprintf(out, " _%s_", rows->value);
        fprintf(out, "\n\t");
        for (const char *c = rows->help; *c; c++)
            fprintf(out, "%s%c", *c == '*' || *c == '\\' ? "\\" : "", *c);
        fprintf(out, "\n\n");
    }
}
