// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include "base/units.h"
#include "campaign/plan_states.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static struct plan planned(const char *text, const struct bench_config *bench)
{
    const struct campaign_config c = fixture_campaign(text);
    struct plan p;
    struct gon_error err;
    assert_int_equal(plan_make(&c, bench, &p, &err), 0);
    return p;
}

static bool warns(const struct plan *p, const char *part)
{
    for (int i = 0; i < p->warnings_count; i++)
        if (strstr(p->warnings[i], part))
            return true;
    return false;
}

// Ten sweeps; 69 coarse directions each, and 21 dense ones of which 5 lie on the coarse grid.
static void the_papers_campaign_has_850_points(void **state)
{
    (void)state;
    struct campaign_config c;
    struct said said = {0};
    struct plan p;
    assert_int_equal(
        campaign_config_load("configs/paper.cfg", (struct cfg_sink){fixture_say, &said}, &c, NULL),
        0);
    assert_string_equal(said.text, "");
    assert_int_equal(plan_make(&c, NULL, &p, NULL), 0);
    assert_int_equal(p.samples, 850);
    assert_int_equal(p.count, 854);
    assert_int_equal(p.sweeps, 10);
    assert_int_equal(p.skips_count, 0);
    int dense = 0, at_45 = 0;
    double lowest_deg = 90, highest_deg = -90, weight = 0;
    for (int i = 0; i < p.count; i++) {
        dense += p.points[i].dense;
        weight += p.points[i].kind == PLAN_SAMPLE ? p.points[i].weight : 0;
        if (p.points[i].theta_i_deg == 45 && p.points[i].dense) {
            at_45++;
            lowest_deg = fmin(lowest_deg, p.points[i].theta_r_deg);
            highest_deg = fmax(highest_deg, p.points[i].theta_r_deg);
        }
    }
    assert_int_equal(dense, 210); // the edges included
    assert_int_equal(at_45, 21);
    assert_true(lowest_deg == 40 && highest_deg == 50);
    assert_true(weight == 640 + 3 * 210);
    assert_true(isnan(p.duration_s));
    plan_clear(&p);
}

static void references_stand_around_the_sweeps(void **state)
{
    (void)state;
    const struct bench_config b = fixture_bench();
    struct plan p = planned("campaign: { name = \"a\"; theta_i_deg = (20, 10);"
                            " theta_r: { from_deg = -10; to_deg = 30; step_deg = 10; };"
                            " dense: { half_width_deg = 0.5; }; };",
                            &b);
    const struct {
        int sweep, point;
        enum plan_kind kind;
        double theta_i_deg, theta_r_deg;
    } expected[] = {
        {0, 0, PLAN_DARK, 0, 180},    {0, 1, PLAN_BEAM, 0, 180},     {1, 0, PLAN_SAMPLE, 20, -10},
        {1, 1, PLAN_SAMPLE, 20, 0},   {1, 2, PLAN_SAMPLE, 20, 10},   {1, 3, PLAN_SAMPLE, 20, 19.5},
        {1, 4, PLAN_SAMPLE, 20, 20},  {1, 5, PLAN_SAMPLE, 20, 20.5}, {1, 6, PLAN_SAMPLE, 20, 30},
        {2, 0, PLAN_SAMPLE, 10, -10}, {2, 1, PLAN_SAMPLE, 10, 0},    {2, 2, PLAN_SAMPLE, 10, 9.5},
        {2, 3, PLAN_SAMPLE, 10, 10},  {2, 4, PLAN_SAMPLE, 10, 10.5}, {2, 5, PLAN_SAMPLE, 10, 20},
        {2, 6, PLAN_SAMPLE, 10, 30},  {3, 0, PLAN_BEAM, 0, 180},     {3, 1, PLAN_DARK, 0, 180},
    };
    assert_int_equal(p.count, sizeof expected / sizeof *expected);
    for (int i = 0; i < p.count; i++) {
        assert_int_equal(p.points[i].sweep, expected[i].sweep);
        assert_int_equal(p.points[i].point, expected[i].point);
        assert_int_equal(p.points[i].kind, expected[i].kind);
        assert_true(p.points[i].theta_i_deg == expected[i].theta_i_deg);
        assert_true(p.points[i].theta_r_deg == expected[i].theta_r_deg);
        assert_string_equal(p.points[i].station, expected[i].kind == PLAN_SAMPLE ? "" : "beam");
        assert_false(p.points[i].done);
    }
    assert_true(warns(&p, "2 angles of incidence"));
    plan_clear(&p);
}

