// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define AXIS(name, unit, more)                                                                     \
    "  { name = \"" name "\"; driver = \"oriental-az\"; bus = \"axes\"; unit = " unit ";\n"        \
    "    steps_per_unit = 1000.0; min = -190.0; max = 190.0; speed = 20.0; acceleration = 60.0;\n" \
    "    deadband = 0.003; " more " }"
#define BEAM "theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = 30.0;"

// Lines: axes from 4 on, three each; with two of them "more" is line 13.
static const char *bench(const char *axes, const char *more, const char *station)
{
    static char text[4000];
    snprintf(text, sizeof text,
             "bench: { name = \"b\"; wavelength_nm = 1060.0; aperture_radius_mm = 8.0;\n"
             "  u_aperture_radius_mm = 0.0; distance_mm = 500.0; u_distance_mm = 0.0; };\n"
             "buses: ( { name = \"axes\"; link = \"modbus-tcp:axes:502\"; } );\n"
             "axes: (\n%s );\n"
             "laser: { driver = \"cobolt-05\"; link = \"tcp:laser:1\"; power_w = 0.05;"
             " warmup_s = 1.0; polarisation = \"u\"; };\n"
             "detector: { driver = \"sr830\"; link = \"tcp:lockin:8000\"; time_constant_s = 0.001;"
             " slope_db = 12; };\n%s"
             "stations: ( { name = \"beam\"; %s } );\n",
             axes, more, station);
    return text;
}

static const char arm_axes[] = AXIS("tilt", "1", "") ",\n" AXIS("arm", "2", "");
static const char arm_rows[] = "kinematics: { rows = ( { axis = \"tilt\"; theta_i = 1; },\n"
                               " { axis = \"arm\"; theta_i = 1; theta_r = 1; offset = 5; } ); };\n";
static const char direct_axes[] = AXIS("theta_i", "1", "") ",\n" AXIS("theta_r", "2", "");

static struct bench_config right(const char *text)
{
    struct bench_config b;
    struct said said = {0};
    if (bench_config_parse(text, "b.cfg", (struct cfg_sink){fixture_say, &said}, &b) < 0)
        print_error("%s", said.text);
    assert_string_equal(said.text, "");
    return b;
}

static void wrong(const char *text, const char *says)
{
    struct bench_config b;
    struct said said = {0};
    assert_int_equal(bench_config_parse(text, "b.cfg", (struct cfg_sink){fixture_say, &said}, &b),
                     GON_E_INPUT);
    assert_string_equal(said.text, says);
}

static void station_at(const struct bench_config *b, double at[BENCH_AXES])
{
    struct kinematics k;
    assert_int_equal(bench_kinematics(b, &k, NULL), 0);
    assert_int_equal(bench_station_at(b, &k, bench_find_station(b, "beam"), at, NULL), 0);
}

static void an_arm_bench_is_read_and_its_stations_follow(void **state)
{
    (void)state;
    double at[BENCH_AXES];
    struct bench_config b = right(bench(arm_axes, arm_rows, BEAM));
    station_at(&b, at);
    assert_true(at[0] == 0 && at[1] == 185 && isnan(at[2]));
    b = right(bench(arm_axes, arm_rows, BEAM " axes = ( { name = \"arm\"; at = 179; } );"));
    station_at(&b, at);
    assert_true(at[0] == 0 && at[1] == 179);
    assert_true(b.axes[0].encoder_steps == 1 && b.axes[0].retries == 2 &&
                b.axes[0].following_error == 0 && b.axes[0].approach == BENCH_FROM_BELOW);
}

