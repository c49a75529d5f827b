// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The host's part of USBTMC against the simulated device, through transport and message, in virtual
// time.
#include "drivers/message.h"

#include "tests/unit/randoms.h"
#include "tests/unit/vusb.h"
#include "tests/usb/meter.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

enum { ABORT_OUT = 1, ABORT_IN = 3, CLEAR = 5, CHECK_CLEAR = 6, STATUS = 128, REMOTE = 160 };

static const struct message_format format = {.end_out = "\n",
                                             .end_in = "\n",
                                             .timeout_ns = MS(200),
                                             .quiet_ns = MS(350),
                                             .sync_query = "*IDN?",
                                             .sync_begins = METER_IDENTITY};

struct bench {
    struct meter meter;
    struct vusb usb;
    struct transport *t;
    struct message *m;
};

static void begin(struct bench *b, const struct cancel *cancel)
{
    struct gon_error err;
    meter_init(&b->meter);
    vusb_init(&b->usb, &b->meter.port);
    if (transport_open_usb_io(&b->usb.io, "usbtmc:1313:8072", &b->usb.clk.clk, cancel, &b->t, &err))
        fail_msg("%s", err.text);
    b->m = message_new(b->t, &format);
    assert_non_null(b->m);
}

static void end(struct bench *b)
{
    message_free(b->m);
    assert_true(b->usb.longest_ns <= MS(50));
}

static int64_t in(const struct bench *b, int64_t ns)
{
    return b->usb.clk.t_ns + ns;
}

static void check_next_value(struct bench *b)
{
    struct gon_error err;
    double w;
    const int rc = message_ask_number(b->m, "MEAS:POW?", &w, &err);
    if (rc < 0)
        fail_msg("%s", err.text);
    assert_int_equal(meter_question(w), b->meter.measured);
}

// --- what goes well ------------------------------------------------------------------------------

static void opening_clears_and_takes_control(void **state)
{
    struct bench b;
    (void)state;
    begin(&b, NULL);
    assert_int_equal(b.usb.device.requests[CLEAR], 1);
    assert_int_equal(b.usb.device.requests[CHECK_CLEAR], 1);
    assert_true(b.usb.device.remote);
    end(&b);
}

