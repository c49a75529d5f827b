// SPDX-License-Identifier: MIT
#include "base/cfg.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const char *kind(const struct cfg_row *row)
{
    switch (row->type) {
    case CFG_STRING:
    case CFG_BYTES:
        return "text";
    case CFG_STRINGS:
        return "list of texts";
    case CFG_INT:
        return "whole number";
    case CFG_HEX:
        return "whole number, also hexadecimal";
    case CFG_REAL:
        return "number";
    case CFG_BOOL:
        return "true or false";
    case CFG_CHOICE:
        return "one of";
    case CFG_CHOICES:
        return "one or a list of";
    case CFG_REALS:
        return "list of numbers";
    case CFG_PAIRS: return "list of pairs of numbers";
    case CFG_GROUP:
        return "group";
    case CFG_GROUPS:
        return "list of groups";
    }
    return "";
}

static void range(FILE *out, const struct cfg_row *row)
{
    bool whole = row->type == CFG_INT || row->type == CFG_HEX;
    bool number = whole || row->type == CFG_REAL || row->type == CFG_REALS ||
                  row->type == CFG_PAIRS;
    int digits = whole ? 17 : 9; // whole numbers to the last digit
    if (!number || row->min == row->max)
        return;
    if (isinf(row->max))
        fprintf(out, ", at least %.*g", digits, row->min);
    else if (isinf(row->min))
        fprintf(out, ", at most %.*g", digits, row->max);
    else
        fprintf(out, ", %.*g to %.*g", digits, row->min, digits, row->max);
}

static void presence(FILE *out, const struct cfg_row *row)
{
    bool group = row->type == CFG_GROUP || row->type == CFG_GROUPS;
    if (!row->fallback)
        fputs(", must be given", out);
    else if (group || !*row->fallback)
        fputs(", may be left out", out);
    else
        fprintf(out, ", default %s", row->fallback);
}

// What scdoc would take for the beginning of bold, or for its own escape.
static void help(FILE *out, const char *text)
{
    for (; *text; text++)
        fprintf(out, "%s%c", *text == '*' || *text == '\\' ? "\\" : "", *text);
}

static void describe(FILE *out, const char *path, const struct cfg_row *row)
{
    for (; row->name; row++) {
        char name[240];
        snprintf(name, sizeof name, "%.150s%s%.80s", path, *path ? "." : "", row->name);
        fprintf(out, "*%s*: %s", name, kind(row));
        for (int i = 0; row->choices && row->choices[i]; i++)
            fprintf(out, "%s \"%s\"", i ? "," : "", row->choices[i]);
        if (row->unit)
            fprintf(out, ", %s", row->unit);
        range(out, row);
        presence(out, row);
        fputs("\n\t", out);
        help(out, row->help ? row->help : "");
        fputs("\n\n", out);
        if (row->rows)
            describe(out, strcat(name, row->type == CFG_GROUPS ? "[]" : ""), row->rows);
    }
}

void cfg_describe(FILE *out, const struct cfg_row *schema)
{
    describe(out, "", schema);
}
