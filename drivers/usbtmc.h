// SPDX-License-Identifier: MIT
// The bytes of USBTMC 1.0 and its subclass USB488 (USB-IF, 2003), as the host sees them. Pure: no
// I/O, no time, no memory. Thread: any.
//
// Every bulk transfer begins with 12 bytes: a message id, a tag that the host counts 1..255, the
// tag's complement, zero; then the size of the payload (little endian), flags, zeros. What follows
// is padded to a multiple of 4. Nothing that a device says is believed before it was checked
// against what was asked for: sizes are bounded before anything is copied.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { USBTMC_HEADER = 12, USBTMC_CAPABILITIES = 24, USBTMC_STATUS_MOST = 8 };

// What an interface that speaks this calls itself.
enum { USBTMC_CLASS = 0xfe, USBTMC_SUBCLASS = 0x03, USBTMC_PROTOCOL_USB488 = 0x01 };

enum usbtmc_request {
    USBTMC_INITIATE_ABORT_BULK_OUT = 1, // value: tag; index: endpoint; 2 bytes
    USBTMC_CHECK_ABORT_BULK_OUT = 2,    // 0; endpoint; 8 bytes
    USBTMC_INITIATE_ABORT_BULK_IN = 3,
    USBTMC_CHECK_ABORT_BULK_IN = 4,
    USBTMC_INITIATE_CLEAR = 5, // 0; interface; 1 byte
    USBTMC_CHECK_CLEAR = 6,    // 0; interface; 2 bytes
    USBTMC_GET_CAPABILITIES = 7,
    USBTMC_READ_STATUS_BYTE = 128, // tag 2..127; interface; 3 bytes
    USBTMC_REN_CONTROL = 160       // 1: remote; interface; 1 byte
};

enum usbtmc_status { USBTMC_SUCCESS = 0x01, USBTMC_PENDING = 0x02, USBTMC_FAILED = 0x80 };

#define USBTMC_MESSAGE_AVAILABLE 0x10 // in the status byte (IEEE 488.2)

struct usbtmc_setup { // a control request, all of them towards the host
    uint8_t type, request;
    uint16_t value, index, length;
};

// The setup for a request about an interface, or about an endpoint (the four abort requests).
struct usbtmc_setup usbtmc_setup(enum usbtmc_request request, uint16_t value, uint8_t index);

uint8_t usbtmc_next_tag(uint8_t tag); // 1..255, never 0

// DEV_DEP_MSG_OUT: a part of a message, the last one with end. Returns the bytes of the frame;
// 0: room is too small.
size_t usbtmc_frame_out(uint8_t *frame, size_t room, uint8_t tag, const void *data, size_t size,
                        bool end);
// REQUEST_DEV_DEP_MSG_IN: asks for at most that many bytes of payload.
void usbtmc_frame_request(uint8_t frame[USBTMC_HEADER], uint8_t tag, uint32_t most);

enum usbtmc_verdict {
    USBTMC_GOOD,
    USBTMC_SHORT,     // less than a header
    USBTMC_WRONG_ID,  // not DEV_DEP_MSG_IN
    USBTMC_WRONG_TAG, // of another request, or not the complement of its copy
    USBTMC_WRONG_SIZE // more than was asked for, or nothing at all without an end
};

struct usbtmc_in {
    uint32_t size; // of the payload in this transfer, at most what was asked for
    bool end;      // of the message (EOM)
};

// The header of an answer to the request with this tag and this most.
enum usbtmc_verdict usbtmc_parse_in(const uint8_t *bytes, size_t size, uint8_t tag, uint32_t most,
                                    struct usbtmc_in *ret_in);
const char *usbtmc_verdict_text(enum usbtmc_verdict verdict);

struct usbtmc_capabilities {
    bool usb488; // answers READ_STATUS_BYTE
    bool remote; // takes REN_CONTROL
};

// False: not a successful answer; bytes that are missing mean no. usb488_protocol: the interface
// says it speaks USB488.
bool usbtmc_parse_capabilities(const uint8_t *bytes, size_t size, bool usb488_protocol,
                               struct usbtmc_capabilities *ret_capabilities);

// A string descriptor as ASCII (others become '?'), without blanks around; false: it is none.
bool usbtmc_parse_string(const uint8_t *bytes, size_t size, char *ret_text, size_t room);