static void a_tilting_bench_wants_the_beam_in_axes(void **state)
{
    (void)state;
    static const char axes[] =
        AXIS("arm", "1", "") ",\n" AXIS("tilt", "2", "") ",\n" AXIS("azimuth", "3", "");
    static const char kind[] = "kinematics: { kind = \"spherical\"; };\n";
    wrong(bench(axes, kind, BEAM),
          "b.cfg:17: stations[0].name = \"beam\": theta_r = 180 deg: the detector would be behind "
          "the sample's face; allowed -90..90 deg; or give every axis of the kinematics in axes\n");
    const struct bench_config b =
        right(bench(axes, kind,
                    BEAM " axes = ( { name = \"arm\"; at = 180; }, { name = \"tilt\"; at = 0; },"
                         " { name = \"azimuth\"; at = 0; } );"));
    struct kinematics k;
    double at[BENCH_AXES];
    station_at(&b, at);
    assert_int_equal(bench_kinematics(&b, &k, NULL), 0);
    assert_true(kinematics_forward(&k, at).theta_r == 180);
}

static void kinematics_mistakes_name_their_lines(void **state)
{
    (void)state;
    wrong(bench(arm_axes,
                "kinematics: {\n rows = ( { axis = \"tilt\"; theta_i = 1; theta_r = 2; },\n"
                " { axis = \"arm\"; theta_i = 2; theta_r = 4; } ); };\n",
                BEAM),
          "b.cfg:14: kinematics.rows = ( ... ): singular: the axes' positions do not tell theta_i, "
          "theta_r apart; one row is a combination of others\n");
    wrong(bench(arm_axes,
                "kinematics: { rows = ( { axis = \"tilt\"; theta_i = 1; },\n"
                " { axis = \"amr\"; theta_r = 1; } ); };\n",
                BEAM),
          "b.cfg:14: kinematics.rows[1].axis = \"amr\": no axis 'amr' in axes; did you mean "
          "'arm'?\n");
    wrong(bench(arm_axes,
                "kinematics: { rows = ( { axis = \"tilt\"; theta_i = 1; },\n"
                " { axis = \"tilt\"; theta_r = 1; } ); };\n",
                BEAM),
          "b.cfg:14: kinematics.rows[1].axis = \"tilt\": has its row already, rows[0]\n");
    wrong(bench(arm_axes, "kinematics: { kind = \"spherical\"; };\n", BEAM),
          "b.cfg:13: kinematics.azimuth: no axis 'azimuth' in axes\n");
    wrong(
        bench(arm_axes, "", BEAM),
        "b.cfg:4: axes = ( ... ): axis 'theta_i' is missing, and no kinematics says what makes it\n"
        "b.cfg:4: axes = ( ... ): axis 'theta_r' is missing, and no kinematics says what makes "
        "it\n");
}

static void axes_mistakes_name_their_lines(void **state)
{
    (void)state;
    wrong(
        bench(AXIS("theta_i", "1", "sweep = (-5, 200);") ",\n" AXIS("theta_r", "2", ""), "", BEAM),
        "b.cfg:7: axes[0].sweep = ( ... ): beyond the axis's travel; allowed -190..190 deg\n");
    wrong(bench(AXIS("theta_i", "1", "sweep = 5;") ",\n" AXIS("theta_r", "2", ""), "", BEAM),
          "b.cfg:7: axes[0].sweep = 5: one number; write (lowest, highest)\n");
    wrong(
        bench(AXIS("theta_i", "1", "approach = \"below\";") ",\n" AXIS("theta_r", "2", ""), "",
              BEAM),
        "b.cfg:7: axes[0].approach = \"below\": unknown; allowed \"from-below\", \"from-above\"\n");
    static const char twelve[] = AXIS("theta_i", "1", "") ",\n" AXIS("theta_r", "2", "") ",\n" AXIS(
        "laser", "3", "") ",\n" AXIS("Phi 2", "4", "") ",\n" AXIS("sample", "5", "");
    wrong(bench(twelve, "", BEAM),
          "b.cfg:11: axes[2].name = \"laser\": allowed a-z, 0-9, _ and -, and not laser, "
          "detector or monitor\n"
          "b.cfg:14: axes[3].name = \"Phi 2\": allowed a-z, 0-9, _ and -, and not laser, "
          "detector or monitor\n"
          "b.cfg:17: axes[4].unit_name: sample is in mm\n");
}

