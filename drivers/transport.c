// SPDX-License-Identifier: MIT
#include "drivers/transport.h"

#include "drivers/transport_kind.h"

#include <stdlib.h>
#include <string.h>

struct transport *transport_new(const struct link *link, const char *text, struct clk *clk,
                                const struct cancel *cancel)
{
    struct transport *t = calloc(1, sizeof *t);
    char *copy = strdup(text);
    if (!t || !copy) {
        free(t);
        free(copy);
        return NULL;
    }
    *t = (struct transport){.ops = &transport_stream_ops,
                            .link = *link,
                            .text = copy,
                            .clk = clk,
                            .cancel = cancel,
                            .fd = -1};
    return t;
}

int transport_finish(struct transport *t, int rc, struct transport **ret_transport,
                     struct gon_error *err)
{
    if (rc == 0)
        rc = t->ops->open(t, err);
    if (rc < 0) {
        transport_close(t);
        return rc;
    }
    *ret_transport = t;
    return 0;
}

int transport_open_parsed(const struct link *link, const char *text, struct clk *clk,
                          const struct cancel *cancel, struct transport **ret_transport,
                          struct gon_error *err)
{
    struct transport *t = transport_new(link, text, clk, cancel);
    if (!t)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", text);
    int rc = 0;
    if (link->kind == LINK_USBTMC)
        rc = transport_usbtmc_attach(t, transport_usb_new(&t->link, t->text, clk), err);
    return transport_finish(t, rc, ret_transport, err);
}

int transport_open_usb_io(struct usb_io *io, const char *link, struct clk *clk,
                          const struct cancel *cancel, struct transport **ret_transport,
                          struct gon_error *err)
{
    struct link parsed;
    int rc = link_parse(link, LINK_TEXT, &parsed, err);
    struct transport *t = rc == 0 ? transport_new(&parsed, link, clk, cancel) : NULL;
    if (!t) {
        io->ops->free(io);
        return rc < 0 ? rc : gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    return transport_finish(t, transport_usbtmc_attach(t, io, err), ret_transport, err);
}

int transport_open(const char *link, struct clk *clk, const struct cancel *cancel,
                   struct transport **ret_transport, struct gon_error *err)
{
    struct link parsed;
    int rc = link_parse(link, LINK_TEXT, &parsed, err);
    return rc < 0 ? rc : transport_open_parsed(&parsed, link, clk, cancel, ret_transport, err);
}

void transport_close(struct transport *t)
{
    if (!t)
        return;
    t->ops->shut(t);
    t->ops->free(t);
    free(t->text);
    free(t);
}

int transport_reopen(struct transport *t, struct gon_error *err)
{
    t->ops->shut(t);
    int rc = t->ops->open(t, err);
    t->stats.reopened += rc == 0;
    return rc;
}

int transport_hung_up(struct transport *t, int error, struct gon_error *err)
{
    t->ops->shut(t);
    t->stats.errors[LINK_HUNG_UP]++;
    return gon_fail(err, GON_E_GONE, "%s: %s (%s)", t->text,
                    t->link.kind == LINK_TCP ? "the connection is broken" : "unplugged",
                    error ? strerror(error) : "hung up");
}

void transport_take_turn(struct transport *t)
{
    int64_t now_ns = clk_now_ns(t->clk);
    if (now_ns - t->turn_ns < TRANSPORT_SLICE_NS)
        return;
    t->turn_ns = now_ns;
    clk_sleep_until(t->clk, now_ns, NULL);
}

int transport_write(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                    struct gon_error *err)
{
    const uint64_t before = t->stats.bytes_out;
    t->ended = false;
    int rc = t->ops->write(t, data, size, deadline_ns, err);
    transport_show(t, TAP_SENT, data, (size_t)(t->stats.bytes_out - before));
    return rc;
}

int transport_read(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                   struct gon_error *err)
{
    t->ended = false;
    int rc = t->ops->read(t, data, size, deadline_ns, err);
    if (rc > 0)
        transport_show(t, TAP_RECEIVED, data, (size_t)rc);
    return rc;
}

int transport_drain(struct transport *t, int64_t quiet_ns, struct gon_error *err)
{
    t->ended = false;
    return t->ops->drain(t, quiet_ns, err);
}

bool transport_framed(const struct transport *t)
{
    return t->link.kind == LINK_USBTMC;
}

bool transport_ended(const struct transport *t)
{
    return t->ended;
}

const char *transport_link(const struct transport *t)
{
    return t->text;
}

const struct link_stats *transport_stats(const struct transport *t)
{
    return &t->stats;
}

void transport_tap(struct transport *t, const struct tap *tap)
{
    t->tap = tap;
}

bool transport_tapped(const struct transport *t)
{
    return t->tap != NULL;
}

void transport_show(const struct transport *t, enum tap_way way, const void *bytes, size_t size)
{
    if (t->tap && size > 0)
        t->tap->take(t->tap->ctx, way, bytes, size);
}

int transport_fd(const struct transport *t)
{
    return t->fd;
}

struct clk *transport_clk(const struct transport *t)
{
    return t->clk;
}

const struct cancel *transport_mind(struct transport *t, const struct cancel *cancel)
{
    const struct cancel *before = t->cancel;
    t->cancel = cancel;
    return before;
}

const struct cancel *transport_cancel(const struct transport *t)
{
    return t->cancel;
}

struct link_stats *transport_book(struct transport *t)
{
    return &t->stats;
}
