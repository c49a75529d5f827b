// SPDX-License-Identifier: MIT
// The reference page of an instrument, from its profile, as Markdown.
#include "cli/out.h"
#include "cli/profile_check.h"
#include "cli/verb.h"
#include "drivers/profile.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

static const struct option_row none[] = {VERB_OPTIONS_END};

static const struct verb doc = {"profile doc",
                                "PROFILE",
                                "the reference page of an instrument",
                                "Prints what the profile says of the instrument as a page of "
                                "Markdown.\n",
                                none,
                                NULL};

// --- texts ---------------------------------------------------------------------------------------

// A cell of a table: bars would end it.
static void cell(const char *text)
{
    for (; *text; text++)
        printf("%s%c", *text == '|' ? "\\" : "", *text);
}

// `as it stands`, with control characters seen.
static void code(const char *text)
{
    if (!*text)
        return;
    putchar('`');
    for (; *text; text++)
        if (*text == '\r' || *text == '\n')
            printf("\\%c", *text == '\r' ? 'r' : 'n');
        else if ((unsigned char)*text < ' ')
            printf("\\x%02x", (unsigned)*text);
        else
            printf("%s%c", *text == '|' ? "\\" : "", *text);
    putchar('`');
}

static void heading(const char *text)
{
    printf("\n## %s\n\n", text);
}

static void row_begin(const char *name)
{
    printf("| ");
    code(name);
    printf(" | ");
}

// --- values --------------------------------------------------------------------------------------

static void print_range(const struct profile_value *v)
{
    if (v->ladder_count)
        printf("one of %d: %g .. %g", v->ladder_count, v->ladder[0],
               v->ladder[v->ladder_count - 1]);
    else if (v->words_count)
        for (int i = 0; i < v->words_count; i++)
            printf("%s%s", i ? ", " : "", v->words[i]);
    else if (v->min != v->max)
        printf("%g .. %g", v->min, v->max);
}

static void print_bits(const struct profile_value *v)
{
    for (int i = 0; i < v->bits_count; i++)
        printf("%sbit %d %s", i ? ", " : *v->help ? " " : "", v->bits[i].bit, v->bits[i].name);
}

static void print_values(const struct profile *p)
{
    static const char *const types[] = {"real", "int", "hex", "string", "word"};
    static const char *const tables[] = {"holding", "input", "coil", "discrete", "none"};
    static const char *const formats[] = {"u16", "s16", "u32", "s32", "f32"};
    const bool modbus = p->protocol == PROFILE_MODBUS;
    heading("Values");
    printf("| name |%s type | unit | range | meaning |\n|---|%s---|---|---|---|\n",
           modbus ? " register |" : "", modbus ? "---|" : "");
    for (int i = 0; i < p->values_count; i++) {
        const struct profile_value *v = &p->values[i];
        row_begin(v->name);
        if (modbus)
            printf("%s %04Xh %s | ", tables[v->table], (unsigned)v->address, formats[v->format]);
        printf("%s | %s | ", types[v->type], v->unit);
        print_range(v);
        printf(" | ");
        cell(v->help);
        print_bits(v);
        printf(" |\n");
    }
}

// --- what is said --------------------------------------------------------------------------------

static void print_exchanges(const struct profile *p)
{
    const struct profile_framing *f = &p->framing;
    heading("Lines");
    printf("A command ends with ");
    code(f->end_out);
    printf(", an answer with ");
    code(f->end_in);
    printf(". Commands are %g ms apart; an answer comes within %g ms.\n", f->gap_ms, f->timeout_ms);
    heading("Exchanges");
    printf("| name | sent | answer | read back by | meaning |\n|---|---|---|---|---|\n");
    for (int i = 0; i < p->exchanges_count; i++) {
        const struct profile_exchange *x = &p->exchanges[i];
        row_begin(x->name);
        code(x->send);
        printf(" | ");
        code(x->answer);
        printf(" | ");
        code(x->verify);
        printf(" | ");
        cell(x->help);
        printf(" |\n");
    }
}

static void print_writes(const struct profile *p)
{
    heading("Writes");
    printf("| name | sets | meaning |\n|---|---|---|\n");
    for (int i = 0; i < p->writes_count; i++) {
        const struct profile_write *w = &p->writes[i];
        row_begin(w->name);
        for (int k = 0; k < w->set_count; k++) {
            printf("%s", k ? ", " : "");
            code(w->set[k]);
        }
        code(w->edge);
        printf(" | ");
        cell(w->help);
        printf(" |\n");
    }
}