static void a_query_is_answered(void **state)
{
    struct bench b;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    assert_int_equal(message_query(b.m, "*IDN?", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, METER_IDENTITY);
    assert_int_equal(message_send(b.m, "SENS:CORR:WAV 1550", NULL), 0);
    assert_int_equal(message_query(b.m, "SENS:CORR:WAV?", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, "1.5500E+03");
    for (int i = 0; i < 600; i++) // the tags go round
        check_next_value(&b);
    assert_int_equal(b.usb.device.requests[ABORT_IN], 0);
    assert_int_equal(b.usb.device.requests[CLEAR], 1);
    end(&b);
}

// Reads one answer in pieces of at most that many bytes; its length.
static size_t read_pieces(struct bench *b, char *text, size_t room, size_t piece)
{
    size_t have = 0;
    do {
        const size_t most = piece < room - have ? piece : room - have;
        struct gon_error err = {0};
        const int n = transport_read(b->t, text + have, most, in(b, MS(200)), &err);
        if (n < 0)
            fail_msg("%s", err.text);
        assert_true(n >= 0 && (n > 0 || transport_ended(b->t)));
        have += (size_t)n;
    } while (!transport_ended(b->t));
    return have;
}

static void answers_of_any_length_come_whole(void **state)
{
    static const unsigned faults[] = {SIM_USB_FAULTS, SIM_USB_SHORT, SIM_USB_SPLIT,
                                      SIM_USB_EMPTY_END, SIM_USB_ZERO_PACKET};
    static const size_t sizes[] = {1, 2, 51, 52, 53, 116, 4000, 4095, 4096, 4097, 5000, 8000};
    struct bench b;
    char text[METER_LONGEST + 8], command[32];
    (void)state;
    begin(&b, NULL);
    for (size_t f = 0; f < sizeof faults / sizeof faults[0]; f++)
        for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
            if (faults[f] < SIM_USB_FAULTS)
                b.usb.device.fault[faults[f]] = 1;
            const int n = snprintf(command, sizeof command, "LONG? %zu\n", sizes[i]);
            assert_int_equal(transport_write(b.t, command, (size_t)n, in(&b, MS(200)), NULL), 0);
            const size_t have = read_pieces(&b, text, sizeof text, i % 2 ? 7 : sizeof text);
            assert_int_equal(have, sizes[i]);
            for (size_t k = 0; k + 1 < have; k++)
                assert_int_equal(text[k], 'a' + (int)(k % 26));
            assert_int_equal(text[have - 1], '\n');
            if (faults[f] < SIM_USB_FAULTS)
                b.usb.device.fault[faults[f]] = 0;
        }
    assert_int_equal(b.usb.device.requests[CLEAR], 1);
    end(&b);
}

static void an_answer_ends_at_eom_without_its_terminator(void **state)
{
    static const struct message_format other = {
        .end_out = "\n", .end_in = "\r\n", .timeout_ns = MS(200), .quiet_ns = MS(350)};
    struct bench b;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    message_free(b.m);
    struct gon_error err;
    meter_init(&b.meter);
    vusb_init(&b.usb, &b.meter.port);
    b.usb.device.end = "0"; // "P0000001" ends its first message after P0, without a line's end
    assert_int_equal(
        transport_open_usb_io(&b.usb.io, "usbtmc:1313:8072", &b.usb.clk.clk, NULL, &b.t, &err), 0);
    b.m = message_new(b.t, &other);
    assert_int_equal(message_query(b.m, "*IDN?\n", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, "Thorlabs,PM10");
    end(&b);
}

static void where_terminators_come_an_answer_without_one_is_a_part(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    check_next_value(&b);
    b.usb.device.end = "0"; // "Thorlabs,PM10"
    assert_int_equal(message_query(b.m, "*IDN?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "the answer breaks off: 'Thorlabs,PM10'"));
    b.usb.device.end = "\n";
    check_next_value(&b);
    end(&b);
}

static void an_answer_given_twice_is_dropped(void **state)
{
    struct bench b;
    (void)state;
    begin(&b, NULL);
    for (int i = 0; i < 10; i++) {
        char again[40];
        check_next_value(&b);
        snprintf(again, sizeof again, "%.9E\n", meter_value_w(b.meter.measured));
        port_send(&b.meter.port, again, strlen(again), b.usb.clk.t_ns);
    }
    check_next_value(&b);
    assert_int_equal(message_stats(b.m)->errors[LINK_STRAY], 10);
    assert_int_equal(b.usb.device.requests[CLEAR], 1);
    end(&b);
}

// Always tells of an answer that nobody read.
static int lying_control(struct usb_io *io, const struct usbtmc_setup *s, uint8_t *data,
                         int64_t deadline_ns)
{
    const int rc = vusb_control(io, s, data, deadline_ns);
    if (s->request == STATUS)
        data[2] |= USBTMC_MESSAGE_AVAILABLE;
    return rc;
}

static void a_status_that_lies_is_not_asked_for_ever(void **state)
{
    struct bench b;
    struct usb_io_ops ops;
    (void)state;
    begin(&b, NULL);
    ops = *b.usb.io.ops;
    ops.control = lying_control;
    b.usb.io.ops = &ops;
    for (int i = 0; i < 3; i++)
        assert_int_equal(message_query(b.m, "MEAS:POW?", (char[80]){0}, 80, NULL), GON_E_LINK);
    for (int i = 0; i < 10; i++)
        check_next_value(&b);
    assert_int_equal(b.usb.device.requests[STATUS], 3);
    end(&b);
}

static void a_long_command_goes_in_parts(void **state)
{
    struct bench b;
    char text[9000], answer[80];
    (void)state;
    begin(&b, NULL);
    memset(text, ' ', sizeof text); // blanks before it: an error, but one command
    text[sizeof text - 1] = '\n';
    assert_int_equal(transport_write(b.t, text, sizeof text, in(&b, MS(200)), NULL), 0);
    assert_int_equal(b.usb.device.commands, 1);
    assert_int_equal(message_query(b.m, "SYST:ERR?", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, "-113,\"Undefined header\"");
    end(&b);
}

static void an_answer_that_nobody_read_is_dropped(void **state)
{
    struct bench b;
    (void)state;
    begin(&b, NULL);
    assert_int_equal(message_send_blind(b.m, "MEAS:POW?", false, NULL), 0);
    clk_sleep(&b.usb.clk.clk, MS(20), NULL);
    check_next_value(&b);
    assert_int_equal(b.meter.measured, 2);
    assert_int_equal(b.usb.device.requests[STATUS], 1);
    assert_int_equal(b.usb.device.requests[CLEAR], 1);
    end(&b);
}

// --- what goes wrong -----------------------------------------------------------------------------

static void each_fault_is_mended_and_the_next_value_is_right(void **state)
{
    static const struct {
        enum sim_usb_fault fault;
        unsigned count;
        const char *said; // of a single query; NULL: it succeeds
        int aborts, clears, halts;
    } rows[] = {
        {SIM_USB_STALL_IN, 1, "reading an answer: refused by the device (stall)", 0, 1, 2},
        {SIM_USB_STALL_OUT, 1, "sending a command: refused by the device (stall)", 0, 1, 2},
        {SIM_USB_WRONG_TAG, 1, "the answer to another question (wrong tag)", 1, 1, 1},
        {SIM_USB_WRONG_COMPLEMENT, 1, "the answer to another question (wrong tag)", 1, 1, 1},
        {SIM_USB_WRONG_ID, 1, "something that is no answer", 1, 1, 1},
        {SIM_USB_HUGE, 1, "an answer of an impossible size", 1, 1, 1},
        {SIM_USB_LARGE, 1, "the answer breaks off", 1, 1, 1},
        {SIM_USB_SMALL, 1, "an answer of an impossible size", 1, 1, 1},
        {SIM_USB_SHORT, 1, NULL, 0, 0, 0},
        {SIM_USB_SPLIT, 1, NULL, 0, 0, 0},
        {SIM_USB_EMPTY_END, 1, NULL, 0, 0, 0},
        {SIM_USB_DEAF, 1, "no answer in 200 ms", 1, 1, 1},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct bench b;
        struct gon_error err = {0};
        char answer[80];
        begin(&b, NULL);
        const uint64_t halts = b.usb.device.halts_cleared;
        b.usb.device.fault[rows[i].fault] = rows[i].count;
        const int rc = message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err);
        assert_int_equal(rc, rows[i].said ? GON_E_LINK : 0);
        if (rows[i].said && (!strstr(err.text, rows[i].said) || !strstr(err.text, "MEAS:POW?")) &&
            rows[i].fault != SIM_USB_STALL_OUT)
            fail_msg("%zu said: %s", i, err.text);
        check_next_value(&b);
        assert_int_equal(b.usb.device.requests[ABORT_IN], rows[i].aborts);
        assert_int_equal(b.usb.device.requests[CLEAR], 1 + rows[i].clears);
        assert_int_equal(b.usb.device.halts_cleared - halts, rows[i].halts);
        assert_int_equal(b.usb.resets, 0);
        end(&b);
    }
}

static void a_command_half_taken_is_aborted(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    b.usb.slow_out = true;
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err), GON_E_LINK);
    check_next_value(&b);
    assert_int_equal(b.meter.measured, 1);
    assert_int_equal(b.usb.device.requests[ABORT_OUT], 1);
    end(&b);
}

static void what_comes_late_is_never_taken_for_the_next_answer(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    for (int late_ms = 150; late_ms < 1500; late_ms += 13) {
        begin(&b, NULL);
        b.meter.port.delay_ns = MS(late_ms);
        const int64_t asked_ns = b.usb.clk.t_ns;
        const int rc = message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err);
        assert_int_equal(rc, late_ms < 200 ? 0 : GON_E_LINK);
        assert_true(b.usb.clk.t_ns - asked_ns <= MS(202));
        check_next_value(&b);
        check_next_value(&b);
        end(&b);
    }
}

static void a_command_alone_mends_the_link(void **state)
{
    struct bench b;
    char text[80];
    (void)state;
    begin(&b, NULL);
    b.meter.port.delay_ns = MS(250);
    assert_int_equal(transport_write(b.t, "MEAS:POW?\n", 10, in(&b, MS(200)), NULL), 0);
    assert_int_equal(transport_read(b.t, text, sizeof text, in(&b, MS(200)), NULL), GON_E_LINK);
    assert_int_equal(transport_write(b.t, "SYST:ERR?\n", 10, in(&b, MS(200)), NULL), 0);
    clk_sleep(&b.usb.clk.clk, MS(100), NULL);
    assert_int_equal(transport_read(b.t, text, sizeof text, in(&b, MS(200)), NULL), 13);
    assert_memory_equal(text, "0,\"No error\"", 12);
    end(&b);
}

static void reading_on_after_a_timeout_loses_nothing(void **state)
{
    struct bench b;
    char text[6000];
    int timeouts = 0;
    size_t have = 0;
    (void)state;
    begin(&b, NULL);
    b.meter.latency_ns = MS(300);
    b.usb.device.fault[SIM_USB_SHORT] = 1;
    assert_int_equal(transport_write(b.t, "LONG? 5000\n", 11, in(&b, MS(200)), NULL), 0);
    while (!transport_ended(b.t)) {
        const int n = transport_read(b.t, text + have, sizeof text - have, in(&b, MS(7)), NULL);
        assert_true(n > 0 || n == GON_E_LINK);
        timeouts += n < 0;
        have += n > 0 ? (size_t)n : 0;
    }
    assert_int_equal(have, 5000);
    assert_true(timeouts > 30);
    for (size_t k = 0; k + 1 < have; k++)
        assert_int_equal(text[k], 'a' + (int)(k % 26));
    assert_int_equal(b.usb.device.requests[ABORT_IN], 0);
    end(&b);
}

static void clearing_waits_while_it_is_pending(void **state)
{
    struct bench b;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    b.usb.device.fault[SIM_USB_DEAF] = 1;
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, NULL), GON_E_LINK);
    b.usb.device.fault[SIM_USB_PENDING] = 19;
    check_next_value(&b);
    assert_int_equal(b.usb.resets, 0);
    end(&b);
}

