// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The bus in virtual time: the unmodified libmodbus on a line that a simulated slave serves.
#include "drivers/bus.h"

#include "drivers/transport.h"
#include "sim/modbus.h"
#include "tests/unit/noisy.h"
#include "tests/unit/vline.h"

#include <arpa/inet.h>
#include <modbus/modbus.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <sys/resource.h>

#define MS(ms) CLK_MS(ms)
enum { REGISTERS = 64 };

// Two units whose registers hold their own name: unit * 1000 + address. Writes are counted.
struct slave {
    struct sim_modbus m; // first: also a port
    uint16_t registers[2][REGISTERS];
    int exception, exceptions_left; // answered to that many requests
    int requests, writes;
    bool numbered; // the first register of an answer is the number of its request
};

static struct slave slave;

static int take_exception(void)
{
    slave.requests++;
    if (slave.exceptions_left <= 0)
        return 0;
    slave.exceptions_left--;
    return slave.exception;
}

static int read_named(void *ctx, int address, int count, uint16_t *ret, int64_t t_ns)
{
    (void)t_ns;
    int exception = take_exception();
    if (exception == 0 && address + count > REGISTERS)
        exception = 2;
    if (exception == 0)
        memcpy(ret, (uint16_t *)ctx + address, (size_t)count * 2);
    if (slave.numbered)
        ret[0] = (uint16_t)slave.requests;
    return exception;
}

static int write_named(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    (void)t_ns;
    int exception = take_exception();
    if (exception)
        return exception;
    slave.writes++;
    memcpy((uint16_t *)ctx + address, values, (size_t)count * 2);
    return 0;
}

static void slave_init(bool tcp)
{
    memset(&slave, 0, sizeof slave);
    sim_modbus_init(&slave.m, tcp, 0, MS(2));
    for (int u = 0; u < 2; u++) {
        sim_modbus_add(&slave.m, (struct sim_modbus_unit){.id = u + 1,
                                                          .read = read_named,
                                                          .write = write_named,
                                                          .ctx = slave.registers[u]});
        for (int i = 0; i < REGISTERS; i++)
            slave.registers[u][i] = (uint16_t)((u + 1) * 1000 + i);
    }
}

static struct bus *begin(struct port *port, const struct cancel *cancel)
{
    struct bus *b;
    struct gon_error err;
    slave_init(false);
    struct clk *clk = vline_begin(port);
    if (bus_open(vline.bus, 100, 350, clk, cancel, &b, &err) < 0)
        fail_msg("%s", err.text);
    return b;
}

static void registers_are_read_and_written(void **state)
{
    uint16_t r[8];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    assert_int_equal(bus_read(b, 2, 10, 3, r, NULL), 0);
    assert_int_equal(r[0], 2010);
    assert_int_equal(r[2], 2012);
    assert_int_equal(bus_write(b, 1, 5, 2, (const uint16_t[]){7, 8}, NULL), 0);
    assert_int_equal(slave.registers[0][6], 8);
    assert_int_equal(bus_stats(b)->requests, 2);
    assert_int_equal(bus_stats(b)->latency_last_ns, MS(2));
    assert_int_equal(bus_stats(b)->bytes_out, 8 + 13);
    assert_int_equal(bus_stats(b)->bytes_in, 11 + 8);
    assert_int_equal(link_stats_failures(bus_stats(b)), 0);
    bus_close(b);
}

static void the_line_is_silent_between_frames(void **state)
{
    uint16_t r[8];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    const int64_t start_ns = vline.clk.t_ns;
    for (int i = 0; i < 3; i++)
        assert_int_equal(bus_read(b, 1, 0, 4, r, NULL), 0);
    assert_int_equal(vline.clk.t_ns - start_ns, 3 * MS(2) + 2 * MS(1.75));
    bus_close(b);
}

