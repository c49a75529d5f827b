// SPDX-License-Identifier: MIT
// drivers/session.h and the whole USBTMC driver over a bad USB device. One reading in two hundred
// meets a fault: those of sim/usbtmc.h (stalls, wrong tags and headers, messages in parts, a clear
// that is pending or leaves bytes), answers up to 3 s late that a clear stops or does not stop, a
// transfer sent once more, two messages in one, an answer given twice, a size in the header that is
// too small or too large.
#pragma once
#include "tests/slow/links_text.h"
#include "tests/unit/vusb.h"

enum links_usb_fault {
    LINKS_USB_LATE = SIM_USB_FAULTS,
    LINKS_USB_LATE_KEPT, // a clear does not stop it
    LINKS_USB_TWICE,     // the instrument says it twice
    LINKS_USB_OLD,       // the last transfer once more, with its old tag, before this one
    LINKS_USB_MERGED,    // the last message and this one as one
    LINKS_USB_SMALL,     // the header says less than there is
    LINKS_USB_LARGE,
    LINKS_USB_FAULTS
};

struct links_usb {
    struct vusb usb; // first
    struct links_device device;
    struct usb_io_ops ops;
    const struct usb_io_ops *inner;
    uint64_t dice, faults;
    unsigned armed; // one of those from LINKS_USB_OLD on; 0: none
    uint8_t last[SIM_USB_PACKET], owed[2 * SIM_USB_PACKET];
    size_t last_size, owed_size; // owed: comes before anything else
};

static inline unsigned links_roll(uint64_t *dice, unsigned sides)
{
    *dice ^= *dice << 13;
    *dice ^= *dice >> 7;
    *dice ^= *dice << 17;
    return (unsigned)(*dice >> 33) % sides;
}

static inline uint32_t links_size(const uint8_t *header)
{
    return header[4] | (uint32_t)header[5] << 8 | (uint32_t)header[6] << 16 |
           (uint32_t)header[7] << 24;
}

static inline void links_set_size(uint8_t *header, uint32_t size)
{
    for (int i = 0; i < 4; i++)
        header[4 + i] = (uint8_t)(size >> 8 * i);
}

static inline int links_give(struct links_usb *u, uint8_t *data, size_t room)
{
    const size_t n = u->owed_size < room ? u->owed_size : room;
    memcpy(data, u->owed, n);
    u->owed_size -= n;
    memmove(u->owed, u->owed + n, u->owed_size);
    return (int)n;
}

// The last message and this one in one transfer, under this one's tag.
static inline void links_merge(struct links_usb *u, const uint8_t *data, size_t payload)
{
    const size_t before = links_size(u->last), both = before + payload;
    memcpy(u->owed, data, USBTMC_HEADER);
    links_set_size(u->owed, (uint32_t)both);
    memcpy(u->owed + USBTMC_HEADER, u->last + USBTMC_HEADER, before);
    memcpy(u->owed + USBTMC_HEADER + before, data + USBTMC_HEADER, payload);
    u->owed_size = USBTMC_HEADER + both;
}

// A whole transfer in one packet meets the fault that waits for it.
static inline int links_spoil(struct links_usb *u, uint8_t *data, size_t room, int n)
{
    const uint32_t payload = links_size(data);
    const unsigned fault = u->armed;
    u->armed = 0;
    switch (fault) {
    case LINKS_USB_OLD:
        memcpy(u->owed, u->last, u->last_size);
        memcpy(u->owed + u->last_size, data, (size_t)n);
        u->owed_size = u->last_size + (size_t)n;
        n = (int)u->last_size; // a packet by itself
        memcpy(data, u->owed, u->last_size);
        u->owed_size -= u->last_size;
        memmove(u->owed, u->owed + u->last_size, u->owed_size);
        return n;
    case LINKS_USB_MERGED: links_merge(u, data, payload); return links_give(u, data, room);
    case LINKS_USB_SMALL: links_set_size(data, 1 + links_roll(&u->dice, payload - 1)); break;
    case LINKS_USB_LARGE: links_set_size(data, payload + 1 + links_roll(&u->dice, 100)); break;
    }
    return n;
}

static inline int links_bulk_in(struct usb_io *io, uint8_t endpoint, uint8_t *data, size_t size,
                                int64_t deadline_ns)
{
    struct links_usb *u = (struct links_usb *)io;
    if (u->owed_size > 0)
        return links_give(u, data, size);
    int n = u->inner->bulk_in(io, endpoint, data, size, deadline_ns);
    const bool whole = n > USBTMC_HEADER + 1 && n <= SIM_USB_PACKET && data[0] == 2 &&
                       data[1] + data[2] == 255 && links_size(data) > 1 &&
                       links_size(data) <= (size_t)n - USBTMC_HEADER;
    if (!whole)
        return n;
    uint8_t kept[SIM_USB_PACKET];
    const size_t kept_size = (size_t)n;
    memcpy(kept, data, kept_size);
    if (u->armed && u->last_size > 0)
        n = links_spoil(u, data, size, n);
    memcpy(u->last, kept, kept_size);
    u->last_size = kept_size;
    return n;
}

