// SPDX-License-Identifier: MIT
#include "campaign/bench_suspend.h"

#include "base/options.h"
#include "campaign/bench.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

static const char *const resumes[] = {"manual", "automatic", NULL};

#define MONITOR "monitor_v"
#define POWER "laser_power_w"

const char *const bench_own_values[] = {"interlock_open", MONITOR, POWER, "disk_free_mb", NULL};

const struct cfg_row bench_suspender_rows[] = {
    {.name = "name",
     .type = CFG_STRING,
     .offset = offsetof(struct bench_suspender, name),
     .size = sizeof((struct bench_suspender *)0)->name,
     .help = "What stands in the pause's text: \"too warm\"."},
    {.name = "when",
     .type = CFG_STRING,
     .offset = offsetof(struct bench_suspender, when),
     .size = BENCH_WHEN,
     .help = "The condition: \"room.temperature_c > 25\", \"door.open\", \"not room.water_ok\"."},
    {.name = "settle_s",
     .type = CFG_REAL,
     .offset = offsetof(struct bench_suspender, settle_s),
     .unit = "s",
     .min = 0,
     .max = 86400,
     .fallback = "30",
     .help = "For so long it must not hold before the run goes on."},
    {.name = "resume",
     .type = CFG_CHOICE,
     .offset = offsetof(struct bench_suspender, resume),
     .choices = resumes,
     .fallback = "\"manual\"",
     .help = "Whether the run then goes on by itself or waits for gonio resume; a door and an "
             "interlock always wait."},
    {0}};

// --- reading a condition -------------------------------------------------------------------------

static const char *const signs[] = {"=", "!=", "<=", "<", ">=", ">"};
static const enum bench_sign sign_of[] = {BENCH_EQUAL, BENCH_UNEQUAL,    BENCH_LESS_EQUAL,
                                          BENCH_LESS,  BENCH_MORE_EQUAL, BENCH_MORE};
enum { SIGNS = sizeof sign_of / sizeof *sign_of };

static void skip_spaces(const char **at)
{
    *at += strspn(*at, " \t");
}

// A name or a number; "" when none stands there, or it is too long.
static void take_word(const char **at, char word[BENCH_TERM])
{
    skip_spaces(at);
    const size_t size = strcspn(*at, " \t=!<>");
    snprintf(word, BENCH_TERM, "%.*s", size < BENCH_TERM ? (int)size : 0, *at);
    *at += size;
    skip_spaces(at);
}

static bool take_sign(const char **at, enum bench_sign *ret_sign)
{
    for (int i = 0; i < SIGNS; i++)
        if (!strncmp(*at, signs[i], strlen(signs[i]))) {
            *at += strlen(signs[i]);
            *ret_sign = sign_of[i];
            return true;
        }
    return false;
}

static int read_term(const char **at, struct bench_term *ret_term, struct gon_error *err)
{
    struct bench_term t = {.sign = BENCH_SET};
    char number[BENCH_TERM];
    take_word(at, t.name);
    if (!strcmp(t.name, "not")) {
        t.sign = BENCH_NOT_SET;
        take_word(at, t.name);
    }
    if (!*t.name || !strcmp(t.name, "and"))
        return gon_fail(err, GON_E_INPUT, "a value's name is missing before '%s'", *at);
    const bool negated = t.sign == BENCH_NOT_SET;
    if (take_sign(at, &t.sign)) {
        if (negated)
            return gon_fail(err, GON_E_INPUT, "behind not stands a name alone, without a limit");
        take_word(at, number);
        if (options_real(number, &t.limit) < 0 || !isfinite(t.limit))
            return gon_fail(err, GON_E_INPUT, "%s is compared with '%s', which is no number",
                            t.name, number);
    }
    *ret_term = t;
    return 0;
}

int bench_condition_parse(const char *when, struct bench_condition *ret_condition,
                          struct gon_error *err)
{
    struct bench_condition c = {.terms = 0};
    char word[BENCH_TERM];
    for (const char *at = when;;) {
        if (c.terms == BENCH_TERMS)
            return gon_fail(err, GON_E_INPUT, "more than %d terms; make two suspenders of it",
                            BENCH_TERMS);
        int rc = read_term(&at, &c.term[c.terms], err);
        if (rc < 0)
            return rc;
        c.terms++;
        if (!*at)
            break;
        take_word(&at, word);
        if (strcmp(word, "and"))
            return gon_fail(err, GON_E_INPUT, "'and' is missing before '%s%s'", word, at);
    }
    *ret_condition = c;
    return 0;
}

// --- judging -------------------------------------------------------------------------------------