static void what_a_clear_left_in_the_device_is_read(void **state)
{
    struct bench b;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    b.usb.device.fault[SIM_USB_DEAF] = b.usb.device.fault[SIM_USB_STALE] = 1;
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, NULL), GON_E_LINK);
    const int64_t begun_ns = b.usb.clk.t_ns;
    check_next_value(&b);
    assert_true(b.usb.clk.t_ns - begun_ns < MS(20));
    assert_int_equal(b.usb.device.stale, 0);
    end(&b);
}

static void what_stays_pending_is_reset_and_reported(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    b.usb.device.fault[SIM_USB_DEAF] = 1;
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, NULL), GON_E_LINK);
    b.usb.device.fault[SIM_USB_PENDING] = 1000;
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "could not be cleared and was reset"));
    assert_int_equal(b.usb.resets, 1);
    b.usb.device.fault[SIM_USB_PENDING] = 0;
    check_next_value(&b);
    end(&b);
}

static void unplugging_is_noticed_at_once(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    begin(&b, NULL);
    b.meter.latency_ns = MS(150);
    b.usb.unplug_ns = in(&b, MS(70));
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err), GON_E_GONE);
    assert_int_equal(b.usb.clk.t_ns, b.usb.unplug_ns);
    assert_non_null(strstr(err.text, "unplugged"));
    assert_int_equal(b.usb.shut, 1);
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err), GON_E_GONE);
    assert_non_null(strstr(err.text, "not open since it hung up"));
    assert_int_equal(message_reopen(b.m, &err), GON_E_GONE);
    b.usb.unplug_ns = PORT_NEVER;
    sim_usbtmc_reset(&b.usb.device);
    assert_int_equal(message_reopen(b.m, &err), 0);
    check_next_value(&b);
    assert_int_equal(b.usb.opened, 2);
    end(&b);
}

