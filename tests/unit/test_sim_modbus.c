// SPDX-License-Identifier: MIT
// uses: sim model base
// Modbus frames against the standards' own examples, and the AZ register map moving an axis in
// virtual time.
#include "sim/bench.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#define MS(ms) ((int64_t)((ms)*1e6))

// --- a plain unit --------------------------------------------------------------------------------

static int read_plain(void *ctx, int address, int count, uint16_t *ret, int64_t t_ns)
{
    (void)t_ns;
    uint16_t *r = ctx;
    if (address + count > 16)
        return MODBUS_BAD_ADDRESS;
    memcpy(ret, r + address, (size_t)count * 2);
    return 0;
}

static int write_plain(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    (void)t_ns;
    uint16_t *r = ctx;
    if (address + count > 16)
        return MODBUS_BAD_ADDRESS;
    memcpy(r + address, values, (size_t)count * 2);
    return 0;
}

struct plain {
    struct sim_modbus m;
    uint16_t registers[16], others[16];
    int64_t t_ns;
};

static struct plain *plain(bool tcp, int64_t gap_ns)
{
    struct plain *p = calloc(1, sizeof *p);
    sim_modbus_init(&p->m, tcp, gap_ns, 0);
    sim_modbus_add(&p->m,
                   (struct sim_modbus_unit){
                       .id = 7, .read = read_plain, .write = write_plain, .ctx = p->registers});
    sim_modbus_add(&p->m, (struct sim_modbus_unit){
                              .id = 9, .read = read_plain, .write = write_plain, .ctx = p->others});
    return p;
}

static size_t bytes(const char *hex, uint8_t *out)
{
    size_t n = 0;
    for (char *end; *hex; hex = end) {
        unsigned long b = strtoul(hex, &end, 16);
        if (end == hex)
            break;
        out[n++] = (uint8_t)b;
    }
    return n;
}

// Sends the frame, with its CRC if rtu, waits for silence, and compares the answer without its CRC.
static void exchange(struct plain *p, const char *request, const char *reply)
{
    uint8_t in[300], out[PORT_REPLY_MOST], expected[300];
    size_t n = bytes(request, in), size = bytes(reply, expected);
    if (!p->m.tcp) {
        uint16_t crc = sim_modbus_crc(in, n);
        in[n++] = crc & 0xff;
        in[n++] = (uint8_t)(crc >> 8);
    }
    p->t_ns += MS(50);
    port_feed(&p->m.port, in, n, p->t_ns);
    p->t_ns += MS(50);
    size_t got = port_take(&p->m.port, p->t_ns, out, NULL);
    if (got > 0 && !p->m.tcp) {
        assert_int_equal(sim_modbus_crc(out, got),
                         0); // a frame with its CRC divides without remainder
        got -= 2;
    }
    assert_int_equal(got, size);
    assert_memory_equal(out, expected, size);
    assert_int_equal(port_take(&p->m.port, p->t_ns, out, NULL), 0);
}

static void crc_of_known_frames(void **state)
{
    (void)state;
    uint8_t f[64];
    assert_int_equal(sim_modbus_crc((const uint8_t *)"123456789", 9),
                     0x4b37); // catalogue check value
    size_t n =
        bytes("07 10 62 00 00 08 10 00 01 00 00 27 10 00 00 27 10 27 10 00 00 00 10 8D 50", f);
    assert_int_equal(sim_modbus_crc(f, n - 2),
                     f[n - 1] << 8 | f[n - 2]); // a manufacturer's example
    n = bytes("07 10 62 00 00 08 DE 11", f);
    assert_int_equal(sim_modbus_crc(f, n - 2), f[n - 1] << 8 | f[n - 2]);
}

static void every_function_answers_as_the_standard_says(void **state)
{
    (void)state;
    for (int gap = 0; gap < 2; gap++) {
        struct plain *p = plain(false, gap * MS(0.3));
        exchange(p, "07 06 00 02 12 34", "07 06 00 02 12 34");
        exchange(p, "07 10 00 03 00 02 04 AB CD 00 05", "07 10 00 03 00 02");
        exchange(p, "07 03 00 02 00 03", "07 03 06 12 34 AB CD 00 05");
        exchange(p, "07 17 00 02 00 02 00 02 00 01 02 77 88",
                 "07 17 04 77 88 AB CD"); // the write first
        assert_int_equal(p->others[2], 0);
        free(p);
    }
}

