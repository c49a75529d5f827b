// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// Shutter, filter wheel and chopper by their profiles, against the instruments that the same
// profiles simulate, and on bad lines.
#include "drivers/selector.h"

#include "tests/unit/profiled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static struct selector *open_it(const char *profile)
{
    struct selector *z;
    struct gon_error err;
    profiled_begin(profiles_get(profile));
    if (selector_by_profile(profiled.profile, vline.link, profiled.clk, NULL, &z, &err) < 0)
        fail_msg("%s", err.text);
    return z;
}

static struct selector *begin(const char *profile)
{
    char text[120];
    struct gon_error err;
    struct selector *z = open_it(profile);
    if (z->ops->identify(z, text, sizeof text, &err) < 0)
        fail_msg("%s", err.text);
    return z;
}

static int where(struct selector *z)
{
    int position = 42;
    struct gon_error err;
    if (z->ops->where(z, &position, NULL, &err) < 0)
        fail_msg("%s", err.text);
    return position;
}

static void it_says_who_it_is(void **state)
{
    static const struct {
        const char *profile, *says;
    } rows[] = {
        {"thorlabs-sc10", "THORLABS SC10 VERSION 1.07"},
        {"thorlabs-mc2000b", "THORLABS MC2000B, 400 Hz"},
        {"thorlabs-fw102c", "THORLABS FW102C/FW212C Filter Wheel version 1.04, 6 positions"}};
    char text[120];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct selector *z = open_it(rows[i].profile);
        assert_int_equal(profiled.device.port.frames_in, 0); // opening sends nothing
        assert_int_equal(z->ops->identify(z, text, sizeof text, NULL), 0);
        assert_string_equal(text, rows[i].says);
        z->ops->free(z);
    }
}

static void another_one_is_refused(void **state)
{
    char text[120];
    struct gon_error err;
    (void)state;
    struct selector *z = open_it("thorlabs-fw102c");
    profiled_do("count = 12");
    assert_int_equal(z->ops->identify(z, text, sizeof text, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "another number of positions"));
    z->ops->free(z);
}

static void positions_have_names(void **state)
{
    (void)state;
    struct selector *z = begin("thorlabs-sc10");
    assert_int_equal(z->ops->positions(z), 2);
    assert_int_equal(selector_find(z, "open"), 0);
    assert_int_equal(selector_find(z, "closed"), 1);
    assert_int_equal(selector_find(z, "ajar"), SELECTOR_ELSEWHERE);
    assert_int_equal(z->ops->safe(z), 1);
    z->ops->free(z);
    z = begin("thorlabs-fw102c");
    assert_int_equal(z->ops->positions(z), 6);
    assert_int_equal(z->ops->safe(z), SELECTOR_ELSEWHERE);
    assert_float_equal(profiled_number("sensors"), 0, 0); // infrared light off: the setup
    z->ops->free(z);
}

static void where_it_is_already_it_is_told_nothing(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-sc10");
    const int closed = selector_find(z, "closed"), open = selector_find(z, "open");
    const uint64_t before = profiled.device.port.frames_in;
    assert_int_equal(z->ops->go(z, closed, &err), 0);
    assert_int_equal(profiled.device.port.frames_in - before, 2); // ens? closed?
    assert_int_equal(z->ops->go(z, open, &err), 0);
    assert_int_equal(where(z), open);
    assert_int_equal(z->ops->go(z, open, &err), 0); // a second "ens" would close it
    assert_float_equal(profiled_number("closed"), 0, 0);
    assert_int_equal(z->ops->go(z, closed, &err), 0);
    assert_float_equal(profiled_number("closed"), 1, 0);
    z->ops->free(z);
}

static void every_position_is_reached(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-fw102c");
    for (int i = 5; i >= 0; i--) {
        assert_int_equal(z->ops->go(z, i, &err), 0);
        assert_int_equal(where(z), i);
        assert_float_equal(profiled_number("position"), i + 1, 0);
    }
    z->ops->free(z);
}

static void it_is_waited_for(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-mc2000b");
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(z->ops->go(z, selector_find(z, "running"), &err), 0); // locks after 2 s
    assert_true(vline.clk.t_ns - start_ns >= CLK_S(2) && vline.clk.t_ns - start_ns < CLK_S(2.2));
    vline_turn();
    assert_true(vline.longest_ns <= CLK_MS(51)); // others had their turn
    assert_int_equal(z->ops->go(z, selector_find(z, "stopped"), &err), 0);
    assert_float_equal(profiled_number("enabled"), 0, 0);
    z->ops->free(z);
}

