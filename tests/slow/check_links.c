// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// Is a wrong value ever accepted from a bad link? In virtual time: the drivers and the unmodified
// libmodbus on a line where one answer in two hundred is lost, up to 3 s late, doubled up to 3 s
// later, cut, split into its bytes, wrapped in garbage or changed.
//
//   check_links [-s SEED] [-n READS]
//
// Every answer carries the number of its request, so that it is known which question it belongs to.
// Wrong is a value that does not belong to a question asked between the call and its return. Each
// policy is measured twice: as it is (0 wrong of 600,000 must come out), and by a client that asks
// and takes what comes, without the protections (which must give wrong values: so the faults bite).
#include "drivers/bus.h"
#include "drivers/message.h"
#include "sim/modbus.h"
#include "tests/unit/noisy.h"
#include "tests/unit/vline.h"

#include <getopt.h>
#include <inttypes.h>
#include <stdio.h>

enum { READS = 600000, BARE_READS = 60000, SEED = 20261126, ONE_IN = 200, REGISTERS = 64 };
#define LATE_NS CLK_S(3)
#define QUIET_MS 3100 // the largest latency, as a profile would say
#define TIMEOUT_MS 100
#define REPLY_NS CLK_MS(2)

struct tally {
    int reads, answered, wrong;
    uint64_t faults;
    double line_s; // time on the line
};

static struct noisy line;
static uint32_t asked; // requests that reached the device

static struct clk *begin(struct port *device, bool tcp, int seed)
{
    asked = 0;
    noisy_init(&line, device, (uint64_t)seed, ONE_IN);
    line.late_most_ns = line.double_most_ns = LATE_NS;
    if (tcp) { // has a checksum of its own: what arrives was sent so
        line.only = (1u << NOISY_FAULTS) - 1 - (1u << NOISY_CHANGED);
        line.one_in = ONE_IN * (NOISY_FAULTS - 1) / NOISY_FAULTS;
    }
    return tcp ? vline_begin_tcp(&line.port) : vline_begin(&line.port);
}

static void finish(struct tally *t, int reads)
{
    t->reads = reads;
    t->faults = line.faults;
    t->line_s = (double)vline.clk.t_ns * 1e-9;
}

// --- Modbus --------------------------------------------------------------------------------------

// The first two registers of an answer are the number of its request, the others their address.
static int read_numbered(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    asked++;
    for (int i = 0; i < count; i++)
        ret_registers[i] = (uint16_t)(address + i);
    ret_registers[0] = (uint16_t)(asked >> 16);
    ret_registers[1] = (uint16_t)asked;
    return 0;
}

static int write_nothing(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns)
{
    (void)ctx, (void)address, (void)count, (void)registers, (void)t_ns;
    return 0;
}

static struct sim_modbus slave;

static struct clk *begin_modbus(bool tcp, int seed)
{
    sim_modbus_init(&slave, tcp, 0, REPLY_NS);
    sim_modbus_add(
        &slave, (struct sim_modbus_unit){.id = 1, .read = read_numbered, .write = write_nothing});
    return begin(&slave.port, tcp, seed);
}

// As the drivers ask: neighbouring reads have different lengths.
static int address_of(int i)
{
    return i * 7 % 40;
}

static int count_of(int i)
{
    return i % 2 ? 8 : 4;
}

static bool is_of(uint32_t before, const uint16_t *r, int i)
{
    const uint32_t number = (uint32_t)r[0] << 16 | r[1];
    bool right = number > before && number <= asked;
    for (int k = 2; k < count_of(i); k++)
        right &= r[k] == address_of(i) + k;
    return right;
}

static struct tally measure_bus(bool tcp, int reads, int seed)
{
    struct tally t = {0};
    struct gon_error err;
    struct bus *b;
    struct clk *clk = begin_modbus(tcp, seed);
    if (bus_open(vline.bus, TIMEOUT_MS, QUIET_MS, clk, NULL, &b, &err) < 0) {
        fprintf(stderr, "check_links: %s\n", err.text);
        exit(1);
    }
    for (int i = 0; i < reads; i++) {
        const uint32_t before = asked;
        uint16_t r[8];
        if (bus_read(b, 1, address_of(i), count_of(i), r, NULL) < 0)
            continue;
        t.answered++;
        t.wrong += !is_of(before, r, i);
    }
    bus_close(b);
    finish(&t, reads);
    return t;
}

// A client that asks and takes what comes when it is long enough and its checksum is right.
static struct tally measure_bare_bus(bool tcp, int reads, int seed)
{
    struct tally t = {0};
    struct transport *wire;
    struct clk *clk = begin_modbus(tcp, seed);
    if (transport_open(vline.link, clk, NULL, &wire, NULL) < 0)
        exit(1);
    for (int i = 0; i < reads; i++) {
        const uint32_t before = asked;
        const uint8_t pdu[5] = {3, 0, (uint8_t)address_of(i), 0, (uint8_t)count_of(i)};
        const size_t size = (size_t)(tcp ? 9 : 5) + 2 * (size_t)count_of(i);
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
        const int64_t deadline_ns = clk_now_ns(clk) + CLK_MS(TIMEOUT_MS);
        int rc = 1;
        while (have < size &&
               (rc = transport_read(wire, in + have, size - have, deadline_ns, NULL)) > 0)
            have += (size_t)rc;
        clk_sleep(clk, CLK_MS(2), NULL);
        if (rc < 0)
            continue;
        const size_t data = tcp ? 9 : 3;
        if (!tcp && sim_modbus_crc(in, size - 2) != (in[size - 2] | in[size - 1] << 8))
            continue;
        uint16_t r[8];
        for (int k = 0; k < count_of(i); k++)
            r[k] = (uint16_t)(in[data + 2 * (size_t)k] << 8 | in[data + 2 * (size_t)k + 1]);
        t.answered++;
        t.wrong += !is_of(before, r, i);
    }
    transport_close(wire);
    finish(&t, reads);
    return t;
}

// --- the report ----------------------------------------------------------------------------------

static int report(const char *policy, struct tally t, bool wants_wrong)
{
    const bool good = wants_wrong ? t.wrong > 0 : t.wrong == 0 && t.answered > t.reads / 100 * 99;
    printf("%-22s %7d reads %6" PRIu64 " faults %7d answered %6d wrong %9.0f s on the line  %s\n",
           policy, t.reads, t.faults, t.answered, t.wrong, t.line_s, good ? "ok" : "FAILED");
    fflush(stdout);
    return !good;
}

int main(int argc, char **argv)
{
    int seed = SEED, reads = READS;
    for (int c; (c = getopt(argc, argv, "s:n:")) != -1;) {
        if (c == '?')
            return 2;
        *(c == 's' ? &seed : &reads) = atoi(optarg);
    }
    printf("links: seed %d, one fault in %d answers, up to %.0f s late\n", seed, ONE_IN,
           (double)LATE_NS * 1e-9);
    int failed = report("modbus-rtu", measure_bus(false, reads, seed), false);
    failed += report("modbus-rtu, bare", measure_bare_bus(false, BARE_READS, seed), true);
    failed += report("modbus-tcp", measure_bus(true, reads, seed), false);
    failed += report("modbus-tcp, bare", measure_bare_bus(true, BARE_READS, seed), true);
    printf("links: %s\n", failed ? "FAILED" : "ok, no wrong value");
    return failed != 0;
}
