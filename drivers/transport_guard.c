// SPDX-License-Identifier: MIT
// The kind of link that a guard process holds: whole commands to it, what the laser says from it.
#include "drivers/guard_link.h"
#include "drivers/transport_kind.h"
#include "drivers/transport_port.h"

#include <poll.h>

#define ANSWER_NS CLK_MS(500) // for the guard, beside the time for the laser

static int guard_open(struct transport *t, struct gon_error *err)
{
    t->shut = false;
    int rc = guard_link_open(t->guard, err);
    t->shut = rc < 0;
    return rc;
}

static void guard_shut(struct transport *t)
{
    t->shut = true; // the guard keeps the port
}

static void guard_free(struct transport *t)
{
    (void)t; // whoever made the link frees it
}

// After each call to the guard; the error's text is there already.
static int settle(struct transport *t, int rc)
{
    if (rc == GON_E_GONE) {
        t->stats.errors[LINK_HUNG_UP] += !t->shut;
        t->shut = true;
    }
    return rc;
}

static int need(const struct transport *t, struct gon_error *err)
{
    return t->shut ? gon_fail(err, GON_E_GONE, "%s: not open since it hung up", t->text) : 0;
}

static int64_t left_ns(const struct transport *t, int64_t deadline_ns)
{
    const int64_t left = deadline_ns - clk_now_ns(t->clk);
    return left > 0 ? left : 0;
}

static int guard_write(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                       struct gon_error *err)
{
    if (size > GUARD_DATA)
        return gon_fail(err, GON_E_INPUT, "%s: %zu bytes are more than the guard lets pass",
                        t->text, size);
    int rc = need(t, err);
    clk_sleep_until(t->clk, guard_link_ready_ns(t->guard), NULL);
    if (rc == 0)
        rc = guard_link_call(t->guard, 'D', data, size, left_ns(t, deadline_ns) + ANSWER_NS, err);
    if (rc == 0)
        t->stats.bytes_out += size;
    return settle(t, rc);
}

// Bytes of a stream come by themselves.
static int await(struct transport *t, int64_t deadline_ns, struct gon_error *err)
{
    struct gon_error why;
    const int rc = transport_slice(guard_link_fd(t->guard), POLLIN, deadline_ns, t->clk, t->cancel);
    if (rc == GON_E_CANCELED)
        return gon_fail(err, rc, "%s: stopped while waiting", t->text);
    if (guard_link_watch(t->guard, &why) == GON_E_DEVICE)
        return settle(t, gon_fail(err, GON_E_GONE, "%s", why.text));
    return 0;
}

static int guard_read(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                      struct gon_error *err)
{
    size_t n;
    int rc = need(t, err);
    while (rc == 0 && (n = guard_link_take(t->guard, data, size)) == 0) {
        const int64_t wait_ns = left_ns(t, deadline_ns);
        transport_take_turn(t);
        if (transport_framed(t))
            rc = guard_link_call(t->guard, 'A', &wait_ns, sizeof wait_ns, wait_ns + ANSWER_NS, err);
        else if (wait_ns == 0)
            rc = gon_fail(err, GON_E_LINK, "%s: nothing came in time", t->text);
        else
            rc = await(t, deadline_ns, err);
    }
    if (rc < 0)
        return settle(t, rc);
    t->ended = transport_framed(t) && guard_link_ended(t->guard);
    t->stats.bytes_in += n;
    return (int)n;
}

static int guard_drain(struct transport *t, int64_t quiet_ns, struct gon_error *err)
{
    char waste[256];
    const int64_t give_up_ns = clk_now_ns(t->clk) + quiet_ns + TRANSPORT_BABBLE_NS;
    int rc = need(t, err), dropped = 0;
    if (rc == 0 && transport_framed(t))
        return settle(t, guard_link_call(t->guard, 'C', &quiet_ns, sizeof quiet_ns,
                                         quiet_ns + TRANSPORT_BABBLE_NS + CLK_S(5), err));
    for (int64_t quiet_since_ns = clk_now_ns(t->clk); rc == 0;) {
        const size_t n = guard_link_take(t->guard, waste, sizeof waste);
        const int64_t now_ns = clk_now_ns(t->clk);
        dropped += (int)n;
        t->stats.bytes_in += n;
        if (n > 0)
            quiet_since_ns = now_ns;
        else if (now_ns >= quiet_since_ns + quiet_ns)
            return dropped;
        else
            rc = await(t, quiet_since_ns + quiet_ns, err);
        if (now_ns >= give_up_ns)
            return gon_fail(err, GON_E_LINK, "%s: does not stop sending (%d bytes dropped)",
                            t->text, dropped);
    }
    return rc;
}

static const struct transport_ops transport_guard_ops = {guard_open,  guard_shut, guard_free,
                                                         guard_write, guard_read, guard_drain};

int transport_open_guarded(struct guard_link *g, const char *link, struct clk *clk,
                           struct transport **ret_transport, struct gon_error *err)
{
    struct link parsed;
    int rc = link_parse(link, LINK_TEXT, &parsed, err);
    struct transport *t = rc == 0 ? transport_new(&parsed, link, clk, NULL) : NULL;
    if (!t)
        return rc < 0 ? rc : gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    t->guard = g;
    t->ops = &transport_guard_ops;
    return transport_finish(t, 0, ret_transport, err);
}