static void a_slow_line_has_longer_gaps(void **state)
{
    struct bus *b;
    struct gon_error err;
    char link[128];
    uint16_t r[8];
    (void)state;
    slave_init(false);
    struct clk *clk = vline_begin(&slave.m.port);
    snprintf(link, sizeof link, "%s?baud=9600&parity=E&stop=1", vline.bus);
    assert_int_equal(bus_open(link, 100, 350, clk, NULL, &b, &err), 0);
    const int64_t start_ns = vline.clk.t_ns;
    for (int i = 0; i < 2; i++)
        assert_int_equal(bus_read(b, 1, 0, 4, r, NULL), 0);
    assert_int_equal(vline.clk.t_ns - start_ns, 2 * MS(2) + (int64_t)(3.5 * 11e9 / 9600));
    bus_close(b);
}

static void wrong_settings_are_refused(void **state)
{
    struct bus *b = NULL;
    struct gon_error err;
    (void)state;
    struct clk *clk = vline_begin(&slave.m.port);
    assert_int_equal(bus_open(vline.bus, 9, 350, clk, NULL, &b, &err), GON_E_INPUT);
    assert_int_equal(bus_open(vline.bus, 201, 350, clk, NULL, &b, &err), GON_E_INPUT);
    assert_int_equal(bus_open(vline.bus, 100, 5001, clk, NULL, &b, &err), GON_E_INPUT);
    assert_int_equal(bus_open(vline.link, 100, 350, clk, NULL, &b, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "modbus-rtu:"));
    assert_null(b);
}

// A unit that is slower than the bench thought. It never lowers what another needs.
static void a_slow_unit_is_given_its_time(void **state)
{
    uint16_t r[8];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    bus_expect(b, 150, 0);
    bus_expect(b, 20, 20);
    slave.m.port.delay_ns = MS(140);
    assert_int_equal(bus_read(b, 1, 0, 4, r, NULL), 0);
    assert_int_equal(bus_stats(b)->errors[LINK_SILENT], 0);
    bus_expect(b, 500, 5000); // but nobody is waited for without end
    slave.m.port.drop = 1;
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(bus_read(b, 1, 0, 4, r, NULL), 0);
    assert_in_range(vline.clk.t_ns - start_ns, MS(5200), MS(5210));
    bus_close(b);
}

static void exceptions_name_function_address_and_count(void **state)
{
    uint16_t r[8] = {42};
    struct gon_error err;
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    assert_int_equal(bus_read(b, 1, 62, 4, r, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 1 has no such register"));
    assert_non_null(strstr(err.text, "exception 2; function 3, 4 registers at 003Eh"));
    assert_int_equal(r[0], 42);
    assert_int_equal(slave.requests, 1); // not repeated
    slave.exception = 4;
    slave.exceptions_left = 1;
    assert_int_equal(bus_write(b, 2, 0, 1, r, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "exception 4; function 16"));
    assert_int_equal(bus_stats(b)->errors[LINK_REFUSED], 2);
    bus_close(b);
}

static void a_busy_unit_is_waited_for(void **state)
{
    uint16_t r[8];
    struct gon_error err;
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.exception = 6;
    slave.exceptions_left = 4;
    assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), 0);
    slave.exceptions_left = 4;
    assert_int_equal(bus_write(b, 1, 0, 2, r, NULL), 0);
    assert_int_equal(slave.writes, 1);

    slave.exceptions_left = 1000;
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "stays busy"));
    assert_true(vline.clk.t_ns - start_ns <= MS(1010));
    assert_true(slave.requests < 30);
    bus_close(b);
}

// "Accepted, still at work" must not make a write happen twice.
static void an_acknowledged_write_is_not_repeated(void **state)
{
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.exception = 5;
    slave.exceptions_left = 1;
    assert_int_equal(bus_write(b, 1, 0, 1, (const uint16_t[]){1}, NULL), 0);
    assert_int_equal(slave.requests, 1);
    bus_close(b);
}

static void a_lost_answer_repeats_reads_but_never_writes(void **state)
{
    uint16_t r[8];
    struct gon_error err;
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.m.port.drop = 2;
    assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), 0);
    assert_int_equal(bus_stats(b)->retries, 2);
    assert_int_equal(bus_stats(b)->errors[LINK_SILENT], 2);

    slave.m.port.drop = 1;
    assert_int_equal(bus_write(b, 1, 0, 1, (const uint16_t[]){77}, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "it may have been carried out"));
    assert_int_equal(slave.writes, 1);
    assert_int_equal(slave.registers[0][0], 77);

    slave.m.port.drop = 3;
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "unit 1 does not answer"));
    bus_close(b);
}

