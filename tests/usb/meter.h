// SPDX-License-Identifier: MIT
// A power meter in lines of text, just enough to be asked over any wire. Each MEAS:POW? gives
// another value, and tells which: an answer to the question before is seen.
#pragma once
#include "sim/line.h"
#include "sim/port.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define METER_IDENTITY "Thorlabs,PM100USB,P0000001,1.4.0"
enum { METER_LONGEST = 8000 };

struct meter {
    struct port port; // first
    struct sim_line line;
    int64_t latency_ns;
    unsigned measured; // values given
    unsigned errors;   // in its queue
    double wavelength_nm;
};

// The value that the nth question gets, counted from 1; and back.
static inline double meter_value_w(unsigned n)
{
    return 1e-3 + n * 1e-9;
}

static inline unsigned meter_question(double value_w)
{
    return (unsigned)((value_w - 1e-3) * 1e9 + 0.5);
}

static inline void meter_say(struct meter *m, const char *text, int64_t t_ns)
{
    const size_t size = strlen(text);
    for (size_t at = 0; at < size; at += PORT_REPLY_MOST) {
        const size_t rest = size - at;
        port_send(&m->port, text + at, rest < PORT_REPLY_MOST ? rest : PORT_REPLY_MOST,
                  t_ns + m->latency_ns);
    }
}

// "LONG? 5000": that many bytes with the line's end, the alphabet over and over.
static inline void meter_say_long(struct meter *m, size_t size, int64_t t_ns)
{
    char text[METER_LONGEST + 1];
    size = size < 1 ? 1 : size > METER_LONGEST ? METER_LONGEST : size;
    for (size_t i = 0; i < size; i++)
        text[i] = (char)('a' + i % 26);
    text[size - 1] = '\n';
    text[size] = 0;
    meter_say(m, text, t_ns);
}

static inline void meter_hear(struct meter *m, const char *line, int64_t t_ns)
{
    char text[80] = "";
    if (strcmp(line, "*IDN?") == 0) {
        snprintf(text, sizeof text, METER_IDENTITY "\n");
    } else if (strcmp(line, "MEAS:POW?") == 0) {
        snprintf(text, sizeof text, "%.9E\n", meter_value_w(++m->measured));
    } else if (strcmp(line, "SENS:CORR:WAV?") == 0) {
        snprintf(text, sizeof text, "%.4E\n", m->wavelength_nm);
    } else if (strncmp(line, "SENS:CORR:WAV ", 14) == 0) {
        m->wavelength_nm = strtod(line + 14, NULL);
    } else if (strcmp(line, "SYST:ERR?") == 0) {
        snprintf(text, sizeof text, m->errors ? "-113,\"Undefined header\"\n" : "0,\"No error\"\n");
        m->errors -= m->errors > 0;
    } else if (strncmp(line, "LONG? ", 6) == 0) {
        meter_say_long(m, strtoul(line + 6, NULL, 10), t_ns);
    } else {
        m->errors++;
    }
    if (text[0])
        meter_say(m, text, t_ns);
}

static inline void meter_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct meter *m = (struct meter *)p;
    for (size_t i = 0; i < size; i++)
        if (bytes[i] != '\r' && sim_line_add(&m->line, bytes[i], "\n"))
            meter_hear(m, m->line.text, t_ns);
}

static inline void meter_tick(struct port *p, int64_t t_ns)
{
    (void)p;
    (void)t_ns;
}

static inline void meter_hangup(struct port *p)
{
    sim_line_clear(&((struct meter *)p)->line);
}

static inline void meter_init(struct meter *m)
{
    static const struct port_ops ops = {meter_feed, meter_tick, meter_hangup};
    memset(m, 0, sizeof *m);
    port_init(&m->port, &ops);
    m->latency_ns = 3000000; // about the time of one sample
    m->wavelength_nm = 1064;
}
