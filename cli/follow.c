// SPDX-License-Identifier: MIT
#include "cli/follow.h"

#include "base/clk.h"
#include "campaign/store.h"
#include "cli/ask.h"
#include "cli/client.h"
#include "cli/fitview.h"
#include "cli/interrupt.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BAR = 20, ASK_MS = 1000 };

struct follow {
    int run;
    bool json, live, line_shown;
    bool ended, unknown, away; // unknown: to the daemon
    char state[32];
    json_t *fit; // the last one
    struct ask *ask;
};

static double number(const json_t *o, const char *key)
{
    const json_t *v = json_object_get(o, key);
    return json_is_number(v) ? json_number_value(v) : (double)NAN;
}

static int whole(const json_t *o, const char *key)
{
    return (int)json_integer_value(json_object_get(o, key));
}

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));
    return text ? text : "";
}

static void clear_line(struct follow *f)
{
    if (f->line_shown)
        fputs("\r\033[K", stderr);
    f->line_shown = false;
}

static void time_left(double left_s, char *text, size_t size)
{
    char time[40] = "";
    if (isfinite(left_s))
        out_duration(time, sizeof time, left_s);
    snprintf(text, size, "%s%s", time, *time ? " left" : "");
}

static void where(const json_t *e, char *text, size_t size)
{
    int sweep = whole(e, "sweep"), sweeps = whole(e, "sweeps");
    if (sweep >= 1 && sweep <= sweeps)
        snprintf(text, size, "sweep %d/%d θi=%g°", sweep, sweeps, number(e, "theta_i_deg"));
    else
        snprintf(text, size, "dark and beam");
}

static int width(const char *text)
{
    int n = 0;
    for (; *text; text++)
        n += (*text & 0xc0) != 0x80;
    return n;
}

// The bar gives way on a narrow terminal; whether the laser is on must be seen.
static void bar(double part, int room, char *text)
{
    int cells = room > BAR ? BAR : room;
    *text = 0;
    for (int i = 0; i < cells; i++)
        strcat(text, i < (int)(part * cells + 0.5) ? "█" : "░");
}

static void show_reading(struct follow *f, const json_t *e)
{
    char filled[BAR * 4 + 1], left[40], value[60] = "", sweep[60], rest[300];
    double part = whole(e, "total") > 0 ? (double)whole(e, "done") / whole(e, "total") : 0;
    where(e, sweep, sizeof sweep);
    time_left(number(e, "left_s"), left, sizeof left);
    if (isfinite(number(e, "f_r_per_sr")))
        out_value(value, sizeof value, number(e, "f_r_per_sr"), number(e, "u_f_r_per_sr"));
    snprintf(rest, sizeof rest, "%3.0f%%  θr %6.2f°  %s%s%s  %s  laser %s", 100 * part,
             number(e, "theta_r_deg"), *value ? "f_r " : "", value, *value ? " /sr" : "", left,
             json_is_true(json_object_get(e, "emission")) ? "ON" : "off");
    bar(part, out_columns(stderr) - width(sweep) - width(rest) - 4, filled);
    fprintf(stderr, "\r%s  %s %s\033[K", sweep, filled, rest);
    fflush(stderr);
    f->line_shown = true;
}

static void show_sweep(struct follow *f, const json_t *e)
{
    char left[40];
    clear_line(f);
    time_left(number(e, "left_s"), left, sizeof left);
    if (!f->live)
        fprintf(stderr, "sweep %d/%d  theta_i %g deg  %d of %d readings  %s\n", whole(e, "sweep"),
                whole(e, "sweeps"), number(e, "theta_i_deg"), whole(e, "done"), whole(e, "total"),
                left);
}

static void show_state(struct follow *f, const json_t *e)
{
    const char *state = text_of(e, "state"), *text = text_of(e, "text");
    bool same = !strcmp(state, f->state) && !*text;
    snprintf(f->state, sizeof f->state, "%s", state);
    if (same)
        return;
    clear_line(f);
    fprintf(stderr, "run %d %s%s%s\n", f->run, state, *text ? ": " : "", text);
}

static void take_fit(struct follow *f, const json_t *e)
{
    json_t *fit = json_object_get(e, "fit");
    char text[300];
    json_decref(f->fit);
    f->fit = json_incref(fit);
    clear_line(f);
    if (!fit)
        fprintf(stderr, "fit after sweep %d failed: %s\n", whole(e, "sweep"), text_of(e, "error"));
    else if (!f->json) {
        fitview_line(fit, text, sizeof text);
        fprintf(stderr, "fit after sweep %d: %s\n", whole(e, "sweep"), text);
    }
}

static void show(struct follow *f, const char *kind, const json_t *e)
{
    if (!strcmp(kind, "reading") && f->live)
        show_reading(f, e);
    else if (!strcmp(kind, "sweep"))
        show_sweep(f, e);
    else if (!strcmp(kind, "log"))
        clear_line(f), fprintf(stderr, "%s\n", text_of(e, "text"));
    else if (!strcmp(kind, "state"))
        show_state(f, e);
}

