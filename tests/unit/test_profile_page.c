// SPDX-License-Identifier: MIT
// uses: cli campaign drivers fit model base
// The reference page shows everything that a profile says: each setting of each shipped profile,
// and of one that uses what those leave out, is changed in turn, and the page must change with it.
#include "cli/profile_page.h"

#include "drivers/profile.h"
#include "tests/unit/profiles.h"

#include <glob.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <stdbool.h>

// What the shipped profiles leave out.
static const char lines[] =
    "profile: { name = \"m\"; title = \"M\"; role = \"laser\"; protocol = \"message\";"
    "  source = \"s\"; };"
    "values: ( { name = \"lit\"; type = \"int\"; max = 1; },"
    "  { name = \"w\"; unit = \"W\"; min = 1; max = 2; scale = 2; offset = 1; inverse = true;"
    "    resolution = 0.1; over = [ 9e9 ]; invalid = [ 8e8 ]; valid = \"lit = 1\";"
    "    changes = true; help = \"h\"; } );"
    "framing: { end_out = \"\\r\"; end_in = \"\\n\"; echo_end = \"\\r\"; ok_line = \"OK\";"
    "  empty = true; gap_ms = 3; timeout_ms = 210; quiet_ms = 360; sync = \"lit\"; };"
    "checksum: { kind = \"crc\"; width = 16; polynomial = 7; initial = 1; xor_out = 2;"
    "  reflect_in = true; reflect_out = true; form = \"hex-lower\"; before = \"*\"; };"
    "exchanges: ( { name = \"lit\"; send = \"l?\"; answer = \"{lit}\"; },"
    "  { name = \"set\"; send = \"w {w}\"; answer = \"{w}\"; echoes = true; settle_ms = 3;"
    "    timeout_ms = 300; check = true; verify = \"w\"; then = \"lit = 0\"; help = \"h\"; },"
    "  { name = \"w\"; send = \"w?\"; answer = \"{w}\"; believe = \"w = 1\"; },"
    "  { name = \"e\"; send = \"e?\"; answer = \"{lit}\"; },"
    "  { name = \"on\"; send = \"l1\"; }, { name = \"keep\"; send = \"k\"; },"
    "  { name = \"off\"; send = \"l0\"; } );"
    "refusals: ( { like = \"no*\"; means = \"key\"; } );"
    "errors: { ask = \"e\"; fine = \"lit = 0\"; code = \"lit\";"
    "  codes = ( { code = 1; text = \"one\"; means = \"busy\"; } ); };"
    "identify: { asks = ( \"lit\" ); title = \"{lit}\"; serial = \"lit\"; restarted = \"lit = 1\";"
    "  refuse = ( { when = \"lit = 1\"; is = \"busy\"; text = \"no\"; } ); };"
    "laser: { status = ( \"lit\", \"w\" ); once = ( \"w\" ); light = ( \"lit\" );"
    "  emitting = \"lit = 1\"; interlock_closed = \"lit = 0\";"
    "  states = ( { when = \"lit = 1\"; is = \"emitting\"; text = \"t\"; }, { is = \"off\"; } );"
    "  power = \"w\"; setpoint = \"w\"; fault = \"lit\"; set_power = \"set\"; power_most_w = 2;"
    "  before_on = ( \"w\" ); may_not = ( { when = \"w = 2\"; is = \"key\"; text = \"t\"; } );"
    "  prepare = ( { when = \"w = 1\"; send = \"set\"; } ); on = ( { send = \"on\"; } );"
    "  after_refusal = ( \"w\" ); refusals = ( { when = \"w = 1\"; is = \"fault\"; text = \"t\"; } "
    ");"
    "  off = ( \"\\rl0\" ); off_asks = ( \"lit\" ); is_off = \"lit = 0\";"
    "  faults = ( { code = 1; text = \"f\"; means = \"fault\"; } );"
    "  keepalive = { send = \"keep\"; period_ms = 300; }; };";

