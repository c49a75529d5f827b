// SPDX-License-Identifier: MIT
#include "drivers/recorder.h"

#include "drivers/bus.h"
#include "drivers/capture.h"
#include "drivers/golden_entry.h"
#include "drivers/message.h"
#include "drivers/profile_use.h"
#include "drivers/record_step.h"
#include "drivers/session.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BUS_TIMEOUT_MS 200
#define BUS_QUIET_MS 350 // transports.md: what late answers were seen to take

enum { SHOWN = 4 * GOLDEN_BYTES, KEPT_MOST = 256 };

struct recorder {
    const struct profile *p;
    struct bus *bus; // NULL: messages
    struct session *s;
    struct clk *clk;
    struct recorder_sink sink;
    struct golden_maker maker;
    char source[PROFILE_TEXT];
    struct capture capture;
    struct profile_golden *kept[KEPT_MOST];
    int kept_count;
    bool has[PROFILE_VALUES > PROFILE_EXCHANGES ? PROFILE_VALUES : PROFILE_EXCHANGES];
};

// --- life ----------------------------------------------------------------------------------------

static void say_source(struct recorder *r, const char *who)
{
    const time_t now = (time_t)(clk_utc_ns(r->clk) / CLK_S(1));
    struct tm utc;
    char day[20];
    gmtime_r(&now, &utc);
    strftime(day, sizeof day, "%Y-%m-%d", &utc);
    snprintf(r->source, sizeof r->source, "recorded %s with gonio %s from %.100s", day,
             GONIO_VERSION, who);
    r->maker.source = r->source;
}

static int open_link(struct recorder *r, const char *link, int unit, const struct cancel *cancel,
                     struct gon_error *err)
{
    int rc;
    if (r->p->protocol == PROFILE_MESSAGE) {
        rc = session_open(r->p, link, r->clk, cancel, &r->s, err);
        if (rc == 0)
            transport_tap(message_transport(session_message(r->s)), &r->capture.tap);
        return rc;
    }
    rc = bus_open(link, BUS_TIMEOUT_MS, BUS_QUIET_MS, r->clk, cancel, &r->bus, err);
    if (rc == 0 && !(r->s = session_on_bus(r->p, r->bus, unit)))
        rc = gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    if (rc == 0)
        bus_tap(r->bus, &r->capture.tap);
    return rc;
}

int recorder_open(const struct profile *p, const char *link, int unit, struct clk *clk,
                  const struct cancel *cancel, struct recorder_sink sink,
                  struct recorder **ret_recorder, struct gon_error *err)
{
    struct recorder *r = calloc(1, sizeof *r);
    if (!r)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    const enum golden_wire wire = p->protocol == PROFILE_MESSAGE          ? GOLDEN_MESSAGE
                                  : strncmp(link, "modbus-tcp:", 11) == 0 ? GOLDEN_TCP
                                                                          : GOLDEN_RTU;
    r->p = p;
    r->clk = clk;
    r->sink = sink;
    r->maker = (struct golden_maker){p, wire, unit, r->source, strncmp(link, "usbtmc:", 7) == 0};
    capture_begin(&r->capture);
    say_source(r, "an instrument that has not said who it is");
    int rc = open_link(r, link, unit, cancel, err);
    if (rc < 0) {
        recorder_close(r);
        return rc;
    }
    *ret_recorder = r;
    return 0;
}

void recorder_close(struct recorder *r)
{
    if (!r)
        return;
    session_free(r->s);
    bus_close(r->bus);
    for (int i = 0; i < r->kept_count; i++)
        free(r->kept[i]);
    free(r);
}

// --- what was captured ---------------------------------------------------------------------------

static void comment(struct recorder *r, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
static void comment(struct recorder *r, const char *fmt, ...)
{
    char text[3 * SHOWN];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    // What an error quotes of an answer may be any bytes.
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < ' ' || (unsigned char)*c >= 0x7f)
            *c = '?';
    r->sink.take(r->sink.ctx, NULL, text);
}

static bool is_kept(const struct recorder *r, const struct profile_golden *g)
{
    for (int i = 0; i < r->kept_count; i++)
        if (strcmp(r->kept[i]->does, g->does) == 0 && strcmp(r->kept[i]->sent, g->sent) == 0 &&
            strcmp(r->kept[i]->received, g->received) == 0)
            return true;
    return false;
}

// What it answers need not be asked again; a refusal is an answer, too.
static void remember(struct recorder *r, const struct profile_golden *g)
{
    const int exchange = profile_exchange(r->p, g->does);
    if (r->p->protocol == PROFILE_MESSAGE && exchange >= 0)
        r->has[exchange] = true;
    for (int i = 0; i < g->asks_count; i++)
        r->has[profile_value(r->p, g->asks[i])] = true;
    struct profile_golden *copy = r->kept_count < KEPT_MOST ? malloc(sizeof *copy) : NULL;
    if (!copy)
        return;
    *copy = *g;
    r->kept[r->kept_count++] = copy;
}

static void give(struct recorder *r, const struct profile_golden *g, const struct captured *c)
{
    char sent[SHOWN], received[SHOWN], text[2 * SHOWN + 40] = "";
    const bool hex = r->p->protocol == PROFILE_MODBUS;
    golden_bytes_show(&c->sent, hex, sent, sizeof sent);
    golden_bytes_show(&c->received, hex, received, sizeof received);
    if (r->maker.wire != GOLDEN_RTU)
        snprintf(text, sizeof text, "%s -> %s", sent, *received ? received : "nothing");
    if (!is_kept(r, g))
        r->sink.take(r->sink.ctx, g, text);
    remember(r, g);
}

