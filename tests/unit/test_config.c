// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include "base/units.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static void campaign_complains(const char *text, const char *expected)
{
    struct campaign_config c;
    struct said said = {0};
    assert_int_equal(
        campaign_config_parse(text, "bad.cfg", (struct cfg_sink){fixture_say, &said}, &c),
        GON_E_INPUT);
    assert_string_equal(said.text, expected);
}

// The bench of the fixture with one piece of text exchanged.
static void bench_complains(const char *old, const char *new, const char *expected)
{
    static char text[sizeof FIXTURE_BENCH + 500];
    const char *at = strstr(FIXTURE_BENCH, old);
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - FIXTURE_BENCH), FIXTURE_BENCH, new,
             at + strlen(old));
    struct bench_config b;
    struct said said = {0};
    int rc = bench_config_parse(text, "b.cfg", (struct cfg_sink){fixture_say, &said}, &b);
    assert_string_equal(said.text, expected);
    assert_int_equal(rc, *expected ? GON_E_INPUT : GON_OK);
}

static void a_minimal_campaign_is_two_lines(void **state)
{
    (void)state;
    const struct campaign_config c =
        fixture_campaign("campaign: { name = \"a\"; theta_i_deg = (0, 5.5); };");
    assert_true(c.theta_i_count == 2 && c.theta_i_deg[1] == 5.5);
    assert_true(c.from_deg == -85 && c.to_deg == 85 && c.step_deg == 2.5);
    assert_true(c.dense_half_width_deg == 5 && c.dense_step_deg == 0.5 && c.dense_weight == 3);
    assert_true(c.readings == 4 && c.beam_readings == 16 && c.dark_readings == 16 &&
                c.blind_half_deg == 0);
    assert_int_equal(c.pol_in, POL_IN_LASER);
    assert_int_equal(c.pol_out, POL_U);
    assert_int_equal(c.fit.method, FIT_MEMETIC);
    assert_int_equal(c.fit.weighting, FIT_VARIANCE);
    assert_int_equal(c.fit.diffuse, BRDF_DIFFUSE_PAPER);
    assert_true(c.fit.seed == 1 && c.fit.theta_i_max_deg == 85);
}

static void a_campaigns_mistakes_name_their_lines(void **state)
{
    (void)state;
    campaign_complains(
        "campaign: {\n name = \"a\";\n\n theta_i_deg = (0, 5, 10, 20, 30, 40, 45, 50, 55, 95);\n"
        " theta_r: { stpe = 0.5; };\n};\n",
        "bad.cfg:4: campaign.theta_i_deg[9] = 95: out of range; allowed 0..85 deg\n"
        "bad.cfg:5: unknown setting 'stpe' in campaign.theta_r; did you mean 'step_deg'?\n");
    campaign_complains(
        "campaign: { name = \"\"; theta_i_deg = (5, 5.0000001,\n 7, 7);\n"
        " theta_r: {\n  from_deg = 20; to_deg = 10;\n step_deg = 0.1; }; };",
        "bad.cfg:4: campaign.theta_r.from_deg = 20: not below to_deg = 10 deg\n"
        "bad.cfg:1: campaign.dense.step_deg: coarser than theta_r.step_deg = 0.1 deg\n"
        "bad.cfg:1: campaign.name = \"\": empty; give the campaign a name\n"
        "bad.cfg:1: campaign.theta_i_deg[1] = 5.0000001: is there already; each angle of incidence "
        "once\n"
        "bad.cfg:2: campaign.theta_i_deg[3] = 7: is there already; each angle of incidence once\n");
    campaign_complains(
        "campaign: { theta_i_deg = 1; readings: { count = 0; }; pol_out = \"unknown\";"
        " fit: { weights = \"dens\"; }; };",
        "bad.cfg:1: campaign.readings.count = 0: out of range; allowed 1..1000\n"
        "bad.cfg:1: campaign.pol_out = \"unknown\": unknown; allowed \"u\", \"s\", \"p\", \"+45\", "
        "\"-45\", \"R\", \"L\"\n"
        "bad.cfg:1: campaign.fit.weights = \"dens\": unknown; allowed \"uniform\", \"dense\", "
        "\"relative\", \"variance\"; did you mean \"dense\"?\n"
        "bad.cfg:1: campaign.name: missing; What the campaign is called.\n");
}

static void the_shipped_campaigns_are_right(void **state)
{
    (void)state;
    const char *const paths[] = {"configs/paper.cfg", "configs/demo.cfg"};
    for (int i = 0; i < 2; i++) {
        struct campaign_config c;
        struct said said = {0};
        char *text = NULL;
        assert_int_equal(
            campaign_config_load(paths[i], (struct cfg_sink){fixture_say, &said}, &c, &text), 0);
        assert_string_equal(said.text, "");
        assert_non_null(strstr(text, "theta_i_deg"));
        free(text);
    }
}

static void the_fit_is_asked_for_as_configured(void **state)
{
    (void)state;
    const struct campaign_config c = fixture_campaign(
        "campaign: { name = \"a\"; theta_i_deg = 1; dense: { half_width_deg = 7; weight = 4; };"
        " fit: { method = \"paper\"; weights = \"dense\"; diffuse = \"lambert\"; seed = 42; }; };");
    const struct fit_options o = campaign_fit_options(&c);
    assert_int_equal(o.method, FIT_PAPER);
    assert_int_equal(o.weighting, FIT_DENSE);
    assert_int_equal(o.diffuse, BRDF_DIFFUSE_LAMBERT);
    assert_true(o.seed == 42 && o.dense_g == 4);
    // An encoder that says 7.003 deg for the edge still means the edge.
    assert_true(o.dense_half_width_rad > units_rad(7.005) &&
                o.dense_half_width_rad < units_rad(7.02));
}

