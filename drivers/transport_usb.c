// SPDX-License-Identifier: MIT
// struct usb_io over libusb-1.0.
//
// Transfers go through libusb's asynchronous calls: one is submitted and stays with the kernel
// while the wait for it is cut into slices. Synchronous calls with a short timeout would take it
// back at the end of each slice, and what the device had begun to send would have to be pieced
// together.
#include "drivers/transport_claim.h"
#include "drivers/transport_kind.h"

#include <errno.h>
#include <libusb-1.0/libusb.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FDS_MOST = 8, SETUP = LIBUSB_CONTROL_SETUP_SIZE, CONTROL_MOST = 255, SERIAL_MOST = 127 };

#define STRING_NS CLK_MS(500) // for a string descriptor

struct usb_device {
    struct usb_io io; // first
    const struct link *link;
    const char *text;
    struct clk *clk;
    char serial[SERIAL_MOST + 1]; // of the device that was opened first; "": it has none
    bool known;                   // serial is
    libusb_context *context;      // NULL: shut
    libusb_device_handle *handle;
    int claimed; // interface; -1: none
    struct libusb_transfer *transfer;
    int done; // of the transfer
    uint8_t control[SETUP + CONTROL_MOST];
};

static struct usb_device *device_of(struct usb_io *io)
{
    return (struct usb_device *)io;
}

// --- one transfer --------------------------------------------------------------------------------

static void LIBUSB_CALL finished(struct libusb_transfer *transfer)
{
    *(int *)transfer->user_data = 1;
}

// Waits on libusb's descriptors and the token, at most a slice: 0 or USB_CANCELED.
static int slice(struct usb_device *d, int64_t until_ns)
{
    const int64_t now_ns = clk_now_ns(d->clk);
    int64_t left_ns = until_ns - now_ns;
    left_ns = left_ns < 0 ? 0 : left_ns > TRANSPORT_SLICE_NS ? TRANSPORT_SLICE_NS : left_ns;
    struct pollfd p[FDS_MOST + 1] = {{cancel_fd(d->io.cancel), POLLIN, 0}};
    nfds_t n = 1;
    const struct libusb_pollfd **list = libusb_get_pollfds(d->context);
    for (int i = 0; list && list[i] && n <= FDS_MOST; i++)
        p[n++] = (struct pollfd){list[i]->fd, list[i]->events, 0};
    libusb_free_pollfds(list);
    const struct timespec ts = {0, (long)left_ns};
    const int rc = ppoll(p, n, &ts, NULL);
    if (cancel_requested(d->io.cancel))
        return USB_CANCELED;
    struct timeval at_once = {0, 0};
    libusb_handle_events_timeout_completed(d->context, &at_once, &d->done);
    if (rc == 0)
        clk_sleep_until(d->clk, now_ns, NULL); // nothing came: the clock's turn
    return 0;
}

// The kernel gives a transfer back at once when asked to; until then its memory is in use.
static void take_back(struct usb_device *d)
{
    libusb_cancel_transfer(d->transfer);
    while (!d->done) {
        struct timeval wait = {0, 50000};
        libusb_handle_events_timeout_completed(d->context, &wait, &d->done);
    }
}

static int outcome(const struct libusb_transfer *transfer, int why)
{
    switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED: return transfer->actual_length;
    case LIBUSB_TRANSFER_TIMED_OUT:
    case LIBUSB_TRANSFER_CANCELLED:
        return transfer->actual_length > 0 && transfer->type == LIBUSB_TRANSFER_TYPE_BULK
                   ? transfer->actual_length
                   : why;
    case LIBUSB_TRANSFER_STALL: return USB_STALLED;
    case LIBUSB_TRANSFER_NO_DEVICE: return USB_GONE;
    case LIBUSB_TRANSFER_OVERFLOW:
    case LIBUSB_TRANSFER_ERROR: break;
    }
    return USB_FAILED;
}

static int of_error(int error)
{
    switch (error) {
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND: return USB_GONE;
    case LIBUSB_ERROR_PIPE: return USB_STALLED;
    default: return error < 0 ? USB_FAILED : 0;
    }
}

// The transfer is filled in.
static int run(struct usb_device *d, int64_t deadline_ns)
{
    d->done = 0;
    int rc = of_error(libusb_submit_transfer(d->transfer));
    if (rc < 0)
        return rc;
    while (!d->done && rc == 0) {
        rc = slice(d, deadline_ns);
        if (rc == 0 && clk_now_ns(d->clk) >= deadline_ns)
            rc = USB_LATE;
    }
    if (!d->done)
        take_back(d);
    return outcome(d->transfer, rc);
}

static int usb_control(struct usb_io *io, const struct usbtmc_setup *setup, uint8_t *data,
                       int64_t deadline_ns)
{
    struct usb_device *d = device_of(io);
    if (setup->length > CONTROL_MOST)
        return USB_FAILED;
    libusb_fill_control_setup(d->control, setup->type, setup->request, setup->value, setup->index,
                              setup->length);
    libusb_fill_control_transfer(d->transfer, d->handle, d->control, finished, &d->done, 0);
    const int rc = run(d, deadline_ns);
    if (rc > 0)
        memcpy(data, d->control + SETUP, (size_t)rc);
    return rc;
}