// Also when the next question is the very same.
static void a_late_answer_is_never_taken(void **state)
{
    uint16_t r[2];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.numbered = true;
    for (int i = 0; i < 20; i++) {
        if (i % 3 == 0)
            slave.m.port.delay_ns = MS(100) + i * MS(12);
        assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), 0);
        assert_int_equal(r[0], slave.requests);
    }
    bus_close(b);
}

static void what_comes_unasked_is_dropped_before_a_request(void **state)
{
    uint16_t r[2];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    port_send(&slave.m.port, "\1\3\4\0", 4, vline.clk.t_ns);
    assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), 0);
    assert_int_equal(r[0], 1000);
    assert_int_equal(bus_stats(b)->errors[LINK_STRAY], 1);
    assert_int_equal(bus_stats(b)->retries, 0);
    bus_close(b);
}

static void a_unit_that_is_not_there_does_not_answer(void **state)
{
    uint16_t r[2];
    struct gon_error err;
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    assert_int_equal(bus_read(b, 9, 0, 2, r, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "unit 9 does not answer"));
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), 0);
    bus_close(b);
}

// Answers written byte by byte: who it is from, what is in it, what its checksum is.
static uint8_t forged[16];
static size_t forged_size;

static void feed_forged(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    if (slave.requests++ == 0)
        port_send(p, forged, forged_size, t_ns + MS(1));
    else {
        port_feed(&slave.m.port, bytes, size, t_ns);
        uint8_t reply[PORT_REPLY_MOST];
        size_t n = port_take(&slave.m.port, t_ns + MS(5), reply, NULL);
        port_send(p, reply, n, t_ns + MS(2));
    }
}

static void check_forged(const uint8_t *pdu, size_t size, uint16_t crc_error, enum link_error kind)
{
    static const struct port_ops ops = {feed_forged, scripted_nothing, scripted_hangup};
    struct port p;
    uint16_t r[2];
    port_init(&p, &ops);
    struct bus *b = begin(&p, NULL);
    memcpy(forged, pdu, size);
    const uint16_t crc = sim_modbus_crc(pdu, size) ^ crc_error;
    forged[size] = (uint8_t)crc;
    forged[size + 1] = (uint8_t)(crc >> 8);
    forged_size = size + 2;
    assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), 0);
    assert_int_equal(r[0], 1000);
    assert_int_equal(r[1], 1001);
    assert_int_equal(bus_stats(b)->retries, 1);
    assert_int_equal(bus_stats(b)->resyncs, 1);
    assert_int_equal(bus_stats(b)->errors[kind], 1);
    assert_int_equal(link_stats_failures(bus_stats(b)), 1);
    assert_int_equal(link_stats_answers(bus_stats(b)), 1);
    bus_close(b);
}

static void wrong_unit_function_length_or_checksum_is_no_answer(void **state)
{
    (void)state;
    check_forged((const uint8_t[]){2, 3, 4, 0, 9, 0, 9}, 7, 0, LINK_MISFIT);
    check_forged((const uint8_t[]){1, 4, 4, 0, 9, 0, 9}, 7, 0, LINK_MISFIT);
    check_forged((const uint8_t[]){1, 3, 2, 0, 9}, 5, 0, LINK_MISFIT);
    check_forged((const uint8_t[]){1, 3, 6, 0, 9, 0, 9, 0, 9}, 9, 0, LINK_MISFIT);
    check_forged((const uint8_t[]){1, 3, 4, 0, 9, 0, 9}, 7, 0x0100, LINK_GARBLED);
}

// --- the other functions, as the Application Protocol 1.1b3 (6.1 to 6.12) shows them
// --------------

struct shown {
    uint8_t sent[16], received[16];
    size_t sent_size, received_size;
};

