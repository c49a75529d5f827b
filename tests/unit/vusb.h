// SPDX-License-Identifier: MIT
// A USB device in virtual time: struct usb_io over sim/usbtmc. What the host waits for moves the
// clock, so thousands of timeouts cost nothing, and the same seed gives the same bytes at the same
// times.
#pragma once
#include "drivers/transport_kind.h"
#include "drivers/usbtmc_host.h"
#include "sim/usbtmc.h"

#include <assert.h>
#include <string.h>

struct vusb {
    struct usb_io io; // first
    struct sim_usbtmc device;
    struct clk_virtual clk;
    int64_t unplug_ns, cancel_ns;
    struct cancel *cancel;
    bool absent;        // for open
    bool slow_out;      // takes only the first 8 bytes of a transfer, once
    int64_t turn_ns;    // when the clock had its turn
    int64_t longest_ns; // without one
    unsigned opened, shut, resets;
};

#define VUSB_TRANSFER_NS 125000 // a microframe

static inline struct vusb *vusb_of(struct usb_io *io)
{
    return (struct vusb *)io;
}

static inline void vusb_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    struct vusb *v = (struct vusb *)((char *)clk - offsetof(struct vusb, clk));
    (void)cancel;
    const int64_t silent_ns = v->clk.t_ns - v->turn_ns;
    v->longest_ns = silent_ns > v->longest_ns ? silent_ns : v->longest_ns;
    v->clk.t_ns = t_ns > v->clk.t_ns ? t_ns : v->clk.t_ns;
    v->turn_ns = v->clk.t_ns;
    if (v->cancel && v->clk.t_ns >= v->cancel_ns)
        cancel_request(v->cancel);
}

// After a transfer's time, or until_ns: an outcome, or 0.
static inline int vusb_pass(struct vusb *v, int64_t until_ns)
{
    const int64_t now_ns = v->clk.t_ns;
    int64_t next_ns =
        until_ns < now_ns + TRANSPORT_SLICE_NS ? until_ns : now_ns + TRANSPORT_SLICE_NS;
    next_ns = v->unplug_ns < next_ns ? v->unplug_ns : next_ns;
    if (v->cancel && v->cancel_ns < next_ns)
        next_ns = v->cancel_ns;
    clk_sleep_until(&v->clk.clk, next_ns, NULL);
    if (v->clk.t_ns >= v->unplug_ns)
        return USB_GONE;
    return cancel_requested(v->io.cancel) ? USB_CANCELED : 0;
}

static inline int vusb_open(struct usb_io *io, struct usb_shape *ret_shape, struct gon_error *err)
{
    struct vusb *v = vusb_of(io);
    if (v->absent || v->clk.t_ns >= v->unplug_ns)
        return gon_fail(err, GON_E_GONE, "no such device");
    v->opened++;
    *ret_shape = (struct usb_shape){0, SIM_USB_IN, SIM_USB_OUT, SIM_USB_PACKET, true};
    return 0;
}

static inline void vusb_shut(struct usb_io *io)
{
    vusb_of(io)->shut++;
}

static inline void vusb_free(struct usb_io *io)
{
    (void)io; // the test's
}

static inline int vusb_outcome(int n)
{
    return n == SIM_USB_STALL ? USB_STALLED : n;
}

static inline int vusb_control(struct usb_io *io, const struct usbtmc_setup *s, uint8_t *data,
                               int64_t deadline_ns)
{
    struct vusb *v = vusb_of(io);
    const uint8_t setup[SIM_USB_SETUP] = {s->type,
                                          s->request,
                                          (uint8_t)s->value,
                                          (uint8_t)(s->value >> 8),
                                          (uint8_t)s->index,
                                          (uint8_t)(s->index >> 8),
                                          (uint8_t)s->length,
                                          (uint8_t)(s->length >> 8)};
    (void)deadline_ns;
    const int rc = vusb_pass(v, v->clk.t_ns + VUSB_TRANSFER_NS);
    return rc < 0
               ? rc
               : vusb_outcome(sim_usbtmc_control(&v->device, setup, data, s->length, v->clk.t_ns));
}

static inline int vusb_bulk_out(struct usb_io *io, uint8_t endpoint, const uint8_t *data,
                                size_t size, int64_t deadline_ns)
{
    struct vusb *v = vusb_of(io);
    assert(endpoint == SIM_USB_OUT);
    int rc = vusb_pass(v, v->clk.t_ns + VUSB_TRANSFER_NS);
    if (rc < 0)
        return rc;
    if (v->slow_out) {
        v->slow_out = false;
        size = 8;
        while (rc == 0 && v->clk.t_ns < deadline_ns)
            rc = vusb_pass(v, deadline_ns);
    }
    rc = sim_usbtmc_bulk_out(&v->device, data, size, v->clk.t_ns);
    return vusb_outcome(rc);
}

static inline int vusb_bulk_in(struct usb_io *io, uint8_t endpoint, uint8_t *data, size_t size,
                               int64_t deadline_ns)
{
    struct vusb *v = vusb_of(io);
    assert(endpoint == SIM_USB_IN);
    int rc = vusb_pass(v, v->clk.t_ns + VUSB_TRANSFER_NS);
    while (rc == 0) {
        const int n = sim_usbtmc_bulk_in(&v->device, data, size, v->clk.t_ns);
        if (n != SIM_USB_NAK)
            return vusb_outcome(n);
        if (v->clk.t_ns >= deadline_ns)
            return USB_LATE;
        const int64_t next_ns = sim_usbtmc_next_ns(&v->device);
        rc = vusb_pass(v, next_ns < deadline_ns ? next_ns : deadline_ns);
    }
    return rc;
}

static inline int vusb_clear_halt(struct usb_io *io, uint8_t endpoint)
{
    uint8_t none[1];
    const uint8_t setup[SIM_USB_SETUP] = {0x02, 1, 0, 0, endpoint, 0, 0, 0};
    struct vusb *v = vusb_of(io);
    const int rc = vusb_pass(v, v->clk.t_ns + VUSB_TRANSFER_NS);
    return rc < 0 ? rc : vusb_outcome(sim_usbtmc_control(&v->device, setup, none, 0, v->clk.t_ns));
}

static inline int vusb_reset(struct usb_io *io)
{
    vusb_of(io)->resets++;
    sim_usbtmc_reset(&vusb_of(io)->device);
    return 0;
}

// A device with this text instrument behind it; its clock is &v->clk.clk.
static inline void vusb_init(struct vusb *v, struct port *port)
{
    static const struct usb_io_ops ops = {vusb_open,       vusb_shut,     vusb_free,
                                          vusb_control,    vusb_bulk_out, vusb_bulk_in,
                                          vusb_clear_halt, vusb_reset};
    static const struct sim_usb_identity identity = {0x1313, 0x8072, "Thorlabs", "PM100USB",
                                                     "P0000001"};
    static struct clk_ops clk_ops;
    memset(v, 0, sizeof *v);
    v->io.ops = &ops;
    sim_usbtmc_init(&v->device, port, "\n", &identity);
    struct clk *clk = clk_virtual_init(&v->clk, CLK_S(1), CLK_S(1700000000));
    clk_ops = *clk->ops;
    clk_ops.sleep_until = vusb_sleep_until;
    clk->ops = &clk_ops;
    v->turn_ns = v->clk.t_ns;
    v->unplug_ns = v->cancel_ns = PORT_NEVER;
}
