// SPDX-License-Identifier: MIT
// drivers/session.h and drivers/message.h on a bad serial line, asked as the SR830's profile asks:
// as it is, with a checksum, and by a device that repeats its command; and as the Keithley 6485's,
// which has one question only and a time stamp in its answers.
//
// A line without a checksum cannot show that a number lost a byte, or that one became another
// digit, a sign or a blank, or was added to it. Those are left out there, all other bytes are not;
// what they do is measured on its own.
#pragma once
#include "drivers/message.h"
#include "tests/slow/links_text.h"

#define LINKS_OF_NUMBERS "0123456789+-.eE"
#define LINKS_BESIDE_NUMBERS LINKS_OF_NUMBERS " \t\r\n"
#define LINKS_ALL_FAULTS ((1u << NOISY_ALL) - 1)

struct links_serial {
    struct links_policy policy;
    unsigned faults; // bits of noisy_fault
    const char *garbage_lacks, *changed_lacks;
};

static inline struct links_serial links_plain(void)
{
    return (struct links_serial){
        .policy = {.name = "serial, two forms",
                   .profile = links_profile("sr830"),
                   .asks = {"snap_wide", "snap"},
                   .commands = {"SNAP?1,9,2", "SNAP?1,9"},
                   .signals = {"x", "x"},
                   .scale = 1,
                   .begin = {"sync", "range"}},
        .faults = LINKS_ALL_FAULTS - (1u << NOISY_HEADLESS),
        .garbage_lacks = LINKS_OF_NUMBERS,
        .changed_lacks = LINKS_BESIDE_NUMBERS,
    };
}

static inline struct links_serial links_stamped(void)
{
    struct links_serial s = links_plain();
    free(s.policy.profile);
    s.policy = (struct links_policy){.name = "serial, time stamp",
                                     .profile = links_profile("keithley-6485"),
                                     .asks = {"read", "read"},
                                     .commands = {"READ?", "READ?"},
                                     .signals = {"current_a", "current_a"},
                                     .scale = 1e-3,
                                     .begin = {"sync"}};
    return s;
}

static inline struct links_serial links_summed(void)
{
    struct links_serial s = links_plain();
    s.policy.name = "serial, checksum";
    s.policy.profile->checksum = (struct profile_checksum){
        .kind = PROFILE_CRC, .width = 16, .polynomial = 0x1021, .initial = 0xffff, .before = "*"};
    s.faults = LINKS_ALL_FAULTS;
    s.garbage_lacks = s.changed_lacks = NULL;
    return s;
}

// Both questions have answers of one form: only the echo tells whose they are.
static inline struct links_serial links_echoed(void)
{
    struct links_serial s = links_plain();
    struct profile *p = s.policy.profile;
    struct profile_exchange *wide = &p->exchanges[profile_exchange(p, "snap_wide")];
    s.policy.name = "serial, echo";
    s.policy.commands[0] = "SNAP?2,9";
    s.policy.signals[0] = "y";
    snprintf(wide->send, sizeof wide->send, "SNAP?2,9");
    snprintf(wide->answer, sizeof wide->answer, "{y},{frequency_hz}");
    *wide->believe = 0;
    strcpy(p->framing.echo_end, "\r");
    strcpy(p->framing.end_in, "\r> ");
    s.faults = LINKS_ALL_FAULTS;
    s.garbage_lacks = NULL;
    return s;
}

// One question alone: a double that comes after the next question is the answer to that.
static inline struct links_serial links_alike(void)
{
    struct links_serial s = links_plain();
    s.policy.asks[0] = s.policy.asks[1];
    s.policy.commands[0] = s.policy.commands[1];
    return s;
}

// What is left out elsewhere.
static inline struct links_serial links_digits(void)
{
    struct links_serial s = links_plain();
    s.policy.name = "serial, digits changed";
    s.faults = 1u << NOISY_CHANGED | 1u << NOISY_HEADLESS | 1u << NOISY_BEFORE;
    s.garbage_lacks = s.changed_lacks = NULL;
    return s;
}

static inline void links_set_faults(const struct links_serial *s)
{
    links_line.garbage_lacks = s->garbage_lacks;
    links_line.changed_lacks = s->changed_lacks;
}

static inline struct links_tally links_measure_serial(const struct links_serial *s, int reads,
                                                      int seed)
{
    struct links_tally t = {0};
    struct links_device device;
    struct session *session;
    struct gon_error err;
    links_device_init(&device, s->policy.profile, &vline.clk);
    struct clk *clk = links_begin(&device.port, false, s->faults, seed);
    links_set_faults(s);
    const unsigned one_in = links_line.one_in;
    links_line.one_in = 0;
    if (session_open(s->policy.profile, vline.link, clk, NULL, &session, &err) < 0) {
        fprintf(stderr, "check_links: %s\n", err.text);
        exit(1);
    }
    links_begin_session(session, &s->policy);
    links_line.one_in = one_in;
    for (int i = 0; i < reads; i++)
        links_read(session, &s->policy, i, clk, &t);
    session_free(session);
    links_finish(&t, reads);
    return t;
}

// Writes, and takes the line that comes next; its checksum and its echo are looked at.
static inline struct links_tally links_measure_bare_serial(const struct links_serial *s, int reads,
                                                           int seed)
{
    const struct profile *p = s->policy.profile;
    struct links_tally t = {0};
    struct links_device device;
    struct transport *wire;
    char in[4096];
    size_t have = 0;
    links_device_init(&device, p, &vline.clk);
    struct clk *clk = links_begin(&device.port, false, s->faults, seed);
    links_set_faults(s);
    if (transport_open(vline.link, clk, NULL, &wire, NULL) < 0)
        exit(1);
    for (int i = 0; i < reads; i++) {
        const char *command = s->policy.commands[i % 2];
        char out[64], *end;
        const int64_t begun_ns = clk_now_ns(clk);
        size_t size = (size_t)snprintf(out, sizeof out, "%s", command);
        checksum_append(&p->checksum, out, size, sizeof out - 2, &size, NULL);
        out[size++] = '\r';
        transport_write(wire, out, size, begun_ns + CLK_MS(100), NULL);
        const size_t length = strlen(p->framing.end_in);
        while (!(end = memmem(in, have, p->framing.end_in, length))) {
            const int rc = have < sizeof in ? transport_read(wire, in + have, sizeof in - have,
                                                             begun_ns + CLK_MS(300), NULL)
                                            : -1;
            if (rc < 0)
                break;
            have += (size_t)rc;
        }
        if (!end) {
            have = 0;
            t.refused++;
            continue;
        }
        *end = 0;
        const char *answer = in;
        if (*p->framing.echo_end && (answer = strchr(in, '\r')))
            answer++;
        if (!answer || checksum_take(&p->checksum, in, (size_t)(end - in), &size, NULL) < 0)
            t.refused++;
        else
            links_believe(answer, &s->policy, i, links_tick(begun_ns), links_tick(clk_now_ns(clk)),
                          &t);
        have -= (size_t)(end - in) + length;
        memmove(in, end + length, have);
    }
    transport_close(wire);
    links_finish(&t, reads);
    return t;
}