static const struct shown *example;
static int shown_requests;

static size_t framed(const uint8_t *pdu, size_t size, uint8_t *ret_frame)
{
    ret_frame[0] = 17;
    memcpy(ret_frame + 1, pdu, size);
    const uint16_t crc = sim_modbus_crc(ret_frame, size + 1);
    ret_frame[size + 1] = (uint8_t)crc;
    ret_frame[size + 2] = (uint8_t)(crc >> 8);
    return size + 3;
}

static void feed_shown(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    uint8_t frame[24];
    shown_requests++;
    assert_int_equal(size, framed(example->sent, example->sent_size, frame));
    assert_memory_equal(bytes, frame, size);
    port_send(p, frame, framed(example->received, example->received_size, frame), t_ns + MS(1));
}

static struct bus *begin_shown(const struct shown *e)
{
    static const struct port_ops ops = {feed_shown, scripted_nothing, scripted_hangup};
    static struct port p;
    port_init(&p, &ops);
    example = e;
    shown_requests = 0;
    return begin(&p, NULL);
}

static void check_read(enum bus_table table, int address, int count, const struct shown *e,
                       const uint16_t *expected)
{
    uint16_t r[24];
    struct bus *b = begin_shown(e);
    assert_int_equal(bus_read_table(b, 17, table, address, count, 1, r, NULL), 0);
    for (int i = 0; i < count; i++)
        assert_int_equal(r[i], expected[i]);
    bus_close(b);
}

static void coils_and_inputs_are_read_as_the_standard_shows(void **state)
{
    (void)state;
    check_read(BUS_COIL, 0x13, 19,
               &(struct shown){{1, 0, 0x13, 0, 0x13}, {1, 3, 0xcd, 0x6b, 5}, 5, 5},
               (const uint16_t[]){1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1});
    check_read(
        BUS_DISCRETE, 0xc4, 22,
        &(struct shown){{2, 0, 0xc4, 0, 0x16}, {2, 3, 0xac, 0xdb, 0x35}, 5, 5},
        (const uint16_t[]){0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 0, 1, 1, 0, 1, 1, 1, 0, 1, 0, 1, 1});
    check_read(BUS_INPUT, 8, 1, &(struct shown){{4, 0, 8, 0, 1}, {4, 2, 0, 10}, 5, 4},
               (const uint16_t[]){10});
    check_read(BUS_HOLDING, 0x6b, 3,
               &(struct shown){{3, 0, 0x6b, 0, 3}, {3, 6, 2, 0x2b, 0, 0, 0, 0x64}, 5, 8},
               (const uint16_t[]){0x22b, 0, 0x64});
}

static int write_shown(enum bus_table table, int address, int count, bool single,
                       const uint16_t *values, const struct shown *e)
{
    struct bus *b = begin_shown(e);
    const int rc = bus_write_table(b, 17, table, address, count, single, values, NULL);
    assert_int_equal(shown_requests, 1);
    bus_close(b);
    return rc;
}

static void coils_and_registers_are_written_as_the_standard_shows(void **state)
{
    (void)state;
    assert_int_equal(
        write_shown(BUS_COIL, 0xac, 1, true, (const uint16_t[]){1},
                    &(struct shown){{5, 0, 0xac, 0xff, 0}, {5, 0, 0xac, 0xff, 0}, 5, 5}),
        0);
    assert_int_equal(write_shown(BUS_HOLDING, 1, 1, true, (const uint16_t[]){3},
                                 &(struct shown){{6, 0, 1, 0, 3}, {6, 0, 1, 0, 3}, 5, 5}),
                     0);
    assert_int_equal(
        write_shown(BUS_COIL, 0x13, 10, true, (const uint16_t[]){1, 0, 1, 1, 0, 0, 1, 1, 1, 0},
                    &(struct shown){{15, 0, 0x13, 0, 10, 2, 0xcd, 1}, {15, 0, 0x13, 0, 10}, 8, 5}),
        0);
    assert_int_equal(
        write_shown(BUS_HOLDING, 1, 2, false, (const uint16_t[]){10, 0x102},
                    &(struct shown){{16, 0, 1, 0, 2, 4, 0, 10, 1, 2}, {16, 0, 1, 0, 2}, 10, 5}),
        0);
}

