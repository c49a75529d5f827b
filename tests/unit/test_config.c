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
    assert_true(c.pol_in_count == 1 && c.pol_in[0] == POL_IN_LASER);
    assert_true(c.pol_out_count == 1 && c.pol_out[0] == POL_U);
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
                    "b.cfg:4: axes = ( ... ): axis 'theta_i' is missing, and no kinematics says "
                    "what makes it\n");
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

static void a_campaign_may_have_several_states(void **state)
{
    (void)state;
    struct campaign_channel channels[CAMPAIGN_CHANNELS];
#define STATES(more) "campaign: { name = \"a\"; theta_i_deg = 1;\n " more " };"
    struct campaign_config c =
        fixture_campaign(STATES("pol_in = (\"s\", \"p\"); pol_out = [\"u\", \"+45\"];"));
    assert_int_equal(campaign_channels(&c, channels), 4); // all of one pol_in before the next
    const int each[][2] = {
        {POL_S, POL_U}, {POL_S, POL_PLUS45}, {POL_P, POL_U}, {POL_P, POL_PLUS45}};
    for (int i = 0; i < 4; i++)
        assert_true(channels[i].in == each[i][0] && channels[i].out == each[i][1]);
    c = fixture_campaign(STATES("pol_in = (\"s\", \"p\", \"s\"); pol_out = (\"s\", \"p\", \"p\"); "
                                "pol_combine = \"pairs\";"));
    assert_int_equal(campaign_channels(&c, channels), 3);
    assert_true(channels[1].in == POL_P && channels[1].out == POL_P);
    assert_true(channels[2].in == POL_S && channels[2].out == POL_P);
    c = fixture_campaign(STATES(""));
    assert_int_equal(campaign_channels(&c, channels), 1);
    assert_true(channels[0].in == POL_IN_LASER && channels[0].out == POL_U);
    campaign_complains(
        STATES("pol_in = (\"s\", \"p\",\n \"s\", \"vertical\");"),
        "bad.cfg:3: campaign.pol_in[3] = \"vertical\": unknown; allowed \"u\", \"s\", \"p\", "
        "\"+45\", \"-45\", \"R\", \"L\", \"laser\"\n");
    campaign_complains(
        STATES("pol_in = (\"s\", \"p\",\n \"s\");\n pol_out = (\"u\", \"u\");"),
        "bad.cfg:3: campaign.pol_in[2] = \"s\": is there already; each state once\n"
        "bad.cfg:4: campaign.pol_out[1] = \"u\": is there already; each state once\n");
    campaign_complains(STATES("pol_in = (\"s\", \"p\");\n pol_combine = \"pairs\";"),
                       "bad.cfg:3: campaign.pol_combine = \"pairs\": pol_in has 2 and pol_out 1; "
                       "for pairs as many of each\n");
    campaign_complains(STATES("pol_in = (\"s\", \"s\"); pol_out = (\"p\", \"p\");\n"
                              " pol_combine = \"pairs\";"),
                       "bad.cfg:2: campaign.pol_in[1] = \"s\": with its pol_out is there already; "
                       "each pair once\n");
#undef STATES
}

static void a_benchs_states_are_read(void **state)
{
    (void)state;
    const struct bench_config b = fixture_polarised_bench();
    const struct bench_state *p = bench_find_state(&b.polarisation.pol_in, POL_P);
    assert_true(p && p->axes_count == 1 && p->axes[0].at == 90);
    assert_string_equal(p->axes[0].name, "polariser");
    assert_true(bench_find_state(&b.polarisation.pol_out, POL_U)->axes[0].at == 270);
    assert_null(bench_find_state(&b.polarisation.pol_in, POL_U));
    assert_true(b.polarisation.polariser_extinction == 0.002 && b.polarisation.extinction == 0.001);
    assert_true(b.polarisation.transmission == 0.8 && b.polarisation.u_transmission == 0.008);
    const struct bench_config plain = fixture_bench();
    assert_true(plain.polarisation.pol_in.count == 0 && plain.polarisation.transmission == 1);
}

