// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// A unit made from a profile, asked and told by the same profile over the unmodified libmodbus, in
// virtual time.
#include "drivers/bus.h"
#include "drivers/link_stats.h"
#include "drivers/session.h"
#include "sim/actor_registers.h"
#include "tests/unit/noisy.h"
#include "tests/unit/vline.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

static const char text[] =
    "profile: { name = \"u\"; title = \"Unit\"; role = \"inputs\"; source = \"this test\";"
    "  protocol = \"modbus\"; };\n"
    "registers: { timeout_ms = 120; };\n"
    "values: (\n"
    "  { name = \"kind\"; type = \"int\"; address = 1; access = \"r\"; },\n"
    "  { name = \"level\"; unit = \"V\"; scale = 0.01; min = 0; max = 10; resolution = 0.01;"
    "    address = 2; },\n"
    "  { name = \"count\"; type = \"int\"; format = \"s32\"; address = 10;"
    "    valid = \"mode = counting\"; },\n"
    "  { name = \"mode\"; type = \"word\"; words = ( \"idle\", \"counting\" ); address = 12; },\n"
    "  { name = \"input\"; type = \"hex\"; format = \"u32\"; address = 20; access = \"w\";"
    "    bits = ( { name = \"go\"; bit = 0; }, { name = \"stop\"; bit = 1; } ); },\n"
    "  { name = \"input_low\"; type = \"hex\"; address = 21; access = \"w\"; shares = \"input\"; "
    "},\n"
    "  { name = \"hours\"; type = \"int\"; address = 40; access = \"r\"; },\n"
    "  { name = \"went\"; type = \"int\"; address = 50; access = \"r\"; }\n"
    ");\n"
    "writes: (\n"
    "  { name = \"set_level\"; set = \"level\"; readback = true; },\n"
    "  { name = \"set_mode\"; set = \"mode = counting\"; verify = \"mode = counting\"; },\n"
    "  { name = \"go\"; edge = \"input.go\"; release = \"let_go\"; then = \"went = 1\"; },\n"
    "  { name = \"stop\"; edge = \"input.stop\"; release = \"let_go\"; repeat = true;"
    "    then = \"went = 0\"; },\n"
    "  { name = \"let_go\"; set = \"input_low = 0\"; repeat = true; }\n"
    ");\n"
    "identify: { asks = ( \"kind\", \"hours\" ); restarted = \"hours = 0\";"
    "  refuse = ( { when = \"kind != 3\"; text = \"is another kind\"; } ); };\n"
    "inputs: { status = ( \"level\", \"count\", \"mode\" ); };\n"
    "simulate: { start = ( { value = \"kind\"; is = \"3\"; }, { value = \"hours\"; is = \"7\"; },"
    "  { value = \"level\"; is = \"1.25\"; }, { value = \"count\"; is = \"-5\"; } );"
    "  deny = ( { does = \"set_mode\"; when = \"hours = 9\"; answer = \"4\"; },"
    "           { does = \"set_mode\"; when = \"hours = 8\"; answer = \"6\"; } ); };\n";

static struct profile *profile;
static struct actor actor;
static struct sim_modbus slaves;
static struct sim_modbus_unit inner;
static struct noisy line;
static struct bus *bus;
static struct {
    int count;
    int address[40], size[40];
    uint16_t value[40]; // the last register
    int stuck;          // this address keeps what it has, though it acknowledges
} writes;

static int write_counted(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns)
{
    const int i = writes.count++;
    if (i < 40) {
        writes.address[i] = address;
        writes.size[i] = count;
        writes.value[i] = values[count - 1];
    }
    return address == writes.stuck ? 0 : inner.write(ctx, address, count, values, t_ns);
}

static void say(void *ctx, const char *message)
{
    (void)ctx;
    print_error("%s\n", message);
}

static struct session *begin(void)
{
    struct gon_error err;
    assert_int_equal(profile_parse(text, "u.cfg", (struct cfg_sink){say, NULL}, &profile), 0);
    if (actor_init(&actor, profile, CLK_S(1), &err) < 0)
        fail_msg("%s", err.text);
    memset(&writes, 0, sizeof writes);
    sim_modbus_init(&slaves, false, 0, MS(1));
    inner = actor_registers_unit(&actor, 5);
    struct sim_modbus_unit counted = inner;
    counted.write = write_counted;
    sim_modbus_add(&slaves, counted);
    noisy_init(&line, &slaves.port, 3, 0);
    struct clk *clk = vline_begin(&line.port);
    if (bus_open(vline.bus, 50, 100, clk, NULL, &bus, &err) < 0)
        fail_msg("%s", err.text);
    return session_on_bus(profile, bus, 5);
}

