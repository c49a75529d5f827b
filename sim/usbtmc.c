// SPDX-License-Identifier: MIT
#include "sim/usbtmc.h"

#include <string.h>

enum { MSG_OUT = 1, REQUEST_IN = 2, HEADER = 12 };
enum { SUCCESS = 0x01, PENDING = 0x02, FAILED = 0x80, NOT_IN_PROGRESS = 0x81 };

static const char *const fault_names[SIM_USB_FAULTS] = {
    "stall_in", "stall_out", "wrong_tag", "wrong_complement", "wrong_id", "huge",  "small", "large",
    "short",    "split",     "empty_end", "zero_packet",      "pending",  "stale", "deaf"};

bool sim_usbtmc_set_fault(struct sim_usbtmc *u, const char *name, unsigned count)
{
    for (int i = 0; i < SIM_USB_FAULTS; i++)
        if (strcmp(fault_names[i], name) == 0) {
            u->fault[i] = count;
            return true;
        }
    return false;
}

static bool strikes(struct sim_usbtmc *u, enum sim_usb_fault fault)
{
    if (u->fault[fault] == 0)
        return false;
    u->fault[fault]--;
    return true;
}

void sim_usbtmc_init(struct sim_usbtmc *u, struct port *port, const char *end,
                     const struct sim_usb_identity *identity)
{
    memset(u, 0, sizeof *u);
    u->port = port;
    u->end = end;
    u->identity = *identity;
}

static void forget_in(struct sim_usbtmc *u)
{
    u->requested = u->zero_packet = false;
    u->at = u->size = u->pause = 0;
}

static void forget_out(struct sim_usbtmc *u)
{
    u->header_have = u->payload_left = u->padding_left = 0;
}

static void forget_all(struct sim_usbtmc *u)
{
    forget_in(u);
    forget_out(u);
    u->answers_have = 0;
    u->end_owed = false;
    port_hangup(u->port);
}

void sim_usbtmc_reset(struct sim_usbtmc *u)
{
    forget_all(u);
    u->stale = 0;
    u->halted_in = u->halted_out = u->remote = false;
}

int64_t sim_usbtmc_next_ns(const struct sim_usbtmc *u)
{
    return port_next_ns(u->port);
}

// --- what the instrument says --------------------------------------------------------------------

static void gather(struct sim_usbtmc *u, int64_t t_ns)
{
    uint8_t bytes[PORT_REPLY_MOST];
    for (size_t n; (n = port_take(u->port, t_ns, bytes, NULL)) > 0;) {
        if (n > sizeof u->answers - u->answers_have) // nobody reads it: the oldest is kept
            continue;
        memcpy(u->answers + u->answers_have, bytes, n);
        u->answers_have += n;
    }
}

// The first message with its end; 0: it is not whole yet.
static size_t first_message(const struct sim_usbtmc *u)
{
    const size_t length = strlen(u->end);
    const uint8_t *end = memmem(u->answers, u->answers_have, u->end, length);
    return end ? (size_t)(end - u->answers) + length : 0;
}

static void put_size(uint8_t *header, size_t size)
{
    for (int i = 0; i < 4; i++)
        header[4 + i] = (uint8_t)(size >> (8 * i));
}

static void corrupt(struct sim_usbtmc *u, size_t payload)
{
    uint8_t *b = u->transfer;
    if (strikes(u, SIM_USB_WRONG_TAG)) {
        b[1] = b[1] == 255 ? 1 : b[1] + 1;
        b[2] = (uint8_t)(255 - b[1]);
    }
    if (strikes(u, SIM_USB_WRONG_COMPLEMENT))
        b[2] ^= 0x10;
    if (strikes(u, SIM_USB_WRONG_ID))
        b[0] = MSG_OUT + 126;
    if (strikes(u, SIM_USB_HUGE))
        memset(b + 4, 0xff, 4);
    if (payload > 1 && strikes(u, SIM_USB_SMALL))
        put_size(b, payload / 2);
    if (payload > 1 && strikes(u, SIM_USB_LARGE))
        put_size(b, 2 * payload);
    if (payload > 1 && strikes(u, SIM_USB_SHORT))
        u->pause = HEADER + 1;
}

