// SPDX-License-Identifier: MIT
// An instrument in lines of text that says what links.h's quantity is at the moment it is asked, in
// the words of the profiles sr830, keithley-6485 and thorlabs-pm100; and whether what was read is
// true. Frames its lines as its profile says: terminators, echo, checksum.
#pragma once
#include "drivers/checksum.h"
#include "drivers/session.h"
#include "sim/line.h"
#include "tests/slow/links.h"
#include "tests/unit/profiles.h"

struct links_device {
    struct port port; // first
    struct sim_line line;
    const struct profile *profile;
    int64_t late_ns, late_due_ns; // of the next answer; when the late one comes
    bool keeps, twice;            // a hang-up does not stop what is late; the next is said twice
    const struct clk_virtual *clk;
    char late[PORT_REPLY_MOST];
};

static inline bool links_answer(const struct profile *p, const char *command, int64_t tick,
                                char *text, size_t size)
{
    const double x = links_x(tick), y = links_y(tick), f = links_frequency(tick);
    const bool keithley = strcmp(p->name, "keithley-6485") == 0;
    if (strstr(command, "*IDN?"))
        snprintf(text, size, "%s",
                 keithley          ? "KEITHLEY INSTRUMENTS INC.,MODEL 6485,1012345,B03"
                 : *command == '*' ? "Thorlabs,PM100D,P0012345,2.4.0"
                                   : "Stanford_Research_Systems,SR830,s/n43480,ver1.07");
    else if (strcmp(command, "SENS?") == 0)
        snprintf(text, size, "26");
    else if (strcmp(command, "SNAP?1,9") == 0)
        snprintf(text, size, "%.7g,%.7g", x, f);
    else if (strcmp(command, "SNAP?1,9,2") == 0)
        snprintf(text, size, "%.7g,%.7g,%.7g", x, f, y);
    else if (strcmp(command, "SNAP?2,9") == 0)
        snprintf(text, size, "%.7g,%.7g", y, f);
    else if (strcmp(command, "READ?") == 0 && keithley)
        snprintf(text, size, "%.8EA,%.3f,0", x * 1e-3, (double)tick * 1e-3);
    else if (strcmp(command, "READ?") == 0)
        snprintf(text, size, "%.8E", x);
    else
        return false;
    return true;
}

static inline void links_say(struct links_device *d, const char *command, const char *answer,
                             int64_t t_ns)
{
    const struct profile *p = d->profile;
    char text[200], whole[PORT_REPLY_MOST];
    size_t size = (size_t)snprintf(text, sizeof text, "%s", answer);
    checksum_append(&p->checksum, text, size, sizeof text, &size, NULL);
    snprintf(whole, sizeof whole, "%.40s%s%s%s", *p->framing.echo_end ? command : "",
             p->framing.echo_end, text, p->framing.end_in);
    if (d->late_ns > 0) {
        snprintf(d->late, sizeof d->late, "%s", whole);
        d->late_due_ns = t_ns + d->late_ns;
    }
    for (int i = 0; i <= d->twice; i++)
        port_send(&d->port, whole, strlen(whole), t_ns + LINKS_REPLY_NS + d->late_ns);
    d->late_ns = 0;
    d->twice = false;
}

static inline void links_hear(struct links_device *d, char *command, int64_t t_ns)
{
    char answer[128];
    size_t size;
    if (checksum_take(&d->profile->checksum, command, strlen(command), &size, NULL) == 0 &&
        links_answer(d->profile, command, links_tick(t_ns), answer, sizeof answer))
        links_say(d, command, answer, t_ns);
}

static inline void links_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct links_device *d = (struct links_device *)p;
    for (size_t i = 0; i < size; i++)
        if (sim_line_add(&d->line, bytes[i], "\r\n"))
            links_hear(d, d->line.text, t_ns);
}

static inline void links_tick_nothing(struct port *p, int64_t t_ns)
{
    (void)p, (void)t_ns;
}