static void bad_requests_get_exceptions(void **state)
{
    (void)state;
    struct plain *p = plain(false, 0);
    exchange(p, "07 2B 0E 01 00", "07 AB 01");
    exchange(p, "07 03 00 0F 00 02", "07 83 02");
    exchange(p, "07 03 00 00 00 00", "07 83 03");
    exchange(p, "07 03 00 00 00 7E", "07 83 03");
    exchange(p, "07 03 FF FF 00 02", "07 83 02");
    exchange(p, "07 10 00 00 00 02 02 00 01", "07 90 03"); // count and bytes disagree
    exchange(p, "07 06 00 10 00 01", "07 86 02");
    free(p);
}

// The memory of the examples in the Application Protocol 1.1b3, chapter 6; coils take what is
// written.
struct tables {
    uint16_t coils[64];
};

static int read_tables(void *ctx, enum sim_modbus_table table, int address, int count,
                       uint16_t *ret, int64_t t_ns)
{
    static const uint8_t coils[] = {0xcd, 0x6b, 0x05}, discretes[] = {0xac, 0xdb, 0x35};
    (void)t_ns;
    (void)ctx;
    for (int i = 0; i < count; i++) {
        if (table == MODBUS_INPUTS && address == 8)
            ret[i] = 10;
        else if (table == MODBUS_COILS && address == 19)
            ret[i] = coils[i / 8] >> i % 8 & 1;
        else if (table == MODBUS_DISCRETES && address == 196)
            ret[i] = discretes[i / 8] >> i % 8 & 1;
        else
            return MODBUS_BAD_ADDRESS;
    }
    return 0;
}

static int write_tables(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    struct tables *t = ctx;
    (void)t_ns;
    address -= address >= 160 ? 160 : 0; // where the example's coil is
    if (address + count > 64)
        return MODBUS_BAD_ADDRESS;
    memcpy(t->coils + address, values, (size_t)count * 2);
    return 0;
}

static void the_other_tables_answer_as_in_the_standards_examples(void **state)
{
    (void)state;
    static const struct sim_modbus_tables ops = {read_tables, write_tables};
    struct tables t = {.coils = {0}};
    for (int gap = 0; gap < 2; gap++) {
        struct plain *p = plain(false, gap * MS(0.3));
        exchange(p, "07 01 00 13 00 13", "07 81 01"); // it has only holding registers
        exchange(p, "07 05 00 AC FF 00", "07 85 01");
        sim_modbus_add(
            &p->m,
            (struct sim_modbus_unit){
                .id = 8, .read = read_plain, .write = write_plain, .ctx = &t, .tables = &ops});
        exchange(p, "08 01 00 13 00 13", "08 01 03 CD 6B 05");
        exchange(p, "08 02 00 C4 00 16", "08 02 03 AC DB 35");
        exchange(p, "08 04 00 08 00 01", "08 04 02 00 0A");
        exchange(p, "08 05 00 AC FF 00", "08 05 00 AC FF 00");
        exchange(p, "08 0F 00 13 00 0A 02 CD 01", "08 0F 00 13 00 0A");
        assert_int_equal(t.coils[172 - 160], 1);
        for (int i = 0; i < 10; i++)
            assert_int_equal(t.coils[19 + i], 0x1cd >> i & 1);
        exchange(p, "08 05 00 AC 00 01", "08 85 03"); // neither on nor off
        exchange(p, "08 0F 00 13 00 0A 01 CD", "08 8F 03");
        exchange(p, "08 01 00 13 07 D1", "08 81 03"); // 2001
        exchange(p, "08 04 00 09 00 01", "08 84 02");
        free(p);
    }
}

