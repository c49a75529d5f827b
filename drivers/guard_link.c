// SPDX-License-Identifier: MIT
#include "drivers/guard_link.h"

#include "drivers/transport_port.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define OPEN_NS CLK_S(6) // a port, a connection, a USB device that must be reset
#define RENEW_NS CLK_MS(50)
enum { HEARD = 4096 };

struct guard_link {
    struct guard_host host;
    struct guard_record record;
    struct clk *clk;
    int fd;      // -1: the guard is gone
    bool handed; // the record, to this one
    struct guard_status status;
    bool answered;      // the call that is waited for
    struct guard_no no; // its answer; code 0: done
    uint32_t asked;     // the number of the last X
    int64_t renewed_ns, ready_ns;
    size_t have;
    bool ended;
    char heard[HEARD];
};

struct guard_link *guard_link_new(const struct guard_host *host, const struct guard_record *record,
                                  struct clk *clk)
{
    struct guard_link *g = calloc(1, sizeof *g);
    if (g)
        *g = (struct guard_link){.host = *host, .record = *record, .clk = clk, .fd = -1};
    if (g)
        g->record.brief = host->brief;
    return g;
}

void guard_link_free(struct guard_link *g)
{
    free(g);
}

int64_t guard_link_ready_ns(const struct guard_link *g)
{
    return g->ready_ns;
}

int guard_link_fd(const struct guard_link *g)
{
    return g->fd;
}

// --- hearing -------------------------------------------------------------------------------------

static void hear(struct guard_link *g, const char *bytes, size_t size)
{
    switch (bytes[0]) {
    case 's':
        g->ready_ns = clk_now_ns(g->clk) + g->record.gap_ns; // its last question was answered
        memcpy(&g->status, bytes + 1, size - 1 < sizeof g->status ? size - 1 : sizeof g->status);
        break;
    case 'b':
        g->answered = true;
        g->no.code = 0;
        g->ended = bytes[1];
        size = size - 2 < sizeof g->heard - g->have ? size - 2 : sizeof g->heard - g->have;
        memcpy(g->heard + g->have, bytes + 2, size);
        g->have += size;
        break;
    case 'e':
        memcpy(&g->no, bytes + 1, size - 1 < sizeof g->no ? size - 1 : sizeof g->no);
        g->answered = true;
        break;
    default: // 'd'
        g->no.code = 0;
        g->answered = true;
        break;
    }
}

static void let_go(struct guard_link *g)
{
    g->fd = -1;
    g->have = 0;
}

// All that is there.
static void pump(struct guard_link *g)
{
    char bytes[GUARD_DATA + sizeof(struct guard_no)];
    while (g->fd >= 0) {
        const ssize_t n = recv(g->fd, bytes, sizeof bytes, MSG_DONTWAIT);
        if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR))
            let_go(g);
        if (n <= 0)
            return;
        hear(g, bytes, (size_t)n);
    }
}

size_t guard_link_take(struct guard_link *g, void *bytes, size_t size)
{
    pump(g);
    size = size < g->have ? size : g->have;
    memcpy(bytes, g->heard, size);
    g->have -= size;
    memmove(g->heard, g->heard + size, g->have);
    return size;
}

bool guard_link_ended(const struct guard_link *g)
{
    return g->have == 0 && g->ended;
}

// --- telling -------------------------------------------------------------------------------------

static const char *why_text(const struct guard_link *g)
{
    switch (g->status.why) {
    case GUARD_LEASE:
        return "the guard switched the laser off: goniod had not answered it for 0.5 s";
    case GUARD_STOP: return "the guard switched the laser off: gonio laser off";
    case GUARD_SIGNAL: return "the guard switched the laser off: it was told to end";
    default: return "the guard does not let it pass";
    }
}

static int refused(const struct guard_link *g, struct gon_error *err)
{
    const enum gon_code code = (enum gon_code)g->no.code;
    const char *text = *g->no.text             ? g->no.text
                       : code == GON_E_REFUSED ? why_text(g)
                       : code == GON_E_DEVICE  ? "LASER MAY BE ON: OFF is repeated and does not "
                                                 "help; use its key or the interlock"
                       : code == GON_E_LINK    ? "it is being switched off and does not answer"
                       : code == GON_E_GONE    ? "unplugged"
                                               : "the guard refuses half a command";
    return *g->no.text ? gon_fail(err, code, "%s", text)
                       : gon_fail(err, code, "%s: %s", g->record.link, text);
}

