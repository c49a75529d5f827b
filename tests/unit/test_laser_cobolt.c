// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// The profile of a Cobolt laser against the simulated laser, in virtual time.
#include "drivers/laser.h"

#include "drivers/by_profile.h"
#include "drivers/link_stats.h"
#include "sim/bench.h"
#include "tests/unit/noisy.h"
#include "tests/unit/profiles.h"
#include "tests/unit/vline.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

static struct bench bench;
static struct noisy line;
static struct sim_laser *lamp;

static struct laser *open_on(struct port *port, const struct cancel *cancel)
{
    struct laser *l;
    struct gon_error err;
    struct clk *clk = vline_begin(port);
    if (laser_by_profile(profiles_get("cobolt-05"), vline.link, clk, cancel, &l, &err) < 0)
        fail_msg("%s", err.text);
    return l;
}

static struct laser *begin(const struct cancel *cancel)
{
    struct bench_spec spec;
    bench_defaults(&spec);
    spec.world.laser.temperatures_s = 5;
    spec.world.laser.warmup_s = 20;
    bench_init(&bench, &spec, CLK_S(1));
    lamp = &bench.world.laser;
    noisy_init(&line, bench_port(&bench, BENCH_LASER), 5, 0);
    return open_on(&line.port, cancel);
}

static void run_for(double s)
{
    clk_sleep(&vline.clk.clk, CLK_S(s), NULL);
    world_see(&bench.world, vline.clk.t_ns);
}

static struct laser_status look(struct laser *l)
{
    struct laser_status s;
    struct gon_error err;
    if (l->ops->status(l, &s, &err) < 0)
        fail_msg("%s", err.text);
    return s;
}

static void switch_on(struct laser *l)
{
    struct gon_error err;
    if (l->ops->set_power(l, 0.05, &err) < 0 || l->ops->on(l, &err) < 0)
        fail_msg("%s", err.text);
    run_for(60);
}

static void opening_sends_nothing(void **state)
{
    (void)state;
    struct laser *l = begin(NULL);
    assert_int_equal(bench_port(&bench, BENCH_LASER)->frames_in, 0);
    l->ops->free(l);
}

static void it_says_who_it_is(void **state)
{
    char text[120];
    (void)state;
    struct laser *l = begin(NULL);
    assert_int_equal(l->ops->identify(l, text, sizeof text, NULL), 0);
    assert_string_equal(text, "Cobolt 1064-05-01-0100-SIM, serial 12345, firmware 7.104");
    l->ops->free(l);
}

static void hear_06(struct scripted *s, const char *text, int64_t t_ns)
{
    scripted_say(s, strcmp(text, "glm?") == 0 ? "0638-06-01-0180\r\n" : "1234\r\n", t_ns + MS(2));
}

static void hear_stranger(struct scripted *s, const char *text, int64_t t_ns)
{
    (void)text;
    scripted_say(s, "Syntax error: illegal command\r\n", t_ns + MS(2));
}

static void another_laser_is_refused(void **state)
{
    struct scripted s;
    struct gon_error err;
    char text[120];
    (void)state;
    scripted_init(&s, "\r", hear_06);
    struct laser *l = open_on(&s.port, NULL);
    assert_int_equal(l->ops->identify(l, text, sizeof text, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "06 series"));
    l->ops->free(l);
    scripted_init(&s, "\r", hear_stranger);
    l = open_on(&s.port, NULL);
    assert_int_equal(l->ops->identify(l, text, sizeof text, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "is it a Cobolt 05-01 laser?"));
    l->ops->free(l);
}

static void power_is_set_and_read_back(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    assert_int_equal(l->ops->set_power(l, 0.0375, &err), 0);
    assert_true(fabs(lamp->setpoint_w - 0.0375) < 1e-9);
    assert_true(fabs(look(l).setpoint_w - 0.0375) < 1e-9);
    assert_int_equal(l->ops->set_power(l, 90, &err), GON_E_DEVICE); // it says Error
    assert_int_equal(l->ops->stats(l)->errors[LINK_REFUSED], 1);
    assert_int_equal(l->ops->set_power(l, -1, &err), GON_E_INPUT);
    assert_int_equal(l->ops->set_power(l, 101, &err), GON_E_INPUT);
    assert_int_equal(l->ops->set_power(l, (double)NAN, &err), GON_E_INPUT);
    assert_true(fabs(look(l).setpoint_w - 0.0375) < 1e-9);
    l->ops->free(l);
}

