// SPDX-License-Identifier: MIT
// uses: drivers base
// Asks over a link what comes on standard input: linkask LINK [cr | GUARD]. Commands and answers end
// with a line feed, or with cr. With GUARD, the program gonio-guard, that holds the device: "off" of
// it is the wavelength 1234 nm, light any other. Each line is one of
//
//   ask COMMAND       "ok ANSWER" or "error CODE TEXT"; then the milliseconds that it took
//   send COMMAND      no answer is expected
//   bytes COMMAND     "ok N CRC": the length and the CRC-32C of an answer of any length
//   stop MS COMMAND   as ask, cancelled after that time
//   reopen            one try
//   off               GUARD: until it was read back
//   renew             GUARD: the lease
//   turns             "ok MS": the longest time so far without a turn of the clock
#include "base/crc32c.h"
#include "drivers/guard_link.h"
#include "drivers/message.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <spawn.h>
#include <sys/socket.h>
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

// --- a guard -------------------------------------------------------------------------------------

struct guarded {
    const char *program;
    int fd;
    struct guard_link *link; // NULL: none
};

extern char **environ;

static int start_guard(void *ctx, struct gon_error *err)
{
    struct guarded *g = ctx;
    char *argv[] = {(char *)g->program, (char *)"3", (char *)"guard.sock", NULL};
    posix_spawn_file_actions_t actions;
    pid_t pid;
    int ends[2];
    socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 3);
    int rc = posix_spawn(&pid, g->program, &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (rc)
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", g->program, strerror(rc));
    return g->fd = ends[0];
}

static struct guard_bytes bytes_of(const char *text)
{
    struct guard_bytes b = {.size = (uint8_t)strlen(text)};
    memcpy(b.at, text, b.size);
    return b;
}

static int open_guarded(struct guarded *g, const char *link, struct clk *clk,
                        struct transport **ret_transport, struct gon_error *err)
{
    struct guard_record r = {.framed = true,
                             .end_out = bytes_of("\n"),
                             .end_in = bytes_of("\n"),
                             .timeout_ns = CLK_MS(500),
                             .quiet_ns = CLK_MS(100),
                             .reopen_ns = CLK_MS(200),
                             .offs = 1,
                             .ons = 1,
                             .asks = 1,
                             .off = {bytes_of("SENS:CORR:WAV 1234\n")},
                             .on = {bytes_of("SENS:CORR:WAV ")},
                             .ask = {{bytes_of("SENS:CORR:WAV?\n"), "^1\\.2340E\\+03$"}}};
    snprintf(r.link, sizeof r.link, "%s", link);
    g->link = guard_link_new(&(struct guard_host){.connect = start_guard, .ctx = g}, &r, clk);
    return transport_open_guarded(g->link, link, clk, ret_transport, err);
}

static void obey(struct message *m, struct guard_link *g, struct clock *c, const char *line)
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
    else if (g && strcmp(line, "off") == 0)
        rc = guard_link_off(g, begun_ns + CLK_S(2), &err);
    else if (g && strcmp(line, "renew") == 0)
        guard_link_renew(g);
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
    const bool cr = argc == 3 && !strcmp(argv[2], "cr");
    struct guarded guarded = {.program = argc == 3 && !cr ? argv[2] : NULL};
    if (argc != 2 && argc != 3) {
        fprintf(stderr, "usage: linkask LINK [cr | GUARD]\n");
        return 2;
    }
    stop = cancel_new();
    signal(SIGALRM, on_alarm);
    int rc = guarded.program ? open_guarded(&guarded, argv[1], &c.clk, &t, &err)
                             : transport_open(argv[1], &c.clk, stop, &t, &err);
    say(rc, &err, "open", begun_ns);
    if (rc < 0)
        return 1;
    const struct message_format format = format_of(cr ? "\r" : "\n");
    struct message *m = message_new(t, &format);
    while (m && fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        obey(m, guarded.link, &c, line);
    }
    message_free(m);
    guard_link_free(guarded.link);
    cancel_free(stop);
    return 0;
}