bool bench_term_holds(const struct bench_term *t, double value)
{
    if (isnan(value))
        return true;
    switch (t->sign) {
    case BENCH_SET: return value != 0;
    case BENCH_NOT_SET: return value == 0;
    case BENCH_EQUAL: return value == t->limit;
    case BENCH_UNEQUAL: return value != t->limit;
    case BENCH_LESS: return value < t->limit;
    case BENCH_LESS_EQUAL: return value <= t->limit;
    case BENCH_MORE: return value > t->limit;
    case BENCH_MORE_EQUAL:
    default: return value >= t->limit;
    }
}

void bench_term_text(const struct bench_term *t, double value, char *text, size_t size)
{
    if (isnan(value)) {
        snprintf(text, size, "%s is not known", t->name);
        return;
    }
    int used = snprintf(text, size, "%s = %.6g", t->name, value);
    for (int i = 0; i < SIGNS && used < (int)size; i++)
        if (sign_of[i] == t->sign)
            snprintf(text + used, size - (size_t)used, " %s %.6g", signs[i], t->limit);
}

bool bench_term_is(const struct bench_term *t, const char *own_value)
{
    return !strcmp(t->name, own_value);
}

bool bench_term_needs_light(const struct bench_term *t)
{
    return bench_term_is(t, MONITOR) || bench_term_is(t, POWER);
}

int bench_term_device(const struct bench_config *b, const struct bench_term *t,
                      const char **ret_value)
{
    const char *dot = strchr(t->name, '.');
    for (int i = 0; dot && i < b->devices_count; i++) {
        const char *name = b->devices[i].name;
        if (strlen(name) == (size_t)(dot - t->name) &&
            !strncmp(name, t->name, (size_t)(dot - t->name))) {
            *ret_value = dot + 1;
            return i;
        }
    }
    return -1;
}

// --- checks across settings ----------------------------------------------------------------------

static int complain(struct cfg_file *f, int i, const char *member, const char *text)
{
    char path[60];
    snprintf(path, sizeof path, "suspenders[%d].%s", i, member);
    return cfg_complain(f, path, "%s", text);
}

static const char *meant(const struct bench_config *b, const char *name)
{
    const char *names[BENCH_DEVICES + 8] = {NULL};
    int n = 0;
    const char *dot = strchr(name, '.');
    for (int i = 0; bench_own_values[i] && !dot; i++)
        names[n++] = bench_own_values[i];
    for (int i = 0; i < b->devices_count; i++)
        if (b->devices[i].use == BENCH_INPUTS)
            names[n++] = b->devices[i].name;
    char device[BENCH_TERM];
    snprintf(device, sizeof device, "%.*s", dot ? (int)(dot - name) : BENCH_TERM, name);
    return options_suggest(device, names);
}

static int check_name(struct cfg_file *f, const struct bench_config *b, int i,
                      const struct bench_term *t)
{
    char text[300];
    const char *value;
    const int device = bench_term_device(b, t, &value);
    for (int k = 0; bench_own_values[k]; k++)
        if (bench_term_is(t, bench_own_values[k])) {
            const bool monitor = b->detector.monitor_aux || *b->monitor.driver;
            if (strcmp(t->name, MONITOR) || monitor)
                return 0;
            return complain(f, i, "when", "the bench has no monitor");
        }
    if (device >= 0 && b->devices[device].use == BENCH_INPUTS && *value)
        return 0;
    const char *near = device < 0 ? meant(b, t->name) : NULL;
    snprintf(text, sizeof text,
             "there is no value '%s'%s%s%s; allowed DEVICE.VALUE of the devices that are inputs, "
             "interlock_open, monitor_v, laser_power_w, disk_free_mb",
             t->name, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    return complain(f, i, "when", text);
}

static bool is_of_a_door(const char *text)
{
    return strcasestr(text, "door") || strcasestr(text, "interlock");
}

// Whoever opened it stands before the bench, whatever it says a moment later.
static bool keeps_people_out(const struct bench_suspender *s)
{
    return is_of_a_door(s->name) || is_of_a_door(s->when);
}

static int check_suspender(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_suspender *s = &b->suspenders[i];
    struct bench_condition c;
    struct gon_error err;
    int mistakes = 0;
    if (!*s->name)
        mistakes += complain(f, i, "name", "must not be empty");
    for (int j = 0; j < i; j++)
        if (!strcmp(s->name, b->suspenders[j].name))
            mistakes += complain(f, i, "name", "is the name of another suspender too");
    if (s->resume == BENCH_AUTOMATIC && keeps_people_out(s))
        mistakes += complain(f, i, "resume",
                             "a door or an interlock never resumes by itself; write \"manual\"");
    if (bench_condition_parse(s->when, &c, &err) < 0)
        return mistakes + complain(f, i, "when", err.text);
    for (int k = 0; k < c.terms; k++)
        mistakes += check_name(f, b, i, &c.term[k]);
    return mistakes;
}

int bench_suspend_check(struct cfg_file *f, const struct bench_config *b)
{
    int mistakes = 0;
    for (int i = 0; i < b->suspenders_count; i++)
        mistakes += check_suspender(f, b, i);
    return mistakes;
}
