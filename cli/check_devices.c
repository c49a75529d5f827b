// SPDX-License-Identifier: MIT
// Only profiles know what positions a selector has.
#include "cli/check_inside.h"

#include "campaign/bench.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct checked {
    const char *path, *text;
    const struct bench_config *bench;
    struct cfg_sink sink;
    int worst;
};

static void complain(struct checked *c, const char *word, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));
static void complain(struct checked *c, const char *word, const char *fmt, ...)
{
    char line[800];
    va_list args;
    int used = snprintf(line, sizeof line, "%s:%d: ", c->path, check_line_of(c->text, word));
    va_start(args, fmt);
    vsnprintf(line + used, sizeof line - (size_t)used, fmt, args);
    va_end(args);
    c->sink.say(c->sink.ctx, line);
    c->worst = GON_E_INPUT;
}

static void take(struct checked *c, int rc)
{
    if (rc < 0)
        c->worst = rc;
}

static void check_position(struct checked *c, const struct profile *p, const char *where,
                           const char *position)
{
    char all[300] = "";
    for (int i = 0; i < p->selector.positions_count; i++) {
        const size_t used = strlen(all);
        if (!strcmp(p->selector.positions[i].name, position))
            return;
        snprintf(all + used, sizeof all - used, "%s\"%s\"", used ? ", " : "",
                 p->selector.positions[i].name);
    }
    complain(c, position, "%s = \"%s\": profile %s has no such position; it has %s", where,
             position, p->name, all);
}

static void check_positions(struct checked *c, const struct profile *p, int index)
{
    const struct bench_device *d = &c->bench->devices[index];
    char where[60];
    snprintf(where, sizeof where, "devices[%d].position", index);
    check_position(c, p, where, d->position);
    snprintf(where, sizeof where, "devices[%d].safe", index);
    if (*d->safe)
        check_position(c, p, where, d->safe);
    else if (d->use == BENCH_SHUTTER && !*p->selector.safe)
        complain(c, d->name,
                 "%s: missing: profile %s does not say where it is safe, and a shutter goes there "
                 "when a run pauses or ends",
                 where, p->name);
    for (int i = 0; i < c->bench->stations_count; i++) {
        const struct bench_station *s = &c->bench->stations[i];
        for (int k = 0; k < s->places_count; k++) {
            snprintf(where, sizeof where, "stations[%d].devices[%d].position", i, k);
            if (!strcmp(s->places[k].name, d->name))
                check_position(c, p, where, s->places[k].position);
        }
    }
}

// What suspenders want to see of it.
static void check_values(struct checked *c, const struct profile *p, int index)
{
    for (int i = 0; i < c->bench->suspenders_count; i++) {
        struct bench_condition when;
        const char *value;
        bench_condition_parse(c->bench->suspenders[i].when, &when, NULL);
        for (int k = 0; k < when.terms; k++)
            if (bench_term_device(c->bench, &when.term[k], &value) == index &&
                profile_value(p, value) < 0)
                complain(c, when.term[k].name,
                         "suspenders[%d].when = \"%s\": profile %s has no value '%s'", i,
                         c->bench->suspenders[i].when, p->name, value);
    }
}

static void check_device(struct checked *c, int index)
{
    const struct bench_device *d = &c->bench->devices[index];
    const bool inputs = d->use == BENCH_INPUTS;
    struct profile *p;
    if (!*d->bus)
        take(c, check_link(c->path, c->text, d->link, LINK_TEXT, c->sink));
    int rc = check_profile(c->path, c->text, c->bench, d->driver,
                           inputs ? PROFILE_INPUTS : PROFILE_SELECTOR, c->sink);
    take(c, rc);
    if (rc < 0 || profile_open(d->driver, c->bench->folder, &p, NULL) < 0)
        return;
    if (p->protocol != (*d->bus ? PROFILE_MODBUS : PROFILE_MESSAGE))
        complain(c, d->name, "devices[%d]: profile %s is for %s", index, p->name,
                 *d->bus ? "a link of its own, not a bus" : "a Modbus bus: give bus and unit");
    if (inputs)
        check_values(c, p, index);
    else
        check_positions(c, p, index);
    free(p);
}

int check_devices(const char *path, const char *text, const struct bench_config *bench,
                  struct cfg_sink sink)
{
    struct checked c = {path, text, bench, sink, 0};
    const struct bench_monitor *m = &bench->monitor;
    if (*m->driver) {
        take(&c, check_link(path, text, m->link, LINK_TEXT, sink));
        take(&c, check_profile(path, text, bench, m->driver, PROFILE_DETECTOR, sink));
    }
    for (int i = 0; i < bench->devices_count; i++)
        check_device(&c, i);
    return c.worst;
}