static void strangers_and_broken_frames_get_silence(void **state)
{
    (void)state;
    uint8_t out[PORT_REPLY_MOST], f[64];
    struct plain *p = plain(false, MS(0.3));
    exchange(p, "08 03 00 00 00 01", "");
    size_t n = bytes("07 03 00 00 00 01", f);
    uint16_t crc = sim_modbus_crc(f, n);
    for (int wrong = 1; wrong < 4; wrong++) { // the one byte of the CRC, the other, both
        f[n] = (uint8_t)((crc & 0xff) ^ (wrong & 1));
        f[n + 1] = (uint8_t)((crc >> 8) ^ (wrong >> 1));
        port_feed(&p->m.port, f, n + 2, MS(100 * wrong));
        assert_int_equal(port_take(&p->m.port, MS(100 * wrong + 50), out, NULL), 0);
    }
    p->t_ns = MS(400);
    exchange(p, "07 03 00 00 00 01", "07 03 02 00 00"); // and is well again
    exchange(p, "00 06 00 01 00 2A", "");               // broadcast: done, not answered
    assert_int_equal(p->registers[1], 42);
    assert_int_equal(p->others[1], 42);
    exchange(p, "00 03 00 00 00 01", "");
    free(p);
}

static void silence_ends_a_frame_and_only_silence(void **state)
{
    (void)state;
    uint8_t out[PORT_REPLY_MOST], f[16];
    size_t n = bytes("07 06 00 01 00 2A", f);
    uint16_t crc = sim_modbus_crc(f, n);
    f[n++] = crc & 0xff;
    f[n++] = (uint8_t)(crc >> 8);
    struct plain *p = plain(false, MS(0.3));
    port_feed(&p->m.port, f, 3, MS(1));
    port_feed(&p->m.port, f + 3, n - 3, MS(1.2)); // within the gap: one frame
    assert_int_equal(port_next_ns(&p->m.port), MS(1.5));
    assert_int_equal(port_take(&p->m.port, MS(1.49), out, NULL), 0);
    assert_int_equal(port_take(&p->m.port, MS(1.5), out, NULL), 8);
    p->registers[1] = 0;
    port_feed(&p->m.port, f, 3, MS(2));
    port_feed(&p->m.port, f + 3, n - 3, MS(2.4)); // after it: two broken ones
    assert_int_equal(port_take(&p->m.port, MS(9), out, NULL), 0);
    assert_int_equal(p->registers[1], 0);
    free(p);
}

static void without_baud_timing_frames_end_by_their_length(void **state)
{
    (void)state;
    uint8_t out[PORT_REPLY_MOST], f[16];
    size_t n = bytes("07 06 00 01 00 2A", f);
    uint16_t crc = sim_modbus_crc(f, n);
    f[n++] = crc & 0xff;
    f[n++] = (uint8_t)(crc >> 8);
    struct plain *p = plain(false, 0);
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(port_take(&p->m.port, MS(10), out, NULL), 0);
        port_feed(&p->m.port, f + i, 1, MS(10));
    }
    assert_int_equal(port_take(&p->m.port, MS(10), out, NULL), 8);
    port_feed(&p->m.port, f, 5, MS(20)); // half a frame is forgotten
    port_feed(&p->m.port, f, n, MS(60));
    assert_int_equal(port_take(&p->m.port, MS(60), out, NULL), 8);
    free(p);
}

static void tcp_frames_keep_their_transaction(void **state)
{
    (void)state;
    uint8_t out[PORT_REPLY_MOST], f[64];
    struct plain *p = plain(true, 0);
    exchange(p, "12 34 00 00 00 06 07 06 00 02 00 63", "12 34 00 00 00 06 07 06 00 02 00 63");
    exchange(p, "12 35 00 00 00 06 07 03 00 02 00 01", "12 35 00 00 00 05 07 03 02 00 63");
    exchange(p, "12 36 00 00 00 06 07 03 00 0F 00 02", "12 36 00 00 00 03 07 83 02");
    exchange(p, "12 36 00 00 00 06 08 03 00 00 00 01", "");
    // Two requests in one segment, cut in odd places, are two answers in their order.
    size_t n = bytes("00 01 00 00 00 06 07 03 00 02 00 01 00 02 00 00 00 06 07 03 00 00 00 01", f);
    port_feed(&p->m.port, f, 5, MS(500));
    port_feed(&p->m.port, f + 5, 12, MS(500));
    port_feed(&p->m.port, f + 17, n - 17, MS(500));
    assert_int_equal(port_take(&p->m.port, MS(500), out, NULL), 11);
    assert_int_equal(out[1], 1);
    assert_int_equal(port_take(&p->m.port, MS(500), out, NULL), 11);
    assert_int_equal(out[1], 2);
    p->t_ns = MS(600);
    exchange(p, "00 01 00 05 00 06 07 03 00 02 00 01", ""); // not Modbus
    exchange(p, "00 01 00 00 00 06 07 03 00 02 00 01", "00 01 00 00 00 05 07 03 02 00 63");
    free(p);
}

