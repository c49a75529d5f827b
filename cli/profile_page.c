// SPDX-License-Identifier: MIT
#include "cli/profile_page.h"

#include "cli/settings_doc.h"
#include "drivers/profile.h"

#include <stdbool.h>
#include <stdlib.h>

// --- texts ---------------------------------------------------------------------------------------

// A cell of a table: bars would end it.
static void cell(FILE *out, const char *text)
{
    for (; *text; text++)
        fprintf(out, "%s%c", *text == '|' ? "\\" : "", *text);
}

static void heading(FILE *out, const char *text)
{
    fprintf(out, "\n## %s\n\n", text);
}

static void row_begin(FILE *out, const char *name)
{
    fprintf(out, "| ");
    settings_code(out, name, true);
    fprintf(out, " | ");
}

static const struct cfg_row *rows_of(const char *group)
{
    return settings_group(profile_schema, group);
}

// What a table has no column for.
static void print_more(FILE *out, const char *group, const char *name, const void *at,
                       const char *but)
{
    char *text = NULL;
    size_t size;
    FILE *more = open_memstream(&text, &size);
    const int shown = more ? settings_inline(more, rows_of(group), at, but) : 0;
    if (more)
        fclose(more);
    if (shown > 0)
        fprintf(out, "- `%s`: %s\n", name, text);
    free(text);
}

// --- values --------------------------------------------------------------------------------------

static void print_range(FILE *out, const struct profile_value *v)
{
    if (v->ladder_count)
        fprintf(out, "one of %d: %g .. %g", v->ladder_count, v->ladder[0],
                v->ladder[v->ladder_count - 1]);
    else if (v->words_count)
        for (int i = 0; i < v->words_count; i++)
            fprintf(out, "%s%s", i ? ", " : "", v->words[i]);
    else if (v->min != v->max)
        fprintf(out, "%.10g .. %.10g", v->min, v->max);
}

static void print_bits(FILE *out, const struct profile_value *v)
{
    for (int i = 0; i < v->bits_count; i++) {
        const struct profile_bit *b = &v->bits[i];
        fprintf(out, "%sbit %d %s%s",
                i          ? ", "
                : *v->help ? " "
                           : "",
                b->bit, b->name, *b->help ? " (" : "");
        cell(out, b->help);
        fprintf(out, "%s", *b->help ? ")" : "");
    }
}

// Where ladder or words stand in the column of the range, its ends are told below.
static void print_more_of_value(FILE *out, const struct profile_value *v)
{
    const bool range = !v->ladder_count && !v->words_count;
    char but[160];
    snprintf(but, sizeof but, "name type unit help bits table address format %s %s",
             range ? "min max" : "", v->words_count && !v->ladder_count ? "words" : "");
    print_more(out, "values", v->name, v, but);
}

static void print_values(FILE *out, const struct profile *p)
{
    static const char *const types[] = {"real", "int", "hex", "string", "word"};
    static const char *const tables[] = {"holding", "input", "coil", "discrete", "none"};
    static const char *const formats[] = {"u16", "s16", "u32", "s32", "f32"};
    const bool modbus = p->protocol == PROFILE_MODBUS;
    heading(out, "Values");
    fprintf(out, "| name |%s type | unit | range | meaning |\n|---|%s---|---|---|---|\n",
            modbus ? " register |" : "", modbus ? "---|" : "");
    for (int i = 0; i < p->values_count; i++) {
        const struct profile_value *v = &p->values[i];
        row_begin(out, v->name);
        if (modbus)
            fprintf(out, "%s %04Xh %s | ", tables[v->table], (unsigned)v->address,
                    formats[v->format]);
        fprintf(out, "%s | %s | ", types[v->type], v->unit);
        print_range(out, v);
        fprintf(out, " | ");
        cell(out, v->help);
        print_bits(out, v);
        fprintf(out, " |\n");
    }
    fprintf(out, "\n");
    for (int i = 0; i < p->values_count; i++)
        print_more_of_value(out, &p->values[i]);
}

// --- what is said --------------------------------------------------------------------------------

static void print_group(FILE *out, const char *title, const char *group, const void *at)
{
    heading(out, title);
    settings_list(out, rows_of(group), at, "");
}

// How long things take is said also where it is as usual.
static void print_lines(FILE *out, const struct profile_framing *f)
{
    heading(out, "Lines");
    fprintf(out, "A command ends with ");
    settings_code(out, f->end_out, false);
    fprintf(out, ", an answer with ");
    settings_code(out, f->end_in, false);
    fprintf(out,
            ". Commands are %g ms apart; an answer comes within %g ms, and none any more after "
            "%g ms of silence.\n\n",
            f->gap_ms, f->timeout_ms, f->quiet_ms);
    settings_list(out, rows_of("framing"), f, "end_out end_in gap_ms timeout_ms quiet_ms");
}

