// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// Monitor, selectors and inputs in a bench file: what is right, what is a mistake and on which
// line.
#include "campaign_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define AXIS(name, unit)                                                                           \
    "  { name = \"" name "\"; driver = \"oriental-az\"; bus = \"axes\"; unit = " unit "; "         \
    "steps_per_unit = 1000.0; min = -190.0; max = 190.0; speed = 20.0; acceleration = 60.0; "      \
    "deadband = 0.003; }"

// "more" is line 8, the station's devices are the line after it.
static const char *bench(const char *aux, const char *more, const char *places)
{
    static char text[4000];
    snprintf(
        text, sizeof text,
        "bench: { name = \"b\"; wavelength_nm = 1060.0; aperture_radius_mm = 8.0;\n"
        "  u_aperture_radius_mm = 0.0; distance_mm = 500.0; u_distance_mm = 0.0; };\n"
        "buses: ( { name = \"axes\"; link = \"modbus-tcp:axes:502\"; } );\n"
        "axes: (\n" AXIS("theta_i", "1") "," AXIS(
            "theta_r",
            "2") " );\n"
                 "laser: { driver = \"cobolt-05\"; link = \"tcp:laser:1\"; power_w = 0.05;"
                 " warmup_s = 1.0; polarisation = \"u\"; };\n"
                 "detector: { driver = \"sr830\"; link = \"tcp:lockin:8000\"; time_constant_s = "
                 "0.001;"
                 " slope_db = 12; %s };\n%s\n"
                 "stations: ( { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; %s } );\n",
        aux, more, places);
    return text;
}

#define DEVICE(text) "devices: ( { " text " } );"
#define SHUTTER                                                                                    \
    "name = \"shutter\"; driver = \"thorlabs-sc10\"; link = \"tcp:s:1\"; use = \"shutter\"; "
#define WHEEL "name = \"nd\"; driver = \"thorlabs-fw102c\"; link = \"tcp:w:1\"; use = \"filter\"; "
#define DOOR "name = \"door\"; driver = \"my-door\"; use = \"inputs\"; "

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

static void all_of_them_arrive(void **state)
{
    (void)state;
    struct bench_config b = right(
        bench("",
              "monitor: { driver = \"thorlabs-pm100\"; link = \"tcp:m:1\"; full_scale = 2e-3; };"
              "devices: ( { " SHUTTER "position = \"open\"; darks = true; }, { " WHEEL
              "position = \"1\"; safe = \"6\"; }, { " DOOR "bus = \"axes\"; unit = 9; } );",
              "devices = ( { name = \"nd\"; position = \"2\"; transmission = 0.01; "
              "u_transmission = 0.0001; } );"));
    double u_rel;
    assert_string_equal(b.monitor.driver, "thorlabs-pm100");
    assert_true(b.monitor.full_scale == 2e-3);
    assert_int_equal(b.devices_count, 3);
    assert_true(b.devices[0].use == BENCH_SHUTTER && b.devices[0].darks);
    assert_string_equal(b.devices[0].safe, "");
    assert_true(b.devices[1].use == BENCH_FILTER && !b.devices[1].darks);
    assert_string_equal(b.devices[1].safe, "6");
    assert_true(b.devices[2].use == BENCH_INPUTS && b.devices[2].unit == 9);
    assert_string_equal(b.stations[0].places[0].position, "2");
    assert_int_equal(bench_device_index(&b, "nd"), 1);
    assert_int_equal(bench_device_index(&b, "wheel"), -1);
    assert_int_equal(bench_dark_shutter(&b), 0);
    assert_true(bench_beam_passes(&b, &u_rel) == 0.01 && fabs(u_rel - 0.01) < 1e-12);
    b = right(bench("", "", ""));
    assert_string_equal(b.monitor.driver, "");
    assert_int_equal(bench_dark_shutter(&b), -1);
    assert_true(bench_beam_passes(&b, &u_rel) == 1 && u_rel == 0);
}

static void a_monitor_is_one_thing(void **state)
{
    (void)state;
    wrong(bench("monitor_aux = 1;",
                "monitor: { driver = \"thorlabs-pm100\"; link = \"tcp:m:1\"; };", ""),
          "b.cfg:7: detector.monitor_aux = 1: the bench has a monitor of its own in group monitor; "
          "one or the other, write 0\n");
    wrong(bench("", "monitor: { link = \"tcp:m:1\"; };", ""),
          "b.cfg:8: monitor.driver: is missing\n");
    wrong(bench("", "monitor: { driver = \"thorlabs-pm100\"; link = \"modbus-tcp:m:1\"; };", ""),
          "b.cfg:8: monitor.link = \"modbus-tcp:m:1\": allowed serial:PORT, tcp:HOST:PORT or "
          "usbtmc:VID:PID:SERIAL\n");
}