static void faults_of_a_link_lose_and_delay_replies(void **state)
{
    (void)state;
    uint8_t out[PORT_REPLY_MOST];
    struct plain *p = plain(true, 0);
    p->m.port.drop = 1;
    exchange(p, "00 01 00 00 00 06 07 06 00 02 00 63", "");
    assert_int_equal(p->registers[2], 0x63); // done all the same
    exchange(p, "00 02 00 00 00 06 07 03 00 02 00 01", "00 02 00 00 00 05 07 03 02 00 63");
    p->m.port.delay_ns = MS(300);
    exchange(p, "00 03 00 00 00 06 07 03 00 02 00 01", "");
    assert_int_equal(port_take(&p->m.port, p->t_ns + MS(249), out, NULL), 0);
    assert_int_equal(port_take(&p->m.port, p->t_ns + MS(250), out, NULL), 11);
    p->t_ns += MS(300);
    exchange(p, "00 03 00 00 00 06 07 03 00 02 00 01",
             "00 03 00 00 00 05 07 03 02 00 63"); // only once
    p->m.port.mute = true;
    exchange(p, "00 04 00 00 00 06 07 03 00 02 00 01", "");
    assert_int_equal(p->m.port.lost, 2);
    free(p);
}

// --- the AZ --------------------------------------------------------------------------------------

enum { ZHOME = 0x10, STOP = 0x20, FREE = 0x40, ALM_RST = 0x80 };
enum {
    HOME_END = 0x10,
    READY = 0x20,
    ALM_A = 0x80,
    SYS_BSY = 0x100,
    MOVE = 0x2000,
    IN_POS = 0x4000
};

struct axes {
    struct bench bench;
    int64_t t_ns;
};

static struct axes *axes(void)
{
    struct axes *a = calloc(1, sizeof *a);
    struct bench_spec spec;
    bench_defaults(&spec);
    bench_init(&a->bench, &spec, 0);
    return a;
}

static int32_t get(struct axes *a, int unit, int address)
{
    uint16_t r[2];
    assert_int_equal(sim_az_read(&a->bench.az[unit - 1], address, 2, r, a->t_ns), 0);
    return (int32_t)((uint32_t)r[0] << 16 | r[1]);
}

static int put(struct axes *a, int unit, int address, int32_t value)
{
    uint16_t r[2] = {(uint16_t)((uint32_t)value >> 16), (uint16_t)value};
    return sim_az_write(&a->bench.az[unit - 1], address, 2, r, a->t_ns);
}

static int status(struct axes *a, int unit)
{
    return get(a, unit, 0x7e);
}

// One write of eight values from 0058, as a driver does it.
static int move(struct axes *a, int unit, int type, int32_t position, int32_t speed, int32_t rate)
{
    const int32_t v[8] = {0, type, position, speed, rate, rate, 1000, 1};
    uint16_t r[16];
    for (int i = 0; i < 8; i++) {
        r[2 * i] = (uint16_t)((uint32_t)v[i] >> 16);
        r[2 * i + 1] = (uint16_t)v[i];
    }
    return sim_az_write(&a->bench.az[unit - 1], 0x58, 16, r, a->t_ns);
}

static void home(struct axes *a, int unit)
{
    put(a, unit, 0x7c, ZHOME);
    put(a, unit, 0x7c, 0);
    a->t_ns += MS(20000);
    assert_true(status(a, unit) & HOME_END);
}