static int gone(struct guard_link *g, struct gon_error *err)
{
    let_go(g);
    return gon_fail(err, GON_E_GONE, "%s: its guard process (gonio-guard) is gone", g->record.link);
}

static int tell(struct guard_link *g, char kind, const void *bytes, size_t size,
                struct gon_error *err)
{
    char message[sizeof(struct guard_record) + 1] = {kind};
    memcpy(message + 1, bytes, size);
    pump(g);
    if (g->fd < 0 || send(g->fd, message, size + 1, MSG_DONTWAIT | MSG_NOSIGNAL) < 0)
        return gone(g, err);
    return 0;
}

// Until something is heard, or the time is up; false then.
static bool wait_until(struct guard_link *g, int64_t until_ns)
{
    const int rc = transport_slice(g->fd, POLLIN, until_ns, g->clk, NULL);
    pump(g);
    return rc > 0 || clk_now_ns(g->clk) < until_ns;
}

// A guard that does not answer is as bad as none: it is replaced.
static int call(struct guard_link *g, char kind, const void *bytes, size_t size, int64_t wait_ns,
                struct gon_error *err)
{
    const int64_t until_ns = clk_now_ns(g->clk) + wait_ns;
    g->answered = false;
    int rc = tell(g, kind, bytes, size, err);
    while (rc == 0 && !g->answered && g->fd >= 0 && wait_until(g, until_ns))
        ;
    if (rc == 0 && !g->answered)
        rc = gone(g, err);
    return rc < 0 ? rc : g->no.code < 0 ? refused(g, err) : 0;
}

int guard_link_call(struct guard_link *g, char kind, const void *bytes, size_t size,
                    int64_t wait_ns, struct gon_error *err)
{
    return call(g, kind, bytes, size, wait_ns, err);
}

int guard_link_open(struct guard_link *g, struct gon_error *err)
{
    pump(g);
    if (g->fd < 0) {
        const int rc = g->host.connect(g->host.ctx, err);
        if (rc < 0)
            return rc;
        g->status = (struct guard_status){.phase = GUARD_EMPTY};
        g->fd = rc;
    }
    g->handed = true;
    g->have = 0;
    return call(g, 'R', &g->record, sizeof g->record, OPEN_NS, err);
}

void guard_link_renew(struct guard_link *g)
{
    const int64_t now_ns = clk_now_ns(g->clk);
    if (now_ns - g->renewed_ns < RENEW_NS)
        return;
    g->renewed_ns = now_ns;
    tell(g, 'L', "", 0, NULL);
}

int guard_link_watch(struct guard_link *g, struct gon_error *err)
{
    pump(g);
    if (g->fd < 0 && g->handed) {
        gone(g, err);
        return gon_fail(err, GON_E_DEVICE, "%s: its guard process (gonio-guard) is gone",
                        g->record.link);
    }
    return g->status.latched ? gon_fail(err, GON_E_REFUSED, "%s", why_text(g)) : 0;
}

// --- off -----------------------------------------------------------------------------------------

static int not_off(const struct guard_link *g, struct gon_error *err)
{
    const char *link = g->record.link;
    switch (g->status.seen) {
    case GUARD_SEEN_NO_PORT:
        return gon_fail(err, GON_E_GONE, "%s: unplugged; its guard tries to open it again", link);
    case GUARD_SEEN_ON:
        return gon_fail(
            err, GON_E_DEVICE,
            "%s: LASER MAY BE ON: told to switch off again and again, it still says that "
            "it emits or starts; use its key or the interlock",
            link);
    default:
        return gon_fail(err, GON_E_LINK, "%s: does not answer; OFF is repeated by its guard", link);
    }
}

int guard_link_off(struct guard_link *g, int64_t until_ns, struct gon_error *err)
{
    pump(g);
    int rc = g->fd < 0 ? guard_link_open(g, err) : 0;
    if (rc < 0)
        return rc;
    g->asked++;
    rc = tell(g, 'X', &g->asked, sizeof g->asked, err);
    while (rc == 0 && g->fd >= 0 && g->status.done != g->asked && wait_until(g, until_ns))
        if (g->status.why == GUARD_ASKED && g->status.seen == GUARD_SEEN_NO_PORT)
            break;
    if (rc == 0 && g->fd < 0)
        rc = gone(g, err);
    return rc < 0 ? rc : g->status.done == g->asked ? 0 : not_off(g, err);
}