static void mistakes_of_devices_name_their_lines(void **state)
{
    (void)state;
    static const struct {
        const char *more, *says;
    } cases[] = {
        {DEVICE(SHUTTER),
         "b.cfg:8: devices[0].position: where it stands while measuring is missing\n"},
        {DEVICE(WHEEL "position = \"1\"; darks = true;"),
         "b.cfg:8: devices[0].darks = true: only a shutter can make darks\n"},
        {DEVICE("name = \"laser\"; driver = \"x\"; link = \"tcp:s:1\"; use = \"other\"; position = "
                "\"1\";"),
         "b.cfg:8: devices[0].name = \"laser\": allowed a-z, 0-9, _ and -, and not laser, detector "
         "or monitor\n"},
        {DEVICE("name = \"theta_r\"; driver = \"x\"; link = \"tcp:s:1\"; use = \"other\"; position "
                "= \"1\";"),
         "b.cfg:8: devices[0].name = \"theta_r\": is the name of an axis too\n"},
        {DEVICE("name = \"nd\"; driver = \"x\"; bus = \"axes\"; unit = 9; use = \"filter\"; "
                "position = \"1\";"),
         "b.cfg:8: devices[0].bus = \"axes\": only inputs may be on a bus; give a link\n"},
        {DEVICE(DOOR "bus = \"axes\"; unit = 2;"),
         "b.cfg:8: devices[0].unit = 2: is the unit of another device on that bus too\n"},
        {DEVICE(DOOR "bus = \"axs\"; unit = 9;"),
         "b.cfg:8: devices[0].bus = \"axs\": no bus of that name in buses\n"},
        {DEVICE(DOOR "bus = \"axes\";"),
         "b.cfg:8: devices[0].unit: its address on the bus is missing; allowed 1..247\n"},
        {DEVICE(DOOR "bus = \"axes\"; unit = 9; link = \"tcp:d:1\";"),
         "b.cfg:8: devices[0].link = \"tcp:d:1\": a link or a bus, not both\n"},
        {DEVICE(DOOR), "b.cfg:8: devices[0].link: allowed serial:PORT, tcp:HOST:PORT or "
                       "usbtmc:VID:PID:SERIAL; or "
                       "give bus and unit\n"},
        {DEVICE(DOOR "link = \"tcp:d:1\"; position = \"open\";"),
         "b.cfg:8: devices[0].position = \"open\": inputs are only read\n"},
        {"devices: ( { " WHEEL "position = \"1\"; }, { " WHEEL "position = \"2\"; } );",
         "b.cfg:8: devices[1].name = \"nd\": is the name of another device too\n"},
        {"devices: ( { " SHUTTER "position = \"open\"; darks = true; },\n { name = \"two\"; driver "
         "= \"x\"; link = \"tcp:t:1\"; use = \"shutter\"; position = \"open\"; darks = true; } );",
         "b.cfg:9: devices[1].darks = true: another shutter makes the darks already\n"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        wrong(bench("", cases[i].more, ""), cases[i].says);
}

static void mistakes_of_stations_name_their_lines(void **state)
{
    (void)state;
    static const char devices[] = "devices: ( { " WHEEL "position = \"1\"; }, { " SHUTTER
                                  "position = \"open\"; }, { " DOOR "link = \"tcp:d:1\"; } );";
    wrong(bench("", devices, "devices = ( { name = \"shuter\"; position = \"open\"; } );"),
          "b.cfg:9: stations[0].devices[0].name = \"shuter\": no device of that name in devices; "
          "did you mean 'shutter'?\n");
    wrong(bench("", devices, "devices = ( { name = \"door\"; position = \"open\"; } );"),
          "b.cfg:9: stations[0].devices[0].name = \"door\": has no positions: it is only read\n");
    wrong(bench("", devices,
                "devices = ( { name = \"shutter\"; position = \"open\"; },"
                " { name = \"shutter\"; position = \"closed\"; } );"),
          "b.cfg:9: stations[0].devices[1].name = \"shutter\": is placed twice at one station\n");
    wrong(
        bench("", devices, "devices = ( { name = \"nd\"; position = \"2\"; } );"),
        "b.cfg:9: stations[0].devices[0].transmission: nd filters the beam: what it passes of it, "
        "over what it passes at \"1\", is missing; 1 when it stands before the monitor\n");
    right(bench("", devices, "devices = ( { name = \"nd\"; position = \"1\"; } );"));
}

// --- another day ---------------------------------------------------------------------------------

static struct bench_config full(void)
{
    return right(bench("",
                       "monitor: { driver = \"thorlabs-pm100\"; link = \"tcp:m:1\"; };"
                       "devices: ( { " WHEEL "position = \"1\"; }, { " DOOR
                       "link = \"tcp:d:1\"; } );",
                       "devices = ( { name = \"nd\"; position = \"2\"; transmission = 0.01; } );"));
}

static void refused(const struct bench_config *now, const char *says)
{
    const struct bench_config then = full();
    struct gon_error err;
    assert_int_equal(bench_same_devices(&then, now, &err), GON_E_REFUSED);
    if (!strstr(err.text, says))
        fail_msg("%s", err.text);
}

static void a_campaign_goes_on_with_what_makes_its_numbers(void **state)
{
    (void)state;
    const struct bench_config then = full();
    struct bench_config now = full();
    struct gon_error err;
    snprintf(now.monitor.link, sizeof now.monitor.link, "tcp:other:2");
    now.devices_count = 1; // no door any more
    assert_int_equal(bench_same_devices(&then, &now, &err), 0);
    now.monitor.driver[0] = 0;
    refused(&now, "a thorlabs-pm100 as monitor, the bench has none");
    now = full();
    snprintf(now.devices[0].position, sizeof now.devices[0].position, "3");
    refused(&now, "with nd at '1'");
    now = full();
    snprintf(now.stations[0].places[0].position, sizeof now.stations[0].places[0].position, "3");
    refused(&now, "with nd at '1'");
    now = full();
    now.devices_count = 0;
    refused(&now, "with nd at '1'");
    now = full();
    now.stations[0].places[0].transmission = 0.02;
    refused(&now, "passes 0.01, the bench's passes 0.02");
}

static void suspenders_arrive_and_their_mistakes_are_told(void **state)
{
    (void)state;
#define ROOM "devices: ( { " DOOR "bus = \"axes\"; unit = 9; } ); suspenders: ( { name = \"s\"; when = "
    struct bench_config b =
        right(bench("monitor_aux = 1;", ROOM "\"door.t_c > 25\"; }, { name = \"a\"; when = "
                                             "\"monitor_v < 1\"; resume = \"automatic\"; settle_s = 0.0; } );",
                    ""));
    assert_int_equal(b.suspenders_count, 2);
    assert_true(b.suspenders[0].resume == BENCH_MANUAL && b.suspenders[0].settle_s == 30);
    assert_true(b.suspenders[1].resume == BENCH_AUTOMATIC && b.suspenders[1].settle_s == 0);
    wrong(bench("", ROOM "\"doo.open\"; } );", ""),
          "b.cfg:8: suspenders[0].when = \"doo.open\": there is no value 'doo.open'; did you mean "
          "'door'?; allowed DEVICE.VALUE of the devices that are inputs, interlock_open, monitor_v, "
          "laser_power_w, disk_free_mb\n");
    wrong(bench("", ROOM "\"monitor_v < 1\"; } );", ""),
          "b.cfg:8: suspenders[0].when = \"monitor_v < 1\": the bench has no monitor\n");
    wrong(bench("", ROOM "\"door.open\"; resume = \"automatic\"; } );", ""),
          "b.cfg:8: suspenders[0].resume = \"automatic\": a door or an interlock never resumes by "
          "itself; write \"manual\"\n");
    wrong(bench("", ROOM "\"interlock_open\"; resume = \"automatic\"; } );", ""),
          "b.cfg:8: suspenders[0].resume = \"automatic\": a door or an interlock never resumes by "
          "itself; write \"manual\"\n");
    wrong(bench("", ROOM "\"disk_free_mb <\"; } );", ""),
          "b.cfg:8: suspenders[0].when = \"disk_free_mb <\": disk_free_mb is compared with '', which "
          "is no number\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_of_them_arrive),
        cmocka_unit_test(a_monitor_is_one_thing),
        cmocka_unit_test(mistakes_of_devices_name_their_lines),
        cmocka_unit_test(mistakes_of_stations_name_their_lines),
        cmocka_unit_test(a_campaign_goes_on_with_what_makes_its_numbers),
        cmocka_unit_test(suspenders_arrive_and_their_mistakes_are_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