static void one_frame_moves_an_axis(void **state)
{
    (void)state;
    struct axes *a = axes();
    struct port *p = bench_port(&a->bench, BENCH_AXES_RTU);
    uint8_t out[PORT_REPLY_MOST], f[64];
    // Unit 2 to 10000 steps, 20000 steps/s, 60000 steps/s2 both ways, full current, start.
    size_t n = bytes("02 10 00 58 00 10 20 00 00 00 00 00 00 00 01 00 00 27 10 00 00 4E 20 00 00 "
                     "EA 60 00 00 EA 60 "
                     "00 00 03 E8 00 00 00 01",
                     f);
    uint16_t crc = sim_modbus_crc(f, n);
    f[n++] = crc & 0xff;
    f[n++] = (uint8_t)(crc >> 8);
    port_feed(p, f, n, MS(10));
    assert_int_equal(port_take(p, MS(10), out, NULL), 8);
    // From 0 (counted from where it stands): 1/3 s and 10/3 deg each way, 10/3 deg at 20 deg/s;
    // begins 2 ms later.
    a->t_ns = MS(11);
    assert_int_equal(status(a, 2), READY | IN_POS); // the driver has not begun
    a->t_ns = MS(12 + 333.3333 + 83.3333);
    assert_true(abs(get(a, 2, 0xcc) - 5000) <= 1);
    assert_int_equal(get(a, 2, 0xd0), 20000);
    assert_int_equal(status(a, 2), MOVE);
    a->t_ns = MS(12 + 833);
    assert_true(status(a, 2) & MOVE);
    a->t_ns = MS(12 + 834);
    assert_int_equal(status(a, 2), READY | IN_POS);
    assert_int_equal(get(a, 2, 0xcc), 10000);
    assert_int_equal(get(a, 2, 0xc6), 10000);
    assert_true(fabs(motion_at(&a->bench.world.axis[WORLD_THETA_R], a->t_ns).load - 2.5) <
                1e-9); // from -7.5
    free(a);
}

static void homing_takes_real_motion_and_sets_zero(void **state)
{
    (void)state;
    struct axes *a = axes();
    assert_false(status(a, 2) & HOME_END);
    assert_int_equal(get(a, 2, 0xcc), 0); // unknown place
    put(a, 2, 0x7c, ZHOME);
    put(a, 2, 0x7c, 0);
    a->t_ns = MS(400);
    assert_int_equal(status(a, 2), MOVE);
    assert_int_equal(move(a, 2, 1, 100, 1000, 1000), 0); // echoed and ignored
    assert_int_equal(a->bench.az[1].ignored, 1);
    a->t_ns = MS(5000); // 7.5 deg at 10 deg/s
    assert_int_equal(status(a, 2), HOME_END | READY | IN_POS);
    assert_int_equal(get(a, 2, 0xcc), 0);
    assert_true(motion_at(&a->bench.world.axis[WORLD_THETA_R], a->t_ns).motor == 0);
    move(a, 2, 1, -30000, 20000, 60000);
    a->t_ns += MS(10000);
    assert_true(motion_at(&a->bench.world.axis[WORLD_THETA_R], a->t_ns).motor == -30);
    free(a);
}

static void home_is_lost_with_the_power(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 1);
    move(a, 1, 1, 20000, 20000, 60000);
    a->t_ns += MS(500); // in mid-move
    sim_az_power_cycle(&a->bench.az[0], a->t_ns);
    double stands = motion_at(&a->bench.world.axis[WORLD_THETA_I], a->t_ns).motor;
    assert_true(stands > 1 && stands < 19);
    a->t_ns += MS(5000);
    assert_false(status(a, 1) & (HOME_END | MOVE));
    assert_int_equal(get(a, 1, 0xcc), 0); // and the count says something else
    home(a, 1);
    assert_true(motion_at(&a->bench.world.axis[WORLD_THETA_I], a->t_ns).motor == 0);
    free(a);
}