static void an_echo_that_differs_is_no_answer(void **state)
{
    const uint16_t three = 3, two[] = {10, 0x102};
    (void)state;
    assert_int_equal(write_shown(BUS_HOLDING, 1, 1, true, &three,
                                 &(struct shown){{6, 0, 1, 0, 3}, {6, 0, 1, 0, 2}, 5, 5}),
                     GON_E_LINK);
    assert_int_equal(write_shown(BUS_HOLDING, 1, 1, true, &three,
                                 &(struct shown){{6, 0, 1, 0, 3}, {6, 0, 2, 0, 3}, 5, 5}),
                     GON_E_LINK);
    assert_int_equal(write_shown(BUS_COIL, 1, 1, true, &three,
                                 &(struct shown){{5, 0, 1, 0xff, 0}, {5, 0, 1, 0, 0}, 5, 5}),
                     GON_E_LINK);
    const struct shown other_count = {{16, 0, 1, 0, 2, 4, 0, 10, 1, 2}, {16, 0, 1, 0, 1}, 10, 5};
    const struct shown other_place = {{16, 0, 1, 0, 2, 4, 0, 10, 1, 2}, {16, 0, 2, 0, 2}, 10, 5};
    assert_int_equal(write_shown(BUS_HOLDING, 1, 2, false, two, &other_count), GON_E_LINK);
    assert_int_equal(write_shown(BUS_HOLDING, 1, 2, false, two, &other_place), GON_E_LINK);
}

static void a_hang_up_is_gone_and_a_new_plug_works(void **state)
{
    uint16_t r[2];
    struct gon_error err;
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.m.port.mute = true;
    vline.hangup_ns = vline.clk.t_ns + MS(30);
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), GON_E_GONE);
    assert_true(vline.clk.t_ns - start_ns <= MS(31));
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), GON_E_GONE);
    assert_int_equal(bus_write(b, 1, 0, 2, r, &err), GON_E_GONE);
    assert_true(vline.waits < 20);

    vline.hangup_ns = PORT_NEVER;
    slave.m.port.mute = false;
    assert_int_equal(bus_reopen(b, &err), 0);
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), 0);
    assert_int_equal(bus_stats(b)->errors[LINK_HUNG_UP], 1);
    assert_int_equal(bus_stats(b)->reopened, 1);
    bus_close(b);
}

static void reads_can_be_cancelled_and_writes_go_out_anyway(void **state)
{
    uint16_t r[2];
    struct gon_error err;
    struct cancel *cancel = cancel_new();
    (void)state;
    struct bus *b = begin(&slave.m.port, cancel);
    slave.m.port.mute = true;
    cancel_request(cancel);
    assert_int_equal(bus_read(b, 1, 0, 2, r, &err), GON_E_CANCELED);
    slave.m.port.mute = false;
    slave.m.port.drop = 1;
    assert_int_equal(bus_write(b, 1, 0, 1, r, &err), GON_E_LINK); // now it is out of step
    assert_int_equal(bus_write(b, 1, 0, 1, r, &err), 0);
    bus_close(b);
    cancel_free(cancel);
}

static void nothing_waits_longer_than_one_answer(void **state)
{
    uint16_t r[2];
    (void)state;
    struct bus *b = begin(&slave.m.port, NULL);
    slave.m.port.mute = true;
    for (int i = 0; i < 3; i++)
        assert_int_equal(bus_read(b, 1, 0, 2, r, NULL), GON_E_LINK);
    vline_turn();
    assert_true(vline.longest_ns <= MS(152)); // an answer of 100 ms, and a slice of draining
    bus_close(b);
}