static void put_transfer(struct sim_usbtmc *u, size_t payload, bool end)
{
    memset(u->transfer, 0, HEADER);
    u->transfer[0] = REQUEST_IN;
    u->transfer[1] = u->in_tag;
    u->transfer[2] = (uint8_t)(255 - u->in_tag);
    put_size(u->transfer, payload);
    u->transfer[8] = end;
    memcpy(u->transfer + HEADER, u->answers, payload);
    u->answers_have -= payload;
    memmove(u->answers, u->answers + payload, u->answers_have);
    u->size = HEADER + payload;
    while (u->size % 4)
        u->transfer[u->size++] = 0;
    u->at = 0;
    u->transfers++;
    corrupt(u, payload);
}

// Answers the request when a message, or as much as was asked for, has been said.
static void load(struct sim_usbtmc *u)
{
    const size_t message = first_message(u);
    size_t room = sizeof u->transfer - HEADER - 3;
    room = u->most < room ? u->most : room;
    size_t payload = message ? message : u->answers_have;
    if (u->end_owed) {
        u->end_owed = false;
        put_transfer(u, 0, true);
    } else if (message && message <= room) {
        if (message > 1 && strikes(u, SIM_USB_SPLIT))
            put_transfer(u, message / 2, false);
        else {
            u->end_owed = strikes(u, SIM_USB_EMPTY_END);
            put_transfer(u, message, !u->end_owed);
        }
    } else if (payload >= room) {
        put_transfer(u, room, false);
    }
}

int sim_usbtmc_bulk_in(struct sim_usbtmc *u, uint8_t *bytes, size_t room, int64_t t_ns)
{
    gather(u, t_ns);
    if (u->halted_in)
        return SIM_USB_STALL;
    if (u->stale > 0) {
        const size_t n = u->stale < room ? u->stale : room;
        memset(bytes, 0xee, n);
        u->stale -= n;
        return (int)n;
    }
    if (u->zero_packet && u->size == 0) {
        u->zero_packet = false;
        return 0;
    }
    if (u->requested && u->size == 0)
        load(u);
    if (u->size == 0)
        return SIM_USB_NAK;
    if (strikes(u, SIM_USB_STALL_IN)) {
        u->halted_in = true;
        forget_in(u);
        return SIM_USB_STALL;
    }
    const size_t stop = u->at < u->pause ? u->pause : u->size;
    const size_t n = stop - u->at < room ? stop - u->at : room;
    memcpy(bytes, u->transfer + u->at, n);
    u->at += n;
    if (u->at == u->size) {
        const bool whole_packets = u->size % SIM_USB_PACKET == 0;
        forget_in(u);
        u->zero_packet = whole_packets && strikes(u, SIM_USB_ZERO_PACKET);
    }
    return (int)n;
}

// --- what it is told -----------------------------------------------------------------------------

static void end_command(struct sim_usbtmc *u, int64_t t_ns)
{
    const size_t length = strlen(u->end);
    u->commands++;
    if (u->last_byte != (uint8_t)u->end[length - 1])
        port_feed(u->port, (const uint8_t *)u->end, length, t_ns);
}

static int halt_out(struct sim_usbtmc *u)
{
    forget_out(u);
    u->halted_out = true;
    return SIM_USB_STALL;
}

// A whole header has come: 0, or it is not one.
static int begin(struct sim_usbtmc *u)
{
    const uint8_t *h = u->header;
    const uint32_t size = h[4] | (uint32_t)h[5] << 8 | (uint32_t)h[6] << 16 | (uint32_t)h[7] << 24;
    if (h[1] == 0 || h[1] + h[2] != 255 || size == 0)
        return halt_out(u);
    u->out_tag = h[1];
    if (h[0] == REQUEST_IN && !u->requested) {
        u->requested = true;
        u->in_tag = h[1];
        u->most = size;
        u->header_have = 0;
        return 0;
    }
    if (h[0] != MSG_OUT)
        return halt_out(u);
    u->payload_left = size;
    u->padding_left = (4 - size % 4) % 4;
    return 0;
}

