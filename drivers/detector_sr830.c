// SPDX-License-Identifier: MIT
// SRS SR830 over RS-232 (manual pages 5-2 ff.: commands end with CR, answers with CR, one a query).
#include "drivers/detector.h"

#include "drivers/message.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MODEL "Stanford_Research_Systems,SR830"
#define CLIPPED 0.95    // of full scale and above: counts as saturated
#define IMPOSSIBLE 1.5  // outputs end at 1.09 of full scale: not an answer to this range
#define FREQUENCY_MOST_HZ 102000.0
#define AUX_MOST_V 10.5

static const double full_scale_v[] = {2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 2e-7, 5e-7, 1e-6,
                                      2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3,
                                      2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1,  0.2,  0.5,  1.0}; // SENS
static const double time_constant_s[] = {1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2,
                                         3e-2, 0.1,  0.3,  1.0,  3.0,  10,   30,
                                         100,  300,  1e3,  3e3,  1e4,  3e4}; // OFLT
enum { RANGES = sizeof full_scale_v / sizeof full_scale_v[0] };
enum { CONSTANTS = sizeof time_constant_s / sizeof time_constant_s[0] };

// LIAS?: b0 input or reserve, b1 filter, b2 output, b3 reference unlocked, b4 its range, b5 time
// constant.
enum { LIAS_OVERLOAD = 0x07, LIAS_UNLOCKED = 0x08, LIAS_CHANGED = 0x30 };
// *ESR?: b4 bad parameter, b5 illegal command, b7 power on.
enum { ESR_REFUSED = 0x30, ESR_POWER_ON = 0x80 };

// OUTX 0 sends answers to RS-232 whatever was chosen before, also after the device restarted.
#define IDENTIFY "OUTX 0;*IDN?"

static const struct message_format format = {
    .end_out = "\r",
    .end_in = "\r",
    .min_gap_ns = 0,
    .timeout_ns = CLK_MS(300), // 20 ms to answer and 70 characters at 9600 baud
    .quiet_ns = CLK_MS(350),
    .sync_query = IDENTIFY,
    .sync_begins = MODEL,
};

struct sr830 {
    struct detector detector; // first
    struct message *m;
    int range; // as it was set; -1: not known
    int aux;   // of the monitor; 0: none
    bool wide; // the last sample asked for one number more
    bool clipped;   // a sample since the last condition was
    bool restarted; // since the last setup
};

static struct sr830 *sr_of(struct detector *d)
{
    return (struct sr830 *)d;
}

// --- settings ------------------------------------------------------------------------------------

static int ask_int(struct sr830 *z, const char *query, int most, int *ret_value,
                   struct gon_error *err)
{
    double value = (double)NAN;
    int rc = message_ask_number(z->m, query, &value, err);
    if (rc < 0)
        return rc;
    if (value != floor(value) || value < 0 || value > most) {
        message_out_of_step(z->m, "not in the list");
        return gon_fail(err, GON_E_LINK, "%s: '%s' was answered %g; possible: 0..%d",
                        transport_link(message_transport(z->m)), query, value, most);
    }
    *ret_value = (int)value;
    return 0;
}

// Reading them clears them, so a restart is remembered.
static int ask_events(struct sr830 *z, int *ret_events, struct gon_error *err)
{
    int rc = ask_int(z, "*ESR?", 255, ret_events, err);
    if (rc == 0 && *ret_events & ESR_POWER_ON)
        z->restarted = true;
    return rc;
}

// Sends, reads back and compares; an illegal command would answer nothing, and is named by *ESR?.
static int set(struct sr830 *z, const char *name, int value, int most, struct gon_error *err)
{
    char command[32];
    int now, events;
    snprintf(command, sizeof command, "%s %d;%s?", name, value, name);
    int rc = ask_int(z, command, most, &now, err);
    if (rc == 0)
        rc = ask_events(z, &events, err);
    if (rc < 0)
        return rc;
    if (now != value || (events & ESR_REFUSED)) {
        message_refused(z->m);
        return gon_fail(err, GON_E_DEVICE, "%s: refuses %s %d (it reads back %d, *ESR? is %d)",
                        transport_link(message_transport(z->m)), name, value, now, events);
    }
    return 0;
}

