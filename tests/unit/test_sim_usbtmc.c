// SPDX-License-Identifier: MIT
// uses: sim model base
// The simulated USB device by bytes that are written here by hand, from USBTMC 1.0 and USB488 1.0.
#include "sim/usbtmc.h"

#include "tests/usb/meter.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define NOW_NS 1000000000
#define LATER_NS (NOW_NS + 1000000000)

struct bench {
    struct meter meter;
    struct sim_usbtmc usb;
    uint8_t in[600];
};

static const struct sim_usb_identity identity = {0x1313, 0x8072, "Maker", "Meter", "P7"};

static void begin(struct bench *b)
{
    meter_init(&b->meter);
    sim_usbtmc_init(&b->usb, &b->meter.port, "\n", &identity);
}

static int control(struct bench *b, uint8_t type, uint8_t request, uint16_t value, uint8_t index,
                   uint8_t length)
{
    const uint8_t setup[] = {type,  request, (uint8_t)value, (uint8_t)(value >> 8),
                             index, 0,       length,         0};
    return sim_usbtmc_control(&b->usb, setup, b->in, sizeof b->in, NOW_NS);
}

// DEV_DEP_MSG_OUT with this tag, as one transfer.
static int send(struct bench *b, uint8_t tag, const char *text, bool end)
{
    uint8_t frame[128] = {1, tag, (uint8_t)(255 - tag), 0, (uint8_t)strlen(text), 0, 0, 0, end};
    memcpy(frame + 12, text, strlen(text));
    return sim_usbtmc_bulk_out(&b->usb, frame, 12 + (strlen(text) + 3) / 4 * 4, NOW_NS);
}

static int ask(struct bench *b, uint8_t tag, uint8_t most)
{
    const uint8_t frame[12] = {2, tag, (uint8_t)(255 - tag), 0, most};
    return sim_usbtmc_bulk_out(&b->usb, frame, sizeof frame, NOW_NS);
}

static int take(struct bench *b, size_t room)
{
    return sim_usbtmc_bulk_in(&b->usb, b->in, room, LATER_NS);
}

static void a_command_is_answered_when_it_was_asked_for(void **state)
{
    static const uint8_t header[12] = {2, 9, 246, 0, 33, 0, 0, 0, 1};
    struct bench b;
    (void)state;
    begin(&b);
    assert_int_equal(send(&b, 8, "*IDN?\n", true), 20);
    assert_int_equal(sim_usbtmc_bulk_in(&b.usb, b.in, 600, NOW_NS), SIM_USB_NAK); // not asked
    assert_int_equal(ask(&b, 9, 200), 12);
    assert_int_equal(sim_usbtmc_bulk_in(&b.usb, b.in, 600, NOW_NS), SIM_USB_NAK); // too early
    assert_int_equal(take(&b, 600), 12 + 36);
    assert_memory_equal(b.in, header, sizeof header);
    assert_memory_equal(b.in + 12, METER_IDENTITY "\n\0\0\0", 36);
    assert_int_equal(take(&b, 600), SIM_USB_NAK);
}

static void eom_ends_a_command_as_a_line_does(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    send(&b, 1, "*ID", false);
    send(&b, 2, "N?", true);
    ask(&b, 3, 200);
    assert_int_equal(take(&b, 600), 12 + 36);
    send(&b, 4, "*IDN?", false); // not ended
    ask(&b, 5, 200);
    assert_int_equal(take(&b, 600), SIM_USB_NAK);
}

static void an_answer_comes_in_parts_of_what_is_asked_for(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    send(&b, 1, "*IDN?\n", true);
    ask(&b, 2, 30);
    assert_int_equal(take(&b, 20), 20); // the first 20 bytes of 12 + 32
    assert_int_equal(b.in[4], 30);
    assert_int_equal(b.in[8], 0);
    assert_int_equal(take(&b, 600), 24);
    ask(&b, 3, 30);
    assert_int_equal(take(&b, 600), 16);
    assert_int_equal(b.in[4], 3);
    assert_int_equal(b.in[8], 1);
    assert_memory_equal(b.in + 12, ".0\n", 3);
}

static void what_is_no_frame_halts_the_endpoint(void **state)
{
    static const uint8_t wrong[][12] = {
        {3, 1, 254, 0, 1}, {1, 1, 255, 0, 1}, {1, 0, 255, 0, 1}, {2, 1, 254}};
    struct bench b;
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        begin(&b);
        assert_int_equal(sim_usbtmc_bulk_out(&b.usb, wrong[i], 12, NOW_NS), SIM_USB_STALL);
        assert_int_equal(send(&b, 1, "*IDN?\n", true), SIM_USB_STALL);
        assert_int_equal(control(&b, 0x82, 0, 0, SIM_USB_OUT, 2), 2);
        assert_int_equal(b.in[0], 1);
        assert_int_equal(control(&b, 0x02, 1, 0, SIM_USB_OUT, 0), 0);
        assert_int_equal(send(&b, 1, "*IDN?\n", true), 20);
    }
    begin(&b);
    ask(&b, 1, 10);
    assert_int_equal(ask(&b, 2, 10), SIM_USB_STALL); // one request at a time
}