static inline void links_arm(struct links_usb *u)
{
    if (links_roll(&u->dice, LINKS_ONE_IN) != 0)
        return;
    const unsigned fault = links_roll(&u->dice, LINKS_USB_FAULTS);
    u->faults++;
    if (fault < SIM_USB_FAULTS)
        u->usb.device.fault[fault] = 1;
    else if (fault == LINKS_USB_TWICE)
        u->device.twice = true;
    else if (fault >= LINKS_USB_OLD)
        u->armed = fault;
    else {
        u->device.late_ns = 1 + (int64_t)links_roll(&u->dice, 1000000) * (LINKS_LATE_NS / 1000000);
        u->device.keeps = fault == LINKS_USB_LATE_KEPT;
    }
}

static inline struct transport *links_begin_usb(struct links_usb *u, const struct profile *p,
                                                int seed)
{
    struct transport *wire;
    struct gon_error err;
    memset(u, 0, sizeof *u);
    links_device_init(&u->device, p, &u->usb.clk);
    vusb_init(&u->usb, &u->device.port);
    u->dice = (uint64_t)seed;
    u->inner = u->usb.io.ops;
    u->ops = *u->inner;
    u->ops.bulk_in = links_bulk_in;
    u->usb.io.ops = &u->ops;
    if (transport_open_usb_io(&u->usb.io, "usbtmc:1313:8078", &u->usb.clk.clk, NULL, &wire, &err) <
        0) {
        fprintf(stderr, "check_links: %s\n", err.text);
        exit(1);
    }
    return wire;
}

static inline struct links_policy links_meter(void)
{
    return (struct links_policy){.name = "usbtmc",
                                 .profile = links_profile("thorlabs-pm100"),
                                 .asks = {"read", "read"},
                                 .commands = {"READ?", "READ?"},
                                 .signals = {"power_w", "power_w"},
                                 .scale = 1,
                                 .begin = {"identity"}};
}

// The lock-in's questions, of two forms in turn.
static inline struct links_policy links_lockin(void)
{
    struct profile *p = links_profile("sr830");
    strcpy(p->framing.end_out, "\n");
    strcpy(p->framing.end_in, "\n");
    return (struct links_policy){.name = "usbtmc, two forms",
                                 .profile = p,
                                 .asks = {"snap_wide", "snap"},
                                 .commands = {"SNAP?1,9,2", "SNAP?1,9"},
                                 .signals = {"x", "x"},
                                 .scale = 1,
                                 .begin = {"sync", "range"}};
}

static inline struct links_tally links_measure_usb(const struct links_policy *p, int reads,
                                                   int seed)
{
    static struct links_usb u;
    struct links_tally t = {.reads = reads};
    struct session *session;
    struct clk *clk = &u.usb.clk.clk;
    if (session_over(p->profile, links_begin_usb(&u, p->profile, seed), &session, NULL) < 0)
        exit(1);
    links_begin_session(session, p);
    for (int i = 0; i < reads; i++) {
        links_arm(&u);
        links_read(session, p, i, clk, &t);
    }
    session_free(session);
    t.faults = u.faults;
    t.line_s = (double)u.usb.clk.t_ns * 1e-9;
    return t;
}

// One transfer out, one in, whatever its header says; a halt is cleared.
static inline struct links_tally links_measure_bare_usb(const struct links_policy *p, int reads,
                                                        int seed)
{
    static struct links_usb u;
    struct links_tally t = {.reads = reads};
    struct clk *clk = &u.usb.clk.clk;
    const struct usb_io_ops *ops = &u.ops;
    uint8_t tag = 0;
    transport_close(links_begin_usb(&u, p->profile, seed)); // clears it once
    for (int i = 0; i < reads; i++) {
        const char *command = p->commands[i % 2];
        uint8_t frame[64], in[SIM_USB_PACKET + 1] = {0};
        char line[32];
        const int64_t begun_ns = clk_now_ns(clk), deadline_ns = begun_ns + CLK_MS(LINKS_TIMEOUT_MS);
        links_arm(&u);
        const int length = snprintf(line, sizeof line, "%s\n", command);
        const size_t size = usbtmc_frame_out(frame, sizeof frame, tag = usbtmc_next_tag(tag), line,
                                             (size_t)length, true);
        ops->bulk_out(&u.usb.io, SIM_USB_OUT, frame, size, deadline_ns);
        usbtmc_frame_request(frame, tag = usbtmc_next_tag(tag), 4096);
        ops->bulk_out(&u.usb.io, SIM_USB_OUT, frame, USBTMC_HEADER, deadline_ns);
        const int rc = ops->bulk_in(&u.usb.io, SIM_USB_IN, in, SIM_USB_PACKET, deadline_ns);
        if (rc < USBTMC_HEADER) {
            ops->clear_halt(&u.usb.io, SIM_USB_IN);
            ops->clear_halt(&u.usb.io, SIM_USB_OUT);
            t.refused++;
            continue;
        }
        const size_t said = links_size(in), room = SIM_USB_PACKET - USBTMC_HEADER;
        in[USBTMC_HEADER + (said < room ? said : room)] = 0;
        links_believe((const char *)in + USBTMC_HEADER, p, i, links_tick(begun_ns),
                      links_tick(clk_now_ns(clk)), &t);
    }
    t.faults = u.faults;
    t.line_s = (double)u.usb.clk.t_ns * 1e-9;
    return t;
}
