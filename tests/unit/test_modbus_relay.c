// SPDX-License-Identifier: MIT
// uses: drivers base
// What stands between libmodbus and the line while somebody listens, and what is made of it.
#include "drivers/modbus_relay.h"

#include "drivers/capture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { PATIENCE_MS = 20000 };

static void await(int fd)
{
    struct pollfd p = {fd, POLLIN, 0};
    assert_int_equal(poll(&p, 1, PATIENCE_MS), 1);
}

static void it_passes_on_what_goes_both_ways_and_shows_it(void **state)
{
    int line[2];
    char got[16];
    struct modbus_relay_bytes sent, received;
    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, line), 0);
    struct modbus_relay *r = modbus_relay_start(line[0]);
    assert_non_null(r);
    assert_int_equal(write(modbus_relay_fd(r), "ask", 3), 3);
    await(line[1]);
    assert_int_equal(read(line[1], got, sizeof got), 3);
    assert_memory_equal(got, "ask", 3);
    assert_int_equal(write(line[1], "\0yes", 4), 4);
    await(modbus_relay_fd(r));
    assert_int_equal(read(modbus_relay_fd(r), got, sizeof got), 4);
    modbus_relay_end(r, &sent, &received);
    assert_int_equal(sent.size, 3);
    assert_memory_equal(sent.byte, "ask", 3);
    assert_int_equal(received.size, 4);
    assert_memory_equal(received.byte, "\0yes", 4);
    // What comes afterwards stays on the line.
    assert_int_equal(write(line[1], "late", 4), 4);
    await(line[0]);
    assert_int_equal(read(line[0], got, sizeof got), 4);
    close(line[0]);
    close(line[1]);
}

static void a_line_that_hangs_up_is_the_end_of_the_file(void **state)
{
    int line[2];
    char got[16];
    struct modbus_relay_bytes sent, received;
    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, line), 0);
    struct modbus_relay *r = modbus_relay_start(line[0]);
    assert_non_null(r);
    close(line[1]);
    await(modbus_relay_fd(r));
    assert_int_equal(read(modbus_relay_fd(r), got, sizeof got), 0);
    assert_int_equal(write(modbus_relay_fd(r), "ask", 3), 3); // no signal
    modbus_relay_end(r, &sent, &received);
    assert_int_equal(sent.size + received.size, 0);
    close(line[0]);
}

static void a_capture_keeps_exchanges_apart(void **state)
{
    static struct capture c;
    (void)state;
    capture_begin(&c);
    c.tap.take(c.tap.ctx, TAP_RECEIVED, "late", 4);
    c.tap.take(c.tap.ctx, TAP_SENT, "a\r", 2);
    c.tap.take(c.tap.ctx, TAP_RECEIVED, "1", 1);
    c.tap.take(c.tap.ctx, TAP_RECEIVED, "\r\n", 2);
    c.tap.take(c.tap.ctx, TAP_SENT, "b\r", 2);
    c.tap.take(c.tap.ctx, TAP_SENT, "c\r", 2);
    assert_int_equal(c.stray.size, 4);
    assert_int_equal(c.count, 3);
    assert_int_equal(c.exchange[0].received.size, 3);
    assert_memory_equal(c.exchange[0].received.byte, "1\r\n", 3);
    assert_int_equal(c.exchange[1].received.size, 0);
    for (int i = 3; i < CAPTURE_MOST + 2; i++)
        c.tap.take(c.tap.ctx, TAP_SENT, "d\r", 2);
    c.tap.take(c.tap.ctx, TAP_RECEIVED, "?", 1); // is no answer to the last that was kept
    assert_int_equal(c.lost, 2);
    assert_int_equal(c.exchange[CAPTURE_MOST - 1].received.size, 0);
    capture_forget(&c);
    assert_int_equal(c.count + c.lost + (int)c.stray.size, 0);
}

static void long_answers_are_cut_and_passed_on(void **state)
{
    static struct capture c;
    static char many[2 * GOLDEN_BYTES];
    (void)state;
    capture_begin(&c);
    c.tap.take(c.tap.ctx, TAP_SENT, "a\r", 2);
    c.tap.take(c.tap.ctx, TAP_RECEIVED, many, sizeof many);
    assert_int_equal(c.exchange[0].received.size, GOLDEN_BYTES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_passes_on_what_goes_both_ways_and_shows_it),
        cmocka_unit_test(a_line_that_hangs_up_is_the_end_of_the_file),
        cmocka_unit_test(a_capture_keeps_exchanges_apart),
        cmocka_unit_test(long_answers_are_cut_and_passed_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