static void an_abort_needs_the_tag_of_the_transfer(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    assert_int_equal(control(&b, 0xa2, 3, 5, SIM_USB_IN, 2), 2);
    assert_int_equal(b.in[0], 0x80); // nothing to abort
    ask(&b, 5, 10);
    control(&b, 0xa2, 3, 4, SIM_USB_IN, 2);
    assert_int_equal(b.in[0], 0x81);
    control(&b, 0xa2, 3, 5, SIM_USB_IN, 2);
    assert_true(b.in[0] == 1 && b.in[1] == 5);
    assert_int_equal(control(&b, 0xa2, 4, 0, SIM_USB_IN, 8), 8);
    assert_int_equal(b.in[0], 1);
    assert_int_equal(take(&b, 600), 0); // the short packet that ends it
    assert_int_equal(take(&b, 600), SIM_USB_NAK);
    assert_int_equal(ask(&b, 6, 10), 12);
}

static void clearing_forgets_commands_and_answers(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    send(&b, 1, "MEAS:POW?\n", true);
    assert_int_equal(take(&b, 600), SIM_USB_NAK); // the answer is there, not asked for
    send(&b, 2, "*ID", false);
    b.usb.fault[SIM_USB_PENDING] = 1;
    assert_int_equal(control(&b, 0xa1, 5, 0, 0, 1), 1);
    assert_int_equal(b.in[0], 1);
    assert_int_equal(control(&b, 0xa1, 6, 0, 0, 2), 2);
    assert_int_equal(b.in[0], 2);
    control(&b, 0xa1, 6, 0, 0, 2);
    assert_int_equal(b.in[0], 1);
    send(&b, 3, "*IDN?\n", true);
    ask(&b, 4, 200);
    assert_int_equal(take(&b, 600), 12 + 36);
    assert_memory_equal(b.in + 12, "Thorlabs", 8);
}

static void a_clear_may_wait_until_its_fifo_was_read(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    b.usb.fault[SIM_USB_STALE] = 1;
    control(&b, 0xa1, 5, 0, 0, 1);
    control(&b, 0xa1, 6, 0, 0, 2);
    assert_true(b.in[0] == 2 && b.in[1] == 1);
    assert_int_equal(take(&b, SIM_USB_PACKET), SIM_USB_PACKET);
    assert_int_equal(take(&b, SIM_USB_PACKET), 1);
    control(&b, 0xa1, 6, 0, 0, 2);
    assert_true(b.in[0] == 1 && b.in[1] == 0);
}

static void the_status_byte_tells_of_an_answer(void **state)
{
    const uint8_t setup[] = {0xa1, 128, 2, 0, 0, 0, 3, 0};
    struct bench b;
    (void)state;
    begin(&b);
    send(&b, 1, "*IDN?\n", true);
    assert_int_equal(control(&b, 0xa1, 128, 2, 0, 3), 3);
    assert_true(b.in[0] == 1 && b.in[1] == 2 && b.in[2] == 0);
    assert_int_equal(sim_usbtmc_control(&b.usb, setup, b.in, sizeof b.in, LATER_NS), 3);
    assert_int_equal(b.in[2], 0x10);
}

static void it_describes_itself(void **state)
{
    static const uint8_t serial[] = {6, 3, 'P', 0, '7', 0};
    uint8_t all[SIM_USB_DESCRIPTORS];
    struct bench b;
    (void)state;
    begin(&b);
    sim_usbtmc_descriptors(&b.usb, all);
    assert_int_equal(control(&b, 0x80, 6, 0x0100, 0, 18), 18);
    assert_memory_equal(b.in, all, 18);
    assert_true(b.in[8] == 0x13 && b.in[9] == 0x13 && b.in[10] == 0x72 && b.in[11] == 0x80);
    assert_int_equal(control(&b, 0x80, 6, 0x0200, 0, 9), 9); // the header first, as hosts do
    assert_int_equal(b.in[2], 32);
    assert_int_equal(control(&b, 0x80, 6, 0x0200, 0, 255), 32);
    assert_memory_equal(b.in, all + 18, 32);
    assert_int_equal(control(&b, 0x80, 6, 0x0303, 9, 255), sizeof serial);
    assert_memory_equal(b.in, serial, sizeof serial);
    assert_int_equal(control(&b, 0x80, 6, 0x0304, 9, 255), SIM_USB_STALL);
    assert_int_equal(control(&b, 0xa1, 7, 0, 0, 24), 24);
    assert_true(b.in[0] == 1 && b.in[3] == 1 && b.in[13] == 1 && b.in[14] == 6);
    assert_int_equal(control(&b, 0xa1, 99, 0, 0, 1), SIM_USB_STALL);
}

static void faults_have_names(void **state)
{
    struct bench b;
    (void)state;
    begin(&b);
    assert_true(sim_usbtmc_set_fault(&b.usb, "stall_in", 2));
    assert_true(sim_usbtmc_set_fault(&b.usb, "deaf", 3));
    assert_int_equal(b.usb.fault[SIM_USB_STALL_IN], 2);
    assert_int_equal(b.usb.fault[SIM_USB_DEAF], 3);
    assert_false(sim_usbtmc_set_fault(&b.usb, "stall", 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_is_answered_when_it_was_asked_for),
        cmocka_unit_test(eom_ends_a_command_as_a_line_does),
        cmocka_unit_test(an_answer_comes_in_parts_of_what_is_asked_for),
        cmocka_unit_test(what_is_no_frame_halts_the_endpoint),
        cmocka_unit_test(an_abort_needs_the_tag_of_the_transfer),
        cmocka_unit_test(clearing_forgets_commands_and_answers),
        cmocka_unit_test(a_clear_may_wait_until_its_fifo_was_read),
        cmocka_unit_test(the_status_byte_tells_of_an_answer),
        cmocka_unit_test(it_describes_itself),
        cmocka_unit_test(faults_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