static int bulk(struct usb_io *io, uint8_t endpoint, uint8_t *data, size_t size,
                int64_t deadline_ns)
{
    struct usb_device *d = device_of(io);
    libusb_fill_bulk_transfer(d->transfer, d->handle, endpoint, data, (int)size, finished, &d->done,
                              0);
    return run(d, deadline_ns);
}

static int usb_bulk_out(struct usb_io *io, uint8_t endpoint, const uint8_t *data, size_t size,
                        int64_t deadline_ns)
{
    return bulk(io, endpoint, (uint8_t *)data, size, deadline_ns); // libusb only reads it
}

static int usb_clear_halt(struct usb_io *io, uint8_t endpoint)
{
    return of_error(libusb_clear_halt(device_of(io)->handle, endpoint));
}

static int usb_reset(struct usb_io *io)
{
    return of_error(libusb_reset_device(device_of(io)->handle));
}

// --- which device --------------------------------------------------------------------------------

// What was met on the way to the one that is wanted.
struct found {
    libusb_device_handle *handle; // the first that fits; open
    int fit, others, closed;      // fitting; of another serial number; not to be opened
    int error;                    // of the last that could not be opened
    char node[32];                // and its name
    char serials[200];            // links of the fitting and the others, for messages
};

static void string_of(struct usb_device *d, uint8_t index, char ret_text[SERIAL_MOST + 1])
{
    const struct usbtmc_setup setup = {LIBUSB_ENDPOINT_IN, LIBUSB_REQUEST_GET_DESCRIPTOR,
                                       (uint16_t)(LIBUSB_DT_STRING << 8 | index), 0x0409,
                                       CONTROL_MOST};
    uint8_t bytes[CONTROL_MOST];
    int rc = 0;
    ret_text[0] = 0;
    if (index != 0) // as English; devices answer so whatever other languages they have
        rc = usb_control(&d->io, &setup, bytes, clk_now_ns(d->clk) + STRING_NS);
    if (rc <= 0 || !usbtmc_parse_string(bytes, (size_t)rc, ret_text, SERIAL_MOST + 1))
        ret_text[0] = 0;
}

static const char *wanted_serial(const struct usb_device *d)
{
    return d->link->place[0] ? d->link->place : d->known ? d->serial : NULL;
}

static void consider(struct usb_device *d, libusb_device *device, uint8_t serial_index,
                     struct found *f)
{
    char serial[SERIAL_MOST + 1];
    const char *wanted = wanted_serial(d);
    snprintf(f->node, sizeof f->node, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
             libusb_get_device_address(device));
    const int rc = libusb_open(device, &d->handle);
    if (rc < 0) {
        f->closed++;
        f->error = rc;
        return;
    }
    string_of(d, serial_index, serial);
    const size_t used = strlen(f->serials);
    snprintf(f->serials + used, sizeof f->serials - used, "%susbtmc:%04x:%04x:%s", used ? ", " : "",
             d->link->vendor, d->link->product, serial);
    const bool fits = !wanted || strcmp(serial, wanted) == 0;
    f->fit += fits;
    f->others += !fits;
    if (fits && !f->handle) {
        f->handle = d->handle;
        if (!d->known)
            snprintf(d->serial, sizeof d->serial, "%s", serial);
    } else {
        libusb_close(d->handle);
    }
    d->handle = NULL;
}

static void search(struct usb_device *d, struct found *f)
{
    libusb_device **list;
    const ssize_t n = libusb_get_device_list(d->context, &list);
    for (ssize_t i = 0; i < n; i++) {
        struct libusb_device_descriptor about;
        if (libusb_get_device_descriptor(list[i], &about) == 0 &&
            about.idVendor == d->link->vendor && about.idProduct == d->link->product)
            consider(d, list[i], about.iSerialNumber, f);
    }
    if (n >= 0)
        libusb_free_device_list(list, 1);
}

static int say_denied(const struct usb_device *d, const char *node, struct gon_error *err)
{
    return gon_fail(err, GON_E_REFUSED,
                    "%s: permission denied on %s; as root put the line SUBSYSTEM==\"usb\", "
                    "ATTR{idVendor}==\"%04x\", ATTR{idProduct}==\"%04x\", GROUP=\"plugdev\", "
                    "MODE=\"0660\" into /etc/udev/rules.d/60-gonio.rules, join the group plugdev, "
                    "and plug it in again",
                    d->text, node, d->link->vendor, d->link->product);
}

