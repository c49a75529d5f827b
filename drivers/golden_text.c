// SPDX-License-Identifier: MIT
#include "drivers/golden_text.h"

#include <math.h>
#include <string.h>

void golden_text_string(FILE *out, const char *text)
{
    fputc('"', out);
    for (; *text; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c == '\r' || c == '\n')
            fprintf(out, "\\%c", c == '\r' ? 'r' : 'n');
        else if (c < ' ' || c >= 0x7f)
            fprintf(out, "\\x%02x", c);
        else
            fprintf(out, "%s%c", c == '"' || c == '\\' ? "\\" : "", c);
    }
    fputc('"', out);
}

static void print_text(FILE *out, const char *name, const char *text, const char *before)
{
    if (!*text)
        return;
    fprintf(out, "%s%s = ", before, name);
    golden_text_string(out, text);
    fputc(';', out);
}

static void print_asks(FILE *out, const struct profile_golden *g)
{
    fprintf(out, "asks = (");
    for (int i = 0; i < g->asks_count; i++) {
        fprintf(out, "%s ", i ? "," : "");
        golden_text_string(out, g->asks[i]);
    }
    fprintf(out, " );");
}

void golden_text_print(FILE *out, const struct profile_golden *g, bool modbus)
{
    fprintf(out, "  { ");
    if (g->asks_count)
        print_asks(out, g);
    print_text(out, "does", g->does, "");
    if (modbus)
        fprintf(out, " unit = %d;", g->unit);
    print_text(out, "with", g->with, " ");
    print_text(out, "sent", g->sent, modbus ? "\n    " : " ");
    print_text(out, "received", g->received, modbus ? "\n    " : " ");
    print_text(out, "gives", g->gives, "\n    ");
    print_text(out, "source", g->source, "\n    ");
    fprintf(out, " }");
}

// What read_right of profile_data.c and profile_literal take for this number.
static void write_number(const struct profile_value *v, double number, char *text, size_t size)
{
    const bool whole = number == floor(number) && number >= 0 && number <= 4294967295.0;
    if (isinf(number))
        snprintf(text, size, "over");
    else if (v->type == PROFILE_WORD && profile_word(v, number))
        snprintf(text, size, "'%s'", profile_word(v, number));
    else if (v->type == PROFILE_HEX && whole)
        snprintf(text, size, "0x%llX", (unsigned long long)number);
    else
        snprintf(text, size, "%.10g", number);
}

bool golden_text_value(const struct profile *p, const struct profile_data *d, int value, char *text,
                       size_t size)
{
    const struct profile_value *v = &p->values[value];
    char right[PROFILE_DATA_TEXT + 3];
    const size_t used = strlen(text);
    if (v->type != PROFILE_STRING)
        write_number(v, d->number[value], right, sizeof right);
    else if (strchr(d->text[value], '\''))
        return false;
    else
        snprintf(right, sizeof right, "'%s'", d->text[value]);
    const int more =
        snprintf(text + used, size - used, "%s%s = %s", used ? ", " : "", v->name, right);
    if (more >= 0 && used + (size_t)more < size)
        return true;
    text[used] = 0;
    return false;
}
