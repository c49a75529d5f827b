// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign/keepout.h"
#include "tests/unit/randoms.h"
#include "tests/unit/simconfig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

enum { THETA_I, THETA_R, SAMPLE };

static void fence(struct bench_config *b, const char *name, const double vertex[][2], int vertices)
{
    struct bench_keep_out *k = &b->keep_out[b->keep_out_count++];
    *k = (struct bench_keep_out){.vertices = vertices};
    snprintf(k->name, sizeof k->name, "%s", name);
    memcpy(k->vertex, vertex, (size_t)vertices * sizeof *vertex);
}

// A laser head that the detector would meet: theta_r within 5 deg of -theta_i, for theta_i > 20.
static struct bench_config bench_with_head(struct kinematics *ret_kinematics)
{
    static const double head[][2] = {{20, -15}, {20, -25}, {85, -90}, {85, -80}};
    struct bench_config b;
    simconfig_bench(&b);
    fence(&b, "laser head", head, 4);
    assert_int_equal(bench_kinematics(&b, ret_kinematics, NULL), 0);
    return b;
}

static int way(const struct bench_config *b, const struct kinematics *k, double i0, double r0,
               double i1, double r1, struct keepout_way *ret, struct gon_error *err)
{
    const double from[BENCH_AXES] = {i0, r0, 30}, to[BENCH_AXES] = {i1, r1, 0};
    return keepout_find_way(b, k, from, to, ret, err);
}

static void places_and_their_margin(void **state)
{
    (void)state;
    struct kinematics k;
    const struct bench_config b = bench_with_head(&k);
    assert_int_equal(keepout_at(&b, 30, -30), 0);
    assert_int_equal(keepout_at(&b, 30, -24.95), 0);
    assert_int_equal(keepout_at(&b, 30, -24.75), -1);
    assert_int_equal(keepout_at(&b, 19.8, -20), -1);
    assert_int_equal(keepout_at(&b, 30, 30), -1);
}

static void all_together_where_that_is_clear(void **state)
{
    (void)state;
    struct kinematics k;
    struct keepout_way w;
    const struct bench_config b = bench_with_head(&k);
    assert_int_equal(way(&b, &k, 10, -80, 10, 80, &w, NULL), 0);
    assert_int_equal(w.stages, 1);
    assert_true((w.stage[0].axes & 7) == 7);
}

static void one_after_the_other_where_together_is_not(void **state)
{
    (void)state;
    struct kinematics k;
    struct keepout_way w;
    const struct bench_config b = bench_with_head(&k);
    // behind the head theta_i must be small before theta_r comes back
    assert_int_equal(way(&b, &k, 60, -80, 10, -60, &w, NULL), 0);
    assert_int_equal(w.stages, 2);
    assert_true(w.stage[0].axes >> THETA_I & 1 && !(w.stage[0].axes >> THETA_R & 1));
    assert_true(w.stage[0].axes >> SAMPLE & 1); // turns nothing: with the first
    assert_true(w.stage[1].axes == 1 << THETA_R);
    assert_int_equal(way(&b, &k, 10, -60, 60, -80, &w, NULL), 0);
    assert_true(w.stages == 2 && w.stage[1].axes == 1 << THETA_I);
}

static void a_station_leads_round(void **state)
{
    (void)state;
    struct kinematics k;
    struct keepout_way w;
    const struct bench_config b = bench_with_head(&k);
    // the beam is at (0, 180): theta_i down to 0, theta_r past the head, and back
    assert_int_equal(way(&b, &k, 60, -80, 60, 0, &w, NULL), 0);
    assert_int_equal(w.stages, 3);
    assert_true(w.stage[1].to[THETA_I] == 0 && w.stage[1].to[THETA_R] == 180);
    assert_true(w.stage[0].to[SAMPLE] == 30); // where it is
    assert_true(w.stage[2].to[THETA_I] == 60 && w.stage[2].to[THETA_R] == 0);
}

// Between the head and the end of theta_i's travel theta_r can only go back where it came from.
static void a_corner_is_left_as_it_was_entered(void **state)
{
    (void)state;
    static const double hook[][2] = {{40, -40}, {88, -40}, {88, -45},
                                     {50, -45}, {50, -70}, {40, -70}};
    struct kinematics k;
    struct keepout_way w;
    struct bench_config b;
    simconfig_bench(&b);
    b.stations_count = 0;
    fence(&b, "hook", hook, 6);
    assert_int_equal(bench_kinematics(&b, &k, NULL), 0);
    assert_int_equal(way(&b, &k, 80, -60, 10, 30, &w, NULL), 0);
    assert_true(w.stage[0].to[THETA_R] == -180 && w.stage[0].to[THETA_I] == 80);
    assert_int_equal(w.stages, 3);
}

