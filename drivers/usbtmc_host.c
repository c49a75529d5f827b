// SPDX-License-Identifier: MIT
#include "drivers/usbtmc_host.h"

#include <string.h>

#define PENDING_NS CLK_S(1) // for an abort or a clear to be done
#define POLL_NS CLK_MS(50)
#define CONTROL_NS CLK_MS(500) // for one control request
#define STATUS_TRIES 3

void usbtmc_host_init(struct usbtmc_host *h, struct usb_io *io, struct clk *clk, const char *name)
{
    memset(h, 0, sizeof *h);
    h->io = io;
    h->clk = clk;
    h->name = name;
}

// --- failures ------------------------------------------------------------------------------------

static int say(const struct usbtmc_host *h, int outcome, const char *doing, struct gon_error *err)
{
    switch (outcome) {
    case USB_LATE: return gon_fail(err, GON_E_LINK, "%s: %s: nothing came in time", h->name, doing);
    case USB_STALLED:
        return gon_fail(err, GON_E_LINK, "%s: %s: refused by the device (stall)", h->name, doing);
    case USB_GONE: return gon_fail(err, GON_E_GONE, "%s: unplugged", h->name);
    case USB_CANCELED: return gon_fail(err, GON_E_CANCELED, "%s: stopped while waiting", h->name);
    default: return gon_fail(err, GON_E_LINK, "%s: %s: the USB transfer failed", h->name, doing);
    }
}

// What ends every attempt to mend something.
static bool is_final(int outcome)
{
    return outcome == USB_GONE || outcome == USB_CANCELED;
}

