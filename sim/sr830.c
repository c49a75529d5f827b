// SPDX-License-Identifier: MIT
#include "sim/sr830.h"
#include "base/units.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define IDENTITY "Stanford_Research_Systems,SR830,s/n43480,ver1.07 " // the blank belongs to it
enum { REPLY = 120, PARAMETERS = 6 };
enum { ESR_INPUT = 1 << 0, ESR_EXECUTION = 1 << 4, ESR_COMMAND = 1 << 5, ESR_POWER_ON = 1 << 7 };

static const double full_scale_v[] = {2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 2e-7, 5e-7, 1e-6,
                                      2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3,
                                      2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1,  0.2,  0.5,  1};
static const double time_constant_s[] = {1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3,
                                         1,    3,    10,   30,   100,  300,  1e3,  3e3,  1e4, 3e4};
static const double reserve[] = {1000, 100, 5}; // high, normal, low noise: times full scale

// Settings that are a number to write and to read back. Ranges from the manual's remote list.
enum { SENS, OFLT, OFSL, RMOD, PHAS, FREQ, OUTX };
static const struct {
    const char *name;
    double min, max, power_on;
    int decimals; // 0: an integer
} settings[SIM_SR830_SETTINGS] = {
    [SENS] = {"SENS", 0, 26, 26, 0},
    [OFLT] = {"OFLT", 0, 19, 8, 0},
    [OFSL] = {"OFSL", 0, 3, 1, 0},
    [RMOD] = {"RMOD", 0, 2, 1, 0},
    [PHAS] = {"PHAS", -360, 729.99, 0, 2},
    [FREQ] = {"FREQ", 0.001, 102000, 1000, 2},
    [OUTX] = {"OUTX", 0, 1, 1, 0},
    {"SYNC", 0, 1, 0, 0},
    {"ISRC", 0, 3, 0, 0},
    {"IGND", 0, 1, 0, 0},
    {"ICPL", 0, 1, 0, 0},
    {"ILIN", 0, 3, 0, 0},
    {"FMOD", 0, 1, 1, 0},
    {"RSLP", 0, 2, 0, 0},
    {"HARM", 1, 19999, 1, 0},
    {"SLVL", 0.004, 5, 1, 3},
    {"LOCL", 0, 2, 0, 0},
    {"OVRM", 0, 1, 0, 0},
    {"ALRM", 0, 1, 0, 0},
    {"KCLK", 0, 1, 1, 0},
};

static void apply(struct sim_sr830 *s)
{
    struct lockin *l = &s->world->lockin;
    l->full_scale_v = full_scale_v[(int)s->setting[SENS]];
    l->time_constant_s = time_constant_s[(int)s->setting[OFLT]];
    l->poles = (int)s->setting[OFSL] + 1;
    l->reserve = reserve[(int)s->setting[RMOD]];
    l->phase_rad = units_rad(s->setting[PHAS]);
}

static void reset(struct sim_sr830 *s)
{
    double outx = s->setting[OUTX]; // *RST leaves the interface alone
    for (int i = 0; i < SIM_SR830_SETTINGS; i++)
        s->setting[i] = settings[i].power_on;
    s->setting[OUTX] = outx;
    memset(s->aux_out_v, 0, sizeof s->aux_out_v);
    apply(s);
}

// --- one command ---------------------------------------------------------------------------------

struct request {
    struct sim_sr830 *s;
    double p[PARAMETERS];
    int count;
    bool query;
    char reply[REPLY]; // "" for none
};

// As the instrument writes numbers: six digits, three in an exponent.
static void put_real(char *out, size_t size, double v)
{
    char text[40];
    snprintf(text, sizeof text, "%.6g", v);
    char *e = strchr(text, 'e');
    if (!e) {
        snprintf(out, size, "%s", text);
        return;
    }
    int exponent = atoi(e + 1);
    *e = 0;
    snprintf(out, size, "%se%c%03d", text, exponent < 0 ? '-' : '+', abs(exponent));
}

static double output(const struct sim_sr830 *s, int which)
{
    double x = lockin_x_v(&s->world->lockin), y = lockin_y_v(&s->world->lockin);
    switch (which) {
    case 1:
    case 10: return x; // CH1 and CH2 display X and Y
    case 2:
    case 11: return y;
    case 3: return hypot(x, y);
    case 4: return units_deg(atan2(y, x));
    case 9: return s->setting[FREQ];
    default: return world_aux_v(s->world, which - 4);
    }
}