// A device that clears its queues, and an instrument behind them that is still measuring.
static inline void links_hangup(struct port *p)
{
    struct links_device *d = (struct links_device *)p;
    sim_line_clear(&d->line);
    if (d->keeps && d->late_due_ns > d->clk->t_ns)
        port_send(p, d->late, strlen(d->late), d->late_due_ns);
}

static inline void links_device_init(struct links_device *d, const struct profile *p,
                                     const struct clk_virtual *clk)
{
    static const struct port_ops ops = {links_feed, links_tick_nothing, links_hangup};
    memset(d, 0, sizeof *d);
    port_init(&d->port, &ops);
    d->profile = p;
    d->clk = clk;
}

// --- asking --------------------------------------------------------------------------------------

// Neighbouring reads are asked in turn, as the detector of a profile asks.
struct links_policy {
    const char *name;
    struct profile *profile;
    const char *asks[2], *commands[2]; // exchanges, and what they send
    const char *signals[2];            // values: the first number of the answer
    double scale;                      // of x as the instrument says it
    const char *begin[3];              // exchanges asked before
};

// Whether the command's answer was true at one moment since begun.
static inline bool links_is_true(const char *command, const double v[3], int64_t begun, int64_t now)
{
    const bool has_f = strcmp(command, "READ?") != 0, y_first = strcmp(command, "SNAP?2,9") == 0;
    const bool has_y = strcmp(command, "SNAP?1,9,2") == 0;
    const int64_t tick =
        y_first ? links_when(v[0], begun + LINKS_TURN) - LINKS_TURN : links_when(v[0], begun);
    return tick >= begun && tick <= now && (!has_f || links_is(v[1], links_frequency(tick))) &&
           (!has_y || links_is(v[2], links_y(tick)));
}

static inline bool links_is_within(const double v[3])
{
    return fabs(v[0]) <= 2 && v[1] >= 0 && v[1] <= 102000 && fabs(v[2]) <= 2;
}

// One reading by the session into the tally.
static inline void links_read(struct session *s, const struct links_policy *p, int i,
                              struct clk *clk, struct links_tally *t)
{
    const char *command = p->commands[i % 2];
    const int64_t begun = links_tick(clk_now_ns(clk));
    double v[3] = {0};
    if (session_ask_one(s, p->asks[i % 2], NULL) < 0) {
        t->refused++;
        return;
    }
    t->answered++;
    v[0] = session_number(s, p->signals[i % 2]) / p->scale;
    if (strcmp(command, "READ?") != 0)
        v[1] = session_number(s, "frequency_hz");
    if (strcmp(command, "SNAP?1,9,2") == 0)
        v[2] = session_number(s, "y");
    if (links_is_true(command, v, begun, links_tick(clk_now_ns(clk))))
        return;
    t->wrong++;
    t->beyond += !links_is_within(v);
}

// A line as somebody would read it who trusts the wire.
static inline void links_believe(const char *text, const struct links_policy *p, int i,
                                 int64_t begun, int64_t now, struct links_tally *t)
{
    double v[3] = {0};
    if (sscanf(text, "%lf,%lf,%lf", &v[0], &v[1], &v[2]) < 1) {
        t->refused++;
        return;
    }
    v[0] /= p->scale;
    t->answered++;
    t->wrong += !links_is_true(p->commands[i % 2], v, begun, now);
}

static inline struct profile *links_profile(const char *name)
{
    struct profile *p = malloc(sizeof *p);
    if (!p)
        abort();
    memcpy(p, profiles_get(name), sizeof *p);
    p->framing.quiet_ms = LINKS_QUIET_MS;
    return p;
}

static inline void links_begin_session(struct session *s, const struct links_policy *p)
{
    struct gon_error err = {0};
    for (int i = 0; i < 3 && p->begin[i]; i++)
        if (session_ask_one(s, p->begin[i], &err) < 0) {
            fprintf(stderr, "check_links: %s\n", err.text);
            exit(1);
        }
}