static size_t take_payload(struct sim_usbtmc *u, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    const size_t n = size < u->payload_left ? size : u->payload_left;
    if (u->fault[SIM_USB_DEAF] == 0)
        port_feed(u->port, bytes, n, t_ns);
    u->last_byte = bytes[n - 1];
    u->payload_left -= n;
    if (u->payload_left == 0 && (u->header[8] & 1) && !strikes(u, SIM_USB_DEAF))
        end_command(u, t_ns);
    return n;
}

static size_t take_header(struct sim_usbtmc *u, const uint8_t *bytes, size_t size)
{
    const size_t missing = HEADER - u->header_have, n = size < missing ? size : missing;
    memcpy(u->header + u->header_have, bytes, n);
    u->header_have += n;
    return n;
}

int sim_usbtmc_bulk_out(struct sim_usbtmc *u, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    if (u->halted_out)
        return SIM_USB_STALL;
    if (strikes(u, SIM_USB_STALL_OUT))
        return halt_out(u);
    for (size_t at = 0; at < size;) {
        if (u->header_have < HEADER) {
            at += take_header(u, bytes + at, size - at);
            if (u->header_have == HEADER && begin(u) < 0)
                return SIM_USB_STALL;
        } else if (u->payload_left > 0) {
            at += take_payload(u, bytes + at, size - at, t_ns);
        } else {
            u->padding_left--;
            at++;
        }
        if (u->header_have == HEADER && u->payload_left == 0 && u->padding_left == 0)
            u->header_have = 0;
    }
    return (int)size;
}

// --- descriptors ---------------------------------------------------------------------------------

void sim_usbtmc_descriptors(const struct sim_usbtmc *u, uint8_t ret_bytes[SIM_USB_DESCRIPTORS])
{
    const struct sim_usb_identity *id = &u->identity;
    const uint8_t bytes[SIM_USB_DESCRIPTORS] = {
        // device: USB 2.0, class by interface, packets of 64, strings 1, 2, 3, one configuration
        18, 1, 0, 2, 0, 0, 0, 64, (uint8_t)id->vendor, (uint8_t)(id->vendor >> 8),
        (uint8_t)id->product, (uint8_t)(id->product >> 8), 0, 1, 1, 2, 3, 1,
        // configuration 1: 32 bytes, one interface, self powered
        9, 2, 32, 0, 1, 1, 0, 0xc0, 50,
        // interface 0: two endpoints, USBTMC, USB488
        9, 4, 0, 0, 2, 0xfe, 3, 1, 0,
        // bulk endpoints
        7, 5, SIM_USB_OUT, 2, SIM_USB_PACKET, 0, 0, //
        7, 5, SIM_USB_IN, 2, SIM_USB_PACKET, 0, 0};
    memcpy(ret_bytes, bytes, sizeof bytes);
}

static size_t string_descriptor(const struct sim_usbtmc *u, uint8_t index, uint8_t bytes[255])
{
    const char *texts[] = {NULL, u->identity.manufacturer, u->identity.name, u->identity.serial};
    bytes[1] = 3;
    if (index == 0) { // languages: English (United States)
        bytes[2] = 0x09;
        bytes[3] = 0x04;
        return bytes[0] = 4;
    }
    if (index >= sizeof texts / sizeof texts[0] || !texts[index])
        return 0;
    size_t n = 2;
    for (const char *c = texts[index]; *c && n + 2 <= 254; c++) {
        bytes[n++] = (uint8_t)*c;
        bytes[n++] = 0;
    }
    return bytes[0] = (uint8_t)n;
}

// --- control requests ----------------------------------------------------------------------------

struct request {
    uint8_t type, number;
    uint16_t value, index, length;
};