static void states_complain(const char *old, const char *new, const char *expected)
{
    char text[4000], changed[4000];
    fixture_polarised_text(text, sizeof text);
    const char *at = strstr(text, old);
    assert_non_null(at);
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, new, at + strlen(old));
    struct bench_config b;
    struct said said = {0};
    int rc = bench_config_parse(changed, "b.cfg", (struct cfg_sink){fixture_say, &said}, &b);
    assert_string_equal(said.text, expected);
    assert_int_equal(rc, *expected ? GON_E_INPUT : GON_OK);
}

static void mistakes_in_states_name_their_lines(void **state)
{
    (void)state;
    states_complain(
        "{ is = \"p\"; axes = ( { name = \"polariser\"",
        "{ is = \"p\"; axes = ( { name = \"polarizer\"",
        "b.cfg:20: polarisation.pol_in[1].axes[0].name = \"polarizer\": no axis of that "
        "name in axes; did you mean 'polariser'?\n"
        "b.cfg:20: polarisation.pol_in[1].axes = ( ... ): does not say where axis "
        "polariser stands, as state \"s\" of this side does\n"
        "b.cfg:20: polarisation.pol_in[1].axes = ( ... ): places axis polarizer, and "
        "state \"s\" of this side does not say where that stands\n");
    states_complain("at = 270.0", "at = 300.0",
                    "b.cfg:21: polarisation.pol_out[0].axes[0].at = 300: beyond the limits of axis "
                    "analyser; allowed -10..280 deg\n");
    states_complain("{ is = \"p\"; axes = ( { name = \"analyser\"",
                    "{ is = \"s\"; axes = ( { name = \"analyser\"",
                    "b.cfg:23: polarisation.pol_out[2].is = \"s\": is there already, in "
                    "pol_out[1]\n");
    states_complain(
        "is = \"s\"", "is = \"vertical\"",
        "b.cfg:19: polarisation.pol_in[0].is = \"vertical\": unknown; allowed \"u\", \"s\", "
        "\"p\", \"+45\", \"-45\", \"R\", \"L\"\n");
    states_complain(
        "( { name = \"polariser\"; at = 90.0; } )",
        "( { name = \"polariser\"; at = 90.0; }, { name = \"polariser\"; at = 9.0; } )",
        "b.cfg:20: polarisation.pol_in[1].axes[1].name = \"polariser\": is placed twice "
        "in one state\n");
    states_complain("( { name = \"polariser\"; at = 90.0; } )", "( )",
                    "b.cfg:20: polarisation.pol_in[1].axes = ( ... ): an empty list; give at least "
                    "one group\n");
    states_complain("{ is = \"u\"; axes = ( { name = \"analyser\"; at = 270.0; } ); }",
                    "{ is = \"u\"; axes = ( { name = \"theta_r\"; at = 90.0; } ); }",
                    "b.cfg:21: polarisation.pol_out[0].axes[0].name = \"theta_r\": moves with the "
                    "directions; name an element's axis\n"
                    "b.cfg:22: polarisation.pol_out[1].axes = ( ... ): does not say where axis "
                    "theta_r stands, as state \"u\" of this side does\n"
                    "b.cfg:22: polarisation.pol_out[1].axes = ( ... ): places axis analyser, and "
                    "state \"u\" of this side does not say where that stands\n"
                    "b.cfg:23: polarisation.pol_out[2].axes = ( ... ): does not say where axis "
                    "theta_r stands, as state \"u\" of this side does\n"
                    "b.cfg:23: polarisation.pol_out[2].axes = ( ... ): places axis analyser, and "
                    "state \"u\" of this side does not say where that stands\n");
    states_complain("sample_mm = 30.0; }",
                    "sample_mm = 30.0; axes = ( { name = \"analyser\"; at = 0.0; } ); }",
                    "b.cfg:17: stations[0].axes[0].name = \"analyser\": stands as the states of "
                    "polarisation say, not where a station does\n");
    states_complain("transmission = 0.8", "transmission = 1.8",
                    "b.cfg:25: polarisation.analyser.transmission = 1.8: out of range; allowed "
                    "0.01..1\n");
}

