// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// Lasers by their profiles (the Cobolt has tests of its own): OBIS with its OK lines, Laser Quantum
// with its shutter, and one that gives a lease of its own.
#include "drivers/laser.h"

#include "tests/unit/profiled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static struct laser *open_it(const struct profile *p, const struct cancel *cancel)
{
    struct laser *l;
    struct gon_error err;
    profiled_begin(p);
    if (laser_by_profile(p, vline.link, profiled.clk, cancel, &l, &err) < 0)
        fail_msg("%s", err.text);
    return l;
}

static struct laser *begin(const char *profile)
{
    char text[120];
    struct gon_error err;
    struct laser *l = open_it(profiles_get(profile), NULL);
    if (l->ops->off(l, &err) < 0 || l->ops->identify(l, text, sizeof text, &err) < 0)
        fail_msg("%s", err.text);
    return l;
}

static struct laser_status look(struct laser *l)
{
    struct laser_status s;
    struct gon_error err;
    if (l->ops->status(l, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static void set_and_on(struct laser *l, double power_w)
{
    struct gon_error err;
    if (l->ops->set_power(l, power_w, &err) < 0 || l->ops->on(l, &err) < 0)
        fail_msg("%s", err.text);
}

static void they_say_who_they_are(void **state)
{
    char text[120];
    (void)state;
    struct laser *l = begin("coherent-obis");
    assert_int_equal(l->ops->identify(l, text, sizeof text, NULL), 0);
    assert_string_equal(text, "Coherent OBIS 1064LX, serial 12345678, firmware V2.0");
    l->ops->free(l);
    l = begin("laser-quantum");
    assert_int_equal(l->ops->identify(l, text, sizeof text, NULL), 0);
    assert_string_equal(text, "Laser Quantum, serial LQ1234, software 1.07, calibrated 01/02/2026");
    l->ops->free(l);
}

static void a_profile_of_something_else_is_refused(void **state)
{
    struct laser *l = NULL;
    struct gon_error err;
    (void)state;
    profiled_begin(profiles_get("thorlabs-sc10"));
    assert_int_equal(laser_by_profile(profiled.profile, vline.link, profiled.clk, NULL, &l, &err),
                     GON_E_INPUT);
    assert_non_null(strstr(err.text, "not of a laser"));
    assert_null(l);
}

static void they_warm_and_emit_and_go_off(void **state)
{
    static const char *const lasers[] = {"coherent-obis", "laser-quantum"};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        struct gon_error err;
        struct laser *l = begin(lasers[i]);
        struct laser_status s = look(l);
        assert_true(s.state == LASER_OFF && !s.emission && s.interlock_closed && s.power_w == 0);
        set_and_on(l, 0.1);
        s = look(l);
        assert_true(s.state == LASER_WARMING && s.emission);
        profiled_run(20);
        s = look(l);
        assert_true(s.state == LASER_EMITTING && s.emission);
        assert_true(fabs(s.power_w - 0.1) < 1e-9 && fabs(s.setpoint_w - 0.1) < 1e-9);
        const int64_t start_ns = vline.clk.t_ns;
        assert_int_equal(l->ops->off(l, &err), 0);
        assert_true(vline.clk.t_ns - start_ns < CLK_MS(360));
        s = look(l);
        assert_true(s.state == LASER_OFF && !s.emission);
        l->ops->free(l);
    }
}

static void power_is_set_read_back_and_bounded(void **state)
{
    static const char *const lasers[] = {"coherent-obis", "laser-quantum"};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        struct gon_error err;
        struct laser *l = begin(lasers[i]);
        assert_int_equal(l->ops->set_power(l, 0.25, &err), 0);
        assert_true(fabs(profiled_number("setpoint_w") - 0.25) < 1e-9);
        assert_int_equal(l->ops->set_power(l, 99, &err), GON_E_INPUT);
        assert_int_equal(l->ops->set_power(l, -1, &err), GON_E_INPUT);
        assert_int_equal(l->ops->set_power(l, (double)NAN, &err), GON_E_INPUT);
        assert_true(fabs(look(l).setpoint_w - 0.25) < 1e-9);
        l->ops->free(l);
    }
}

static void an_open_interlock_is_seen_and_refuses_on(void **state)
{
    static const struct {
        const char *laser, *open, *on_value;
    } rows[] = {{"coherent-obis", "status.open = 1", "emission"},
                {"coherent-obis", "interlock = OFF", "emission"},
                {"laser-quantum", "interlock = DISABLED", "enabled"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct gon_error err;
        struct laser *l = begin(rows[i].laser);
        profiled_do(rows[i].open);
        struct laser_status s = look(l);
        assert_true(s.state == LASER_INTERLOCK && !s.interlock_closed);
        assert_int_equal(l->ops->on(l, &err), GON_E_REFUSED);
        assert_non_null(strstr(err.text, "interlock is open"));
        assert_float_equal(profiled_number(rows[i].on_value), 0, 0);
        l->ops->free(l);
    }
}

// The words that were seen on real ones.
static void status_words_of_an_obis_are_understood(void **state)
{
    static const struct {
        const char *word;
        enum laser_state is;
    } rows[] = {
        {"status = 0xCE000100", LASER_NEEDS_KEY}, {"status = 0xCE000008", LASER_NEEDS_KEY},
        {"status = 0xC8001100", LASER_WARMING},   {"status = 0xC8001002", LASER_EMITTING},
        {"status = 0xC8001001", LASER_FAULT},     {"status = 0xCC000008", LASER_INTERLOCK},
        {"status = 0xC8001018", LASER_WARMING},
    };
    (void)state;
    struct laser *l = begin("coherent-obis");
    profiled_do("emission = ON");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct laser_status s;
        struct gon_error err;
        profiled_do(rows[i].word);
        if (l->ops->status(l, &s, &err) < 0)
            fail_msg("%s: %s", rows[i].word, err.text);
        assert_int_equal(s.state, rows[i].is);
    }
    l->ops->free(l);
}

static void faults_have_names_and_refuse_on(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("coherent-obis");
    profiled_do("status.fault = 1, fault = 0x100000");
    assert_int_equal(l->ops->on(l, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "fault 1048576 (too much power)"));
    assert_string_equal(l->ops->fault_text(l, 0), "none");
    assert_string_equal(l->ops->fault_text(l, 3), "not in the list of faults");
    l->ops->free(l);
}

static void an_obis_with_autostart_stays_off(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("coherent-obis");
    profiled_do("autostart = ON");
    assert_int_equal(l->ops->on(l, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "SYST:AUT OFF"));
    assert_float_equal(profiled_number("emission"), 0, 0);
    l->ops->free(l);
}

static void off_ends_an_on_that_waits(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("coherent-obis");
    set_and_on(l, 0.1);
    profiled_run(2); // within the 5 s
    assert_int_equal(l->ops->off(l, &err), 0);
    profiled_run(20);
    assert_false(look(l).emission);
    assert_float_equal(profiled_number("power_w"), 0, 0);
    l->ops->free(l);
}

// Answers without its OK line until that was asked for.
static void hear_without_ok(struct scripted *s, const char *text, int64_t t_ns)
{
    const char *answer = strstr(text, "STAT?") ? "OFF" : "";
    char line[64];
    if (strstr(text, "SYST:STAT?"))
        answer = "C8001008";
    if (strstr(text, "HAND ON"))
        s->step = 1;
    snprintf(line, sizeof line, "%s%s%s", answer, *answer ? "\r\n" : "", s->step ? "OK\r\n" : "");
    if (*text && *line)
        scripted_say(s, line, t_ns + CLK_MS(5));
}

static void off_switches_a_missing_handshake_on(void **state)
{
    struct scripted s;
    struct laser *l;
    struct gon_error err;
    (void)state;
    scripted_init(&s, "\r\n", hear_without_ok);
    struct clk *clk = vline_begin(&s.port);
    assert_int_equal(
        laser_by_profile(profiles_get("coherent-obis"), vline.link, clk, NULL, &l, &err), 0);
    if (l->ops->off(l, &err) < 0)
        fail_msg("%s", err.text);
    assert_int_equal(s.step, 1);
    l->ops->free(l);
}

static void the_shutter_is_opened_first_and_on_is_sent_once(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("laser-quantum");
    look(l);
    profiled.line.lose_nth = 6; // enabled, interlock, shutter, power; SHUTTER OPEN; ON
    assert_int_equal(l->ops->on(l, &err), GON_E_LINK);
    assert_float_equal(profiled_number("shutter"), 1, 0);
    assert_float_equal(profiled_number("enabled"), 1, 0);
    assert_int_equal(l->ops->off(l, &err), 0);
    assert_float_equal(profiled_number("enabled"), 0, 0);
    l->ops->free(l);
}

static void what_the_laser_refuses_is_told(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("laser-quantum");
    look(l);
    profiled_do("interlock = DISABLED");
    struct laser_status s = look(l);
    assert_int_equal(s.state, LASER_INTERLOCK);
    assert_int_equal(l->ops->on(l, &err), GON_E_REFUSED);
    l->ops->free(l);
}

// The link fails at random: off is confirmed only when the light is out, no state is wrong.
static void off_never_claims_what_is_not_so(void **state)
{
    static const char *const lasers[] = {"coherent-obis", "laser-quantum"};
    (void)state;
    for (size_t k = 0; k < 2; k++) {
        int confirmed = 0, lies = 0, read = 0, wrong = 0;
        struct gon_error err;
        const char *on = k == 0 ? "emission" : "enabled";
        struct laser *l = begin(lasers[k]);
        profiled.line.one_in = 5;
        profiled.line.only = 1u << NOISY_LOST | 1u << NOISY_LATE | 1u << NOISY_DOUBLED |
                             1u << NOISY_CUT | 1u << NOISY_SPLIT | 1u << NOISY_BEFORE;
        profiled.line.late_most_ns = CLK_MS(290);
        profiled.line.double_most_ns = CLK_MS(40);
        print_message("seed %llu\n", (unsigned long long)profiled.line.dice);
        for (int i = 0; i < 500; i++) {
            struct laser_status s;
            l->ops->on(l, &err);
            profiled_run(1);
            if (l->ops->status(l, &s, &err) == 0) {
                read++;
                wrong += s.emission != (profiled_number(on) > 0) || !s.interlock_closed;
            }
            if (l->ops->off(l, &err) == 0) {
                confirmed++;
                lies += profiled_number(on) > 0;
            }
        }
        print_message("%s, 500 rounds, %llu faults: %d states read, %d wrong; %d times off, %d "
                      "lies\n",
                      lasers[k], (unsigned long long)profiled.line.faults, read, wrong, confirmed,
                      lies);
        assert_true(confirmed > 400 && read > 400);
        assert_int_equal(lies, 0);
        assert_int_equal(wrong, 0);
        l->ops->free(l);
    }
}

// --- a lease of its own --------------------------------------------------------------------------

static const char leased[] =
    "profile: { name = \"leased\"; title = \"leased\"; role = \"laser\"; protocol = \"message\";\n"
    "  source = \"this test\"; };\n"
    "values: ( { name = \"on\"; type = \"int\"; max = 1; }, { name = \"left_s\"; } );\n"
    "framing: { end_out = \"\\r\"; end_in = \"\\r\"; gap_ms = 10; };\n"
    "exchanges: ( { name = \"is_on\"; send = \"on?\"; answer = \"{on}\"; },\n"
    "  { name = \"start\"; send = \"on\"; answer = \"OK\"; then = \"on = 1, left_s = 1\"; },\n"
    "  { name = \"alive\"; send = \"alive\"; answer = \"OK\"; then = \"left_s = 1\"; },\n"
    "  { name = \"stop\"; send = \"off\"; answer = \"OK\"; then = \"on = 0\"; } );\n"
    "identify: { asks = ( \"is_on\" ); title = \"leased\"; };\n"
    "laser: { status = ( \"is_on\" ); light = ( \"is_on\" ); emitting = \"on = 1\";\n"
    "  states = ( { when = \"on = 1\"; is = \"emitting\"; }, { is = \"off\"; } );\n"
    "  on = ( { send = \"start\"; } ); off = ( \"\\roff\" ); off_asks = ( \"is_on\" );\n"
    "  is_off = \"on = 0\"; keepalive: { send = \"alive\"; period_ms = 1000; }; };\n"
    "simulate: { drift = ( { value = \"left_s\"; to = \"0\"; rate = 1; then = \"on = 0\"; } ); "
    "};\n";

static void its_own_lease_is_renewed_in_time_and_not_more_often(void **state)
{
    struct gon_error err;
    struct profile *p = profiles_parse(leased);
    (void)state;
    struct laser *l = open_it(p, NULL);
    assert_int_equal(l->ops->on(l, &err), 0);
    const uint64_t before = profiled.actor.commands;
    for (int i = 0; i < 100; i++) { // 10 s, every 100 ms
        assert_int_equal(l->ops->keep_alive(l, &err), 0);
        profiled_run(0.1);
        assert_float_equal(profiled_number("on"), 1, 0);
    }
    assert_true(profiled.actor.commands - before >= 10 && profiled.actor.commands - before <= 20);
    profiled_run(2); // nobody renews it
    assert_float_equal(profiled_number("on"), 0, 0);
    l->ops->free(l);
    free(p);
}

static void without_a_lease_nothing_is_sent(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin("coherent-obis");
    const uint64_t before = profiled.actor.commands;
    assert_int_equal(l->ops->keep_alive(l, &err), 0);
    assert_int_equal(profiled.actor.commands, before);
    l->ops->free(l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(they_say_who_they_are),
        cmocka_unit_test(a_profile_of_something_else_is_refused),
        cmocka_unit_test(they_warm_and_emit_and_go_off),
        cmocka_unit_test(power_is_set_read_back_and_bounded),
        cmocka_unit_test(an_open_interlock_is_seen_and_refuses_on),
        cmocka_unit_test(status_words_of_an_obis_are_understood),
        cmocka_unit_test(faults_have_names_and_refuse_on),
        cmocka_unit_test(an_obis_with_autostart_stays_off),
        cmocka_unit_test(off_ends_an_on_that_waits),
        cmocka_unit_test(off_switches_a_missing_handshake_on),
        cmocka_unit_test(the_shutter_is_opened_first_and_on_is_sent_once),
        cmocka_unit_test(what_the_laser_refuses_is_told),
        cmocka_unit_test(off_never_claims_what_is_not_so),
        cmocka_unit_test(its_own_lease_is_renewed_in_time_and_not_more_often),
        cmocka_unit_test(without_a_lease_nothing_is_sent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