static void put_output(const struct sim_sr830 *s, int which, char *out, size_t size)
{
    double v = output(s, which);
    if (which == 9)
        snprintf(out, size, "%.2f", v);
    else if (which >= 5 && which <= 8)
        snprintf(out, size, "%.4f", v); // 1/3 mV
    else
        put_real(out, size, v);
}

static bool whole(double v, int min, int max)
{
    return v == floor(v) && v >= min && v <= max;
}

// Each returns false for a bad parameter.
static bool do_outp(struct request *r)
{
    if (!r->query || r->count != 1 || !whole(r->p[0], 1, 4))
        return false;
    put_output(r->s, (int)r->p[0], r->reply, REPLY);
    return true;
}

static bool do_oaux(struct request *r)
{
    if (!r->query || r->count != 1 || !whole(r->p[0], 1, 4))
        return false;
    put_output(r->s, (int)r->p[0] + 4, r->reply, REPLY);
    return true;
}

static bool do_snap(struct request *r)
{
    if (!r->query || r->count < 2)
        return false;
    for (int i = 0; i < r->count; i++)
        if (!whole(r->p[i], 1, 11))
            return false;
    for (int i = 0; i < r->count; i++) {
        size_t used = strlen(r->reply);
        snprintf(r->reply + used, REPLY - used, "%s", i ? "," : "");
        used = strlen(r->reply);
        put_output(r->s, (int)r->p[i], r->reply + used, REPLY - used);
    }
    return true;
}

static bool do_auxv(struct request *r)
{
    if (r->count != (r->query ? 1 : 2) || !whole(r->p[0], 1, SIM_SR830_AUX))
        return false;
    double *v = &r->s->aux_out_v[(int)r->p[0] - 1];
    if (r->query)
        snprintf(r->reply, REPLY, "%.3f", *v);
    else if (fabs(r->p[1]) > 10.5)
        return false;
    else
        *v = r->p[1];
    return true;
}

// A status byte that reading clears, whole or one bit of it.
static bool put_sticky(struct request *r, unsigned *bits)
{
    unsigned mask = 0xff;
    if (!r->query || r->count > 1 || (r->count == 1 && !whole(r->p[0], 0, 7)))
        return false;
    if (r->count == 1)
        mask = 1u << (int)r->p[0];
    snprintf(r->reply, REPLY, "%u", r->count ? (*bits & mask) != 0 : *bits & mask);
    *bits &= ~mask;
    return true;
}

static bool do_lias(struct request *r)
{
    return put_sticky(r, &r->s->world->lockin.condition);
}

static bool do_esr(struct request *r)
{
    return put_sticky(r, &r->s->event);
}

static bool do_errs(struct request *r)
{
    unsigned none = 0; // its hardware does not fail
    return put_sticky(r, &none);
}

static bool do_stb(struct request *r)
{
    unsigned byte = 0x03; // no scan, no command in progress
    byte |= r->s->world->lockin.condition ? 0x08 : 0;
    byte |= r->s->event & r->s->enable ? 0x20 : 0;
    return put_sticky(r, &byte);
}

static bool do_enable(struct request *r, unsigned *bits)
{
    if (r->query)
        snprintf(r->reply, REPLY, "%u", *bits);
    else if (r->count != 1 || !whole(r->p[0], 0, 255))
        return false;
    else
        *bits = (unsigned)r->p[0];
    return true;
}

static bool do_ese(struct request *r)
{
    return do_enable(r, &r->s->enable);
}

static bool do_sre(struct request *r)
{
    return do_enable(r, &r->s->request_enable);
}

static bool do_idn(struct request *r)
{
    strcpy(r->reply, IDENTITY);
    return r->query && r->count == 0;
}

static bool do_cls(struct request *r)
{
    r->s->event = 0;
    r->s->world->lockin.condition = 0;
    return !r->query && r->count == 0;
}

static bool do_rst(struct request *r)
{
    reset(r->s);
    return !r->query && r->count == 0;
}