static const char registers[] =
    "profile: { name = \"b\"; title = \"B\"; role = \"inputs\"; protocol = \"modbus\";"
    "  source = \"s\"; };"
    "registers: { base = 1; word_order = \"low-first\"; byte_order = \"low-first\";"
    "  block_most = 9; gap_most = 2; single = true; timeout_ms = 150; quiet_ms = 200; };"
    "values: ( { name = \"a\"; type = \"int\"; address = 0x10; format = \"s32\"; access = \"r\";"
    "    word_order = \"high-first\"; alone = true; },"
    "  { name = \"b\"; type = \"int\"; table = \"coil\"; address = 3; max = 1; },"
    "  { name = \"c\"; type = \"hex\"; address = 0x20; shares = \"d\"; access = \"w\";"
    "    bits = ( { name = \"x\"; bit = 3; help = \"h\"; } ); },"
    "  { name = \"d\"; type = \"int\"; address = 0x20; words = ( \"p\", \"q\" ); ladder_first = 1; "
    "} );"
    "writes: ( { name = \"set\"; set = ( \"b = 1\" ); readback = true; verify = \"b = 1\";"
    "    repeat = true; then = \"b = 1\"; help = \"h\"; },"
    "  { name = \"edge\"; edge = \"c.x\"; release = \"free\"; }, { name = \"free\"; set = ( \"c = "
    "0\" ); } );"
    "inputs: { status = ( \"a\", \"b\" ); watchdog = \"set\"; watchdog_ms = 400; };"
    "golden: ( { asks = ( \"b\" ); unit = 3; sent = \"03 01\"; received = \"03 81\"; source = "
    "\"s\"; } );";

static const char axis[] =
    "profile: { name = \"a\"; title = \"A\"; role = \"axis\"; protocol = \"modbus\";"
    "  source = \"s\"; };"
    "values: ( { name = \"at\"; type = \"int\"; address = 1; }, { name = \"s\"; address = 2; } );"
    "writes: ( { name = \"move\"; set = ( \"at = $position\" ); },"
    "  { name = \"stop\"; set = ( \"s = 1\" ); } );"
    "axis: { status = ( \"at\", \"s\" ); position = \"at\"; moving = \"s = 2\"; move = \"move\";"
    "  stop = \"stop\"; watchdog = \"stop\"; watchdog_ms = 300; };";

static const char meter[] =
    "profile: { name = \"d\"; title = \"D\"; role = \"detector\"; protocol = \"message\";"
    "  source = \"s\"; };"
    "values: ( { name = \"x\"; } ); framing: { end_out = \"\\r\"; end_in = \"\\r\"; };"
    "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; } );"
    "detector: { signal = \"x\"; sample = ( \"x\" ); full_scale = \"x\"; ranges = [ 1.0 ];"
    "  read_range = ( \"x\" );"
    "  flags = ( { when = \"x > 1\"; is = \"saturated\"; text = \"t\"; } ); };";

static char *page(const struct profile *p)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    profile_page_print(out, p);
    fclose(out);
    return text;
}

enum { ROWS_MOST = 600 };

struct walk {
    struct profile *p;
    char *page; // as it is
    int changed, silent;
    const struct cfg_row *seen[ROWS_MOST]; // rows that some profile used
    int seen_count;
};

static bool is_seen(const struct walk *w, const struct cfg_row *row)
{
    for (int i = 0; i < w->seen_count; i++)
        if (w->seen[i] == row)
            return true;
    return false;
}

static void compare(struct walk *w, const struct cfg_row *row, const char *path)
{
    char *now = page(w->p);
    w->changed++;
    if (!is_seen(w, row)) {
        assert_true(w->seen_count < ROWS_MOST);
        w->seen[w->seen_count++] = row;
    }
    if (strcmp(now, w->page) == 0) {
        print_error("%s: %s does not show\n", w->p->name, path);
        w->silent++;
    }
    free(now);
}

static void visit(struct walk *w, const struct cfg_row *rows, char *at, const char *path);

static void visit_text(struct walk *w, const struct cfg_row *row, char *text, const char *path)
{
    const char first = *text;
    if (!first)
        return;
    *text = first == 'Z' ? 'Y' : 'Z';
    compare(w, row, path);
    *text = first;
}

static void visit_list(struct walk *w, const struct cfg_row *row, char *at, const char *path)
{
    const int count = *(int *)(void *)(at + row->count_offset);
    char element[300];
    for (int i = 0; i < count; i++) {
        snprintf(element, sizeof element, "%s[%d]", path, i);
        if (row->type == CFG_GROUPS) {
            visit(w, row->rows, at + row->offset + (size_t)i * row->stride, element);
        } else if (row->type == CFG_STRINGS) {
            visit_text(w, row, at + row->offset + (size_t)i * row->stride, element);
        } else {
            assert_int_equal(row->type, CFG_REALS);
            double *number = (double *)(void *)(at + row->offset) + i;
            const double was = *number;
            *number = was + 1 + fabs(was);
            compare(w, row, element);
            *number = was;
        }
    }
}