static void it_warms_and_emits_and_goes_off(void **state)
{
    struct gon_error err;
    (void)state;
    for (int autostart = 0; autostart < 2; autostart++) {
        struct laser *l = begin(NULL);
        lamp->autostart = autostart;
        struct laser_status s = look(l);
        assert_true(s.state == LASER_OFF && !s.emission && s.interlock_closed && s.power_w == 0);
        assert_int_equal(l->ops->set_power(l, 0.05, &err), 0);
        if (l->ops->on(l, &err) < 0)
            fail_msg("%s", err.text);
        assert_int_equal(look(l).state, LASER_WARMING);
        run_for(60);
        s = look(l);
        assert_true(s.state == LASER_EMITTING && s.emission);
        assert_true(fabs(s.power_w - 0.05) < 0.005);
        assert_int_equal(l->ops->off(l, &err), 0);
        assert_false(sim_laser_emits(lamp));
        s = look(l);
        assert_true(s.state == LASER_OFF && !s.emission);
        assert_int_equal(lamp->autostart, autostart); // its settings are its owner's
        l->ops->free(l);
    }
}

static void commands_are_never_too_early_but_for_off(void **state)
{
    struct gon_error err;
    char text[120];
    bool emits;
    (void)state;
    struct laser *l = begin(NULL);
    assert_int_equal(l->ops->identify(l, text, sizeof text, &err), 0);
    switch_on(l);
    for (int i = 0; i < 5; i++) {
        look(l);
        assert_int_equal(l->ops->emission(l, &emits, &err), 0);
        assert_true(emits);
    }
    assert_int_equal(bench.laser.too_early, 0);
    l->ops->free(l);
}

static void off_is_sent_at_once_and_again_after_the_gap(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    switch_on(l);
    run_for(1);
    int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(l->ops->off(l, &err), 0);
    assert_int_equal(lamp->last_off_ns >= start_ns, 1);
    assert_true(lamp->emission_since_ns == start_ns); // light went out with the first byte's time
    assert_true(vline.clk.t_ns - start_ns < MS(360));

    switch_on(l);
    look(l); // ends with a command a moment ago: the laser ignores what comes now
    start_ns = vline.clk.t_ns;
    assert_int_equal(l->ops->off(l, &err), 0);
    assert_true(bench.laser.too_early >= 1);
    assert_true(lamp->emission_since_ns - start_ns <= MS(121));
    assert_false(sim_laser_emits(lamp));
    l->ops->free(l);
}

static void off_is_not_swallowed_by_half_a_command(void **state)
{
    (void)state;
    struct laser *l = begin(NULL);
    switch_on(l);
    run_for(1);
    port_feed(bench_port(&bench, BENCH_LASER), (const uint8_t *)"p 0.0", 5, vline.clk.t_ns);
    assert_int_equal(l->ops->off(l, NULL), 0);
    assert_false(sim_laser_emits(lamp));
    l->ops->free(l);
}

// Before it emits it cannot be seen to be on; the sequence must not go on after off.
static void off_ends_a_start_that_is_under_way(void **state)
{
    struct gon_error err;
    (void)state;
    for (int autostart = 0; autostart < 2; autostart++) {
        struct laser *l = begin(NULL);
        lamp->autostart = autostart;
        assert_int_equal(l->ops->on(l, &err), 0);
        assert_int_equal(lamp->state, SIM_LASER_TEMPERATURES);
        assert_int_equal(l->ops->off(l, &err), 0); // right behind it, too early for the laser
        run_for(60);
        assert_false(sim_laser_emits(lamp));
        assert_int_equal(look(l).state, LASER_OFF);
        l->ops->free(l);
    }
}

// A laser that says that it does not emit, but whose sequence only "@cob0" ends; or nothing does.
static char heard[8][16];
static bool stubborn;

static void hear_sequence(struct scripted *s, const char *text, int64_t t_ns)
{
    if (s->heard <= 8)
        snprintf(heard[s->heard - 1], sizeof heard[0], "%s", text);
    if (strcmp(text, "@cob0") == 0 && !stubborn)
        s->step = 1;
    if (strcmp(text, "l?") == 0)
        scripted_say(s, "0\r\n", t_ns + MS(2));
    else if (strcmp(text, "gom?") == 0)
        scripted_say(s, s->step ? "0\r\n" : "1\r\n", t_ns + MS(2));
    else if (*text)
        scripted_say(s, "OK\r\n", t_ns + MS(2));
}