static const struct {
    const char *name;
    bool (*run)(struct request *r);
} commands[] = {
    {"OUTP", do_outp}, {"SNAP", do_snap}, {"OAUX", do_oaux}, {"AUXV", do_auxv}, {"LIAS", do_lias},
    {"ERRS", do_errs}, {"*ESR", do_esr},  {"*STB", do_stb},  {"*ESE", do_ese},  {"*SRE", do_sre},
    {"*IDN", do_idn},  {"*CLS", do_cls},  {"*RST", do_rst},
};

static bool run_setting(struct request *r, int i)
{
    double *v = &r->s->setting[i];
    if (r->query) {
        snprintf(r->reply, REPLY, "%.*f", settings[i].decimals, *v);
        return r->count == 0;
    }
    if (r->count != 1 || !(r->p[0] >= settings[i].min && r->p[0] <= settings[i].max))
        return false;
    if (settings[i].decimals == 0 && r->p[0] != floor(r->p[0]))
        return false;
    *v = r->p[0];
    apply(r->s);
    return true;
}

// --- lines ---------------------------------------------------------------------------------------

// "SNAP? 1,2,9,5": name of four letters, '?', parameters. False: not of that form.
static bool parse(char *text, char name[5], struct request *r)
{
    if (strlen(text) < 4)
        return false;
    memcpy(name, text, 4);
    name[4] = 0;
    text += 4;
    r->query = *text == '?';
    text += r->query;
    char *save = NULL;
    for (char *word = strtok_r(text, ", ", &save); word; word = strtok_r(NULL, ", ", &save)) {
        char *end;
        if (r->count == PARAMETERS)
            return false;
        r->p[r->count++] = strtod(word, &end);
        if (*end)
            return false;
    }
    return true;
}

static void command(struct sim_sr830_port *p, char *text, int64_t t_ns)
{
    struct sim_sr830 *s = p->lia;
    struct request r = {.s = s};
    char name[5];
    bool known = false, good = false;
    world_see(s->world, t_ns);
    if (parse(text, name, &r)) {
        for (size_t i = 0; i < sizeof commands / sizeof commands[0] && !known; i++)
            if ((known = strcasecmp(name, commands[i].name) == 0))
                good = commands[i].run(&r);
        for (int i = 0; i < SIM_SR830_SETTINGS && !known; i++)
            if ((known = settings[i].name && strcasecmp(name, settings[i].name) == 0))
                good = run_setting(&r, i);
    }
    if (!good) {
        s->event |= known ? ESR_EXECUTION : ESR_COMMAND;
        return;
    }
    if (r.reply[0] && s->setting[OUTX] == 0) {
        strcat(r.reply, "\r");
        port_send(&p->port, r.reply, strlen(r.reply), t_ns + s->reply_ns);
    }
}

static void line(struct sim_sr830_port *p, int64_t t_ns)
{
    if (p->line.overflow) { // the queue is cleared
        p->lia->event |= ESR_INPUT;
        return;
    }
    char *save = NULL;
    for (char *one = strtok_r(p->line.text, ";", &save); one; one = strtok_r(NULL, ";", &save)) {
        one += strspn(one, " ");
        if (*one == 0)
            continue;
        p->port.frames_in++;
        command(p, one, t_ns);
    }
}

static void feed(struct port *port, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct sim_sr830_port *p = (struct sim_sr830_port *)port;
    for (size_t i = 0; i < size; i++)
        if (sim_line_add(&p->line, bytes[i], "\r\n"))
            line(p, t_ns);
}

static void tick(struct port *port, int64_t t_ns)
{
    (void)port; // it never asks for one
    (void)t_ns;
}

static void hangup(struct port *port)
{
    (void)port; // half a command stays in the instrument's buffer, as on a real line
}

static const struct port_ops ops = {feed, tick, hangup};

void sim_sr830_init(struct sim_sr830 *s, struct world *world, int64_t reply_ns)
{
    memset(s, 0, sizeof *s);
    s->world = world;
    s->reply_ns = reply_ns;
    s->setting[OUTX] = settings[OUTX].power_on;
    s->event = ESR_POWER_ON;
    reset(s);
}

void sim_sr830_port_init(struct sim_sr830_port *p, struct sim_sr830 *s)
{
    memset(p, 0, sizeof *p);
    port_init(&p->port, &ops);
    p->lia = s;
}