static int identify(struct detector *d, char *ret_text, size_t size, struct gon_error *err)
{
    struct sr830 *z = sr_of(d);
    char text[120];
    int rc = message_ask_text(z->m, IDENTIFY, text, sizeof text, err);
    if (rc < 0)
        return rc;
    if (strncmp(text, MODEL, strlen(MODEL)) != 0)
        return gon_fail(err, GON_E_DEVICE, "%s: is '%s', not an SR830",
                        transport_link(message_transport(z->m)), text);
    snprintf(ret_text, size, "%s", text);
    return 0;
}

static int setup(struct detector *d, const struct detector_setup *s, double *ret_time_constant_s,
                 struct gon_error *err)
{
    struct sr830 *z = sr_of(d);
    int i = 0;
    while (i < CONSTANTS && time_constant_s[i] < s->time_constant_s * (1 - 1e-9))
        i++;
    if (!(s->time_constant_s > 0) || i == CONSTANTS || s->slope_db % 6 || s->slope_db < 6 ||
        s->slope_db > 24 || s->monitor_aux < 0 || s->monitor_aux > 4)
        return gon_fail(
            err, GON_E_INPUT,
            "SR830: time constant %g s, slope %d dB, monitor input %d; allowed: up to 30000 s; "
            "6, 12, 18, 24 dB; 1..4 or 0 for none",
            s->time_constant_s, s->slope_db, s->monitor_aux);
    int rc = message_send(z->m, "*CLS", err);
    if (rc == 0)
        rc = set(z, "OFLT", i, CONSTANTS - 1, err);
    if (rc == 0)
        rc = set(z, "OFSL", s->slope_db / 6 - 1, 3, err);
    if (rc == 0 && z->range < 0)
        rc = ask_int(z, "SENS?", RANGES - 1, &z->range, err);
    if (rc < 0)
        return rc;
    z->aux = s->monitor_aux;
    z->restarted = z->clipped = false;
    *ret_time_constant_s = time_constant_s[i];
    return 0;
}

static int ranges(struct detector *d)
{
    (void)d;
    return RANGES;
}

static double full_scale(struct detector *d, int range)
{
    (void)d;
    assert(range >= 0 && range < RANGES);
    return full_scale_v[range];
}

static int set_range(struct detector *d, int range, struct gon_error *err)
{
    struct sr830 *z = sr_of(d);
    assert(range >= 0 && range < RANGES);
    z->range = -1;
    int rc = set(z, "SENS", range, RANGES - 1, err);
    if (rc == 0)
        z->range = range;
    return rc;
}

// --- readings ------------------------------------------------------------------------------------

// What a SNAP? was asked for, and room for the answer.
struct snap {
    const struct sr830 *z;
    int count;
    double value[4]; // X, frequency, monitor, Y: the last two as far as asked
};

// Exactly count numbers between commas.
static int split(char *text, int count, double *values, struct gon_error *err)
{
    for (int i = 0; i < count; i++) {
        char *comma = strchr(text, ',');
        if ((comma != NULL) != (i < count - 1))
            return gon_fail(err, GON_E_LINK, "not %d numbers", count);
        if (comma)
            *comma = 0;
        int rc = message_number(text, &values[i], err);
        if (rc < 0)
            return rc;
        text = comma + 1;
    }
    return 0;
}

static int read_snap(const char *answer, void *ctx, struct gon_error *err)
{
    struct snap *s = ctx;
    char text[120];
    double value[4];
    snprintf(text, sizeof text, "%s", answer);
    int rc = split(text, s->count, value, err);
    if (rc < 0)
        return rc;
    const double most_v = s->z->range < 0 ? 2.0 : IMPOSSIBLE * full_scale_v[s->z->range];
    if (fabs(value[0]) > most_v || value[1] < 0 || value[1] > FREQUENCY_MOST_HZ ||
        (s->z->aux && fabs(value[2]) > AUX_MOST_V))
        return gon_fail(err, GON_E_LINK, "outside what the device can answer");
    memcpy(s->value, value, sizeof value);
    return 0;
}