static void end(struct session *s)
{
    session_free(s);
    bus_close(bus);
    free(profile);
}

static void set(const char *assignments)
{
    assert_int_equal(actor_set(&actor, assignments, vline.clk.t_ns, NULL), 0);
}

static double now(const char *name)
{
    return actor.now.number[profile_value(profile, name)];
}

static int set_level(struct session *s, double level_v, struct gon_error *err)
{
    session_put(s, "level", level_v);
    return session_send(s, "set_level", NULL, err);
}

// --- asking --------------------------------------------------------------------------------------

static void values_come_as_numbers(void **state)
{
    (void)state;
    struct session *s = begin();
    set("mode = counting");
    assert_int_equal(session_ask(s, &profile->inputs.status, NULL), 0);
    assert_true(session_number(s, "level") == 1.25);
    assert_true(session_number(s, "count") == -5);
    assert_true(session_holds(s, "mode = counting"));
    assert_int_equal(bus_stats(bus)->requests, 1); // 2..12: 7 registers between
    end(s);
}

static void what_means_nothing_now_is_not_known(void **state)
{
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_ask(s, &profile->inputs.status, NULL), 0);
    assert_true(session_holds(s, "count unknown and mode = idle"));
    end(s);
}

static void an_unbelievable_answer_changes_nothing(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_ask(s, &profile->inputs.status, NULL), 0);
    set("level = 11, mode = counting");
    assert_int_equal(session_ask(s, &profile->inputs.status, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "unit 5: level: 11 V"));
    assert_int_equal(bus_stats(bus)->requests, 1 + 3); // asked again
    assert_true(session_number(s, "level") == 1.25);
    assert_true(session_holds(s, "mode = idle"));
    assert_int_equal(session_ask_once(s, &profile->inputs.status, &err), GON_E_LINK);
    assert_int_equal(bus_stats(bus)->requests, 1 + 3 + 1);
    end(s);
}

static void another_kind_is_refused_and_a_restart_noticed(void **state)
{
    char title[80];
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_identify(s, title, sizeof title, &err), 0);
    assert_false(session_restarted(s));
    set("hours = 0");
    assert_int_equal(session_ask_one(s, "hours", NULL), 0);
    assert_true(session_restarted(s));
    assert_false(session_restarted(s));
    set("kind = 4");
    assert_int_equal(session_identify(s, title, sizeof title, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "unit 5 is another kind"));
    assert_int_equal(writes.count, 0);
    end(s);
}

static void a_slow_unit_is_given_the_time_that_its_profile_says(void **state)
{
    (void)state;
    struct session *s = begin(); // on a bus that waits for 50 ms
    slaves.port.delay_ns = MS(110);
    assert_int_equal(session_ask_one(s, "level", NULL), 0);
    assert_int_equal(bus_stats(bus)->requests, 1);
    end(s);
}

static void a_name_that_is_not_there_is_said(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_ask_one(s, "nothing", &err), GON_E_INPUT);
    assert_int_equal(session_send(s, "nothing", NULL, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no write \"nothing\""));
    end(s);
}

// --- telling -------------------------------------------------------------------------------------

static void what_was_set_is_read_back(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(set_level(s, 2.5, &err), 0);
    assert_true(now("level") == 2.5);
    assert_true(session_number(s, "level") == 2.5);
    assert_int_equal(writes.count, 1);
    end(s);
}

static void another_value_read_back_is_a_refusal(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    writes.stuck = 2;
    assert_int_equal(set_level(s, 2.5, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "level was set to 2.5 V and reads back as 1.25"));
    assert_int_equal(session_meaning(s), PROFILE_REFUSED);
    writes.stuck = 12;
    assert_int_equal(session_send(s, "set_mode", NULL, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "\"mode = counting\" does not hold"));
    end(s);
}

static void a_lost_answer_is_made_up_for_by_the_read_back(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    slaves.port.drop = 1;
    assert_int_equal(set_level(s, 2.5, &err), 0);
    assert_int_equal(writes.count, 1); // and not sent again
    writes.stuck = 2;
    slaves.port.drop = 1;
    assert_int_equal(set_level(s, 3, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "may have been carried out"));
    end(s);
}