// 0.1 is no binary number: sums of it must not make two points of one direction.
static void directions_are_merged_in_micro_degrees(void **state)
{
    (void)state;
    struct plan p = planned("campaign: { name = \"a\"; theta_i_deg = (0.3, 10, 20);"
                            " theta_r: { from_deg = -1; to_deg = 1; step_deg = 0.1; };"
                            " dense: { half_width_deg = 0.3; step_deg = 0.1; }; };",
                            NULL);
    assert_int_equal(p.samples, 3 * 21);
    int dense = 0;
    for (int i = 0; i < p.count; i++)
        dense += p.points[i].dense;
    assert_int_equal(dense, 7);
    plan_clear(&p);
    p = planned("campaign: { name = \"a\"; theta_i_deg = 50;" // 0.3 / 0.1 is a little less than 3
                " theta_r: { from_deg = 0; to_deg = 0.3; step_deg = 0.1; }; dense: { "
                "half_width_deg = 0; }; };",
                NULL);
    assert_int_equal(p.samples, 4);
    plan_clear(&p);
}

static void skipped_points_say_why(void **state)
{
    (void)state;
    struct bench_config b = fixture_bench();
    b.axes[1].max = 25;
    struct plan p =
        planned("campaign: { name = \"a\"; theta_i_deg = (0, 10, 20); blind_half_deg = 5;"
                " theta_r: { from_deg = -30; to_deg = 30; step_deg = 5; };"
                " dense: { half_width_deg = 0; }; };",
                &b);
    // In each sweep 13 directions: 30 is beyond the axis, and -theta_i +- 0 in the shadow; +-5 is
    // not.
    assert_int_equal(p.samples, 3 * 11);
    assert_int_equal(p.skips_count, 6);
    assert_int_equal(p.skips[0].reason, PLAN_SKIP_BLIND);
    assert_true(p.skips[0].theta_r_deg == 0);
    assert_int_equal(p.skips[1].reason, PLAN_SKIP_LIMITS);
    assert_true(p.skips[1].theta_r_deg == 30);
    assert_true(warns(&p, "theta_i = 0 deg: the specular direction lies in the detector's shadow"));
    assert_true(warns(&p, "3 points lie beyond the limits"));
    assert_false(warns(&p, "grazing"));
    plan_clear(&p);
    const struct campaign_config c =
        fixture_campaign("campaign: { name = \"a\"; theta_i_deg = 10; };");
    struct gon_error err;
    b.axes[0].max = 5;
    assert_int_equal(plan_make(&c, &b, &p, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "nothing is left to measure"));
}

static const struct plan_skip *skip_at(const struct plan *p, double theta_i_deg, double theta_r_deg)
{
    for (int i = 0; i < p->skips_count; i++)
        if (p->skips[i].theta_i_deg == theta_i_deg && p->skips[i].theta_r_deg == theta_r_deg)
            return &p->skips[i];
    return NULL;
}

static void fence(struct bench_config *b, const char *name, const double vertex[4][2])
{
    struct bench_keep_out *k = &b->keep_out[b->keep_out_count++];
    *k = (struct bench_keep_out){.vertices = 4};
    snprintf(k->name, sizeof k->name, "%s", name);
    memcpy(k->vertex, vertex, sizeof k->vertex[0] * 4);
}

