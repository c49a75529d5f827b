// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
#include "daemon/safety.h"
#include "tests/unit/simbench.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static struct safety *begin(struct simbench *b)
{
    static const struct arm armed = {.live = true, .name = "anna", .expiry_ns = INT64_MAX};
    simbench_init(b, NULL);
    struct safety *s = safety_new(&b->laser, &b->clk.clk);
    assert_non_null(s);
    safety_arm(s, &armed);
    return s;
}

static void the_first_thing_a_laser_hears_is_off(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    char text[64];
    sim_laser_start(&b.world.laser, true); // it emits from an earlier life
    b.world.laser.state = SIM_LASER_COMPLETED;
    b.fail_at = 2; // whatever comes second fails
    b.fail_code = GON_E_LINK;
    assert_int_equal(safety_begin(s, text, sizeof text, NULL), GON_E_LINK);
    assert_int_equal(b.offs, 1);
    assert_false(sim_laser_emits(&b.world.laser));
    assert_int_equal(safety_begin(s, text, sizeof text, NULL), 0);
    assert_string_equal(text, "simulated laser");
    safety_free(s);
}

static void on_needs_a_running_campaign(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct gon_error err;
    assert_int_equal(safety_begin(s, NULL, 0, &err), 0);
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "no campaign is running"));
    assert_int_equal(b.ons, 0);
    safety_permit(s, true);
    assert_int_equal(safety_on(s, &err), 0);
    assert_true(safety_emission(s));
    assert_int_equal(b.ons, 1);
    safety_free(s);
    assert_false(sim_laser_emits(&b.world.laser));
}

static void on_needs_an_arm(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct arm arm = {0};
    struct gon_error err;
    assert_int_equal(safety_begin(s, NULL, 0, &err), 0);
    safety_permit(s, true);
    safety_arm(s, NULL);
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_string_equal(err.text, "stays off: not armed; gonio laser arm --for 8h");
    safety_arm(s, &arm);
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_int_equal(arm_set(&arm, "anna", NULL, 60, b.clk.t_ns, 0, NULL), 0);
    clk_sleep(&b.clk.clk, CLK_S(60), NULL); // and nobody stepped it
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_int_equal(b.ons, 0);
    assert_int_equal(arm_set(&arm, "anna", NULL, 60, b.clk.t_ns, 0, NULL), 0);
    assert_int_equal(safety_on(s, &err), 0);
    assert_int_equal(b.ons, 1);
    // an arm alone is not enough
    assert_int_equal(safety_off(s, &err), 0);
    safety_permit(s, false);
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_int_equal(b.ons, 1);
    safety_free(s);
}

static void an_arm_that_ends_in_the_light_makes_off_due_and_stands_until_the_run_paused(void **state)
{
    (void)state;
    for (int by_hand = 0; by_hand < 2; by_hand++) {
        struct simbench b;
        struct safety *s = begin(&b);
        struct arm arm = {0};
        struct gon_error err;
        assert_int_equal(safety_begin(s, NULL, 0, &err), 0);
        safety_permit(s, true);
        safety_arm(s, &arm);
        assert_int_equal(arm_set(&arm, "anna", NULL, 60, b.clk.t_ns, 0, NULL), 0);
        assert_int_equal(safety_on(s, &err), 0);
        assert_false(safety_tick(s));
        assert_int_equal(safety_alarm(s, &err), 0);
        if (by_hand)
            arm_end(&arm, "disarmed by bert");
        else
            clk_sleep(&b.clk.clk, CLK_S(60), NULL);
        assert_true(safety_tick(s));
        assert_false(safety_tick(s)); // once
        assert_int_equal(safety_alarm(s, &err), GON_E_REFUSED);
        assert_non_null(strstr(err.text, by_hand ? "the arm of anna ended: disarmed by bert"
                                                 : "the arm of anna ended: it ran out"));
        assert_int_equal(safety_off(s, &err), 0);
        // a new arm alone is not light: the run learns of it first
        assert_int_equal(arm_set(&arm, "anna", NULL, 60, b.clk.t_ns, 0, NULL), 0);
        assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
        safety_permit(s, false);
        safety_permit(s, true);
        assert_int_equal(safety_on(s, &err), 0);
        safety_free(s);
    }
}

static void on_needs_a_closed_interlock(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct gon_error err;
    safety_permit(s, true);
    sim_laser_set_interlock(&b.world.laser, false);
    assert_int_equal(safety_begin(s, NULL, 0, &err), 0);
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "interlock"));
    assert_int_equal(b.ons, 0);
    safety_free(s);
}

static void an_on_whose_answer_is_lost_is_followed_by_off_and_never_repeated(void **state)
{
    (void)state;
    for (int carried_out = 0; carried_out < 2; carried_out++) {
        struct simbench b;
        struct safety *s = begin(&b);
        safety_permit(s, true);
        assert_int_equal(safety_begin(s, NULL, 0, NULL), 0);
        const int offs = b.offs;
        b.calls = carried_out ? 1 : 2; // status, then on: odd calls are carried out
        b.fail_at = b.calls + 2;
        b.fail_code = GON_E_LINK;
        assert_int_equal(safety_on(s, NULL), GON_E_LINK);
        assert_int_equal(b.ons, carried_out);
        assert_true(b.offs > offs);
        assert_false(safety_emission(s));
        assert_false(sim_laser_emits(&b.world.laser));
        safety_free(s);
    }
}