static void a_cancelled_query_ends_at_once_and_off_still_goes(void **state)
{
    struct bench b;
    struct gon_error err;
    char answer[80];
    (void)state;
    struct cancel *cancel = cancel_new();
    begin(&b, cancel);
    b.meter.latency_ns = MS(150);
    b.usb.cancel = cancel;
    b.usb.cancel_ns = in(&b, MS(33));
    assert_int_equal(message_query(b.m, "MEAS:POW?", answer, sizeof answer, &err), GON_E_CANCELED);
    assert_int_equal(b.usb.clk.t_ns, b.usb.cancel_ns);
    assert_int_equal(message_send_blind(b.m, "SENS:CORR:WAV 633", true, &err), 0);
    assert_true(b.meter.wavelength_nm == 633);
    end(&b);
    cancel_free(cancel);
}

static void random_faults_never_give_a_wrong_value(void **state)
{
    struct bench b;
    struct gon_error err;
    uint64_t seed = random_seed();
    int good = 0, faults = 0, failed = 0;
    (void)state;
    begin(&b, NULL);
    for (int i = 0; i < 20000; i++) {
        double w;
        if (random_next(&seed) % 4 == 0) {
            b.usb.device.fault[random_next(&seed) % SIM_USB_FAULTS] = 1;
            faults++;
        }
        if (random_next(&seed) % 16 == 0)
            b.meter.port.delay_ns = (int64_t)(random_next(&seed) % 1000000000);
        const int rc = message_ask_number(b.m, "MEAS:POW?", &w, &err);
        assert_true(rc == 0 || rc == GON_E_LINK);
        if (rc == 0)
            assert_int_equal(meter_question(w), b.meter.measured);
        good += rc == 0;
        failed += rc < 0;
    }
    printf("%d faults, %d values, %d questions failed, %.0f s of virtual time\n", faults, good,
           failed, (double)b.usb.clk.t_ns * 1e-9);
    assert_true(good > 19900);
    assert_int_equal(b.usb.resets, 0);
    end(&b);
}

