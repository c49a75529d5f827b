// SPDX-License-Identifier: MIT
#include "sim/actor_sum.h"

#include <stdio.h>
#include <string.h>

static uint32_t turned(uint32_t value, int width)
{
    uint32_t other = 0;
    for (int i = 0; i < width; i++)
        other |= (value >> i & 1) << (width - 1 - i);
    return other;
}

static uint32_t mask(const struct profile_checksum *c)
{
    return c->width >= 32 ? UINT32_MAX : (UINT32_C(1) << c->width) - 1;
}

// Bit by bit, the highest first, as the catalogue's model says.
static uint32_t crc(const struct profile_checksum *c, const char *text, size_t size)
{
    uint32_t sum = c->initial;
    for (size_t i = 0; i < size; i++) {
        uint32_t byte = (uint8_t)text[i];
        byte = c->reflect_in ? turned(byte, 8) : byte;
        for (int bit = 7; bit >= 0; bit--) {
            uint32_t out = (sum >> (c->width - 1) ^ byte >> bit) & 1;
            sum = sum << 1 ^ (out ? c->polynomial : 0);
        }
    }
    sum &= mask(c);
    return (c->reflect_out ? turned(sum, c->width) : sum) ^ c->xor_out;
}

static uint32_t sum_of(const struct profile_checksum *c, const char *text, size_t size)
{
    uint32_t sum = c->initial;
    if (c->kind == PROFILE_CRC)
        return crc(c, text, size) & mask(c);
    for (size_t i = 0; i < size; i++)
        sum = c->kind == PROFILE_XOR ? sum ^ (uint8_t)text[i] : sum + (uint8_t)text[i];
    return ((c->kind == PROFILE_LRC ? -sum : sum) ^ c->xor_out) & mask(c);
}

size_t actor_sum_add(const struct profile_checksum *c, char *line, size_t size)
{
    if (c->kind == PROFILE_NO_SUM)
        return size;
    uint32_t sum = sum_of(c, line, size);
    size_t before = strlen(c->before);
    int bytes = c->width / 8;
    memcpy(line + size, c->before, before);
    size += before;
    if (c->form == PROFILE_HEX_UPPER)
        return size + (size_t)sprintf(line + size, "%0*X", 2 * bytes, sum);
    if (c->form == PROFILE_HEX_LOWER)
        return size + (size_t)sprintf(line + size, "%0*x", 2 * bytes, sum);
    for (int i = 0; i < bytes; i++)
        line[size++] = (char)(sum >> 8 * (c->form == PROFILE_RAW_LOW ? i : bytes - 1 - i));
    return size;
}

int actor_sum_check(const struct profile_checksum *c, const char *line, size_t size)
{
    char again[PROFILE_LONG + ACTOR_SUM_MOST];
    size_t added = actor_sum_add(c, again, 0); // its size does not depend on the text
    if (size < added || size > PROFILE_LONG)
        return -1;
    size_t text = size - added;
    memcpy(again, line, text);
    actor_sum_add(c, again, text);
    return memcmp(again, line, size) == 0 ? (int)text : -1;
}