static void give_bytes(struct recorder *r, const struct captured *c, const char *why)
{
    char sent[SHOWN], received[SHOWN];
    const bool hex = r->p->protocol == PROFILE_MODBUS;
    golden_bytes_show(&c->sent, hex, sent, sizeof sent);
    golden_bytes_show(&c->received, hex, received, sizeof received);
    comment(r, "no entry: %s -> %s: %s", sent, *received ? received : "nothing", why);
}

// Whether what was wanted is among the entries now.
static bool is_wanted(const struct recorder *r, const struct record_step *step,
                      const struct profile_golden *g)
{
    if (!step->asks.count)
        return strcmp(g->does, step->does) == 0;
    for (int i = 0; i < step->asks.count; i++) {
        if (r->p->protocol == PROFILE_MESSAGE && strcmp(step->asks.name[i], g->does) == 0)
            return true;
        for (int k = 0; k < g->asks_count; k++)
            if (strcmp(step->asks.name[i], g->asks[k]) == 0)
                return true;
    }
    return false;
}

// d: what was known when it was sent.
static bool flush(struct recorder *r, const struct record_step *step, const struct profile_data *d)
{
    bool wanted = false;
    char stray[SHOWN];
    if (r->capture.stray.size > 0) {
        golden_bytes_show(&r->capture.stray, r->p->protocol == PROFILE_MODBUS, stray, sizeof stray);
        comment(r, "came before anything was sent: %s", stray);
    }
    for (int i = 0; i < r->capture.count; i++) {
        const struct captured *c = &r->capture.exchange[i];
        struct profile_golden g;
        struct gon_error why = {0};
        const char *does = step->asks.count ? step->asks.name[0] : step->does;
        if (golden_entry_make(&r->maker, c, does, step->with, d, &g, &why) == 0) {
            give(r, &g, c);
            wanted = wanted || is_wanted(r, step, &g);
        } else {
            give_bytes(r, c, why.text);
        }
    }
    if (r->capture.lost > 0)
        comment(r, "%d more exchanges went by and were not kept", r->capture.lost);
    capture_forget(&r->capture);
    return wanted;
}

// What became of a step: rc of the session, or that no entry came of it.
static int conclude(struct recorder *r, const struct record_step *step,
                    const struct profile_data *d, int rc, const struct gon_error *why,
                    struct gon_error *err)
{
    const char *name = step->asks.count ? step->asks.name[0] : step->does;
    const bool wanted = flush(r, step, d);
    if (rc < 0) {
        comment(r, "%s failed: %s", name, why->text);
        return gon_fail(err, (enum gon_code)rc, "%s", why->text);
    }
    return wanted ? 0 : gon_fail(err, GON_E_LINK, "%s: no entry could be made of it", name);
}

// --- doing ---------------------------------------------------------------------------------------

int recorder_may(const struct profile *p, const char *line, struct gon_error *err)
{
    struct record_step step;
    int rc = record_step_parse(p, line, &step, err);
    return rc < 0 ? rc : record_step_may(p, &step, err);
}

static int run_step(struct recorder *r, const struct record_step *step, struct gon_error *err)
{
    struct golden_params params = {0};
    struct gon_error why = {0};
    int rc = record_step_may(r->p, step, err);
    if (rc == 0 && !step->asks.count)
        rc = record_step_with(r->p, step, session_data(r->s), &params, err);
    if (rc < 0)
        return rc;
    const struct profile_data before = *session_data(r->s);
    rc = step->asks.count ? session_ask(r->s, &step->asks, &why)
                          : session_send(r->s, step->does, params.param, &why);
    return conclude(r, step, &before, rc, &why, err);
}

int recorder_do(struct recorder *r, const char *line, struct gon_error *err)
{
    struct record_step step;
    int rc = record_step_parse(r->p, line, &step, err);
    return rc < 0 ? rc : run_step(r, &step, err);
}

int recorder_identify(struct recorder *r, char *ret_title, size_t size, struct gon_error *err)
{
    const struct profile *p = r->p;
    const struct record_step step = {.asks = p->identify.asks};
    struct gon_error why = {0};
    char title[PROFILE_TEXT] = "", who[2 * PROFILE_TEXT + 40];
    const struct profile_data before = *session_data(r->s);
    int rc = session_identify(r->s, title, sizeof title, &why);
    if (*title)
        snprintf(who, sizeof who, "%s", title);
    else
        snprintf(who, sizeof who, "what answers as %s", p->title);
    if (rc == 0)
        say_source(r, who);
    if (step.asks.count)
        rc = conclude(r, &step, &before, rc, &why, err);
    if (rc == 0)
        snprintf(ret_title, size, "%s", who);
    return rc;
}

static int ask_rest(struct recorder *r, const char *name, bool has, int *failed,
                    struct gon_error *err)
{
    struct record_step step = {.asks = {.count = 1}};
    if (has)
        return 0;
    snprintf(step.asks.name[0], PROFILE_NAME, "%s", name);
    int rc = run_step(r, &step, err);
    *failed += rc < 0;
    return rc == GON_E_GONE || rc == GON_E_CANCELED ? rc : 0;
}

int recorder_ask_all(struct recorder *r, struct gon_error *err)
{
    const struct profile *p = r->p;
    const bool modbus = p->protocol == PROFILE_MODBUS;
    int failed = 0, rc = 0;
    for (int i = 0; i < (modbus ? p->values_count : p->exchanges_count) && rc == 0; i++)
        if (modbus ? profile_is_readable(p, i) : profile_only_asks(p, i))
            rc = ask_rest(r, modbus ? p->values[i].name : p->exchanges[i].name, r->has[i], &failed,
                          err);
    return rc < 0 ? rc : failed;
}