static void take(void *ctx, const json_t *e)
{
    struct follow *f = ctx;
    const char *kind = text_of(e, "event");
    if (f->json)
        out_json_line(e);
    else
        show(f, kind, e);
    if (!strcmp(kind, "fit"))
        take_fit(f, e);
    if (strcmp(kind, "state"))
        return;
    snprintf(f->state, sizeof f->state, "%s", text_of(e, "state"));
    f->ended = ask_is_end(f->state);
}

// --- where the stream does not tell --------------------------------------------------------------

static bool unknown(struct follow *f, const struct gon_error *err)
{
    f->unknown = err->code == GON_E_INPUT;
    f->ended = f->ended || f->unknown;
    return f->unknown;
}

// Whether there is more to follow. An answer that fails says nothing of the run.
static bool goes_on(struct follow *f)
{
    struct gon_error err = {0};
    if (ask_end(f->ask, &err) < 0)
        unknown(f, &err);
    return !f->ended;
}

static bool take_event(void *ctx, const json_t *e)
{
    struct follow *f = ctx;
    const bool lost = !strcmp(text_of(e, "event"), "lost");
    if (lost || whole(e, "run") == f->run)
        take(f, e);
    return lost ? goes_on(f) : !f->ended;
}

static void went_away(void *ctx)
{
    struct follow *f = ctx;
    clear_line(f);
    out_say("the connection to the daemon broke; trying again for 10 s");
    f->away = true;
}

static bool came_back(void *ctx)
{
    struct follow *f = ctx;
    out_say("the daemon is back");
    f->away = false;
    return goes_on(f);
}

static int ask_on(struct follow *f, const struct interrupt *i, struct gon_error *err)
{
    int64_t answered_ns = clk_now_ns(clk_system());
    out_say("no event stream is free (%s); asking for the run once a second", err->text);
    while (!f->ended) {
        int rc = ask_changes(f->ask, err);
        const int64_t now_ns = clk_now_ns(clk_system());
        if (rc == 0)
            answered_ns = now_ns;
        else if (rc == GON_E_CANCELED)
            return rc;
        else if (!unknown(f, err) && now_ns - answered_ns > CLIENT_AWAY_NS)
            return rc;
        f->away = rc < 0;
        if (!f->ended && interrupt_came(i, ASK_MS))
            return GON_E_CANCELED;
    }
    return GON_OK;
}

// --- the end -------------------------------------------------------------------------------------

// The last fit of a run that ended in an earlier life of the daemon.
static json_t *stored_fit(const char *file)
{
    struct store *store = NULL;
    if (store_open(file, STORE_READ, &store, NULL) < 0)
        return NULL;
    char *text = store_read_fit(store, -1);
    json_t *fit = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    store_close(store, NULL);
    return fit;
}

static int report_end(struct follow *f, const char *file)
{
    bool done = !strcmp(f->state, "done");
    if (f->unknown) {
        out_say("the daemon does not know run %d any more; see: gonio list", f->run);
        return EXIT_FAILED;
    }
    if (done && !f->fit && *file)
        f->fit = stored_fit(file);
    if (!f->json && f->fit)
        fitview_print(f->fit);
    if (!f->json && *file)
        fprintf(stderr, "readings: %s   (gonio show %d, gonio fit %d)\n", file, f->run, f->run);
    if (!f->json && !done)
        fprintf(stderr, "go on with: gonio resume %d\n", f->run);
    return done && f->fit ? EXIT_OK : EXIT_FAILED;
}

static int report_interrupt(const struct follow *f)
{
    if (f->away)
        out_say("stopped watching while the daemon was away; see: gonio list");
    else
        out_say("stopped watching; run %d goes on. Stop it: gonio stop. Watch it: gonio watch",
                f->run);
    return EXIT_INTERRUPTED;
}

int follow_run(const char *socket, const struct interrupt *i, const struct follow_run *what)
{
    struct follow f = {
        .run = what->run, .json = what->json, .live = !what->json && out_colour(stderr)};
    struct client_follower follower = {&f, take_event, went_away, came_back};
    struct client *c = NULL;
    struct gon_error err = {0};
    int rc = client_new(socket, &c, &err), status;
    rc = rc < 0 ? rc : ask_new(socket, i->fd, what->run, take, &f, &f.ask, &err);
    if (rc == 0 && f.live)
        fprintf(stderr, "(Ctrl-C: stop watching, the run continues.  Stop the run: gonio stop)\n");
    rc = rc < 0 ? rc : client_follow(c, what->last_id, i->fd, &follower, &err);
    if (rc == GON_E_REFUSED)
        rc = ask_on(&f, i, &err);
    clear_line(&f);
    if (rc == GON_E_CANCELED)
        status = report_interrupt(&f);
    else
        status = rc < 0 ? out_fail(&err) : report_end(&f, what->file);
    json_decref(f.fit);
    ask_free(f.ask);
    client_free(c);
    return status;
}