static int64_t earlier(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

// --- requests ------------------------------------------------------------------------------------

// The answer's first byte is its status; the bytes that did not come are zero.
static int request(struct usbtmc_host *h, enum usbtmc_request r, uint16_t value, uint8_t index,
                   uint8_t *answer, int64_t deadline_ns)
{
    const struct usbtmc_setup setup = usbtmc_setup(r, value, index);
    memset(answer, 0, setup.length);
    const int64_t until_ns = clk_now_ns(h->clk) + CONTROL_NS;
    return h->io->ops->control(h->io, &setup, answer, earlier(until_ns, deadline_ns));
}

static int clear_halt(struct usbtmc_host *h, uint8_t endpoint)
{
    h->halts++;
    return h->io->ops->clear_halt(h->io, endpoint);
}

// Asks with r until what was begun is done: 0; an outcome; USB_LATE when it stays pending.
static int await_done(struct usbtmc_host *h, enum usbtmc_request r, uint8_t index,
                      int64_t deadline_ns)
{
    uint8_t answer[USBTMC_STATUS_MOST];
    const int64_t until_ns = earlier(clk_now_ns(h->clk) + PENDING_NS, deadline_ns);
    do {
        int rc = request(h, r, 0, index, answer, deadline_ns);
        if (rc < 0)
            return rc;
        if (answer[0] != USBTMC_PENDING)
            return answer[0] == USBTMC_SUCCESS ? 0 : USB_FAILED;
        if (answer[1] & 1) // it waits for us to take what it has queued
            rc = h->io->ops->bulk_in(h->io, h->shape.bulk_in, h->buffer, sizeof h->buffer,
                                     earlier(clk_now_ns(h->clk) + POLL_NS, deadline_ns));
        else if (clk_sleep(h->clk, POLL_NS, h->io->cancel) < 0)
            rc = USB_CANCELED;
        if (is_final(rc))
            return rc;
    } while (clk_now_ns(h->clk) < until_ns);
    return USB_LATE;
}

// --- mending -------------------------------------------------------------------------------------

// A device that has nothing to abort answers so, which is as good. What cannot be aborted is
// cleared.
static int abort_transfer(struct usbtmc_host *h, bool in, int64_t deadline_ns)
{
    uint8_t answer[USBTMC_STATUS_MOST];
    const uint8_t endpoint = in ? h->shape.bulk_in : h->shape.bulk_out;
    h->aborts++;
    int rc = request(h, in ? USBTMC_INITIATE_ABORT_BULK_IN : USBTMC_INITIATE_ABORT_BULK_OUT, h->tag,
                     endpoint, answer, deadline_ns);
    if (rc >= 0 && answer[0] == USBTMC_SUCCESS)
        rc = await_done(h, in ? USBTMC_CHECK_ABORT_BULK_IN : USBTMC_CHECK_ABORT_BULK_OUT, endpoint,
                        deadline_ns);
    if (rc >= 0 && !in)
        rc = clear_halt(h, endpoint);
    if (is_final(rc))
        return rc;
    h->broken |= rc < 0;
    if (in) {
        h->asked = h->begun = false;
        h->broken = true; // its answer may come yet
    } else {
        h->halfway = false;
    }
    return 0;
}

// The device forgets every command and answer.
static int clear_device(struct usbtmc_host *h, int64_t deadline_ns)
{
    uint8_t answer[USBTMC_STATUS_MOST];
    h->clears++;
    int rc = request(h, USBTMC_INITIATE_CLEAR, 0, h->shape.interface, answer, deadline_ns);
    if (rc >= 0 && answer[0] != USBTMC_SUCCESS)
        rc = USB_FAILED;
    if (rc >= 0)
        rc = await_done(h, USBTMC_CHECK_CLEAR, h->shape.interface, deadline_ns);
    if (rc >= 0)
        rc = clear_halt(h, h->shape.bulk_out);
    if (rc >= 0) {
        h->asked = h->begun = h->halfway = h->broken = false;
        h->at = h->have = 0;
    }
    return rc < 0 ? rc : 0;
}

static int reset(struct usbtmc_host *h, struct gon_error *err)
{
    h->resets++;
    const int rc = h->io->ops->reset(h->io);
    if (is_final(rc))
        return say(h, rc, "resetting", err);
    h->asked = h->begun = h->halfway = false;
    h->broken = rc < 0;
    h->at = h->have = 0;
    return gon_fail(err, GON_E_DEVICE,
                    "%s: could not be cleared and was reset%s; check its settings, or switch it "
                    "off and on",
                    h->name, rc < 0 ? ", which failed too" : "");
}

static int mend(struct usbtmc_host *h, bool clear, int64_t deadline_ns, struct gon_error *err)
{
    int rc = 0;
    if (h->halfway)
        rc = abort_transfer(h, false, deadline_ns);
    if (rc == 0 && h->asked)
        rc = abort_transfer(h, true, deadline_ns);
    if (rc == 0 && (clear || h->broken)) {
        rc = clear_device(h, deadline_ns);
        if (rc < 0 && !is_final(rc) && clk_now_ns(h->clk) < deadline_ns)
            return reset(h, err);
    }
    return rc < 0 ? say(h, rc, "clearing", err) : 0;
}

int usbtmc_host_start(struct usbtmc_host *h, const struct usb_shape *shape, int64_t deadline_ns,
                      struct gon_error *err)
{
    uint8_t answer[USBTMC_CAPABILITIES];
    usbtmc_host_init(h, h->io, h->clk, h->name);
    h->shape = *shape;
    int rc = request(h, USBTMC_GET_CAPABILITIES, 0, shape->interface, answer, deadline_ns);
    if (is_final(rc))
        return say(h, rc, "asking for its capabilities", err);
    if (rc < 0 || !usbtmc_parse_capabilities(answer, (size_t)rc, shape->usb488, &h->can))
        return gon_fail(err, GON_E_DEVICE,
                        "%s: does not say what it is capable of; switch it off and on", h->name);
    rc = clear_device(h, deadline_ns);
    if (rc < 0)
        return is_final(rc) ? say(h, rc, "clearing", err) : reset(h, err);
    if (h->can.remote) // some devices take commands without it, and say no here
        rc = request(h, USBTMC_REN_CONTROL, 1, shape->interface, answer, deadline_ns);
    return is_final(rc) ? say(h, rc, "taking remote control", err) : 0;
}

// --- commands ------------------------------------------------------------------------------------

static int stalled(struct usbtmc_host *h, uint8_t endpoint, const char *doing,
                   struct gon_error *err)
{
    const int rc = clear_halt(h, endpoint);
    h->broken = true;
    return say(h, is_final(rc) ? rc : USB_STALLED, doing, err);
}

static int put(struct usbtmc_host *h, size_t size, int64_t deadline_ns, const char *doing,
               struct gon_error *err)
{
    const int rc = h->io->ops->bulk_out(h->io, h->shape.bulk_out, h->frame, size, deadline_ns);
    if (rc == (int)size)
        return 0;
    if (rc == USB_STALLED)
        return stalled(h, h->shape.bulk_out, doing, err);
    h->halfway = true;
    return say(h, rc < 0 ? rc : USB_LATE, doing, err);
}

int usbtmc_host_write(struct usbtmc_host *h, const uint8_t *data, size_t size, int64_t deadline_ns,
                      struct gon_error *err)
{
    int rc = mend(h, false, deadline_ns, err);
    h->at = h->have = 0;
    h->ended = false;
    for (size_t done = 0; rc == 0 && done < size;) {
        const size_t part = size - done < USBTMC_CHUNK ? size - done : USBTMC_CHUNK;
        h->tag = usbtmc_next_tag(h->tag);
        const size_t frame = usbtmc_frame_out(h->frame, sizeof h->frame, h->tag, data + done, part,
                                              done + part == size);
        rc = put(h, frame, deadline_ns, "sending a command", err);
        done += part;
    }
    return rc;
}

// --- answers -------------------------------------------------------------------------------------

static int ask(struct usbtmc_host *h, int64_t deadline_ns, struct gon_error *err)
{
    h->tag = usbtmc_next_tag(h->tag);
    usbtmc_frame_request(h->frame, h->tag, USBTMC_CHUNK);
    const int rc = put(h, USBTMC_HEADER, deadline_ns, "asking for an answer", err);
    h->asked = rc == 0;
    h->begun = false;
    return rc;
}

// How much to read at once. At first one packet, which holds the header: with the size known a read
// never waits for a packet of zero bytes that not all devices send.
static size_t wanted(const struct usbtmc_host *h)
{
    const size_t packet = h->shape.packet;
    return h->begun ? (h->left + packet - 1) / packet * packet : packet;
}

// Behind the payload there is room for padding. More than that, unless it is zeros, is payload that
// the header does not tell of: what it does tell of is then only a part of the answer.
static bool carries_more(const struct usbtmc_host *h, const uint8_t *rest, size_t size)
{
    for (size_t i = h->pad; i < size; i++)
        if (rest[i])
            return true;
    return false;
}

static int wrong_answer(struct usbtmc_host *h, enum usbtmc_verdict v, struct gon_error *err)
{
    h->broken = true;
    h->at = h->have = 0;
    return gon_fail(err, GON_E_LINK, "%s: sent %s", h->name, usbtmc_verdict_text(v));
}

// One read from the endpoint into the buffer.
static int receive(struct usbtmc_host *h, int64_t deadline_ns, struct gon_error *err)
{
    struct usbtmc_in in;
    const int rc = h->io->ops->bulk_in(h->io, h->shape.bulk_in, h->buffer, wanted(h), deadline_ns);
    if (rc == USB_STALLED) {
        h->asked = h->begun = false; // a stall ends the transfer
        return stalled(h, h->shape.bulk_in, "reading an answer", err);
    }
    if (rc < 0)
        return say(h, rc, "reading an answer", err);
    size_t n = (size_t)rc, skip = 0;
    if (!h->begun && n > 0) { // a packet of zero bytes ended the transfer before
        const enum usbtmc_verdict v = usbtmc_parse_in(h->buffer, n, h->tag, USBTMC_CHUNK, &in);
        if (v != USBTMC_GOOD)
            return wrong_answer(h, v, err);
        h->begun = true;
        h->left = in.size;
        h->pad = (4 - in.size % 4) % 4;
        h->end = in.end;
        skip = USBTMC_HEADER;
    }
    h->at = skip;
    h->have = n - skip < h->left ? n : skip + h->left; // the rest is padding
    if (carries_more(h, h->buffer + h->have, n - h->have))
        return wrong_answer(h, USBTMC_WRONG_SIZE, err);
    h->left -= (uint32_t)(h->have - h->at);
    if (h->begun && h->left == 0)
        h->asked = h->begun = false;
    return 0;
}

int usbtmc_host_read(struct usbtmc_host *h, uint8_t *data, size_t size, int64_t deadline_ns,
                     struct gon_error *err)
{
    h->ended = false;
    while (h->at == h->have) {
        if (h->broken || h->halfway)
            return gon_fail(err, GON_E_LINK, "%s: out of step since the last error", h->name);
        int rc = h->asked ? 0 : ask(h, deadline_ns, err);
        if (rc == 0)
            rc = receive(h, deadline_ns, err);
        if (rc < 0)
            return rc;
        if (!h->asked && h->end && h->at == h->have)
            break; // ended by a transfer without payload
        if (h->at == h->have && clk_now_ns(h->clk) >= deadline_ns)
            return say(h, USB_LATE, "reading an answer", err);
    }
    const size_t n = h->have - h->at < size ? h->have - h->at : size;
    memcpy(data, h->buffer + h->at, n);
    h->at += n;
    h->ended = h->at == h->have && !h->asked && h->end;
    return (int)n;
}

// An answer that nobody read would be taken for the next one.
static int drop_unread(struct usbtmc_host *h, int64_t deadline_ns, struct gon_error *err)
{
    uint8_t answer[USBTMC_STATUS_MOST], waste[256];
    int dropped = 0;
    h->status_tag = h->status_tag < 2 || h->status_tag == 127 ? 2 : h->status_tag + 1;
    h->status_failed++;
    int rc =
        request(h, USBTMC_READ_STATUS_BYTE, h->status_tag, h->shape.interface, answer, deadline_ns);
    if (is_final(rc))
        return say(h, rc, "reading its status", err);
    if (rc < 3 || answer[0] != USBTMC_SUCCESS)
        return 0;
    if (answer[2] & USBTMC_MESSAGE_AVAILABLE) {
        do {
            rc = usbtmc_host_read(h, waste, sizeof waste, deadline_ns, err);
            dropped += rc > 0 ? rc : 0;
        } while (rc >= 0 && !h->ended);
        if (rc < 0)
            return rc;
    }
    h->status_failed = 0;
    return dropped;
}

int usbtmc_host_drain(struct usbtmc_host *h, bool clear, int64_t deadline_ns, struct gon_error *err)
{
    int dropped = (int)(h->have - h->at);
    h->at = h->have = 0;
    int rc = mend(h, clear, deadline_ns, err);
    if (rc == 0 && !clear && h->can.usb488 && h->status_failed < STATUS_TRIES)
        rc = drop_unread(h, deadline_ns, err);
    return rc < 0 ? rc : dropped + rc;
}