static void a_stuck_shutter_is_told_once_and_is_an_error(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-sc10");
    profiled_do("interlock = 1"); // the blades stay closed
    assert_int_equal(z->ops->go(z, selector_find(z, "open"), &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "does not go to 'open' in 1 s"));
    assert_float_equal(profiled_number("enabled"), 1, 0);
    // Neither open nor closed: to change over could do either, so nothing is said.
    const uint64_t before = profiled.actor.commands;
    assert_int_equal(z->ops->go(z, selector_find(z, "open"), &err), GON_E_DEVICE);
    assert_float_equal(profiled_number("enabled"), 1, 0);
    assert_true(profiled.actor.commands > before);
    z->ops->free(z);
}

static void one_that_takes_too_long_is_not_told_again(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-mc2000b");
    profiled_do("frequency_hz = 20000"); // 100 s until it is locked
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(z->ops->go(z, selector_find(z, "running"), &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "'running' in 20 s, it is at none of its positions"));
    assert_true(vline.clk.t_ns - start_ns < CLK_S(21));
    z->ops->free(z);
}

// The answer to "ens" is lost, with or without the command itself.
static void a_lost_answer_is_no_reason_to_change_over_again(void **state)
{
    struct gon_error err;
    (void)state;
    struct selector *z = begin("thorlabs-sc10");
    profiled.line.lose_nth = 3; // after ens? and closed?
    assert_int_equal(z->ops->go(z, selector_find(z, "open"), &err), 0);
    assert_float_equal(profiled_number("enabled"), 1, 0);
    assert_float_equal(profiled_number("closed"), 0, 0);
    z->ops->free(z);
}

// The command is lost: only then, and only once it was looked at, it is told again.
static void swallow(struct scripted *s, const char *text, int64_t t_ns)
{
    static const char *const answers[] = {"ens?\r0\r> ", "ens?\r1\r> "};
    if (strcmp(text, "ens") == 0) {
        if (++s->step == 1)
            return;
        scripted_say(s, "ens\r> ", t_ns + CLK_MS(5));
    } else if (strcmp(text, "ens?") == 0)
        scripted_say(s, answers[s->step >= 2], t_ns + CLK_MS(5));
    else if (strcmp(text, "closed?") == 0)
        scripted_say(s, s->step >= 2 ? "closed?\r0\r> " : "closed?\r1\r> ", t_ns + CLK_MS(5));
    else
        scripted_say(s, "id?\rSC10\r> ", t_ns + CLK_MS(5));
}

static void a_lost_command_is_told_again_after_a_look(void **state)
{
    struct scripted s;
    struct selector *z;
    struct gon_error err;
    (void)state;
    scripted_init(&s, "\r", swallow);
    struct clk *clk = vline_begin(&s.port);
    assert_int_equal(
        selector_by_profile(profiles_get("thorlabs-sc10"), vline.link, clk, NULL, &z, &err), 0);
    assert_int_equal(z->ops->go(z, selector_find(z, "open"), &err), 0);
    assert_int_equal(s.step, 2);
    z->ops->free(z);
}

// Whatever gets lost, late or doubled: what it says is where it is.
static void on_a_bad_line_it_never_claims_what_is_not_so(void **state)
{
    struct gon_error err;
    int done = 0, lies = 0;
    (void)state;
    struct selector *z = begin("thorlabs-sc10");
    profiled.line.one_in = 6;
    profiled.line.late_most_ns = CLK_MS(340);
    profiled.line.double_most_ns = CLK_MS(340);
    print_message("seed %llu\n", (unsigned long long)profiled.line.dice);
    for (int i = 0; i < 1000; i++) {
        if (z->ops->go(z, i & 1, &err) < 0)
            continue;
        done++;
        lies += profiled_number("closed") != (i & 1);
    }
    print_message("1000 times, %llu faults: %d done, %d lies\n",
                  (unsigned long long)profiled.line.faults, done, lies);
    assert_true(done > 900);
    assert_int_equal(lies, 0);
    z->ops->free(z);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_says_who_it_is),
        cmocka_unit_test(another_one_is_refused),
        cmocka_unit_test(positions_have_names),
        cmocka_unit_test(where_it_is_already_it_is_told_nothing),
        cmocka_unit_test(every_position_is_reached),
        cmocka_unit_test(it_is_waited_for),
        cmocka_unit_test(a_stuck_shutter_is_told_once_and_is_an_error),
        cmocka_unit_test(one_that_takes_too_long_is_not_told_again),
        cmocka_unit_test(a_lost_answer_is_no_reason_to_change_over_again),
        cmocka_unit_test(a_lost_command_is_told_again_after_a_look),
        cmocka_unit_test(on_a_bad_line_it_never_claims_what_is_not_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