// What is as its default is not used.
static void visit_number(struct walk *w, const struct cfg_row *row, char *at, const char *path)
{
    const double fallback = row->fallback ? strtod(row->fallback, NULL) : (double)NAN;
    double *real = (double *)(void *)(at + row->offset);
    int *whole = (int *)(void *)(at + row->offset); // of CFG_HEX the same size
    const double was = row->type == CFG_REAL ? *real : (double)*whole;
    if (was == fallback)
        return;
    if (row->type == CFG_REAL) {
        *real = was + 1 + fabs(was);
        compare(w, row, path);
        *real = was;
    } else {
        *whole += 1;
        compare(w, row, path);
        *whole -= 1;
    }
}

static void visit_choice(struct walk *w, const struct cfg_row *row, char *at, const char *path)
{
    int *choice = (int *)(void *)(at + row->offset);
    const int was = *choice;
    const char *word = row->choices[was];
    if (row->fallback && strncmp(row->fallback + 1, word, strlen(word)) == 0)
        return;
    *choice = was ? was - 1 : 1;
    compare(w, row, path);
    *choice = was;
}

static void visit_row(struct walk *w, const struct cfg_row *r, char *at, const char *path)
{
    bool *yes = (bool *)(at + r->offset);
    switch (r->type) {
    case CFG_STRING:
    case CFG_BYTES: visit_text(w, r, at + r->offset, path); break;
    case CFG_CHOICE: visit_choice(w, r, at, path); break;
    case CFG_INT:
    case CFG_HEX:
    case CFG_REAL: visit_number(w, r, at, path); break;
    case CFG_GROUP:
        if (strcmp(r->name, "keepalive") != 0 || *w->p->laser.keepalive.send) // or it is left out
            visit(w, r->rows, at + r->offset, path);
        break;
    case CFG_BOOL:
        if (!*yes)
            break;
        *yes = false;
        compare(w, r, path);
        *yes = true;
        break;
    default: visit_list(w, r, at, path); break;
    }
}

static void visit(struct walk *w, const struct cfg_row *rows, char *at, const char *path)
{
    char name[280];
    for (const struct cfg_row *r = rows; r->name; r++) {
        snprintf(name, sizeof name, "%.200s%s%.60s", path, *path ? "." : "", r->name);
        visit_row(w, r, at, name);
    }
}

// Groups that are of no use to this profile hold defaults only, if anything.
static bool is_of_use(const struct profile *p, const char *group)
{
    static const char *const messages[] = {"framing", "checksum", "exchanges", "refusals",
                                           "errors"};
    const bool modbus = p->protocol == PROFILE_MODBUS;
    for (size_t i = 0; i < sizeof messages / sizeof *messages; i++)
        if (strcmp(group, messages[i]) == 0)
            return !modbus && (strcmp(group, "checksum") != 0 || p->checksum.kind);
    for (int i = 0; profile_roles[i]; i++)
        if (strcmp(group, profile_roles[i]) == 0)
            return i == p->role;
    return modbus || (strcmp(group, "registers") != 0 && strcmp(group, "writes") != 0);
}

static void walk_profile(struct walk *w, struct profile *p)
{
    w->p = p;
    w->page = page(p);
    for (const struct cfg_row *r = profile_schema; r->name; r++)
        if (is_of_use(p, r->name))
            visit_row(w, r, (char *)p, r->name);
    free(w->page);
}

static void check_seen(struct walk *w, const struct cfg_row *rows, const char *path)
{
    char name[280];
    for (const struct cfg_row *r = rows; r->name; r++) {
        snprintf(name, sizeof name, "%.200s%s%.60s", path, *path ? "." : "", r->name);
        if (r->rows) {
            check_seen(w, r->rows, name);
        } else if (!is_seen(w, r)) {
            print_error("%s: no profile here uses it\n", name);
            w->silent++;
        }
    }
}

static void every_setting_of_every_profile_shows(void **state)
{
    static struct walk w;
    glob_t files;
    (void)state;
    assert_int_equal(glob("configs/profiles/*.cfg", 0, NULL, &files), 0);
    assert_true(files.gl_pathc >= 12);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        struct profile *p;
        assert_int_equal(
            profile_load(files.gl_pathv[i], (struct cfg_sink){profiles_say, NULL}, &p, NULL), 0);
        walk_profile(&w, p);
        free(p);
    }
    globfree(&files);
    const char *const texts[] = {lines, registers, axis, meter};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct profile *p = profiles_parse(texts[i]);
        walk_profile(&w, p);
        free(p);
    }
    check_seen(&w, profile_schema, "");
    printf("%d settings, %d rows\n", w.changed, w.seen_count);
    assert_int_equal(w.silent, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_setting_of_every_profile_shows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
