// SPDX-License-Identifier: MIT
// drivers/bus.h and the unmodified libmodbus on a bad line. Every answer carries the number of its
// request, so that it is known which question it belongs to.
#pragma once
#include "drivers/bus.h"
#include "sim/modbus.h"
#include "tests/slow/links.h"

static uint32_t links_asked; // requests that reached the device

// The first two registers of an answer are the number of its request, the others their address.
static inline int links_read_numbered(void *ctx, int address, int count, uint16_t *ret_registers,
                                      int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    links_asked++;
    for (int i = 0; i < count; i++)
        ret_registers[i] = (uint16_t)(address + i);
    ret_registers[0] = (uint16_t)(links_asked >> 16);
    ret_registers[1] = (uint16_t)links_asked;
    return 0;
}

static inline int links_write_nothing(void *ctx, int address, int count, const uint16_t *registers,
                                      int64_t t_ns)
{
    (void)ctx, (void)address, (void)count, (void)registers, (void)t_ns;
    return 0;
}

static struct sim_modbus links_slave;

static inline struct clk *links_begin_modbus(bool tcp, int seed)
{
    sim_modbus_init(&links_slave, tcp, 0, LINKS_REPLY_NS);
    sim_modbus_add(&links_slave, (struct sim_modbus_unit){.id = 1,
                                                          .read = links_read_numbered,
                                                          .write = links_write_nothing});
    links_asked = 0;
    // TCP has a checksum of its own: what arrives was sent so.
    return links_begin(&links_slave.port, tcp,
                       (1u << NOISY_ALL) - 1 - (tcp ? 1u << NOISY_CHANGED : 0), seed);
}

// As the drivers ask: neighbouring reads have different lengths.
static inline int links_address_of(int i)
{
    return i * 7 % 40;
}

static inline int links_count_of(int i)
{
    return i % 2 ? 8 : 4;
}

static inline bool links_is_of(uint32_t before, const uint16_t *r, int i)
{
    const uint32_t number = (uint32_t)r[0] << 16 | r[1];
    bool right = number > before && number <= links_asked;
    for (int k = 2; k < links_count_of(i); k++)
        right &= r[k] == links_address_of(i) + k;
    return right;
}

static inline struct links_tally links_measure_bus(bool tcp, int reads, int seed)
{
    struct links_tally t = {0};
    struct gon_error err;
    struct bus *b;
    struct clk *clk = links_begin_modbus(tcp, seed);
    if (bus_open(vline.bus, LINKS_TIMEOUT_MS, LINKS_QUIET_MS, clk, NULL, &b, &err) < 0) {
        fprintf(stderr, "check_links: %s\n", err.text);
        exit(1);
    }
    for (int i = 0; i < reads; i++) {
        const uint32_t before = links_asked;
        uint16_t r[8];
        if (bus_read(b, 1, links_address_of(i), links_count_of(i), r, NULL) < 0) {
            t.refused++;
            continue;
        }
        t.answered++;
        t.wrong += !links_is_of(before, r, i);
    }
    bus_close(b);
    links_finish(&t, reads);
    return t;
}

// A client that asks and takes what comes when it is long enough and its checksum is right.
static inline struct links_tally links_measure_bare_bus(bool tcp, int reads, int seed)
{
    struct links_tally t = {0};
    struct transport *wire;
    struct clk *clk = links_begin_modbus(tcp, seed);
    if (transport_open(vline.link, clk, NULL, &wire, NULL) < 0)
        exit(1);
    for (int i = 0; i < reads; i++) {
        const uint32_t before = links_asked;
        const uint8_t pdu[5] = {3, 0, (uint8_t)links_address_of(i), 0, (uint8_t)links_count_of(i)};
        const size_t size = (size_t)(tcp ? 9 : 5) + 2 * (size_t)links_count_of(i);
        uint8_t frame[12] = {0}, in[64];
        size_t have = 0;
        if (tcp) {
            memcpy(frame, (const uint8_t[]){(uint8_t)(i >> 8), (uint8_t)i, 0, 0, 0, 6, 1}, 7);
            memcpy(frame + 7, pdu, 5);
        } else {
            frame[0] = 1;
            memcpy(frame + 1, pdu, 5);
            const uint16_t crc = sim_modbus_crc(frame, 6);
            frame[6] = (uint8_t)crc, frame[7] = (uint8_t)(crc >> 8);
        }
        transport_write(wire, frame, tcp ? 12 : 8, clk_now_ns(clk) + CLK_MS(100), NULL);
        const int64_t deadline_ns = clk_now_ns(clk) + CLK_MS(LINKS_TIMEOUT_MS);
        int rc = 1;
        while (have < size &&
               (rc = transport_read(wire, in + have, size - have, deadline_ns, NULL)) > 0)
            have += (size_t)rc;
        clk_sleep(clk, CLK_MS(2), NULL);
        if (rc < 0) {
            t.refused++;
            continue;
        }
        const size_t data = tcp ? 9 : 3;
        if (!tcp && sim_modbus_crc(in, size - 2) != (in[size - 2] | in[size - 1] << 8)) {
            t.refused++;
            continue;
        }
        uint16_t r[8];
        for (int k = 0; k < links_count_of(i); k++)
            r[k] = (uint16_t)(in[data + 2 * (size_t)k] << 8 | in[data + 2 * (size_t)k + 1]);
        t.answered++;
        t.wrong += !links_is_of(before, r, i);
    }
    transport_close(wire);
    links_finish(&t, reads);
    return t;
}