// The detector comes from the beam at theta_r = 180. Below theta_i = 20 there is a way round the
// head; where there is none, what lies behind it is cut off.
static void keep_outs_take_points_and_what_lies_behind(void **state)
{
    (void)state;
    static const char text[] = "campaign: { name = \"a\"; theta_i_deg = (10, 40);"
                               " theta_r: { from_deg = -60; to_deg = 60; step_deg = 10; };"
                               " dense: { half_width_deg = 0; }; };";
    static const double head[4][2] = {{20, -15}, {20, -25}, {85, -90}, {85, -80}};
    struct bench_config b = fixture_bench();
    struct plan p = planned(text, &b);
    const double free_s = p.duration_s;
    plan_clear(&p);
    fence(&b, "laser head", head);
    p = planned(text, &b);
    assert_int_equal(p.samples, 13 + 12);
    assert_int_equal(skip_at(&p, 40, -40)->reason, PLAN_SKIP_KEEP_OUT);
    assert_true(p.duration_s > free_s + 20); // to the beam and back
    assert_true(warns(&p, "1 points lie in keep-out \"laser head\" and are skipped"));
    plan_clear(&p);
    b.keep_out[0].vertex[0][0] = b.keep_out[0].vertex[1][0] = -10;
    b.keep_out[0].vertex[0][1] = 15;
    b.keep_out[0].vertex[1][1] = 5;
    p = planned(text, &b);
    assert_int_equal(p.samples, 7 + 10);
    assert_int_equal(skip_at(&p, 10, -60)->reason, PLAN_SKIP_CUT_OFF);
    assert_int_equal(skip_at(&p, 10, -10)->reason, PLAN_SKIP_KEEP_OUT);
    assert_int_equal(skip_at(&p, 40, -50)->reason, PLAN_SKIP_CUT_OFF);
    assert_string_equal(plan_skip_text(PLAN_SKIP_CUT_OFF), "cut off by a keep-out");
    assert_true(warns(&p, "7 points are skipped because a keep-out lies between"));
    plan_clear(&p);
}

static void no_way_to_the_beam_refuses_the_campaign(void **state)
{
    (void)state;
    static const double wall[4][2] = {{-10, 100}, {90, 100}, {90, 110}, {-10, 110}};
    struct bench_config b = fixture_bench();
    struct plan p;
    struct gon_error err;
    fence(&b, "wall", wall);
    const struct campaign_config c =
        fixture_campaign("campaign: { name = \"a\"; theta_i_deg = 10; };");
    assert_int_equal(plan_make(&c, &b, &p, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "nothing is left to measure"));
}

// theta_i = tilt - 3 and theta_r = arm - tilt; the arm sweeps to 60 deg and may stand at 183 deg.
static void limits_are_those_of_the_axes(void **state)
{
    (void)state;
    struct bench_config b = fixture_bench();
    snprintf(b.axes[0].name, BENCH_NAME, "tilt");
    snprintf(b.axes[1].name, BENCH_NAME, "arm");
    b.axes[1].max = 190;
    b.axes[1].sweep_count = 2;
    b.axes[1].sweep[0] = -30;
    b.axes[1].sweep[1] = 60;
    b.kinematics.rows_count = 2;
    b.kinematics.rows[0] = (struct bench_row){.axis = "tilt", .theta_i = 1, .offset = 3};
    b.kinematics.rows[1] =
        (struct bench_row){.axis = "arm", .theta_i = 1, .theta_r = 1, .offset = 3};
    struct plan p = planned("campaign: { name = \"a\"; theta_i_deg = (0, 30);"
                            " theta_r: { from_deg = -40; to_deg = 60; step_deg = 10; };"
                            " dense: { half_width_deg = 0; }; };",
                            &b);
    // 0: arm = 3 + theta_r within -30..60: theta_r -30..50; 30: arm = 33 + theta_r: -40..20
    assert_int_equal(p.samples, 9 + 7);
    assert_null(skip_at(&p, 0, -30));
    assert_int_equal(skip_at(&p, 0, -40)->reason, PLAN_SKIP_LIMITS);
    assert_int_equal(skip_at(&p, 0, 60)->reason, PLAN_SKIP_LIMITS);
    assert_int_equal(skip_at(&p, 30, 30)->reason, PLAN_SKIP_LIMITS);
    assert_null(skip_at(&p, 30, -40));
    plan_clear(&p);
}