// Writes the answer's bytes and returns how many, or SIM_USB_STALL.
static int standard(struct sim_usbtmc *u, const struct request *r, uint8_t answer[255])
{
    uint8_t all[SIM_USB_DESCRIPTORS];
    size_t n = 0;
    switch (r->number) {
    case 0: // GET_STATUS: of an endpoint whether it is halted
        answer[0] = r->type == 0x82 && (r->index == SIM_USB_IN ? u->halted_in : u->halted_out);
        answer[1] = 0;
        return 2;
    case 1: // CLEAR_FEATURE
        if (r->type != 0x02)
            return SIM_USB_STALL;
        u->halts_cleared++;
        if (r->index == SIM_USB_IN)
            u->halted_in = false;
        else
            u->halted_out = false;
        return 0;
    case 6: // GET_DESCRIPTOR
        sim_usbtmc_descriptors(u, all);
        if (r->value >> 8 == 1)
            memcpy(answer, all, n = 18);
        else if (r->value >> 8 == 2)
            memcpy(answer, all + 18, n = sizeof all - 18);
        else if (r->value >> 8 == 3)
            n = string_descriptor(u, (uint8_t)r->value, answer);
        return n > 0 ? (int)n : SIM_USB_STALL;
    case 8: // GET_CONFIGURATION
        answer[0] = 1;
        return 1;
    case 9:  // SET_CONFIGURATION
    case 11: // SET_INTERFACE
        return 0;
    default: return SIM_USB_STALL;
    }
}

static int initiate_abort(struct sim_usbtmc *u, const struct request *r, bool in, uint8_t *answer)
{
    const bool going = in ? u->requested : u->header_have > 0;
    const uint8_t tag = in ? u->in_tag : u->out_tag;
    answer[1] = tag;
    answer[0] = !going ? FAILED : r->value != tag ? NOT_IN_PROGRESS : SUCCESS;
    if (answer[0] == SUCCESS) {
        if (in)
            forget_in(u);
        else
            forget_out(u);
        u->zero_packet |= in; // a short packet ends the transfer
    }
    return 2;
}

static int check(struct sim_usbtmc *u, int size, uint8_t *answer)
{
    answer[1] = u->stale > 0; // read me
    answer[0] = u->stale > 0 || strikes(u, SIM_USB_PENDING) ? PENDING : SUCCESS;
    return size;
}

static int clear(struct sim_usbtmc *u, uint8_t *answer)
{
    forget_all(u);
    if (strikes(u, SIM_USB_STALE))
        u->stale = SIM_USB_PACKET + 1;
    answer[0] = SUCCESS;
    return 1;
}

static int capabilities(uint8_t *answer)
{
    const uint8_t bytes[24] = {[0] = SUCCESS, [3] = 1, [13] = 1, [14] = 0x06, [15] = 0x0c};
    memcpy(answer, bytes, sizeof bytes);
    return sizeof bytes;
}

static int read_status(struct sim_usbtmc *u, const struct request *r, uint8_t *answer)
{
    answer[0] = SUCCESS;
    answer[1] = (uint8_t)r->value;
    answer[2] = u->answers_have > 0 ? 0x10 : 0;
    return 3;
}

static int of_class(struct sim_usbtmc *u, const struct request *r, uint8_t *answer)
{
    u->requests[r->number]++;
    memset(answer, 0, 255);
    switch (r->number) {
    case 1: return initiate_abort(u, r, false, answer);
    case 2: return check(u, 8, answer);
    case 3: return initiate_abort(u, r, true, answer);
    case 4: return check(u, 8, answer);
    case 5: return clear(u, answer);
    case 6: return check(u, 2, answer);
    case 7: return capabilities(answer);
    case 128: return read_status(u, r, answer);
    case 160:
        u->remote = r->value == 1;
        answer[0] = SUCCESS;
        return 1;
    default: return SIM_USB_STALL;
    }
}

int sim_usbtmc_control(struct sim_usbtmc *u, const uint8_t setup[SIM_USB_SETUP], uint8_t *data,
                       size_t room, int64_t t_ns)
{
    const struct request r = {setup[0], setup[1], (uint16_t)(setup[2] | setup[3] << 8),
                              (uint16_t)(setup[4] | setup[5] << 8),
                              (uint16_t)(setup[6] | setup[7] << 8)};
    uint8_t answer[255];
    gather(u, t_ns);
    int n = (r.type & 0x60) == 0x20 ? of_class(u, &r, answer) : standard(u, &r, answer);
    if (n < 0)
        return n;
    if (n > r.length)
        n = r.length;
    if ((size_t)n > room)
        n = (int)room;
    memcpy(data, answer, (size_t)n);
    return n;
}