static void a_descriptor_too_large_for_select_is_refused(void **state)
{
    struct bus *b = NULL;
    struct gon_error err;
    struct rlimit limit, before;
    (void)state;
    getrlimit(RLIMIT_NOFILE, &before);
    limit = before;
    if (limit.rlim_cur < 1100)
        limit.rlim_cur = limit.rlim_max < 1100 ? limit.rlim_max : 1100;
    if (limit.rlim_cur < 1100 || setrlimit(RLIMIT_NOFILE, &limit)) {
        print_message("1100 descriptors are not allowed here\n");
        skip();
    }
    struct clk *clk = vline_begin(&slave.m.port);
    int spare = dup(0), top = spare;
    while (top < 1024)
        top = dup(0);
    assert_int_equal(bus_open(vline.bus, 100, 350, clk, NULL, &b, &err), GON_E_SYSTEM);
    assert_non_null(strstr(err.text, "too large for libmodbus"));
    for (; top >= spare; top--)
        close(top);
    setrlimit(RLIMIT_NOFILE, &before);
}

// --- TCP, on a real socket -----------------------------------------------------------------------

static void *serve_tcp(void *ctx)
{
    const int server = *(int *)ctx;
    struct pollfd p[2] = {{server, POLLIN, 0}, {-1, POLLIN, 0}};
    uint8_t bytes[300];
    for (int connections = 0;;) {
        const int64_t due_ns = port_next_ns(&slave.m.port), now_ns = clk_now_ns(clk_system());
        const int wait_ms = due_ns == PORT_NEVER ? 20000
                            : due_ns > now_ns    ? (int)((due_ns - now_ns) / 1000000) + 1
                                                 : 0;
        poll(p, 2, wait_ms);
        if (p[0].revents & POLLIN) { // a new connection instead of the one before
            if (p[1].fd >= 0)
                close(p[1].fd);
            p[1].fd = accept(server, NULL, NULL);
            port_hangup(&slave.m.port);
            slave.m.port.delay_ns = connections++ ? 0 : MS(400);
        } else if (p[1].fd >= 0 && p[1].revents) {
            ssize_t n = read(p[1].fd, bytes, sizeof bytes);
            if (n <= 0 && connections == 2)
                break;
            port_feed(&slave.m.port, bytes, n > 0 ? (size_t)n : 0, clk_now_ns(clk_system()));
        }
        size_t n = port_take(&slave.m.port, clk_now_ns(clk_system()), bytes, NULL);
        if (n > 0 && write(p[1].fd, bytes, n) < 0)
            break;
    }
    close(p[1].fd);
    return NULL;
}

// libmodbus would stay one behind after a late answer: its transactions never fit again.
static void tcp_reconnects_after_a_late_answer(void **state)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    struct bus *b;
    struct gon_error err;
    pthread_t thread;
    char link[64];
    uint16_t r[4];
    (void)state;
    slave_init(true);
    int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(bind(server, (struct sockaddr *)&a, sizeof a) == 0 && listen(server, 4) == 0);
    getsockname(server, (struct sockaddr *)&a, &size);
    snprintf(link, sizeof link, "modbus-tcp:127.0.0.1:%d", ntohs(a.sin_port));
    assert_int_equal(pthread_create(&thread, NULL, serve_tcp, &server), 0);
    if (bus_open(link, 200, 350, clk_system(), NULL, &b, &err) < 0)
        fail_msg("%s", err.text);
    assert_int_equal(bus_read(b, 2, 10, 4, r, &err), 0);
    assert_int_equal(r[3], 2013);
    assert_int_equal(bus_stats(b)->reopened, 1);
    assert_int_equal(bus_stats(b)->errors[LINK_SILENT], 1);
    assert_int_equal(bus_read(b, 1, 20, 2, r, &err), 0);
    assert_int_equal(r[1], 1021);
    assert_int_equal(bus_stats(b)->reopened, 1);
    bus_close(b);
    pthread_join(thread, NULL);
    close(server);
}

// --- many readings under faults ------------------------------------------------------------------

enum { READINGS = 10000, SEED = 20240917 };

// Neighbouring reads differ in length, as the drivers' do; late answers come within quiet_ms.
static int address_of(int i)
{
    return i * 7 % 40;
}

static int count_of(int i)
{
    return i % 2 ? 8 : 4;
}

