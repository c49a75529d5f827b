// SPDX-License-Identifier: MIT
// uses: drivers base
// Asks over a link what comes on standard input: linkask LINK [cr]. Commands and answers end with a
// line feed, or with cr. Each line is one of
//
//   ask COMMAND       "ok ANSWER" or "error CODE TEXT"; then the milliseconds that it took
//   send COMMAND      no answer is expected
//   bytes COMMAND     "ok N CRC": the length and the CRC-32C of an answer of any length
//   stop MS COMMAND   as ask, cancelled after that time
//   reopen            one try
//   turns             "ok MS": the longest time so far without a turn of the clock
#include "base/crc32c.h"
#include "drivers/message.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

static struct cancel *stop; // for the signal handler

static void on_alarm(int number)
{
    (void)number;
    cancel_request(stop);
}

#define TIMEOUT_NS CLK_MS(500)

static struct message_format format_of(const char *end)
{
    return (struct message_format){.end_out = end,
                                   .end_in = end,
                                   .timeout_ns = TIMEOUT_NS,
                                   .quiet_ns = CLK_MS(100),
                                   .sync_query = "*IDN?",
                                   .sync_begins = ""};
}

// The system's clock, which notices how long it was not given its turn.
struct clock {
    struct clk clk; // first
    int64_t turn_ns, longest_ns;
};

static int64_t clock_now_ns(const struct clk *clk)
{
    (void)clk;
    return clk_now_ns(clk_system());
}

static int64_t clock_utc_ns(const struct clk *clk)
{
    (void)clk;
    return clk_utc_ns(clk_system());
}

static void clock_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    struct clock *c = (struct clock *)clk;
    const int64_t silent_ns = clock_now_ns(clk) - c->turn_ns;
    c->longest_ns = silent_ns > c->longest_ns ? silent_ns : c->longest_ns;
    clk_sleep_until(clk_system(), t_ns, cancel);
    c->turn_ns = clock_now_ns(clk);
}

static void say(int rc, const struct gon_error *err, const char *answer, int64_t begun_ns)
{
    const double ms = (double)(clk_now_ns(clk_system()) - begun_ns) * 1e-6;
    if (rc < 0)
        printf("error %s %s (%.1f ms)\n", gon_code_name(err->code), err->text, ms);
    else
        printf("ok %s (%.1f ms)\n", answer, ms);
    fflush(stdout);
}

static int ask_bytes(struct message *m, const char *command, char *answer, size_t size,
                     struct gon_error *err)
{
    static char bytes[65536];
    struct transport *t = message_transport(m);
    const int64_t deadline_ns = clk_now_ns(clk_system()) + TIMEOUT_NS;
    size_t have = 0;
    int rc = message_send(m, command, err);
    while (rc >= 0 && !transport_ended(t) && have < sizeof bytes) {
        rc = transport_read(t, bytes + have, sizeof bytes - have, deadline_ns, err);
        have += rc > 0 ? (size_t)rc : 0;
    }
    snprintf(answer, size, "%zu %08x", have, crc32c(0, bytes, have));
    return rc;
}

static int ask_and_stop(struct message *m, const char *text, char *answer, size_t size,
                        struct gon_error *err)
{
    char *command;
    const long ms = strtol(text, &command, 10);
    const struct itimerval once = {{0, 0}, {ms / 1000, ms % 1000 * 1000}};
    setitimer(ITIMER_REAL, &once, NULL);
    const int rc = message_query(m, command + 1, answer, size, err);
    cancel_reset(stop);
    return rc;
}

static void obey(struct message *m, struct clock *c, const char *line)
{
    struct gon_error err = {0};
    char answer[400] = "";
    const int64_t begun_ns = clk_now_ns(clk_system());
    int rc = 0;
    if (strcmp(line, "turns") != 0)
        c->turn_ns = begun_ns; // waiting for this line is none of the link's
    if (strncmp(line, "ask ", 4) == 0)
        rc = message_query(m, line + 4, answer, sizeof answer, &err);
    else if (strncmp(line, "send ", 5) == 0)
        rc = message_send(m, line + 5, &err);
    else if (strncmp(line, "bytes ", 6) == 0)
        rc = ask_bytes(m, line + 6, answer, sizeof answer, &err);
    else if (strncmp(line, "stop ", 5) == 0)
        rc = ask_and_stop(m, line + 5, answer, sizeof answer, &err);
    else if (strcmp(line, "reopen") == 0)
        rc = message_reopen(m, &err);
    else if (strcmp(line, "turns") == 0)
        snprintf(answer, sizeof answer, "%.1f", (double)c->longest_ns * 1e-6);
    else
        rc = gon_fail(&err, GON_E_INPUT, "'%s' is not understood", line);
    say(rc, &err, answer, begun_ns);
}

int main(int argc, char **argv)
{
    struct gon_error err;
    struct transport *t;
    char line[300];
    static const struct clk_ops ops = {clock_now_ns, clock_utc_ns, clock_sleep_until};
    const int64_t begun_ns = clk_now_ns(clk_system());
    struct clock c = {{&ops}, begun_ns, 0};
    if (argc < 2 || argc > 3 || (argc == 3 && strcmp(argv[2], "cr") != 0)) {
        fprintf(stderr, "usage: linkask LINK [cr]\n");
        return 2;
    }
    stop = cancel_new();
    signal(SIGALRM, on_alarm);
    int rc = transport_open(argv[1], &c.clk, stop, &t, &err);
    say(rc, &err, "open", begun_ns);
    if (rc < 0)
        return 1;
    const struct message_format format = format_of(argc == 3 ? "\r" : "\n");
    struct message *m = message_new(t, &format);
    while (m && fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        obey(m, &c, line);
    }
    message_free(m);
    cancel_free(stop);
    return 0;
}
