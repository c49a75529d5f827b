// SPDX-License-Identifier: MIT
#include "sim/cobolt.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SERIAL "12345"
#define MODEL "1064-05-01-0100-SIM"
#define FIRMWARE "7.104"
enum { REPLY = 80 };

// --- actions: 0, or the reason of a refusal ------------------------------------------------------

static const char *start(struct sim_laser *l, bool autostart_sequence)
{
    switch (sim_laser_start(l, autostart_sequence)) {
    case SIM_LASER_ACCEPTED: return NULL;
    case SIM_LASER_AUTOSTART: return "autostart is enabled, use @cob1";
    case SIM_LASER_INTERLOCK: return "interlock is open";
    case SIM_LASER_NO_KEY: return "key must be switched off and on";
    case SIM_LASER_FAULTY: return "fault is latched";
    }
    return "not now";
}

static const char *on(struct sim_laser *l)
{
    return start(l, false);
}

static const char *sequence(struct sim_laser *l)
{
    return start(l, true);
}

static const char *off(struct sim_laser *l)
{
    sim_laser_off(l);
    return NULL;
}

static const char *stop_sequence(struct sim_laser *l)
{
    sim_laser_abort(l);
    return NULL;
}

static const char *clear(struct sim_laser *l)
{
    sim_laser_clear_fault(l);
    return NULL;
}

static const char *constant_power(struct sim_laser *l)
{
    l->constant_current = false;
    return NULL;
}

static const char *constant_current(struct sim_laser *l)
{
    l->constant_current = true;
    return NULL;
}

static const char *autostart_on(struct sim_laser *l)
{
    l->autostart = true;
    return NULL;
}

static const char *autostart_off(struct sim_laser *l)
{
    l->autostart = false;
    return NULL;
}

static const struct {
    const char *command;
    const char *(*act)(struct sim_laser *l);
} actions[] = {
    {"l0", off},
    {"l1", on},
    {"@cob0", off},
    {"@cob1", sequence},
    {"restart", sequence},
    {"abort", stop_sequence},
    {"cf", clear},
    {"cp", constant_power},
    {"ecp", constant_power},
    {"ci", constant_current},
    {"ecc", constant_current},
    {"@cobas 1", autostart_on},
    {"@cobas 0", autostart_off},
};

// --- queries and settings ------------------------------------------------------------------------

// False: not a query that is known.
static bool query(const struct sim_cobolt *c, const char *q, char ret_text[REPLY])
{
    const struct sim_laser *l = &c->world->laser;
    const struct {
        const char *query;
        int value;
    } integers[] = {
        {"gom?", l->state},
        {"l?", sim_laser_emits(l)},
        {"f?", l->fault},
        {"ilk?", !l->interlock_closed},
        {"@cobas?", l->autostart},
        {"@cobasks?", l->key},
        {"gam?", !l->constant_current},
    };
    const struct {
        const char *query, *format;
        double value;
    } reals[] = {
        {"p?", "%.4f", l->setpoint_w},          {"pa?", "%.5f", sim_laser_power_w(l)},
        {"gmlp?", "%.4f", l->spec.power_max_w}, {"i?", "%.1f", 1000 * sim_laser_current_a(l)},
        {"glc?", "%.3f", l->current_a},         {"hrs?", "%.2f", c->hours},
    };
    const struct {
        const char *query, *text;
    } texts[] = {
        {"?", "OK"}, {"sn?", SERIAL}, {"gsn?", SERIAL}, {"glm?", MODEL}, {"gfv?", FIRMWARE}};
    for (size_t i = 0; i < sizeof integers / sizeof integers[0]; i++)
        if (strcmp(q, integers[i].query) == 0)
            return snprintf(ret_text, REPLY, "%d", integers[i].value) > 0;
    for (size_t i = 0; i < sizeof reals / sizeof reals[0]; i++)
        if (strcmp(q, reals[i].query) == 0) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
            return snprintf(ret_text, REPLY, reals[i].format, reals[i].value) > 0;
#pragma GCC diagnostic pop
        }
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (strcmp(q, texts[i].query) == 0)
            return snprintf(ret_text, REPLY, "%s", texts[i].text) > 0;
    return false;
}