static void an_off_that_does_nothing_is_said_aloud_and_blocks_on(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct gon_error err;
    safety_permit(s, true);
    assert_int_equal(safety_begin(s, NULL, 0, &err), 0);
    assert_int_equal(safety_on(s, &err), 0);
    clk_sleep(&b.clk.clk, CLK_S(60), NULL);
    world_see(&b.world, b.clk.t_ns);
    b.world.laser.ignores_off = true;
    const int64_t start_ns = b.clk.t_ns;
    assert_int_equal(safety_off(s, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "LASER MAY BE ON"));
    assert_true(b.clk.t_ns - start_ns <= CLK_S(SAFETY_OFF_S + 0.2));
    assert_true(b.offs > 10);
    assert_true(safety_emission(s) && safety_pending(s));
    assert_int_equal(safety_on(s, &err), GON_E_REFUSED);
    b.world.laser.ignores_off = false;
    assert_int_equal(safety_off(s, &err), 0);
    assert_false(safety_emission(s) || safety_pending(s));
    assert_int_equal(safety_on(s, &err), 0);
    safety_free(s);
}

static void a_laser_that_is_gone_stays_pending_until_it_is_back_and_off(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    safety_permit(s, true);
    assert_int_equal(safety_begin(s, NULL, 0, NULL), 0);
    assert_int_equal(safety_on(s, NULL), 0);
    b.gone_until_ns[SIMBENCH_LASER] = b.clk.t_ns + CLK_S(10);
    assert_int_equal(safety_off(s, NULL), GON_E_GONE);
    assert_true(safety_emission(s) && safety_pending(s));
    assert_int_equal(safety_reopen(s, NULL, 0, NULL), GON_E_GONE);
    clk_sleep(&b.clk.clk, CLK_S(11), NULL);
    assert_int_equal(safety_reopen(s, NULL, 0, NULL), 0);
    assert_false(safety_emission(s) || safety_pending(s));
    safety_free(s);
}

static void a_stop_is_due_once_and_not_within_a_call(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct cancel *stop = cancel_new();
    safety_permit(s, true);
    assert_int_equal(safety_begin(s, NULL, 0, NULL), 0);
    safety_obey(s, stop);
    cancel_request(stop);
    assert_false(safety_tick(s)); // no light: nothing is due
    cancel_reset(stop);
    assert_int_equal(safety_on(s, NULL), 0);
    assert_false(safety_tick(s));
    cancel_request(stop);
    assert_true(safety_tick(s));
    assert_false(safety_tick(s)); // repeating it is the caller's
    safety_obey(s, stop);
    assert_true(safety_tick(s));
    assert_int_equal(safety_off(s, NULL), 0);
    safety_obey(s, stop);
    assert_false(safety_tick(s));
    safety_free(s);
    cancel_free(stop);
}

static void the_longest_silence_while_on_is_known(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    safety_permit(s, true);
    assert_int_equal(safety_begin(s, NULL, 0, NULL), 0);
    clk_sleep(&b.clk.clk, CLK_S(10), NULL);
    safety_tick(s);
    assert_true(safety_worst_gap_ns(s) == 0); // off: no lease
    assert_int_equal(safety_on(s, NULL), 0);
    clk_sleep(&b.clk.clk, CLK_MS(70), NULL);
    safety_tick(s);
    clk_sleep(&b.clk.clk, CLK_MS(30), NULL);
    safety_tick(s);
    assert_true(safety_worst_gap_ns(s) == CLK_MS(70));
    safety_free(s);
}

// A laser that goes off by itself when nobody renews its lease.
static int renewed;

static int renew(struct laser *l, struct gon_error *err)
{
    (void)l;
    (void)err;
    renewed++;
    return 0;
}

static void the_lasers_own_lease_is_renewed_while_it_may_emit_and_never_else(void **state)
{
    (void)state;
    struct simbench b;
    struct safety *s = begin(&b);
    struct laser_ops ops = *b.laser.ops;
    struct cancel *stop = cancel_new();
    ops.keep_alive = renew;
    b.laser.ops = &ops;
    renewed = 0;
    safety_obey(s, stop);
    assert_int_equal(safety_begin(s, NULL, 0, NULL), 0);
    safety_permit(s, true);
    safety_tick(s);
    assert_int_equal(renewed, 0); // it is off
    assert_int_equal(safety_on(s, NULL), 0);
    safety_tick(s);
    safety_tick(s);
    assert_int_equal(renewed, 2);
    cancel_request(stop);
    safety_tick(s);
    assert_int_equal(renewed, 2); // it shall go off
    safety_obey(s, NULL);
    b.world.laser.state = SIM_LASER_COMPLETED;
    b.world.laser.ignores_off = true;
    assert_int_equal(safety_off(s, NULL), GON_E_DEVICE);
    safety_tick(s);
    assert_int_equal(renewed, 2); // and most of all now
    b.world.laser.ignores_off = false;
    safety_free(s);
    cancel_free(stop);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_thing_a_laser_hears_is_off),
        cmocka_unit_test(on_needs_a_running_campaign),
        cmocka_unit_test(on_needs_an_arm),
        cmocka_unit_test(an_arm_that_ends_in_the_light_makes_off_due_and_stands_until_the_run_paused),
        cmocka_unit_test(on_needs_a_closed_interlock),
        cmocka_unit_test(an_on_whose_answer_is_lost_is_followed_by_off_and_never_repeated),
        cmocka_unit_test(an_off_that_does_nothing_is_said_aloud_and_blocks_on),
        cmocka_unit_test(a_laser_that_is_gone_stays_pending_until_it_is_back_and_off),
        cmocka_unit_test(a_stop_is_due_once_and_not_within_a_call),
        cmocka_unit_test(the_longest_silence_while_on_is_known),
        cmocka_unit_test(the_lasers_own_lease_is_renewed_while_it_may_emit_and_never_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