// --- a device out of its mind --------------------------------------------------------------------

// Overrides what a vusb sends towards the host: random bytes, random outcomes, and now and then
// the truth.
struct noise {
    struct vusb *usb;
    const struct usb_io_ops *ops;
    uint64_t seed;
};

static struct noise noise;

static int distort(uint8_t *data, size_t size, int rc)
{
    const uint64_t dice = random_next(&noise.seed) % 8;
    if (dice == 0)
        return USB_FAILED + (int)(random_next(&noise.seed) % 5); // each outcome but none
    for (size_t i = 0; dice < 4 && i < size; i++)
        if (random_next(&noise.seed) % 2)
            data[i] = (uint8_t)random_next(&noise.seed);
    return dice < 2 ? (int)(random_next(&noise.seed) % (size + 1)) : rc;
}

static int noisy_control(struct usb_io *io, const struct usbtmc_setup *setup, uint8_t *data,
                         int64_t deadline_ns)
{
    return distort(data, setup->length, noise.ops->control(io, setup, data, deadline_ns));
}

static int noisy_bulk_in(struct usb_io *io, uint8_t endpoint, uint8_t *data, size_t size,
                         int64_t deadline_ns)
{
    return distort(data, size, noise.ops->bulk_in(io, endpoint, data, size, deadline_ns));
}

static void random_bytes_and_outcomes_do_no_harm(void **state)
{
    struct bench b;
    struct usb_io_ops ops;
    char text[100];
    int answers = 0, codes[9] = {0};
    (void)state;
    begin(&b, NULL);
    noise = (struct noise){&b.usb, b.usb.io.ops, random_seed()};
    ops = *b.usb.io.ops;
    ops.control = noisy_control;
    ops.bulk_in = noisy_bulk_in;
    b.usb.io.ops = &ops;
    for (int i = 0; i < 20000; i++) {
        const int64_t begun_ns = b.usb.clk.t_ns;
        const int rc =
            message_query(b.m, i % 7 ? "MEAS:POW?" : "LONG? 600", text, sizeof text, NULL);
        assert_true(rc <= 0 && rc >= GON_E_SYSTEM);
        assert_true(b.usb.clk.t_ns - begun_ns < CLK_S(5)); // bounded whatever comes
        codes[-rc]++;
        answers += rc == 0;
        if (rc == GON_E_GONE)
            message_reopen(b.m, NULL);
    }
    printf("%d answers; errors: link %d, gone %d, device %d, canceled %d\n", answers,
           codes[-GON_E_LINK], codes[-GON_E_GONE], codes[-GON_E_DEVICE], codes[-GON_E_CANCELED]);
    assert_true(answers > 100 && codes[-GON_E_LINK] > 100 && codes[-GON_E_GONE] > 100);
    message_free(b.m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opening_clears_and_takes_control),
        cmocka_unit_test(a_query_is_answered),
        cmocka_unit_test(answers_of_any_length_come_whole),
        cmocka_unit_test(an_answer_ends_at_eom_without_its_terminator),
        cmocka_unit_test(where_terminators_come_an_answer_without_one_is_a_part),
        cmocka_unit_test(an_answer_given_twice_is_dropped),
        cmocka_unit_test(a_status_that_lies_is_not_asked_for_ever),
        cmocka_unit_test(a_long_command_goes_in_parts),
        cmocka_unit_test(an_answer_that_nobody_read_is_dropped),
        cmocka_unit_test(each_fault_is_mended_and_the_next_value_is_right),
        cmocka_unit_test(a_command_half_taken_is_aborted),
        cmocka_unit_test(what_comes_late_is_never_taken_for_the_next_answer),
        cmocka_unit_test(a_command_alone_mends_the_link),
        cmocka_unit_test(reading_on_after_a_timeout_loses_nothing),
        cmocka_unit_test(clearing_waits_while_it_is_pending),
        cmocka_unit_test(what_a_clear_left_in_the_device_is_read),
        cmocka_unit_test(what_stays_pending_is_reset_and_reported),
        cmocka_unit_test(unplugging_is_noticed_at_once),
        cmocka_unit_test(a_cancelled_query_ends_at_once_and_off_still_goes),
        cmocka_unit_test(random_faults_never_give_a_wrong_value),
        cmocka_unit_test(random_bytes_and_outcomes_do_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