static void stations_mistakes_name_their_lines(void **state)
{
    (void)state;
    wrong(bench(direct_axes, "", BEAM " axes = ( { name = \"theta_i\"; at = 200; } );"),
          "b.cfg:13: stations[0].axes[0].at = 200: beyond the limits of axis theta_i; allowed "
          "-190..190 deg\n");
    wrong(bench(arm_axes, arm_rows, "theta_i_deg = 0.0; theta_r_deg = 190.0;"),
          "b.cfg:15: stations[0].name = \"beam\": beyond the limits of axis arm, at 195; allowed "
          "-190..190 deg\n");
    wrong(bench(direct_axes, "", BEAM " axes = ( { name = \"thet_i\"; at = 2; } );"),
          "b.cfg:13: stations[0].axes[0].name = \"thet_i\": no axis of that name in axes; did you "
          "mean 'theta_i'?\n");
}

static void keep_outs_are_read_and_checked(void **state)
{
    (void)state;
    const struct bench_config b = right(
        bench(direct_axes,
              "keep_out: ( { name = \"laser head\"; polygon = ( (0, -5), (90, -95), (90, -85), "
              "(0, 5) ); } );\n",
              BEAM));
    assert_int_equal(b.keep_out_count, 1);
    assert_string_equal(b.keep_out[0].name, "laser head");
    assert_int_equal(b.keep_out[0].vertices, 4);
    assert_true(b.keep_out[0].vertex[1][0] == 90 && b.keep_out[0].vertex[1][1] == -95);
    wrong(bench(direct_axes,
                "keep_out: ( { name = \"wall\"; polygon = ( (0, 1), (1, 2), (2, 3) ); },\n"
                " { name = \"line\"; polygon = ( (0, 1), (1, 2) ); } );\n",
                BEAM),
          "b.cfg:13: keep_out[0].polygon = ( ... ): its corners lie on one line\n"
          "b.cfg:14: keep_out[1].polygon = ( ... ): fewer than three corners\n");
    wrong(
        bench(direct_axes,
              "keep_out: ( { name = \"wall\"; polygon = ( (-1, 170), (1, 170), (0, 190) ); } );\n",
              BEAM),
        "b.cfg:14: stations[0].name = \"beam\": lies in keep_out[0] \"wall\"\n");
}

static void a_profile_is_predicted(void **state)
{
    (void)state;
    const struct bench_axis a = {.speed = 20, .acceleration = 60};
    const double all_s = bench_axis_move_s(&a, 10, -30); // 40 deg down
    assert_true(bench_axis_on_way(&a, 10, -30, -1) == 10);
    assert_true(bench_axis_on_way(&a, 10, -30, all_s) == -30);
    double before = 10, speed = 0;
    for (double t = 0.001; t < all_s; t += 0.001) {
        const double now = bench_axis_on_way(&a, 10, -30, t), v = (before - now) / 0.001;
        assert_true(v >= 0 && v <= 20 + 1e-6 && fabs(v - speed) <= 0.06 + 1e-6);
        before = now;
        speed = v;
    }
    assert_true(fabs(before + 30) < 1e-3);
    assert_true(fabs(bench_axis_on_way(&a, 0, 1, bench_axis_move_s(&a, 0, 1) / 2) - 0.5) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_arm_bench_is_read_and_its_stations_follow),
        cmocka_unit_test(a_tilting_bench_wants_the_beam_in_axes),
        cmocka_unit_test(kinematics_mistakes_name_their_lines),
        cmocka_unit_test(axes_mistakes_name_their_lines),
        cmocka_unit_test(stations_mistakes_name_their_lines),
        cmocka_unit_test(keep_outs_are_read_and_checked),
        cmocka_unit_test(a_profile_is_predicted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