static void print_registers(FILE *out, const struct profile_registers *r)
{
    heading(out, "Registers");
    fprintf(out, "The manual calls the first one %d. One request reads up to %d of them.\n\n",
            r->base, r->block_most);
    settings_list(out, rows_of("registers"), r, "base block_most");
}

static void print_exchanges(FILE *out, const struct profile *p)
{
    print_lines(out, &p->framing);
    if (p->checksum.kind != PROFILE_NO_SUM)
        print_group(out, "Checksum", "checksum", &p->checksum);
    heading(out, "Exchanges");
    fprintf(out, "| name | sent | answer | read back by | meaning |\n|---|---|---|---|---|\n");
    for (int i = 0; i < p->exchanges_count; i++) {
        const struct profile_exchange *x = &p->exchanges[i];
        row_begin(out, x->name);
        settings_code(out, x->send, true);
        fprintf(out, " | ");
        settings_code(out, x->answer, true);
        fprintf(out, " | ");
        settings_code(out, x->verify, true);
        fprintf(out, " | ");
        cell(out, x->help);
        fprintf(out, " |\n");
    }
    fprintf(out, "\n");
    for (int i = 0; i < p->exchanges_count; i++)
        print_more(out, "exchanges", p->exchanges[i].name, &p->exchanges[i],
                   "name send answer verify help");
    if (p->refusals_count)
        heading(out, "Refusals");
    for (int i = 0; i < p->refusals_count; i++) {
        fprintf(out, "- ");
        settings_inline(out, rows_of("refusals"), &p->refusals[i], "");
        fprintf(out, "\n");
    }
    if (*p->errors.ask)
        print_group(out, "Errors", "errors", &p->errors);
}

static void print_writes(FILE *out, const struct profile *p)
{
    print_registers(out, &p->registers);
    heading(out, "Writes");
    fprintf(out, "| name | sets | meaning |\n|---|---|---|\n");
    for (int i = 0; i < p->writes_count; i++) {
        const struct profile_write *w = &p->writes[i];
        row_begin(out, w->name);
        for (int k = 0; k < w->set_count; k++) {
            fprintf(out, "%s", k ? ", " : "");
            settings_code(out, w->set[k], true);
        }
        settings_code(out, w->edge, true);
        fprintf(out, " | ");
        cell(out, w->help);
        fprintf(out, " |\n");
    }
    fprintf(out, "\n");
    for (int i = 0; i < p->writes_count; i++)
        print_more(out, "writes", p->writes[i].name, &p->writes[i], "name set edge help");
}

// --- the page ------------------------------------------------------------------------------------

static void print_head(FILE *out, const struct profile *p)
{
    fprintf(out, "# %s\n\n", p->title);
    fprintf(out, "Profile `%s`, role %s, over %s. ", p->name, profile_roles[p->role],
            p->protocol == PROFILE_MODBUS ? "Modbus" : "lines of text");
    if (*p->link)
        fprintf(out, "Connected as `%s`.", p->link);
    fprintf(out, "\n\nSource: %s\n", p->source);
    if (p->unverified_count)
        fprintf(out, "\nNot verified:\n\n");
    for (int i = 0; i < p->unverified_count; i++)
        fprintf(out, "- %s\n", p->unverified[i]);
}

static void print_role(FILE *out, const struct profile *p)
{
    static const char *const titles[] = {"Laser", "Detector", "Axis", "Positions", "Inputs"};
    const void *const groups[] = {&p->laser, &p->detector, &p->axis, &p->selector, &p->inputs};
    print_group(out, titles[p->role], profile_roles[p->role], groups[p->role]);
}

static void print_golden(FILE *out, const struct profile *p)
{
    if (!p->golden_count)
        return;
    heading(out, "Shown by");
    for (int i = 0; i < p->golden_count; i++) {
        fprintf(out, "- ");
        settings_code(out, p->golden[i].sent, false);
        fprintf(out, ": %s\n  - ", p->golden[i].source);
        settings_inline(out, rows_of("golden"), &p->golden[i], "sent source");
        fprintf(out, "\n");
    }
}

void profile_page_print(FILE *out, const struct profile *p)
{
    print_head(out, p);
    print_values(out, p);
    if (p->protocol == PROFILE_MESSAGE)
        print_exchanges(out, p);
    else
        print_writes(out, p);
    print_group(out, "Identity", "identify", &p->identify);
    print_role(out, p);
    print_golden(out, p);
    print_group(out, "Simulated", "simulate", &p->simulate);
}
