// SPDX-License-Identifier: MIT
// A simulated USB device of the class USBTMC, subclass USB488, as bytes and times: control
// requests, bulk-out and bulk-in as a host controller would carry them, any struct port behind it
// that answers in lines of text. Written from the specifications (USBTMC 1.0, USB488 1.0, 2003),
// not from gonio's driver. No I/O and no USB: unit tests, a simulation in virtual time and a server
// of USB requests drive it through these calls. Thread: one.
//
// A command ends with EOM: where its text lacks the line's end, that is added. An answer ends with
// the line's end, which is sent, and EOM.
#pragma once
#include "sim/port.h"

enum { SIM_USB_NAK = -1, SIM_USB_STALL = -2 }; // not yet; halted or unknown
enum { SIM_USB_IN = 0x82, SIM_USB_OUT = 0x01, SIM_USB_PACKET = 64 };
enum { SIM_USB_ANSWERS = 16384, SIM_USB_TRANSFER = 8192, SIM_USB_SETUP = 8 };

// Each is the number of times that it still happens.
enum sim_usb_fault {
    SIM_USB_STALL_IN,  // the next answer
    SIM_USB_STALL_OUT, // the next command
    SIM_USB_WRONG_TAG, // of another request, with its complement
    SIM_USB_WRONG_COMPLEMENT,
    SIM_USB_WRONG_ID,
    SIM_USB_HUGE,        // promises 4 GB
    SIM_USB_SMALL,       // says half of what it sends
    SIM_USB_LARGE,       // says twice as much
    SIM_USB_SHORT,       // a short packet in the middle of the transfer
    SIM_USB_SPLIT,       // half of the message, without EOM
    SIM_USB_EMPTY_END,   // all of the message without EOM, which then comes alone
    SIM_USB_ZERO_PACKET, // ends a transfer of whole packets, as some devices do
    SIM_USB_PENDING,     // the answer to CHECK_...
    SIM_USB_STALE,       // clearing is pending until bytes in the FIFO were read
    SIM_USB_DEAF,        // a command is taken and forgotten
    SIM_USB_FAULTS
};

struct sim_usb_identity {
    uint16_t vendor, product;
    const char *manufacturer, *name, *serial; // borrowed
};

struct sim_usbtmc {
    struct port *port;
    struct sim_usb_identity identity;
    const char *end; // of a line
    bool halted_in, halted_out;
    // the command that comes in
    uint8_t header[12];
    size_t header_have, payload_left, padding_left;
    uint8_t last_byte, out_tag;
    // the request that is out, and the transfer that answers it
    bool requested;
    bool end_owed; // the message was sent without EOM
    uint8_t in_tag;
    uint32_t most;
    uint8_t transfer[SIM_USB_TRANSFER];
    size_t stale;           // bytes in the FIFO that a clear left there
    size_t at, size, pause; // pause: a short packet ends there; 0: none
    bool zero_packet;       // is still to come
    // what the instrument has said
    uint8_t answers[SIM_USB_ANSWERS];
    size_t answers_have;
    unsigned fault[SIM_USB_FAULTS];
    bool remote;
    uint64_t requests[256]; // class requests seen, by number
    uint64_t commands, transfers, halts_cleared;
};

// Borrows port and all strings. end: the line's end, "\n".
void sim_usbtmc_init(struct sim_usbtmc *u, struct port *port, const char *end,
                     const struct sim_usb_identity *identity);
void sim_usbtmc_reset(struct sim_usbtmc *u); // bus reset, unplugged: as switched on, faults stay

// The 8 bytes of a setup packet, and room for the data of a request towards the host. The bytes of
// the answer, or SIM_USB_STALL.
int sim_usbtmc_control(struct sim_usbtmc *u, const uint8_t setup[SIM_USB_SETUP], uint8_t *data,
                       size_t room, int64_t t_ns);
// Takes all of it, or SIM_USB_STALL.
int sim_usbtmc_bulk_out(struct sim_usbtmc *u, const uint8_t *bytes, size_t size, int64_t t_ns);
// Less than room: a short packet ended it. SIM_USB_NAK: ask again at sim_usbtmc_next_ns.
int sim_usbtmc_bulk_in(struct sim_usbtmc *u, uint8_t *bytes, size_t room, int64_t t_ns);
int64_t sim_usbtmc_next_ns(const struct sim_usbtmc *u); // PORT_NEVER

// The device descriptor and the configuration's, as a hub reads them.
enum { SIM_USB_DESCRIPTORS = 18 + 32 };
void sim_usbtmc_descriptors(const struct sim_usbtmc *u, uint8_t ret_bytes[SIM_USB_DESCRIPTORS]);

// "stall_in", "wrong_tag", ... as above; false: unknown.
bool sim_usbtmc_set_fault(struct sim_usbtmc *u, const char *name, unsigned count);