// --- roles ---------------------------------------------------------------------------------------

static void print_condition(const char *what, const char *condition)
{
    if (!*condition)
        return;
    printf("- %s while ", what);
    code(condition);
    printf("\n");
}

static void print_rules(const struct profile_rules *r, const char *const *list)
{
    for (int i = 0; i < r->count; i++) {
        const struct profile_rule *rule = &r->rule[i];
        printf("- %s", list ? list[rule->is] : rule->send);
        printf(*rule->when ? " when " : i ? " otherwise" : " always");
        code(rule->when);
        printf("%s%s\n", *rule->text ? ": " : "", rule->text);
    }
}

static void print_codes(const char *what, const struct profile_code *codes, int count)
{
    if (!count)
        return;
    heading(what);
    printf("| code | meaning |\n|---|---|\n");
    for (int i = 0; i < count; i++) {
        printf("| %d (%Xh) | ", codes[i].code, (unsigned)codes[i].code);
        cell(codes[i].text);
        printf(" |\n");
    }
}

static void print_laser(const struct profile_laser *l)
{
    heading("Laser");
    print_condition("light comes out, or may,", l->emitting);
    print_condition("the interlock is closed", l->interlock_closed);
    print_condition("it is surely off", l->is_off);
    printf("\nIts state, the first that holds:\n\n");
    print_rules(&l->states, profile_laser_states);
    printf("\nSwitched on by, the first that holds:\n\n");
    print_rules(&l->on, NULL);
    printf("\nSwitched off by");
    for (int i = 0; i < l->off_count; i++) {
        printf("%s", i ? ", " : " ");
        code(l->off[i]);
    }
    printf(", until that is seen.\n");
    print_codes("Faults", l->faults, l->faults_count);
}

static void print_role(const struct profile *p)
{
    const struct profile_axis *a = &p->axis;
    const struct profile_selector *s = &p->selector;
    if (p->role == PROFILE_LASER) {
        print_laser(&p->laser);
    } else if (p->role == PROFILE_DETECTOR) {
        heading("Detector");
        print_rules(&p->detector.flags, profile_flags);
    } else if (p->role == PROFILE_AXIS) {
        heading("Axis");
        print_condition("it moves", a->moving);
        print_condition("it is in position", a->in_position);
        print_condition("it is ready", a->ready);
        print_condition("it knows its home", a->homed);
        print_condition("there is an alarm", a->alarm);
        print_codes("Alarms", a->alarms, a->alarms_count);
    } else if (p->role == PROFILE_SELECTOR) {
        heading("Positions");
        for (int i = 0; i < s->positions_count; i++)
            print_condition(s->positions[i].name, s->positions[i].when);
    }
    print_codes("Errors", p->errors.codes, p->errors.codes_count);
}

// --- the page ------------------------------------------------------------------------------------

static void print_head(const struct profile *p)
{
    printf("# %s\n\n", p->title);
    printf("Profile `%s`, role %s. ", p->name, profile_roles[p->role]);
    if (*p->link)
        printf("Connected as `%s`.", p->link);
    printf("\n\nSource: %s\n", p->source);
    if (p->unverified_count)
        printf("\nNot verified:\n\n");
    for (int i = 0; i < p->unverified_count; i++)
        printf("- %s\n", p->unverified[i]);
}

static void print_golden(const struct profile *p)
{
    if (!p->golden_count)
        return;
    heading("Shown by");
    for (int i = 0; i < p->golden_count; i++) {
        printf("- ");
        code(p->golden[i].sent);
        printf(": %s\n", p->golden[i].source);
    }
}

int profile_doc(int argc, char **argv)
{
    char path[PATH_MAX], nothing;
    const char *name;
    if (verb_take(&doc, argc, argv, &nothing, &name, 1, 1) < 0)
        return EXIT_INPUT;
    struct profile *p = profile_take(name, path, sizeof path);
    if (!p)
        return EXIT_INPUT;
    print_head(p);
    print_values(p);
    if (p->protocol == PROFILE_MESSAGE)
        print_exchanges(p);
    else
        print_writes(p);
    print_role(p);
    print_golden(p);
    free(p);
    return out_finish(EXIT_OK);
}
