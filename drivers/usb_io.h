// SPDX-License-Identifier: MIT
// What the USBTMC protocol needs of a USB device, and no more: so it runs over libusb
// (drivers/transport_usb) and over a simulated device in virtual time, where a test brings its own.
// Waits are cut as drivers/transport.h promises. Inside this layer. Thread: the transport's.
#pragma once
#include "base/cancel.h"
#include "base/err.h"
#include "drivers/usbtmc.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct usb_io;

enum usb_outcome {
    USB_LATE = -1,     // nothing by the deadline
    USB_STALLED = -2,  // the endpoint is halted, or the request unknown
    USB_GONE = -3,     // unplugged
    USB_CANCELED = -4, // by the token
    USB_FAILED = -5    // anything else: babble, overflow, no memory
};

struct usb_shape {                        // of the interface that was claimed
    uint8_t interface, bulk_in, bulk_out; // number and endpoint addresses
    uint16_t packet;                      // most bytes of a bulk-in packet: 8..1024
    bool usb488;
};

// Moving bytes: how many, or an enum usb_outcome. What had come by the deadline, or by a
// cancellation, counts: bulk_in then returns it instead of USB_LATE, and the rest can be read by
// the next call; bulk_out returns less than size.
struct usb_io_ops {
    int (*open)(struct usb_io *io, struct usb_shape *ret_shape, struct gon_error *err);
    void (*shut)(struct usb_io *io); // also twice
    void (*free)(struct usb_io *io); // of what is shut
    int (*control)(struct usb_io *io, const struct usbtmc_setup *setup, uint8_t *data,
                   int64_t deadline_ns); // data: setup->length bytes, towards the host
    int (*bulk_out)(struct usb_io *io, uint8_t endpoint, const uint8_t *data, size_t size,
                    int64_t deadline_ns);
    int (*bulk_in)(struct usb_io *io, uint8_t endpoint, uint8_t *data, size_t size,
                   int64_t deadline_ns);
    int (*clear_halt)(struct usb_io *io, uint8_t endpoint);
    int (*reset)(struct usb_io *io); // of the device, by its port; the last resort
};

struct usb_io {
    const struct usb_io_ops *ops; // first
    const struct cancel *cancel;  // the transport's of the moment
};