static void warnings_name_what_spoils_the_fit(void **state)
{
    (void)state;
    struct bench_config b = fixture_bench();
    b.laser.polarisation = POL_UNKNOWN;
    struct plan p = planned("campaign: { name = \"a\"; theta_i_deg = (0, 30, 60);"
                            " theta_r: { from_deg = -85; to_deg = 50; }; };",
                            &b);
    assert_true(warns(&p, "theta_i = 60 deg: the specular direction lies outside"));
    assert_true(warns(&p, "3 points at |theta_r| >= 85 deg"));
    assert_true(warns(&p, "polarisation is unknown"));
    plan_clear(&p);
    p = planned("campaign: { name = \"a\"; theta_i_deg = (0, 30, 60); pol_in = \"s\"; };", &b);
    assert_true(warns(&p, "an element must be in the beam"));
    plan_clear(&p);
}

#define STATES(states)                                                                             \
    "campaign: { name = \"a\"; theta_i_deg = (0, 30, 60); theta_r: { from_deg = 0; to_deg = 60;"   \
    " step_deg = 30; }; dense: { half_width_deg = 0; }; blind_half_deg = 1; " states " };"

// Per sweep one state after the other; the beam once in each state of the light, without analyser.
static void every_sweep_is_measured_in_every_state(void **state)
{
    (void)state;
    const struct bench_config b = fixture_polarised_bench();
    struct plan p = planned(STATES("pol_in = (\"s\", \"p\"); pol_out = (\"s\", \"u\");"), &b);
    const int order[4][2] = {{POL_S, POL_S}, {POL_S, POL_U}, {POL_P, POL_S}, {POL_P, POL_U}};
    // Sweep 1 loses theta_r = 0 to the shadow, once and not in each state.
    assert_true(p.samples == 4 * 8 && p.count == p.samples + 6 && p.skips_count == 1);
    const enum plan_kind kinds[] = {PLAN_DARK, PLAN_BEAM, PLAN_BEAM};
    const int light[] = {POL_S, POL_S, POL_P};
    for (int i = 0; i < 3; i++) {
        const struct plan_point *first = &p.points[i], *last = &p.points[p.count - 1 - i];
        assert_true(first->kind == kinds[i] && first->sweep == 0 && first->point == i);
        assert_true(first->pol_in == light[i] && first->pol_out == POL_U);
        assert_true(last->kind == kinds[i] && last->sweep == 4 && last->point == 2 - i);
        assert_true(last->pol_in == (i == 2 ? POL_S : POL_P) && last->pol_out == POL_U);
    }
    for (int i = 0; i < 12; i++) { // sweep 2
        const struct plan_point *q = &p.points[3 + 8 + i];
        assert_true(q->sweep == 2 && q->point == i && q->theta_i_deg == 30);
        assert_true(q->theta_r_deg == 30 * (i % 3));
        assert_true(q->pol_in == order[i / 3][0] && q->pol_out == order[i / 3][1]);
    }
    assert_int_equal(p.warnings_count, 1); // of the shadow only
    assert_int_equal(plan_check_states(&p, &b, NULL), 0);
    plan_clear(&p);
}

static void a_single_state_is_planned_as_ever(void **state)
{
    (void)state;
    const struct bench_config b = fixture_bench();
    struct plan p = planned(STATES("pol_in = \"s\"; pol_out = \"p\";"), &b);
    for (int i = 0; i < p.count; i++) // nothing moves: what is in the beam stays there
        assert_true(p.points[i].pol_in == POL_S && p.points[i].pol_out == POL_P);
    assert_true(warns(&p, "pol_out = \"p\", but no axis of the bench moves an analyser"));
    assert_int_equal(plan_check_states(&p, &b, NULL), 0);
    plan_clear(&p);
    p = planned(STATES(""), &b);
    assert_true(p.points[4].pol_in == POL_U && p.points[4].pol_out == POL_U);
    plan_clear(&p);
}