static int sample(struct detector *d, struct detector_sample *ret_sample, struct gon_error *err)
{
    struct sr830 *z = sr_of(d);
    static const char *const aux[] = {"", ",5", ",6", ",7", ",8"};
    char command[32];
    struct snap s = {.z = z, .count = 2 + (z->aux > 0) + !z->wide};
    z->wide = !z->wide;
    snprintf(command, sizeof command, "SNAP?1,9%s%s", aux[z->aux], z->wide ? ",2" : "");
    int rc = message_ask(z->m, command, read_snap, &s, err);
    if (rc < 0)
        return rc;
    if (z->range >= 0 && fabs(s.value[0]) >= CLIPPED * full_scale_v[z->range])
        z->clipped = true;
    *ret_sample = (struct detector_sample){
        .signal_v = s.value[0],
        .monitor_v = z->aux ? s.value[2] : (double)NAN,
        .reference_hz = s.value[1],
    };
    return 0;
}

// *CLS would clear the events too, and with them the sign of a restart.
static int clear(struct detector *d, struct gon_error *err)
{
    int lias;
    sr_of(d)->clipped = false;
    return ask_int(sr_of(d), "LIAS?", 255, &lias, err);
}

static int condition(struct detector *d, unsigned *ret_flags, struct gon_error *err)
{
    struct sr830 *z = sr_of(d);
    int lias = 0, events = 0, range = 0;
    int rc = ask_int(z, "LIAS?", 255, &lias, err);
    if (rc == 0)
        rc = ask_events(z, &events, err);
    if (rc == 0)
        rc = ask_int(z, "SENS?", RANGES - 1, &range, err);
    if (rc < 0)
        return rc;
    const bool changed =
        lias & LIAS_CHANGED || z->restarted || (z->range >= 0 && range != z->range);
    *ret_flags = (lias & LIAS_OVERLOAD || z->clipped ? DETECTOR_SATURATED : 0u) |
                 (lias & LIAS_UNLOCKED ? DETECTOR_UNLOCKED : 0u) |
                 (changed ? DETECTOR_UNSETTLED : 0u);
    z->clipped = false;
    return 0;
}

// --- life ----------------------------------------------------------------------------------------

static int sr830_reopen(struct detector *d, struct gon_error *err)
{
    sr_of(d)->range = -1;
    return message_reopen(sr_of(d)->m, err);
}

static const struct link_stats *sr830_stats(const struct detector *d)
{
    return message_stats(((const struct sr830 *)d)->m);
}

static void sr830_free(struct detector *d)
{
    if (!d)
        return;
    message_free(sr_of(d)->m);
    free(d);
}

int detector_sr830_open(const char *link, struct clk *clk, const struct cancel *cancel,
                        struct detector **ret_detector, struct gon_error *err)
{
    static const struct detector_ops ops = {.identify = identify,
                                            .setup = setup,
                                            .ranges = ranges,
                                            .full_scale_v = full_scale,
                                            .set_range = set_range,
                                            .sample = sample,
                                            .clear = clear,
                                            .condition = condition,
                                            .reopen = sr830_reopen,
                                            .stats = sr830_stats,
                                            .free = sr830_free};
    struct transport *t;
    int rc = transport_open(link, clk, cancel, &t, err);
    if (rc < 0)
        return rc;
    struct sr830 *z = calloc(1, sizeof *z);
    struct message *m = z ? message_new(t, &format) : NULL;
    if (!m) {
        if (!z)
            transport_close(t);
        free(z);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    *z = (struct sr830){.detector = {&ops}, .m = m, .range = -1};
    *ret_detector = &z->detector;
    return 0;
}