static void nothing_is_sent_beyond_the_range(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(set_level(s, 11, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "unit 5: set_level: level = 11 V; allowed: 0..10"));
    session_data(s)->known[profile_value(profile, "level")] = false;
    assert_int_equal(session_send(s, "set_level", NULL, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "level is not known"));
    assert_int_equal(bus_stats(bus)->requests, 0);
    end(s);
}

static void a_refusal_has_a_meaning(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    set("hours = 9");
    assert_int_equal(session_send(s, "set_mode", NULL, &err), GON_E_DEVICE);
    assert_int_equal(session_meaning(s), PROFILE_REFUSED);
    set("hours = 8");
    assert_int_equal(session_send(s, "set_mode", NULL, &err), GON_E_DEVICE); // for a second
    assert_int_equal(session_meaning(s), PROFILE_BUSY);
    set("hours = 7");
    assert_int_equal(session_send(s, "set_mode", NULL, &err), 0);
    assert_int_equal(session_meaning(s), PROFILE_FINE);
    end(s);
}

// --- bits that act on their edge -----------------------------------------------------------------

static void check_write(int i, int address, int size, uint16_t value)
{
    assert_true(writes.count > i);
    assert_int_equal(writes.address[i], address);
    assert_int_equal(writes.size[i], size);
    assert_int_equal(writes.value[i], value);
}

static void a_bit_is_set_and_taken_back(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_send(s, "let_go", NULL, &err), 0);
    assert_int_equal(session_send(s, "go", NULL, &err), 0);
    check_write(0, 21, 1, 0);
    check_write(1, 20, 2, 1);
    check_write(2, 21, 1, 0);
    assert_int_equal(writes.count, 3);
    assert_true(now("went") == 1);
    end(s);
}

static void the_first_edge_clears_what_others_left(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    set("input = 1");
    assert_int_equal(session_send(s, "go", NULL, &err), 0);
    assert_true(now("went") == 1); // without: no edge
    assert_int_equal(writes.count, 3);
    end(s);
}

static void an_edge_is_taken_back_also_when_it_failed(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_send(s, "let_go", NULL, &err), 0);
    slaves.port.drop = 1;
    assert_int_equal(session_send(s, "go", NULL, &err), GON_E_LINK); // once
    check_write(1, 20, 2, 1);
    check_write(2, 21, 1, 0);
    assert_int_equal(writes.count, 3);
    slaves.port.drop = 1;
    assert_int_equal(session_send(s, "stop", NULL, &err), 0); // may be repeated, and is
    check_write(5, 20, 2, 2);
    check_write(6, 21, 1, 0);
    assert_int_equal(writes.count, 7);
    end(s);
}

static void a_bit_left_set_is_cleared_before_the_next_write(void **state)
{
    struct gon_error err;
    (void)state;
    struct session *s = begin();
    assert_int_equal(session_send(s, "let_go", NULL, &err), 0);
    slaves.port.mute = true;
    assert_int_equal(session_send(s, "stop", NULL, &err), GON_E_LINK);
    slaves.port.mute = false;
    set("input = 2, went = 0"); // as if only the setting had arrived
    writes.count = 0;
    assert_int_equal(set_level(s, 2.5, &err), 0);
    check_write(0, 21, 1, 0);
    check_write(1, 2, 1, 250);
    writes.count = 0;
    assert_int_equal(set_level(s, 2.5, &err), 0);
    assert_int_equal(writes.count, 1);
    end(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_come_as_numbers),
        cmocka_unit_test(what_means_nothing_now_is_not_known),
        cmocka_unit_test(an_unbelievable_answer_changes_nothing),
        cmocka_unit_test(another_kind_is_refused_and_a_restart_noticed),
        cmocka_unit_test(a_slow_unit_is_given_the_time_that_its_profile_says),
        cmocka_unit_test(a_name_that_is_not_there_is_said),
        cmocka_unit_test(what_was_set_is_read_back),
        cmocka_unit_test(another_value_read_back_is_a_refusal),
        cmocka_unit_test(a_lost_answer_is_made_up_for_by_the_read_back),
        cmocka_unit_test(nothing_is_sent_beyond_the_range),
        cmocka_unit_test(a_refusal_has_a_meaning),
        cmocka_unit_test(a_bit_is_set_and_taken_back),
        cmocka_unit_test(the_first_edge_clears_what_others_left),
        cmocka_unit_test(an_edge_is_taken_back_also_when_it_failed),
        cmocka_unit_test(a_bit_left_set_is_cleared_before_the_next_write),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