static void states_that_the_bench_has_not_are_said(void **state)
{
    (void)state;
    struct gon_error err;
    struct bench_config b = fixture_polarised_bench();
    struct plan p = planned(STATES("pol_in = (\"s\", \"+45\");"), &b);
    assert_true(warns(&p, "the bench has no state \"+45\" for pol_in; it has s, p"));
    assert_int_equal(plan_check_states(&p, &b, &err), GON_E_INPUT);
    assert_string_equal(err.text, "the campaign asks for pol_in = \"+45\", and the bench has only "
                                  "s, p; see group polarisation of its file");
    plan_clear(&p);
    p = planned(STATES(""), &b); // the laser as it is, but a polariser stands in its beam
    assert_true(warns(&p, "no state \"u\" for pol_in"));
    assert_int_equal(plan_check_states(&p, &b, &err), GON_E_INPUT);
    plan_clear(&p);
    p = planned(STATES("pol_in = \"s\"; pol_out = (\"p\", \"R\");"), &b);
    assert_true(warns(&p, "no state \"R\" for pol_out; it has u, s, p"));
    plan_clear(&p);
    b = fixture_bench();
    p = planned(STATES("pol_in = (\"s\", \"p\");"), &b);
    assert_int_equal(plan_check_states(&p, &b, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "the bench has no such states"));
    plan_clear(&p);
    const struct campaign_config c = fixture_campaign(STATES("pol_in = (\"u\", \"laser\");"));
    assert_int_equal(plan_make(&c, &b, &p, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "\"laser\" is \"u\" on this bench"));
}

static void an_analyser_that_stays_is_parallel_to_the_beam(void **state)
{
    (void)state;
    struct bench_config b = fixture_polarised_bench();
    memmove(&b.polarisation.pol_out.state[0], &b.polarisation.pol_out.state[1],
            2 * sizeof b.polarisation.pol_out.state[0]);
    b.polarisation.pol_out.count = 2; // without "u"
    struct plan p = planned(
        STATES("pol_in = (\"s\", \"p\"); pol_out = (\"p\", \"s\"); pol_combine = \"pairs\";"), &b);
    assert_true(p.points[1].pol_in == POL_S && p.points[1].pol_out == POL_S);
    assert_true(p.points[2].pol_in == POL_P && p.points[2].pol_out == POL_P);
    assert_true(p.points[3].pol_in == POL_S && p.points[3].pol_out == POL_P);
    assert_true(warns(&p,
                      "the beam of pol_in = \"p\" is measured behind it at \"p\", where it passes "
                      "1 of the light"));
    assert_int_equal(plan_check_states(&p, &b, NULL), 0);
    plan_clear(&p);
    struct gon_error err;
    b.polarisation.pol_out.count = 1; // s alone
    p = planned(STATES("pol_in = \"p\"; pol_out = \"s\";"), &b);
    assert_int_equal(plan_check_states(&p, &b, &err), GON_E_INPUT);
    assert_non_null(
        strstr(err.text, "lets the beam of pol_in = \"p\" through; add \"u\" or \"p\""));
    plan_clear(&p);
}

// n-pole tables of lock-in manuals: 1e-4 after 9.2, 11.8, 13.9, 15.9 time constants.
static void filters_settle_as_tabulated(void **state)
{
    (void)state;
    const double settle[] = {9.2103, 11.7564, 13.9282, 15.9137}; // of an independent root finder
    const double spacing[] = {2.9957, 4.7439, 5.9186, 6.8767};
    for (int n = 1; n <= 4; n++) {
        assert_true(fabs(plan_settle_s(0.1, 6 * n) - 0.1 * settle[n - 1]) < 1e-4);
        assert_true(fabs(plan_spacing_s(0.1, 6 * n) - 0.1 * spacing[n - 1]) < 1e-4);
    }
}