static void stop_acts_on_its_edge_and_holds_while_set(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 2);
    move(a, 2, 1, 90000, 20000, 60000);
    a->t_ns += MS(1000);
    uint16_t stop = STOP;
    assert_int_equal(sim_az_write(&a->bench.az[1], 0x7d, 1, &stop, a->t_ns),
                     0); // the lower word alone
    a->t_ns += MS(334);
    assert_false(status(a, 2) & (MOVE | READY));
    int32_t rest = get(a, 2, 0xcc);
    assert_true(rest > 10000 && rest < 25000);
    assert_int_equal(get(a, 2, 0xc6), rest);
    move(a, 2, 1, 90000, 20000, 60000); // the bit is still set
    a->t_ns += MS(100);
    assert_int_equal(get(a, 2, 0xcc), rest);
    put(a, 2, 0x7c, 0);
    move(a, 2, 1, 90000, 20000, 60000);
    a->t_ns += MS(100);
    assert_true(get(a, 2, 0xcc) > rest);
    put(a, 2, 0x78, STOP); // the twin clears itself
    a->t_ns += MS(1000);
    assert_int_equal(status(a, 2), HOME_END | READY | IN_POS);
    free(a);
}

static void a_second_home_bit_without_an_edge_does_nothing(void **state)
{
    (void)state;
    struct axes *a = axes();
    put(a, 1, 0x7c, ZHOME);
    a->t_ns += MS(20000);
    assert_true(status(a, 1) & HOME_END);
    move(a, 1, 1, 5000, 20000, 60000);
    a->t_ns += MS(5000);
    put(a, 1, 0x7c, ZHOME); // was never cleared
    a->t_ns += MS(5000);
    assert_int_equal(get(a, 1, 0xcc), 5000);
    free(a);
}

static void an_alarm_is_latched_and_moves_are_ignored(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 3);
    move(a, 3, 1, 60000, 20000, 60000); // beyond the hard limit at 35 mm
    a->t_ns += MS(10000);
    assert_int_equal(status(a, 3), HOME_END | ALM_A);
    assert_int_equal(get(a, 3, 0x80), SIM_AZ_OVERTRAVEL);
    assert_int_equal(get(a, 3, 0xcc), 35000);
    assert_int_equal(move(a, 3, 1, 0, 20000, 60000), 0);
    a->t_ns += MS(5000);
    assert_int_equal(get(a, 3, 0xcc), 35000);
    put(a, 3, 0x180, 1);
    put(a, 3, 0x180, 0);
    assert_int_equal(get(a, 3, 0x80), 0);
    move(a, 3, 1, 0, 20000, 60000);
    a->t_ns += MS(5000);
    assert_int_equal(get(a, 3, 0xcc), 0);
    sim_az_raise(&a->bench.az[2], SIM_AZ_OVERLOAD, a->t_ns);
    put(a, 3, 0x180, 1);
    sim_az_raise(&a->bench.az[2], SIM_AZ_OVERLOAD, a->t_ns);
    put(a, 3, 0x180, 1); // no edge
    assert_int_equal(get(a, 3, 0x80), SIM_AZ_OVERLOAD);
    put(a, 3, 0x7c, ALM_RST);
    assert_int_equal(get(a, 3, 0x80), 0);
    free(a);
}

static void preset_is_refused_while_moving_and_takes_time(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 2);
    move(a, 2, 1, 30000, 20000, 60000);
    a->t_ns += MS(500);
    assert_int_equal(put(a, 2, 0x18a, 1), MODBUS_FAILURE);
    a->t_ns += MS(5000);
    assert_int_equal(put(a, 2, 0x18a, 1), 0);
    assert_int_equal(get(a, 2, 0xcc), 0); // the position jumped
    assert_true(status(a, 2) & SYS_BSY);
    assert_int_equal(move(a, 2, 1, 1000, 20000, 60000), MODBUS_BUSY);
    a->t_ns += MS(201);
    assert_int_equal(move(a, 2, 1, 1000, 20000, 60000), 0);
    a->t_ns += MS(5000);
    assert_true(motion_at(&a->bench.world.axis[WORLD_THETA_R], a->t_ns).motor == 31);
    free(a);
}

static void incremental_moves_count_from_command_or_feedback(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 2);
    move(a, 2, 1, 10000, 20000, 60000);
    a->t_ns += MS(5000);
    move(a, 2, 2, -3000, 20000, 60000);
    a->t_ns += MS(5000);
    assert_int_equal(get(a, 2, 0xcc), 7000);
    move(a, 2, 3, 500, 20000, 60000);
    a->t_ns += MS(5000);
    assert_int_equal(get(a, 2, 0xcc), 7500);
    free(a);
}