static bool is_right(int i, const uint16_t *r)
{
    bool right = r[0] == (uint16_t)slave.requests;
    for (int k = 1; k < count_of(i); k++)
        right &= r[k] == (1 + i / 2 % 2) * 1000 + address_of(i) + k;
    return right;
}

static struct noisy noisy;

static void begin_noisy(void)
{
    noisy_init(&noisy, &slave.m.port, SEED, 10);
    noisy.late_most_ns = MS(340);
    noisy.double_most_ns = MS(340);
}

static void no_wrong_value_under_faults(void **state)
{
    int good = 0, wrong = 0;
    uint16_t r[8];
    (void)state;
    begin_noisy();
    struct bus *b = begin(&noisy.port, NULL);
    slave.numbered = true;
    for (int i = 0; i < READINGS; i++)
        if (bus_read(b, 1 + i / 2 % 2, address_of(i), count_of(i), r, NULL) == 0) {
            good++;
            wrong += !is_right(i, r);
        }
    print_message("seed %d: %d readings, %llu faults, %d answered, %d wrong, %.0f s of bus time\n",
                  SEED, READINGS, (unsigned long long)noisy.faults, good, wrong,
                  (double)vline.clk.t_ns * 1e-9);
    assert_true(noisy.faults > READINGS / 20);
    assert_true(good >= READINGS - READINGS / 100);
    assert_int_equal(wrong, 0);
    bus_close(b);
}

// The same faults on libmodbus alone, all reads of one length: what the protections are for.
static void the_bare_library_gives_wrong_values(void **state)
{
    int good = 0, wrong = 0;
    uint16_t r[8];
    struct transport *t;
    (void)state;
    begin_noisy();
    slave_init(false);
    struct clk *clk = vline_begin(&noisy.port);
    assert_int_equal(transport_open(vline.link, clk, NULL, &t, NULL), 0);
    modbus_t *m = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    modbus_set_socket(m, transport_fd(t));
    modbus_set_response_timeout(m, 0, 100000);
    modbus_set_slave(m, 1);
    for (int i = 0; i < READINGS; i++)
        if (modbus_read_registers(m, address_of(i), 4, r) == 4) {
            good++;
            wrong += r[0] != 1000 + address_of(i);
        }
    print_message("bare: %d answered, %d wrong\n", good, wrong);
    assert_true(wrong > 100);
    modbus_set_socket(m, -1);
    modbus_free(m);
    transport_close(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_are_read_and_written),
        cmocka_unit_test(the_line_is_silent_between_frames),
        cmocka_unit_test(a_slow_line_has_longer_gaps),
        cmocka_unit_test(wrong_settings_are_refused),
        cmocka_unit_test(a_slow_unit_is_given_its_time),
        cmocka_unit_test(exceptions_name_function_address_and_count),
        cmocka_unit_test(a_busy_unit_is_waited_for),
        cmocka_unit_test(an_acknowledged_write_is_not_repeated),
        cmocka_unit_test(a_lost_answer_repeats_reads_but_never_writes),
        cmocka_unit_test(a_late_answer_is_never_taken),
        cmocka_unit_test(what_comes_unasked_is_dropped_before_a_request),
        cmocka_unit_test(a_unit_that_is_not_there_does_not_answer),
        cmocka_unit_test(wrong_unit_function_length_or_checksum_is_no_answer),
        cmocka_unit_test(coils_and_inputs_are_read_as_the_standard_shows),
        cmocka_unit_test(coils_and_registers_are_written_as_the_standard_shows),
        cmocka_unit_test(an_echo_that_differs_is_no_answer),
        cmocka_unit_test(a_hang_up_is_gone_and_a_new_plug_works),
        cmocka_unit_test(reads_can_be_cancelled_and_writes_go_out_anyway),
        cmocka_unit_test(nothing_waits_longer_than_one_answer),
        cmocka_unit_test(a_descriptor_too_large_for_select_is_refused),
        cmocka_unit_test(tcp_reconnects_after_a_late_answer),
        cmocka_unit_test(no_wrong_value_under_faults),
        cmocka_unit_test(the_bare_library_gives_wrong_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