static bool number(const char *text, double *ret)
{
    char *end;
    double v = strtod(text, &end);
    while (*end == ' ')
        end++;
    if (end == text || *end || !(v >= 0 && v < 1e6))
        return false;
    *ret = v;
    return true;
}

// "p 0.05", "slc 0.5": false when it is neither.
static bool setting(struct sim_laser *l, const char *line, char ret_text[REPLY])
{
    double v;
    bool power = strncmp(line, "p ", 2) == 0;
    if (!power && strncmp(line, "slc ", 4) != 0)
        return false;
    if (!number(line + (power ? 2 : 4), &v))
        return false;
    double most = power ? l->spec.power_max_w : 2;
    if (v > most) {
        snprintf(ret_text, REPLY, "Error: %g is above %g", v, most);
        return true;
    }
    *(power ? &l->setpoint_w : &l->current_a) = v;
    strcpy(ret_text, "OK");
    return true;
}

static void carry_out(struct sim_cobolt *c, const char *line, char ret_text[REPLY])
{
    struct sim_laser *l = &c->world->laser;
    for (size_t i = 0; i < sizeof actions / sizeof actions[0]; i++)
        if (strcmp(line, actions[i].command) == 0) {
            const char *why = actions[i].act(l);
            snprintf(ret_text, REPLY, "%s%s", why ? "Error: " : "OK", why ? why : "");
            return;
        }
    if (!query(c, line, ret_text) && !setting(l, line, ret_text))
        strcpy(ret_text, "Syntax error: illegal command");
}

static void command(struct sim_cobolt_port *p, const char *line, int64_t t_ns)
{
    struct sim_cobolt *c = p->laser;
    while (*line == ' ' || *line == '\n')
        line++;
    if (*line == 0)
        return;
    p->port.frames_in++;
    const bool too_early = c->last_ns != INT64_MIN && t_ns - c->last_ns < SIM_COBOLT_GAP_NS;
    struct sim_cobolt_heard *h = &c->heard[c->heard_count++ % SIM_COBOLT_HEARD];
    *h = (struct sim_cobolt_heard){.t_ns = t_ns, .too_early = too_early};
    snprintf(h->text, sizeof h->text, "%s", line);
    if (too_early) {
        c->too_early++;
        return;
    }
    c->last_ns = t_ns;
    world_see(c->world, t_ns);
    char text[REPLY], out[SIM_LINE_MOST + REPLY + 8];
    carry_out(c, line, text);
    int n =
        snprintf(out, sizeof out, "%s%s%s\r\n", c->echo ? line : "", c->echo ? "\r\n" : "", text);
    port_send(&p->port, out, n < PORT_REPLY_MOST ? (size_t)n : PORT_REPLY_MOST, t_ns + c->reply_ns);
}

// --- the port ------------------------------------------------------------------------------------

static void feed(struct port *port, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct sim_cobolt_port *p = (struct sim_cobolt_port *)port;
    for (size_t i = 0; i < size; i++)
        if (sim_line_add(&p->line, bytes[i], "\r"))
            command(p, p->line.text, t_ns);
}

static void tick(struct port *port, int64_t t_ns)
{
    (void)port; // it never asks for one
    (void)t_ns;
}

static void hangup(struct port *port)
{
    (void)port; // half a command stays in the laser's buffer, as on a real line
}

static const struct port_ops ops = {feed, tick, hangup};

void sim_cobolt_init(struct sim_cobolt *c, struct world *world, int64_t reply_ns)
{
    *c = (struct sim_cobolt){
        .world = world, .reply_ns = reply_ns, .last_ns = INT64_MIN, .hours = 1234.5};
}

void sim_cobolt_port_init(struct sim_cobolt_port *p, struct sim_cobolt *c)
{
    memset(p, 0, sizeof *p);
    port_init(&p->port, &ops);
    p->laser = c;
}
