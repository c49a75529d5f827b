// SPDX-License-Identifier: MIT
#include "drivers/checksum.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { LONGEST = 8 }; // characters of 32 bits in hexadecimal

static uint32_t mask_of(const struct profile_checksum *c)
{
    return (uint32_t)((UINT64_C(1) << c->width) - 1);
}

static uint32_t reflected(uint32_t value, int width)
{
    uint32_t turned = 0;
    for (int i = 0; i < width; i++)
        turned |= (value >> i & 1) << (width - 1 - i);
    return turned;
}

// Bit by bit with the register's highest bit first; a command is some ten bytes long.
static uint32_t crc_of(const struct profile_checksum *c, const unsigned char *bytes, size_t size)
{
    uint32_t crc = c->initial;
    for (size_t i = 0; i < size; i++) {
        const uint32_t byte = c->reflect_in ? reflected(bytes[i], 8) : bytes[i];
        for (int bit = 7; bit >= 0; bit--) {
            const uint32_t out = (crc >> (c->width - 1) ^ byte >> bit) & 1;
            crc = crc << 1 ^ (out ? c->polynomial : 0);
        }
    }
    crc &= mask_of(c);
    return (c->reflect_out ? reflected(crc, c->width) : crc) ^ c->xor_out;
}

uint32_t checksum_of(const struct profile_checksum *c, const void *bytes, size_t size)
{
    const unsigned char *at = bytes;
    uint32_t value = c->initial;
    if (c->kind == PROFILE_NO_SUM)
        return 0;
    if (c->kind == PROFILE_CRC)
        return crc_of(c, at, size) & mask_of(c);
    for (size_t i = 0; i < size; i++)
        value = c->kind == PROFILE_XOR ? value ^ at[i] : value + at[i];
    if (c->kind == PROFILE_LRC)
        value = -value;
    return (value ^ c->xor_out) & mask_of(c);
}

static bool is_raw(const struct profile_checksum *c)
{
    return c->form == PROFILE_RAW_HIGH || c->form == PROFILE_RAW_LOW;
}

static size_t size_of(const struct profile_checksum *c)
{
    return (size_t)(is_raw(c) ? c->width / 8 : c->width / 4);
}

// As it stands behind the text, without what stands before it.
static void write_sum(const struct profile_checksum *c, uint32_t sum, char ret_sum[LONGEST + 1])
{
    const int bytes = c->width / 8;
    if (is_raw(c))
        for (int i = 0; i < bytes; i++)
            ret_sum[i] = (char)(sum >> 8 * (c->form == PROFILE_RAW_LOW ? i : bytes - 1 - i));
    else
        snprintf(ret_sum, LONGEST + 1, c->form == PROFILE_HEX_LOWER ? "%0*" PRIx32 : "%0*" PRIX32,
                 c->width / 4, sum);
}

int checksum_append(const struct profile_checksum *c, char *text, size_t have, size_t size,
                    size_t *ret_size, struct gon_error *err)
{
    const size_t before = strlen(c->before), all = before + size_of(c);
    char sum[LONGEST + 1] = "";
    if (c->kind == PROFILE_NO_SUM) {
        *ret_size = have;
        return 0;
    }
    if (have + all >= size)
        return gon_fail(err, GON_E_INPUT, "no room for the checksum behind %zu bytes", have);
    write_sum(c, checksum_of(c, text, have), sum);
    memcpy(text + have, c->before, before);
    memcpy(text + have + before, sum, size_of(c));
    text[have + all] = 0;
    *ret_size = have + all;
    return 0;
}

static void printable(const char *bytes, size_t size, char ret_text[3 * LONGEST + 1])
{
    for (size_t i = 0; i < size; i++)
        snprintf(ret_text + 3 * i, 4, "%s%02X", i ? " " : "", (unsigned char)bytes[i]);
}

static int wrong(const struct profile_checksum *c, const char *got, const char *expected,
                 struct gon_error *err)
{
    char got_bytes[3 * LONGEST + 1] = "", expected_bytes[3 * LONGEST + 1] = "";
    if (!is_raw(c))
        return gon_fail(err, GON_E_LINK, "wrong checksum: got '%.*s' / expected '%s'",
                        (int)size_of(c), got, expected);
    printable(got, size_of(c), got_bytes);
    printable(expected, size_of(c), expected_bytes);
    return gon_fail(err, GON_E_LINK, "wrong checksum: got %s / expected %s", got_bytes,
                    expected_bytes);
}

int checksum_take(const struct profile_checksum *c, char *text, size_t have, size_t *ret_size,
                  struct gon_error *err)
{
    const size_t before = strlen(c->before), all = before + size_of(c);
    char sum[LONGEST + 1] = "";
    if (c->kind == PROFILE_NO_SUM) {
        *ret_size = have;
        return 0;
    }
    if (have < all || memcmp(text + have - all, c->before, before) != 0)
        return gon_fail(err, GON_E_LINK, "the checksum is missing behind '%.*s'",
                        have < 80 ? (int)have : 80, text);
    const char *got = text + have - size_of(c);
    write_sum(c, checksum_of(c, text, have - all), sum);
    if (is_raw(c) ? memcmp(got, sum, size_of(c)) : strncasecmp(got, sum, size_of(c)))
        return wrong(c, got, sum, err);
    text[have - all] = 0;
    *ret_size = have - all;
    return 0;
}
