// SPDX-License-Identifier: MIT
#include "drivers/usbtmc.h"

#include <string.h>

enum { DEV_DEP_MSG_OUT = 1, REQUEST_DEV_DEP_MSG_IN = 2, DEV_DEP_MSG_IN = 2 };
enum { FLAG_END = 0x01, STRING_DESCRIPTOR = 3 };
enum { TYPE_INTERFACE = 0xa1, TYPE_ENDPOINT = 0xa2 }; // class requests, device to host

static void put_u32(uint8_t *to, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        to[i] = (uint8_t)(value >> (8 * i));
}

static uint32_t get_u32(const uint8_t *from)
{
    return from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

static uint16_t answer_length(enum usbtmc_request request)
{
    switch (request) {
    case USBTMC_INITIATE_ABORT_BULK_OUT:
    case USBTMC_INITIATE_ABORT_BULK_IN:
    case USBTMC_CHECK_CLEAR: return 2;
    case USBTMC_CHECK_ABORT_BULK_OUT:
    case USBTMC_CHECK_ABORT_BULK_IN: return 8;
    case USBTMC_GET_CAPABILITIES: return USBTMC_CAPABILITIES;
    case USBTMC_READ_STATUS_BYTE: return 3;
    case USBTMC_INITIATE_CLEAR:
    case USBTMC_REN_CONTROL: break;
    }
    return 1;
}

struct usbtmc_setup usbtmc_setup(enum usbtmc_request request, uint16_t value, uint8_t index)
{
    const bool endpoint = request <= USBTMC_CHECK_ABORT_BULK_IN;
    return (struct usbtmc_setup){.type = endpoint ? TYPE_ENDPOINT : TYPE_INTERFACE,
                                 .request = (uint8_t)request,
                                 .value = value,
                                 .index = index,
                                 .length = answer_length(request)};
}

uint8_t usbtmc_next_tag(uint8_t tag)
{
    return tag == 255 ? 1 : (uint8_t)(tag + 1);
}

static void put_header(uint8_t *frame, uint8_t id, uint8_t tag, uint32_t size, uint8_t flags)
{
    memset(frame, 0, USBTMC_HEADER);
    frame[0] = id;
    frame[1] = tag;
    frame[2] = (uint8_t)(255 - tag);
    put_u32(frame + 4, size);
    frame[8] = flags;
}

size_t usbtmc_frame_out(uint8_t *frame, size_t room, uint8_t tag, const void *data, size_t size,
                        bool end)
{
    if (room < USBTMC_HEADER + 3 || size > room - USBTMC_HEADER - 3 || size > UINT32_MAX)
        return 0;
    const size_t padded = (size + 3) & ~(size_t)3;
    put_header(frame, DEV_DEP_MSG_OUT, tag, (uint32_t)size, end ? FLAG_END : 0);
    memcpy(frame + USBTMC_HEADER, data, size);
    memset(frame + USBTMC_HEADER + size, 0, padded - size);
    return USBTMC_HEADER + padded;
}

void usbtmc_frame_request(uint8_t frame[USBTMC_HEADER], uint8_t tag, uint32_t most)
{
    put_header(frame, REQUEST_DEV_DEP_MSG_IN, tag, most, 0);
}

enum usbtmc_verdict usbtmc_parse_in(const uint8_t *bytes, size_t size, uint8_t tag, uint32_t most,
                                    struct usbtmc_in *ret_in)
{
    if (size < USBTMC_HEADER)
        return USBTMC_SHORT;
    if (bytes[0] != DEV_DEP_MSG_IN)
        return USBTMC_WRONG_ID;
    if (bytes[1] != tag || bytes[2] != 255 - tag)
        return USBTMC_WRONG_TAG;
    const uint32_t payload = get_u32(bytes + 4);
    const bool end = bytes[8] & FLAG_END;
    if (payload > most || (payload == 0 && !end))
        return USBTMC_WRONG_SIZE;
    *ret_in = (struct usbtmc_in){.size = payload, .end = end};
    return USBTMC_GOOD;
}

const char *usbtmc_verdict_text(enum usbtmc_verdict verdict)
{
    switch (verdict) {
    case USBTMC_GOOD: return "good";
    case USBTMC_SHORT: return "an answer without a header";
    case USBTMC_WRONG_ID: return "something that is no answer";
    case USBTMC_WRONG_TAG: return "the answer to another question (wrong tag)";
    case USBTMC_WRONG_SIZE: break;
    }
    return "an answer of an impossible size";
}

bool usbtmc_parse_capabilities(const uint8_t *bytes, size_t size, bool usb488_protocol,
                               struct usbtmc_capabilities *ret_capabilities)
{
    if (size == 0 || bytes[0] != USBTMC_SUCCESS)
        return false;
    *ret_capabilities = (struct usbtmc_capabilities){
        .usb488 = usb488_protocol, .remote = usb488_protocol && size > 14 && (bytes[14] & 0x02)};
    return true;
}

bool usbtmc_parse_string(const uint8_t *bytes, size_t size, char *ret_text, size_t room)
{
    if (size < 2 || bytes[0] < 2 || bytes[1] != STRING_DESCRIPTOR || room == 0)
        return false;
    const size_t said = bytes[0] < size ? bytes[0] : size;
    size_t used = 0;
    for (size_t i = 2; i + 1 < said && used + 1 < room; i += 2) {
        const bool plain = bytes[i + 1] == 0 && bytes[i] >= 0x20 && bytes[i] < 0x7f;
        if (plain && bytes[i] == ' ' && used == 0)
            continue;
        ret_text[used++] = plain ? (char)bytes[i] : '?';
    }
    while (used > 0 && ret_text[used - 1] == ' ')
        used--;
    ret_text[used] = 0;
    return true;
}