static void no_way_is_said_with_its_reason(void **state)
{
    (void)state;
    struct kinematics k;
    struct keepout_way w;
    struct gon_error err;
    struct bench_config b = bench_with_head(&k);
    b.stations_count = 0;
    b.axes[THETA_I].min = 25; // no way round the head's end
    assert_int_equal(way(&b, &k, 60, -80, 60, 0, &w, &err), GON_E_INPUT);
    assert_string_equal(err.text,
                        "no way from theta_i 60.000, theta_r -80.000 to 60.000, 0.000 deg round "
                        "keep-out \"laser head\": it lies between, whichever axis moves first");
    assert_int_equal(way(&b, &k, 60, 0, 60, -60, &w, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "the target lies in it"));
    assert_int_equal(way(&b, &k, 60, -60, 60, 0, &w, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "the bench stands in it; move it out by hand"));
    assert_int_equal(way(&b, &k, (double)NAN, -60, 60, 0, &w, &err), GON_E_INPUT);
    assert_string_equal(err.text, "axis theta_i: where it stands is not known");
}

static void the_way_round_for_the_approach_counts(void **state)
{
    (void)state;
    static const double below[][2] = {{-10, 8}, {90, 8}, {90, 9.8}, {-10, 9.8}};
    struct kinematics k;
    struct keepout_way w;
    struct bench_config b;
    simconfig_bench(&b);
    fence(&b, "shelf", below, 4);
    assert_int_equal(bench_kinematics(&b, &k, NULL), 0);
    assert_int_equal(way(&b, &k, 30, 40, 30, 10, &w, NULL), 0);
    b.axes[THETA_R].backlash = 0.2; // 10 - 0.2 deg is too near
    assert_int_equal(way(&b, &k, 30, 40, 30, 10, &w, NULL), GON_E_INPUT);
    b.axes[THETA_R].approach = BENCH_FROM_ABOVE;
    assert_int_equal(way(&b, &k, 30, 40, 30, 10, &w, NULL), 0);
}

// Whatever place within the box is in a keep-out, the box was called so: random polygons, benches
// and boxes, and places tried at random.
static void no_place_in_a_box_is_missed(void **state)
{
    (void)state;
    uint64_t seed = random_seed();
    const struct kinematics_row rows[] = {{.axis = 0, .of = {1}}, {.axis = 1, .of = {1, 1}}};
    const struct kinematics_roles roles = {0, 1, 2, -1, -1};
    int hits = 0, clear = 0;
    for (int n = 0; n < 3000; n++) {
        struct kinematics k = kinematics_spherical(&roles);
        struct bench_config b = {.axes_count = 3};
        double low[BENCH_AXES] = {0}, high[BENCH_AXES] = {0}, vertex[5][2], size[3];
        if (n % 2)
            assert_int_equal(kinematics_linear(rows, 2, &k, NULL), 0);
        const double x = random_between(&seed, 0, 80), y = random_between(&seed, -80, 80);
        for (int v = 0; v < 5; v++) { // a star, seldom convex
            const double r = random_between(&seed, 1, 20), a = 2 * RANDOM_PI * v / 5;
            vertex[v][0] = x + r * cos(a);
            vertex[v][1] = y + r * sin(a);
        }
        fence(&b, "star", vertex, 5);
        const struct kinematics_pose middle = {x, y, 0, (double)NAN, (double)NAN};
        double about[BENCH_AXES];
        assert_int_equal(kinematics_inverse(&k, &middle, about, NULL), 0);
        for (int i = 0; i < 3; i++) {
            size[i] = random_next(&seed) % 3 ? random_log(&seed, 0.01, 40) : 0;
            low[i] = (isnan(about[i]) ? 0 : about[i]) + random_between(&seed, -40, 20);
            high[i] = low[i] + size[i];
        }
        const int found = keepout_within(&b, &k, low, high);
        bool met = false;
        for (int t = 0; t < 300; t++) {
            double at[BENCH_AXES];
            for (int i = 0; i < 3; i++)
                at[i] = low[i] + size[i] * random_between(&seed, 0, 1);
            const struct kinematics_pose p = kinematics_forward(&k, at);
            met = met || keepout_at(&b, p.theta_i, p.theta_r) >= 0;
        }
        assert_false(met && found < 0);
        hits += met;
        clear += found < 0;
    }
    printf("%d boxes touch, %d are clear of 3000\n", hits, clear);
    assert_true(hits > 200 && clear > 200);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_and_their_margin),
        cmocka_unit_test(all_together_where_that_is_clear),
        cmocka_unit_test(one_after_the_other_where_together_is_not),
        cmocka_unit_test(a_station_leads_round),
        cmocka_unit_test(a_corner_is_left_as_it_was_entered),
        cmocka_unit_test(no_way_is_said_with_its_reason),
        cmocka_unit_test(the_way_round_for_the_approach_counts),
        cmocka_unit_test(no_place_in_a_box_is_missed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
