// SPDX-License-Identifier: MIT
// The kind of link that is a USB device: usbtmc_host over a struct usb_io.
#include "drivers/transport_kind.h"
#include "drivers/usbtmc_host.h"

#include <stdlib.h>

#define START_NS CLK_S(2)

struct usb_link {
    struct usb_io *io;
    bool open;
    struct usbtmc_host host;
};

int transport_usbtmc_attach(struct transport *t, struct usb_io *io, struct gon_error *err)
{
    struct usb_link *u = io ? calloc(1, sizeof *u) : NULL;
    if (!u) {
        if (io)
            io->ops->free(io);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", t->text);
    }
    u->io = io;
    usbtmc_host_init(&u->host, io, t->clk, t->text);
    t->usb = u;
    t->ops = &transport_usbtmc_ops;
    return 0;
}

static void usb_shut(struct transport *t)
{
    t->usb->io->ops->shut(t->usb->io);
    t->usb->open = false;
}

static void usb_free(struct transport *t)
{
    t->usb->io->ops->free(t->usb->io);
    free(t->usb);
}

static int usb_open(struct transport *t, struct gon_error *err)
{
    struct usb_link *u = t->usb;
    struct usb_shape shape;
    u->io->cancel = t->cancel;
    int rc = u->io->ops->open(u->io, &shape, err);
    if (rc == 0)
        rc = usbtmc_host_start(&u->host, &shape, clk_now_ns(t->clk) + START_NS, err);
    u->open = rc == 0;
    if (rc < 0)
        usb_shut(t);
    return rc;
}

// Before each call: the token of the moment, the clock's turn, and whether there is a device.
static int prepare(struct transport *t, struct gon_error *err)
{
    if (!t->usb->open)
        return gon_fail(err, GON_E_GONE, "%s: not open since it hung up", t->text);
    t->usb->io->cancel = t->cancel;
    transport_take_turn(t);
    return 0;
}

// After each call: who is gone is let go.
static int settle(struct transport *t, int rc)
{
    if (rc == GON_E_GONE)
        usb_shut(t);
    return rc;
}

static int usb_write(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                     struct gon_error *err)
{
    int rc = prepare(t, err);
    if (rc == 0)
        rc = settle(t, usbtmc_host_write(&t->usb->host, data, size, deadline_ns, err));
    if (rc == 0)
        t->stats.bytes_out += size;
    return rc;
}

static int usb_read(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                    struct gon_error *err)
{
    int rc = prepare(t, err);
    if (rc == 0)
        rc = settle(t, usbtmc_host_read(&t->usb->host, data, size, deadline_ns, err));
    if (rc >= 0) {
        t->stats.bytes_in += (size_t)rc;
        t->ended = t->usb->host.ended;
    }
    return rc;
}

static int usb_drain(struct transport *t, int64_t quiet_ns, struct gon_error *err)
{
    int rc = prepare(t, err);
    const int64_t deadline_ns = clk_now_ns(t->clk) + quiet_ns + TRANSPORT_BABBLE_NS;
    if (rc == 0)
        rc = settle(t, usbtmc_host_drain(&t->usb->host, quiet_ns > 0, deadline_ns, err));
    if (rc > 0)
        t->stats.bytes_in += (size_t)rc;
    return rc;
}

const struct transport_ops transport_usbtmc_ops = {usb_open,  usb_shut, usb_free,
                                                   usb_write, usb_read, usb_drain};