static void off_is_not_confirmed_while_a_start_goes_on(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    stubborn = false;
    scripted_init(&s, "\r", hear_sequence);
    struct laser *l = open_on(&s.port, NULL);
    assert_int_equal(l->ops->off(l, &err), 0);
    assert_int_equal(s.step, 1);
    assert_string_equal(heard[0], ""); // ends what was half-sent
    assert_string_equal(heard[1], "l0");
    stubborn = true;
    s.step = 0;
    assert_int_equal(l->ops->off(l, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "LASER MAY BE ON"));
    l->ops->free(l);
}

static void a_laser_that_ignores_off_is_an_alarm(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    switch_on(l);
    lamp->ignores_off = true;
    const uint64_t before = lamp->offs;
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(l->ops->off(l, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "LASER MAY BE ON"));
    assert_non_null(strstr(err.text, "key or the interlock"));
    assert_true(lamp->offs - before >= 5);
    assert_true(vline.clk.t_ns - start_ns < CLK_S(3));
    lamp->ignores_off = false;
    assert_int_equal(l->ops->off(l, &err), 0);
    l->ops->free(l);
}

static void off_is_confirmed_only_by_the_laser_itself(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    switch_on(l);
    bench_port(&bench, BENCH_LASER)->mute = true;
    assert_int_equal(l->ops->off(l, &err), GON_E_LINK); // it went off, but nobody said so
    assert_false(sim_laser_emits(lamp));
    bench_port(&bench, BENCH_LASER)->mute = false;
    assert_int_equal(l->ops->off(l, &err), 0);
    l->ops->free(l);
}

static void off_does_not_mind_being_cancelled(void **state)
{
    struct gon_error err;
    struct laser_status s;
    struct cancel *cancel = cancel_new();
    (void)state;
    struct laser *l = begin(cancel);
    switch_on(l);
    cancel_request(cancel);
    assert_int_equal(l->ops->status(l, &s, &err), GON_E_CANCELED);
    assert_int_equal(l->ops->off(l, &err), 0);
    assert_false(sim_laser_emits(lamp));
    l->ops->free(l);
    cancel_free(cancel);
}

static void an_open_interlock_is_seen_and_refuses_on(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    sim_laser_set_interlock(lamp, false);
    struct laser_status s = look(l);
    assert_true(s.state == LASER_INTERLOCK && !s.interlock_closed);
    const uint64_t before = lamp->ons;
    assert_int_equal(l->ops->on(l, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "interlock is open"));
    assert_int_equal(lamp->ons, before); // not even asked

    // It latched the fault while it was off: closed again, it may start.
    sim_laser_set_interlock(lamp, true);
    s = look(l);
    assert_true(s.state == LASER_OFF && s.fault_code == 3);
    switch_on(l);
    assert_true(sim_laser_emits(lamp));

    sim_laser_set_interlock(lamp, false);
    s = look(l);
    assert_true(s.state == LASER_INTERLOCK && !s.emission && !s.interlock_closed);
    assert_int_equal(l->ops->off(l, &err), 0);

    // Opened while it was on: the operator must turn the key.
    sim_laser_set_interlock(lamp, true);
    assert_int_equal(look(l).state, LASER_NEEDS_KEY);
    const uint64_t ons = lamp->ons;
    assert_int_equal(l->ops->on(l, &err), GON_E_REFUSED);
    assert_int_equal(lamp->ons, ons);
    sim_laser_set_key(lamp, false);
    sim_laser_set_key(lamp, true);
    assert_int_equal(look(l).state, LASER_OFF);
    switch_on(l);
    assert_true(sim_laser_emits(lamp));
    l->ops->free(l);
}

static void a_key_that_must_be_turned_is_named(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    lamp->autostart = false;
    sim_laser_set_key(lamp, false);
    assert_int_equal(l->ops->on(l, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "key switch"));
    lamp->autostart = true; // then it accepts and waits for the key
    assert_int_equal(l->ops->on(l, &err), 0);
    run_for(10);
    assert_int_equal(look(l).state, LASER_NEEDS_KEY);
    l->ops->free(l);
}

static void a_fault_has_its_code_and_refuses_on(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    lamp->state = SIM_LASER_FAULT;
    lamp->fault = 1;
    struct laser_status s = look(l);
    assert_true(s.state == LASER_FAULT && s.fault_code == 1);
    assert_int_equal(l->ops->on(l, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "fault 1 (temperature)"));
    assert_string_equal(l->ops->fault_text(l, 4), "constant power not reached in time");
    l->ops->free(l);
}