// One device, or why not: the handle is in d then.
static int choose(struct usb_device *d, struct gon_error *err)
{
    struct found f = {0};
    search(d, &f);
    d->handle = f.handle;
    if (cancel_requested(d->io.cancel))
        return gon_fail(err, GON_E_CANCELED, "%s: stopped while opening", d->text);
    if (f.fit == 1)
        return 0;
    if (f.fit > 1)
        return gon_fail(err, GON_E_INPUT, "%s: %d such devices; give the serial: %s", d->text,
                        f.fit, f.serials);
    if (f.closed > 0 && f.error == LIBUSB_ERROR_ACCESS)
        return say_denied(d, f.node, err);
    if (f.closed > 0)
        return gon_fail(err, GON_E_GONE, "%s: %s cannot be opened: %s", d->text, f.node,
                        libusb_strerror(f.error));
    if (f.others > 0)
        return gon_fail(err, GON_E_GONE, "%s: no device with the serial '%s'; there is %s", d->text,
                        wanted_serial(d), f.serials);
    return gon_fail(err, GON_E_GONE,
                    "%s: no such device; is it plugged in and switched on? (lsusb)", d->text);
}

// --- its interface -------------------------------------------------------------------------------

static bool shape_of(const struct libusb_interface_descriptor *i, struct usb_shape *ret_shape)
{
    struct usb_shape s = {.interface = i->bInterfaceNumber,
                          .usb488 = i->bInterfaceProtocol == USBTMC_PROTOCOL_USB488};
    if (i->bInterfaceClass != USBTMC_CLASS || i->bInterfaceSubClass != USBTMC_SUBCLASS)
        return false;
    for (int k = 0; k < i->bNumEndpoints; k++) {
        const struct libusb_endpoint_descriptor *e = &i->endpoint[k];
        if ((e->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK)
            continue;
        if (e->bEndpointAddress & LIBUSB_ENDPOINT_IN) {
            s.bulk_in = e->bEndpointAddress;
            s.packet = e->wMaxPacketSize & 0x7ff; // above it: packets a microframe
        } else {
            s.bulk_out = e->bEndpointAddress;
        }
    }
    *ret_shape = s;
    return s.bulk_in && s.bulk_out && s.packet >= USBTMC_HEADER && s.packet <= 1024;
}

static bool find_interface(struct usb_device *d, struct usb_shape *ret_shape)
{
    struct libusb_config_descriptor *config;
    bool found = false;
    if (libusb_get_active_config_descriptor(libusb_get_device(d->handle), &config) < 0)
        return false;
    for (int i = 0; i < config->bNumInterfaces && !found; i++)
        found = config->interface[i].num_altsetting > 0 &&
                shape_of(&config->interface[i].altsetting[0], ret_shape);
    libusb_free_config_descriptor(config);
    return found;
}

static int claim(struct usb_device *d, int interface, struct gon_error *err)
{
    char node[32];
    libusb_device *device = libusb_get_device(d->handle);
    libusb_set_auto_detach_kernel_driver(d->handle, 1); // usbtmc, given back when it is released
    const int rc = libusb_claim_interface(d->handle, interface);
    if (rc == 0) {
        d->claimed = interface;
        return 0;
    }
    snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
             libusb_get_device_address(device));
    if (rc == LIBUSB_ERROR_BUSY)
        return transport_claim_failed(d->text, node, EBUSY, err);
    return gon_fail(err, GON_E_GONE, "%s: cannot be claimed: %s", d->text, libusb_strerror(rc));
}

static void usb_shut(struct usb_io *io)
{
    struct usb_device *d = device_of(io);
    libusb_free_transfer(d->transfer);
    if (d->handle && d->claimed >= 0)
        libusb_release_interface(d->handle, d->claimed); // back to the kernel's driver
    if (d->handle)
        libusb_close(d->handle);
    if (d->context)
        libusb_exit(d->context);
    d->transfer = NULL;
    d->handle = NULL;
    d->context = NULL;
    d->claimed = -1;
}

// A context of its own each time: it lists the devices that are there now.
static int usb_open(struct usb_io *io, struct usb_shape *ret_shape, struct gon_error *err)
{
    struct usb_device *d = device_of(io);
    int rc = libusb_init(&d->context);
    if (rc < 0) {
        d->context = NULL;
        return gon_fail(err, GON_E_SYSTEM, "%s: no USB: %s", d->text, libusb_strerror(rc));
    }
    d->transfer = libusb_alloc_transfer(0);
    if (!d->transfer)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", d->text);
    rc = choose(d, err);
    if (rc < 0)
        return rc;
    if (!find_interface(d, ret_shape))
        return gon_fail(err, GON_E_DEVICE,
                        "%s: has no USBTMC interface; some instruments must be switched to it in "
                        "their menu",
                        d->text);
    rc = claim(d, ret_shape->interface, err);
    d->known |= rc == 0;
    return rc;
}

static void usb_free(struct usb_io *io)
{
    free(io);
}

struct usb_io *transport_usb_new(const struct link *link, const char *text, struct clk *clk)
{
    static const struct usb_io_ops ops = {.open = usb_open,
                                          .shut = usb_shut,
                                          .free = usb_free,
                                          .control = usb_control,
                                          .bulk_out = usb_bulk_out,
                                          .bulk_in = bulk,
                                          .clear_halt = usb_clear_halt,
                                          .reset = usb_reset};
    struct usb_device *d = calloc(1, sizeof *d);
    if (!d)
        return NULL;
    d->io.ops = &ops;
    d->link = link;
    d->text = text;
    d->clk = clk;
    d->claimed = -1;
    return &d->io;
}