static void a_bench_is_read_whole(void **state)
{
    (void)state;
    const struct bench_config b = fixture_bench();
    assert_int_equal(b.axes_count, 2);
    assert_true(b.wavelength_nm == 1060 && b.regime == BENCH_UNDERFILLED && b.distance_mm == 500);
    assert_string_equal(b.axes[1].name, "theta_r");
    assert_true(b.axes[1].unit == 2 && b.axes[1].min == -180 && b.axes[1].backlash == 0 &&
                b.axes[1].zero == 0);
    assert_string_equal(b.axes[1].unit_name, "deg");
    assert_string_equal(b.buses[0].link, "modbus-rtu:/dev/ttyUSB0?baud=115200&parity=E");
    assert_int_equal(b.buses[0].timeout_ms, 200);
    assert_true(b.laser.power_w == 0.05 && b.laser.polarisation == POL_U);
    assert_true(b.detector.slope_db == 12 && b.detector.monitor_aux == 1 &&
                b.detector.u_linearity_rel == 0);
    assert_true(bench_find_station(&b, "beam")->theta_r_deg == 180);
    assert_null(bench_find_station(&b, "park"));
    assert_string_equal(b.directory, "");
    assert_true(fabs(bench_omega_sr(&b) - UNITS_PI * 64 / 250000) < 1e-15);
}

static void a_benchs_mistakes_name_their_lines(void **state)
{
    (void)state;
    bench_complains("\"theta_i\"", "\"theta_o\"",
                    "b.cfg:5: axes[0].name = \"theta_o\": unknown; allowed theta_i, theta_r, "
                    "sample; did you mean "
                    "'theta_i'?\nb.cfg:4: axes = ( ... ): axis 'theta_i' is missing\n");
    bench_complains("unit = 2", "unit = 1",
                    "b.cfg:7: axes[1].unit = 1: is the unit of axes[0] on that bus too\n");
    bench_complains("bus = \"axes\"; unit = 2", "bus = \"axis\"; unit = 2",
                    "b.cfg:7: axes[1].bus = \"axis\": no bus of that name in buses\n");
    bench_complains("min = -5.0; max = 88.0", "min = 88.0; max = -5.0",
                    "b.cfg:6: axes[0].min = 88: not below max = -5\n"
                    "b.cfg:13: stations[0].theta_i_deg = 0: beyond the limits of axis theta_i; "
                    "allowed 88..-5 deg\n");
    bench_complains("max = 180.0", "max = 170.0",
                    "b.cfg:13: stations[0].theta_r_deg = 180: beyond the limits of axis theta_r; "
                    "allowed -180..170 deg\n");
    bench_complains("name = \"beam\"", "name = \"baem\"",
                    "b.cfg:13: stations = ( ... ): station 'beam' is missing: where the detector "
                    "looks into the beam\n");
    bench_complains(
        "serial:/dev/ttyUSB1", "/dev/ttyUSB1",
        "b.cfg:9: laser.link = \"/dev/ttyUSB1\": allowed serial:PORT, tcp:HOST:PORT or "
        "usbtmc:VID:PID:SERIAL\n");
    bench_complains("serial:/dev/ttyUSB1", "usbtmc:1313:8072:P0001234", "");
    bench_complains("modbus-rtu:", "rtu:",
                    "b.cfg:3: buses[0].link = \"rtu:/dev/ttyUSB0?baud=115200&parity=E\": allowed "
                    "modbus-rtu:PORT or "
                    "modbus-tcp:HOST:PORT\n");
    bench_complains("slope_db = 12", "slope_db = 13",
                    "b.cfg:11: detector.slope_db = 13: allowed 6, 12, 18, 24 dB\n");
}

// A polarised laser measures f_00 + m f_01: no answer must never become "unpolarised".
static void the_lasers_polarisation_must_be_said(void **state)
{
    (void)state;
    bench_complains("  polarisation = \"u\"; };\n", "};\n",
                    "b.cfg:9: laser.polarisation: missing; Of the light on the sample; \"unknown\" "
                    "is an answer, and a "
                    "warning with every result.\n");
    bench_complains("polarisation = \"u\"", "polarisation = \"unknown\"", "");
}

static void polarisations_have_names(void **state)
{
    (void)state;
    assert_int_equal(polarisation_find("-45"), POL_MINUS45);
    assert_int_equal(polarisation_find("x"), -1);
    assert_string_equal(polarisation_name(POL_PLUS45), "+45");
    assert_string_equal(polarisation_name(POL_UNKNOWN), "unknown");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_minimal_campaign_is_two_lines),
        cmocka_unit_test(a_campaigns_mistakes_name_their_lines),
        cmocka_unit_test(the_shipped_campaigns_are_right),
        cmocka_unit_test(the_fit_is_asked_for_as_configured),
        cmocka_unit_test(a_bench_is_read_whole),
        cmocka_unit_test(a_benchs_mistakes_name_their_lines),
        cmocka_unit_test(the_lasers_polarisation_must_be_said),
        cmocka_unit_test(polarisations_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