// By hand: 2 s warm-up; dark and beam at (0, 180); to (30, 0): 180 deg at 20 deg/s and 60 deg/s^2
// is 9.3333 s; 10 deg steps 0.8333 s, short ones of 1 deg 2 sqrt(1/60) s; back to (0, 180).
static void duration_adds_moves_and_readings(void **state)
{
    (void)state;
    struct bench_config b = fixture_bench();
    b.laser.warmup_s = 2;
    struct plan p =
        planned("campaign: { name = \"a\"; theta_i_deg = 30;"
                " theta_r: { from_deg = 0; to_deg = 10; step_deg = 10; };"
                " dense: { half_width_deg = 0; };"
                " readings: { count = 3; }; beam: { count = 1; }; dark: { count = 1; }; };",
                &b);
    const double settle_s = plan_settle_s(0.001, 12), spacing_s = plan_spacing_s(0.001, 12);
    const double expected_s = 2 + (180.0 / 20 + 20.0 / 60) + (10.0 / 20 + 20.0 / 60) +
                              (170.0 / 20 + 20.0 / 60) + 6 * (0.03 + settle_s) + 2 * 2 * spacing_s;
    assert_true(fabs(p.duration_s - expected_s) < 1e-9);
    plan_clear(&p);
}

// 90 deg of a polariser at 20 deg/s and 60 deg/s^2 take 4.8333 s: to p for the beam, back to s for
// the sample, to p and, before the closing beam in s, back.
static void duration_has_the_elements_moves(void **state)
{
    (void)state;
    const struct bench_config b = fixture_polarised_bench();
    const char text[] =
        "campaign: { name = \"a\"; theta_i_deg = 0; pol_in = %s; theta_r: { from_deg ="
        " 0; to_deg = 10; step_deg = 10; }; dense: { half_width_deg = 0; };"
        " readings: { count = 1; }; beam: { count = 1; }; dark: { count = 1; }; };";
    char one[400], two[400];
    snprintf(one, sizeof one, text, "\"s\"");
    snprintf(two, sizeof two, text, "(\"s\", \"p\")");
    struct plan p = planned(one, &b), q = planned(two, &b);
    const double settle_s = plan_settle_s(0.001, 12), back_s = 10.0 / 20 + 20.0 / 60;
    const double more_s = 5 * (90.0 / 20 + 20.0 / 60) + 4 * (0.03 + settle_s) + 2 * back_s;
    assert_true(fabs(q.duration_s - p.duration_s - more_s) < 1e-9);
    plan_clear(&p);
    plan_clear(&q);
}

static void too_many_points_are_refused(void **state)
{
    (void)state;
    struct campaign_config c =
        fixture_campaign("campaign: { name = \"a\"; theta_i_deg = 0;"
                         " theta_r: { step_deg = 0.01; }; dense: { half_width_deg = 0; }; };");
    for (c.theta_i_count = 0; c.theta_i_count < 70; c.theta_i_count++)
        c.theta_i_deg[c.theta_i_count] = c.theta_i_count;
    struct plan p;
    struct gon_error err;
    assert_int_equal(plan_make(&c, NULL, &p, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "more than 1000000 points"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_papers_campaign_has_850_points),
        cmocka_unit_test(references_stand_around_the_sweeps),
        cmocka_unit_test(directions_are_merged_in_micro_degrees),
        cmocka_unit_test(skipped_points_say_why),
        cmocka_unit_test(keep_outs_take_points_and_what_lies_behind),
        cmocka_unit_test(no_way_to_the_beam_refuses_the_campaign),
        cmocka_unit_test(limits_are_those_of_the_axes),
        cmocka_unit_test(warnings_name_what_spoils_the_fit),
        cmocka_unit_test(every_sweep_is_measured_in_every_state),
        cmocka_unit_test(a_single_state_is_planned_as_ever),
        cmocka_unit_test(states_that_the_bench_has_not_are_said),
        cmocka_unit_test(an_analyser_that_stays_is_parallel_to_the_beam),
        cmocka_unit_test(duration_has_the_elements_moves),
        cmocka_unit_test(filters_settle_as_tabulated),
        cmocka_unit_test(duration_adds_moves_and_readings),
        cmocka_unit_test(too_many_points_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
