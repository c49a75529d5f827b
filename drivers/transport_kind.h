// SPDX-License-Identifier: MIT
// A transport from inside: what the kinds of links share, and the calls that each of them answers.
// drivers/transport.c is what they have in common, drivers/transport_stream.c the two kinds that
// are descriptors (serial, TCP), drivers/transport_usbtmc.c messages over USB. Inside this layer.
// Thread: the transport's.
#pragma once
#include "drivers/link.h"
#include "drivers/transport.h"
#include "drivers/usb_io.h"

#define TRANSPORT_SLICE_NS CLK_MS(50) // the longest wait without a turn of the clock
#define TRANSPORT_BABBLE_NS CLK_S(2)  // a line that is not silent by then says nothing useful

struct guard_link;
struct serial_port;
struct usb_link;

struct transport_ops { // as the calls of drivers/transport.h
    int (*open)(struct transport *t, struct gon_error *err);
    void (*shut)(struct transport *t); // also when it is
    void (*free)(struct transport *t); // what the kind has; after shut
    int (*write)(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                 struct gon_error *err);
    int (*read)(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                struct gon_error *err);
    int (*drain)(struct transport *t, int64_t quiet_ns, struct gon_error *err);
};

struct transport {
    const struct transport_ops *ops; // first
    struct link link;
    char *text;
    struct clk *clk;
    const struct cancel *cancel;
    int64_t turn_ns; // when the clock last had its turn
    bool ended;      // the last read ended a message
    struct link_stats stats;
    const struct tap *tap; // NULL: nobody listens
    // of the kinds
    struct serial_port *serial; // NULL: TCP, or closed
    int fd;                     // -1: closed, or USB
    struct usb_link *usb;
    struct guard_link *guard; // NULL: no guard process has it
    bool shut;                // with one: hung up or not opened yet
};

extern const struct transport_ops transport_stream_ops, transport_usbtmc_ops;

// One of a kind that is to be set (a stream, so far); NULL without memory. finish opens what is
// complete, or takes it apart, also with an rc that failed before.
struct transport *transport_new(const struct link *link, const char *text, struct clk *clk,
                                const struct cancel *cancel);
int transport_finish(struct transport *t, int rc, struct transport **ret_transport,
                     struct gon_error *err);

// A line that never falls silent must not take the clock's turn away.
void transport_take_turn(struct transport *t);

// What transport_open does for usbtmc:..., over any struct usb_io, which is taken over.
int transport_open_usb_io(struct usb_io *io, const char *link, struct clk *clk,
                          const struct cancel *cancel, struct transport **ret_transport,
                          struct gon_error *err);
// libusb's (drivers/transport_usb.c): the device by the link's numbers; by the serial number that
// it had when it was opened first, if the link names none. Borrows link, text and clk. NULL:
// without memory.
struct usb_io *transport_usb_new(const struct link *link, const char *text, struct clk *clk);
// For drivers/transport.c: gives t what its kind needs; takes io over, also when it fails.
int transport_usbtmc_attach(struct transport *t, struct usb_io *io, struct gon_error *err);