static void registers_that_are_not_there_and_values_out_of_range(void **state)
{
    (void)state;
    struct axes *a = axes();
    uint16_t r[20] = {0};
    struct sim_az *z = &a->bench.az[0];
    assert_int_equal(sim_az_read(z, 0x7e, 4, r, 0), 0);
    assert_int_equal(sim_az_read(z, 0xcc, 10, r, 0), 0);
    assert_int_equal(sim_az_read(z, 0x10, 1, r, 0), MODBUS_BAD_ADDRESS);
    assert_int_equal(sim_az_read(z, 0xd4, 4, r, 0), MODBUS_BAD_ADDRESS);
    assert_int_equal(put(a, 1, 0x7e, 1), MODBUS_BAD_ADDRESS);     // read only
    assert_int_equal(put(a, 1, 0x5e, 5000000), MODBUS_BAD_VALUE); // 4 MHz at most
    assert_int_equal(put(a, 1, 0x60, 0), MODBUS_BAD_VALUE);
    assert_int_equal(put(a, 1, 0x5a, 5), MODBUS_BAD_VALUE);
    assert_int_equal(sim_az_write(z, 0x5d, 1, r, 0), MODBUS_BAD_VALUE); // half of a 32-bit value
    assert_int_equal(move(a, 1, 1, 1000, 20000, 0), MODBUS_BAD_VALUE);
    assert_int_equal(get(a, 1, 0x5c), 0); // and nothing of it was taken
    free(a);
}

static void two_reads_of_one_position_can_be_torn(void **state)
{
    (void)state;
    struct axes *a = axes();
    uint16_t upper, lower;
    home(a, 2);
    move(a, 2, 1, 90000, 20000, 60000);
    a->t_ns += MS(2 + 333.333 / 2); // below 65536
    while (get(a, 2, 0xcc) < 65500)
        a->t_ns += MS(1);
    sim_az_read(&a->bench.az[1], 0xcc, 1, &upper, a->t_ns);
    sim_az_read(&a->bench.az[1], 0xcd, 1, &lower, a->t_ns + MS(5));
    int32_t torn = upper << 16 | lower;
    assert_true(torn < 1000); // neither before nor after
    free(a);
}

static void without_current_nothing_moves(void **state)
{
    (void)state;
    struct axes *a = axes();
    home(a, 2);
    put(a, 2, 0x7c, FREE);
    assert_false(status(a, 2) & (READY | IN_POS));
    move(a, 2, 1, 1000, 20000, 60000);
    a->t_ns += MS(2000);
    assert_int_equal(get(a, 2, 0xcc), 0);
    put(a, 2, 0x7c, 0);
    assert_true(status(a, 2) & READY);
    free(a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crc_of_known_frames),
        cmocka_unit_test(every_function_answers_as_the_standard_says),
        cmocka_unit_test(bad_requests_get_exceptions),
        cmocka_unit_test(the_other_tables_answer_as_in_the_standards_examples),
        cmocka_unit_test(strangers_and_broken_frames_get_silence),
        cmocka_unit_test(silence_ends_a_frame_and_only_silence),
        cmocka_unit_test(without_baud_timing_frames_end_by_their_length),
        cmocka_unit_test(tcp_frames_keep_their_transaction),
        cmocka_unit_test(faults_of_a_link_lose_and_delay_replies),
        cmocka_unit_test(one_frame_moves_an_axis),
        cmocka_unit_test(homing_takes_real_motion_and_sets_zero),
        cmocka_unit_test(home_is_lost_with_the_power),
        cmocka_unit_test(stop_acts_on_its_edge_and_holds_while_set),
        cmocka_unit_test(a_second_home_bit_without_an_edge_does_nothing),
        cmocka_unit_test(an_alarm_is_latched_and_moves_are_ignored),
        cmocka_unit_test(preset_is_refused_while_moving_and_takes_time),
        cmocka_unit_test(incremental_moves_count_from_command_or_feedback),
        cmocka_unit_test(registers_that_are_not_there_and_values_out_of_range),
        cmocka_unit_test(two_reads_of_one_position_can_be_torn),
        cmocka_unit_test(without_current_nothing_moves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