static void on_is_sent_once_even_when_its_answer_is_lost(void **state)
{
    struct gon_error err;
    (void)state;
    struct laser *l = begin(NULL);
    look(l); // with the set-point, which is asked only once
    const uint64_t before = lamp->ons;
    line.lose_nth = 7; // after five answers of a status and one of @cobas?
    int rc = l->ops->on(l, &err);
    assert_int_equal(rc, GON_E_LINK);
    assert_int_equal(lamp->ons, before + 1);
    assert_int_equal(l->ops->off(l, &err), 0);
    l->ops->free(l);
}

static void an_echo_is_named(void **state)
{
    struct gon_error err;
    struct laser_status s;
    (void)state;
    struct laser *l = begin(NULL);
    bench.laser.echo = true;
    assert_int_equal(l->ops->status(l, &s, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "turn its echo off"));
    l->ops->free(l);
}

// The link fails at random, but never lies: off is confirmed only when the light is out.
static void off_never_claims_what_is_not_so(void **state)
{
    int confirmed = 0, lies = 0, wrong = 0, read = 0;
    struct gon_error err;
    char text[120];
    (void)state;
    struct laser *l = begin(NULL);
    lamp->spec.temperatures_s = 0;
    lamp->spec.warmup_s = 0.1;
    assert_int_equal(l->ops->identify(l, text, sizeof text, &err), 0);
    line.one_in = 4;
    line.only = 1u << NOISY_LOST | 1u << NOISY_LATE | 1u << NOISY_DOUBLED | 1u << NOISY_CUT |
                1u << NOISY_SPLIT | 1u << NOISY_BEFORE;
    line.late_most_ns = MS(340);
    line.double_most_ns = MS(90);
    for (int i = 0; i < 500; i++) {
        struct laser_status s;
        l->ops->on(l, &err);
        run_for(1);
        if (l->ops->status(l, &s, &err) == 0) {
            read++;
            wrong += s.emission != sim_laser_emits(lamp) || !s.interlock_closed;
        }
        lamp->ignores_off = i % 3 == 0;
        if (l->ops->off(l, &err) == 0) {
            confirmed++;
            lies += sim_laser_emits(lamp);
        }
        lamp->ignores_off = false;
    }
    print_message("500 rounds, %llu faults: %d states read, %d wrong; %d times off, %d lies\n",
                  (unsigned long long)line.faults, read, wrong, confirmed, lies);
    assert_true(confirmed > 200 && read > 200);
    assert_int_equal(lies, 0);
    assert_int_equal(wrong, 0);
    l->ops->free(l);
}

static void states_have_names(void **state)
{
    (void)state;
    assert_string_equal(laser_state_name(LASER_OFF), "off");
    assert_string_equal(laser_state_name(LASER_NEEDS_KEY), "needs its key");
    for (int s = LASER_OFF; s <= LASER_FAULT; s++)
        assert_string_not_equal(laser_state_name((enum laser_state)s), "unknown");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opening_sends_nothing),
        cmocka_unit_test(it_says_who_it_is),
        cmocka_unit_test(another_laser_is_refused),
        cmocka_unit_test(power_is_set_and_read_back),
        cmocka_unit_test(it_warms_and_emits_and_goes_off),
        cmocka_unit_test(commands_are_never_too_early_but_for_off),
        cmocka_unit_test(off_is_sent_at_once_and_again_after_the_gap),
        cmocka_unit_test(off_is_not_swallowed_by_half_a_command),
        cmocka_unit_test(off_ends_a_start_that_is_under_way),
        cmocka_unit_test(off_is_not_confirmed_while_a_start_goes_on),
        cmocka_unit_test(a_laser_that_ignores_off_is_an_alarm),
        cmocka_unit_test(off_is_confirmed_only_by_the_laser_itself),
        cmocka_unit_test(off_does_not_mind_being_cancelled),
        cmocka_unit_test(an_open_interlock_is_seen_and_refuses_on),
        cmocka_unit_test(a_key_that_must_be_turned_is_named),
        cmocka_unit_test(a_fault_has_its_code_and_refuses_on),
        cmocka_unit_test(on_is_sent_once_even_when_its_answer_is_lost),
        cmocka_unit_test(an_echo_is_named),
        cmocka_unit_test(off_never_claims_what_is_not_so),
        cmocka_unit_test(states_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