static void an_axis_belongs_to_one_side(void **state)
{
    (void)state;
    char text[4000];
    struct bench_config b;
    struct said said = {0};
    fixture_polarised_text(text, sizeof text);
    for (char *at = text; (at = strstr(at, "{ name = \"polariser\"; at"));)
        memcpy(at, "{ name = \"analyser\" ; at", 24); // as long
    assert_int_equal(bench_config_parse(text, "b.cfg", (struct cfg_sink){fixture_say, &said}, &b),
                     GON_E_INPUT);
    assert_string_equal(said.text,
                        "b.cfg:21: polarisation.pol_out = ( ... ): axis analyser belongs "
                        "to pol_in already\n");
}

static void a_campaign_goes_on_with_the_same_states_only(void **state)
{
    (void)state;
    const struct bench_config then = fixture_polarised_bench();
    struct bench_config now = then;
    struct gon_error err;
    now.polarisation.u_transmission = 0.5; // a better calibration
    assert_int_equal(bench_same_states(&then.polarisation, &now.polarisation, &err), 0);
    now.polarisation.pol_out.state[2].axes[0].at = 91;
    assert_int_equal(bench_same_states(&then.polarisation, &now.polarisation, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "pol_out \"p\" elsewhere"));
    now = then;
    now.polarisation.pol_in.count = 1;
    assert_int_equal(bench_same_states(&then.polarisation, &now.polarisation, &err), GON_E_REFUSED);
    now = then;
    now.polarisation.transmission = 0.9;
    assert_int_equal(bench_same_states(&then.polarisation, &now.polarisation, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "passes 0.8"));
}

static void polarisations_have_names(void **state)
{
    (void)state;
    assert_int_equal(polarisation_find("-45"), POL_MINUS45);
    assert_int_equal(polarisation_find("x"), -1);
    assert_string_equal(polarisation_name(POL_PLUS45), "+45");
    assert_string_equal(polarisation_name(POL_UNKNOWN), "unknown");
    for (int i = 0; i < POL_COUNT; i++)
        assert_int_equal(polarisation_crossed(polarisation_crossed((enum polarisation)i)), i);
    assert_true(polarisation_passed(POL_S, POL_S) == 1 && polarisation_passed(POL_S, POL_P) == 0);
    assert_true(polarisation_passed(POL_U, POL_P) == 0.5 &&
                polarisation_passed(POL_R, POL_S) == 0.5);
    assert_true(polarisation_passed(POL_L, POL_U) == 1 && polarisation_passed(POL_L, POL_R) == 0);
}

static void a_bench_remembers_its_folder_and_profiles(void **state)
{
    struct bench_config b;
    char *text;
    (void)state;
    assert_int_equal(bench_config_load("configs/goniod.cfg", (struct cfg_sink){0}, &b, &text), 0);
    assert_string_equal(b.folder, "configs");
    assert_string_equal(b.laser.driver, "cobolt-05");
    assert_string_equal(b.detector.driver, "sr830");
    assert_string_equal(fixture_bench().folder, "");
    free(text);
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
        cmocka_unit_test(a_campaign_may_have_several_states),
        cmocka_unit_test(a_benchs_states_are_read),
        cmocka_unit_test(mistakes_in_states_name_their_lines),
        cmocka_unit_test(an_axis_belongs_to_one_side),
        cmocka_unit_test(a_campaign_goes_on_with_the_same_states_only),
        cmocka_unit_test(polarisations_have_names),
        cmocka_unit_test(a_bench_remembers_its_folder_and_profiles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
