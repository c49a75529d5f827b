// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// One test reads measured BRDFs beside the checkout, ../shared/real, when there; else skipped.
#include "campaign_fixture.h"

#include "base/units.h"
#include "campaign/csv.h"
#include "campaign/dataset.h"
#include "campaign/reduce.h"
#include "fit/rng.h"

#include <fcntl.h>
#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <time.h>

static char path[] = "/tmp/gonio-data-XXXXXX";

static int begin(void **state)
{
    (void)state;
    close(mkstemp(path));
    return 0;
}

static int end(void **state)
{
    (void)state;
    unlink(path);
    return 0;
}

static void put(const char *text)
{
    FILE *out = fopen(path, "w");
    fputs(text, out);
    fclose(out);
}

static struct dataset taken(const char *text, const char *column,
                            const struct dataset_filter *filter)
{
    const struct dataset_filter all = dataset_filter_all();
    struct dataset d = {0};
    struct gon_error err = {0};
    put(text);
    int rc = dataset_from_csv(path, column, filter ? filter : &all, &d, &err);
    if (rc < 0)
        print_error("%s\n", err.text);
    assert_int_equal(rc, 0);
    return d;
}

// The error's text, without the folder.
static void refused(const char *text, const char *column, const char *expected)
{
    const struct dataset_filter all = dataset_filter_all();
    struct dataset d;
    struct gon_error err = {0};
    char full[300];
    put(text);
    int rc = dataset_from_csv(path, column, &all, &d, &err);
    snprintf(full, sizeof full, "%s%s", path, expected);
    assert_string_equal(err.text, full);
    assert_int_equal(rc, GON_E_INPUT);
}

#define HEAD "theta_i_deg,theta_r_signed_deg,f_r\n"

static void signs_become_half_planes(void **state)
{
    (void)state;
    struct dataset d = taken(
        "theta_i_deg,theta_r_signed_deg,f_r\n10,20,0.5\n10,-20,0.25\n45,0,-1e-3\n", NULL, NULL);
    assert_int_equal(d.count, 3);
    assert_true(d.theta_i_rad[0] == units_rad(10) && d.theta_r_rad[0] == units_rad(20) &&
                d.dphi_rad[0] == UNITS_PI);
    assert_true(d.theta_r_rad[1] == units_rad(20) && d.dphi_rad[1] == 0);
    assert_true(d.dphi_rad[2] == UNITS_PI && d.f_per_sr[2] == -1e-3); // noise may be below zero
    assert_null(d.u_per_sr);
    assert_true(d.u_scale == 0);
    const struct fit_data f = dataset_fit_data(&d);
    assert_true(f.count == 3 && f.f_per_sr == d.f_per_sr && f.u_per_sr == NULL);
    dataset_clear(&d);
    d = taken("dphi_deg,f_r,theta_r_deg,theta_i_deg\n-90,1,30,40\n", NULL, NULL);
    assert_true(d.theta_i_rad[0] == units_rad(40) && d.theta_r_rad[0] == units_rad(30) &&
                d.dphi_rad[0] == units_rad(-90));
    dataset_clear(&d);
}

static void what_other_programs_write_is_fine(void **state)
{
    (void)state;
    struct dataset d =
        taken("\xef\xbb\xbf# made by\r\n\r\n \"theta_i_deg\" , theta_r_signed_deg,\"f_r\",note\r\n"
              "# 10,20\r\n10,20, 5E-1 ,\"a, b\"\r\n10,20,+.5,\r\n   \r\n10.0,20.,0.5,x",
              NULL, NULL);
    assert_int_equal(d.count, 3); // duplicates stay
    for (int i = 0; i < 3; i++)
        assert_true(d.f_per_sr[i] == 0.5 && d.theta_r_rad[i] == units_rad(20));
    dataset_clear(&d);
}

static void uncertainties_belong_to_their_column(void **state)
{
    (void)state;
    struct dataset d = taken("theta_i_deg,theta_r_signed_deg,f_r,u_f_r\n1,2,3,0.25\n", NULL, NULL);
    assert_true(d.u_per_sr && d.u_per_sr[0] == 0.25);
    dataset_clear(&d);
    const char *two = "theta_i_deg,theta_r_signed_deg,f_r,u_f_r,g,h,u_h\n1,2,3,0.25,4,5,0.5\n";
    d = taken(two, "g", NULL);
    assert_true(d.f_per_sr[0] == 4 && d.u_per_sr == NULL); // u_f_r is f_r's
    dataset_clear(&d);
    d = taken(two, "h", NULL);
    assert_true(d.f_per_sr[0] == 5 && d.u_per_sr[0] == 0.5);
    dataset_clear(&d);
    d = taken("theta_i_deg,theta_r_signed_deg,g,u_f_r\n1,2,3,0.25\n", "g", NULL);
    assert_true(d.u_per_sr && d.u_per_sr[0] == 0.25);
    dataset_clear(&d);
}

static void says(const char *text, const char *column, const char *expected)
{
    struct dataset d = taken(text, column, NULL);
    assert_string_equal(d.note, expected);
    dataset_clear(&d);
}

static void columns_that_look_misspelt_are_noted(void **state)
{
    (void)state;
    says("theta_i_deg,theta_r_signed_deg,f_r,polin\n10,2,3,s\n", NULL,
         "Column 'polin' is ignored; did you mean 'pol_in'?");
    says("theta_i_deg,theta_r_signed_deg,f_r,pol_in,polout\n10,2,3,s,s\n", NULL,
         "Column 'polout' is ignored; did you mean 'pol_out'?");
    says("theta_i_deg,theta_r_signed_deg,f_r,u_fr,pol_ni\n10,2,3,1,s\n", NULL,
         "Column 'u_fr' is ignored; did you mean 'u_f_r'? "
         "Column 'pol_ni' is ignored; did you mean 'pol_in'?");
    says("theta_i_deg,theta_r_signed_deg,f_450nm,u_f450nm\n10,2,3,1\n", "f_450nm",
         "Column 'u_f450nm' is ignored; did you mean 'u_f_450nm'?");
    // What belongs to another column, is used, or has nothing to do with it.
    says("theta_i_deg,theta_r_signed_deg,f_r,u_f_r,pol_in,pol_out\n10,2,3,1,s,u\n", NULL, "");
    says("theta_i_deg,theta_r_signed_deg,f_450nm,f_550nm,u_f_450nm\n10,2,3,4,1\n", "f_550nm", "");
    says("id,theta_i_deg,theta_r_signed_deg,f_r,point,note,n,unit,sweep,plane,u_theta_i_deg,time\n"
         "1,10,2,3,1,2,3,4,5,6,7,8\n",
         NULL, "");
}

static void angles_that_may_be_radians_are_noted(void **state)
{
    (void)state;
    const char *note = "All angles are below 1.6, and are read as degrees: are these radians?";
    says("theta_i_deg,theta_r_signed_deg,f_r\n0,-1.48,3\n1.0472,1.5,3\n", NULL, note);
    says("theta_i_deg,theta_r_signed_deg,f_r\n0,-1.48,3\n1.0472,1.7,3\n", NULL, "");
    says("theta_i_deg,theta_r_signed_deg,f_r\n0,0,3\n", NULL, "");
}

static void states_of_polarisation_are_read(void **state)
{
    (void)state;
    struct dataset d =
        taken("theta_i_deg,pol_in,theta_r_signed_deg,f_r,pol_out\n1,u,2,3,u\n1,+45,2,3,"
              "-45\n1,\"R\",2,3,L\n1,s,2,3,p\n",
              NULL, NULL);
    static const enum brdf_state in[] = {BRDF_STATE_U, BRDF_STATE_PLUS45, BRDF_STATE_R,
                                         BRDF_STATE_S},
                                 out[] = {BRDF_STATE_U, BRDF_STATE_MINUS45, BRDF_STATE_L,
                                          BRDF_STATE_P};
    const struct fit_data f = dataset_fit_data(&d);
    assert_int_equal(f.count, 4);
    for (int i = 0; i < 4; i++)
        assert_true(f.pol_in[i] == in[i] && f.pol_out[i] == out[i]);
    dataset_clear(&d);
    d = taken("theta_i_deg,pol_in,theta_r_signed_deg,f_r\n1,s,2,3\n", NULL, NULL);
    assert_true(d.pol_in[0] == BRDF_STATE_S && d.pol_out[0] == BRDF_STATE_U);
    dataset_clear(&d);
    d = taken("theta_i_deg,pol_in,theta_r_signed_deg,f_r,pol_out\n1,u,2,3,u\n", NULL, NULL);
    assert_true(!d.pol_in && !d.pol_out); // all unpolarised: nothing to tell
    dataset_clear(&d);
}

static void filters_choose_sweeps(void **state)
{
    (void)state;
    const char *text = "theta_i_deg,theta_r_signed_deg,f_r\n0,1,1\n30,1,2\n60,1,3\n60.5,1,4\n";
    struct dataset_filter f = dataset_filter_all();
    f.theta_i_max_deg = 60;
    struct dataset d = taken(text, NULL, &f);
    assert_true(d.count == 3 && d.left_out == 1);
    dataset_clear(&d);
    f = dataset_filter_all();
    f.theta_i_deg[f.theta_i_count++] = 60.5;
    f.theta_i_deg[f.theta_i_count++] = 0;
    d = taken(text, NULL, &f);
    assert_true(d.count == 2 && d.f_per_sr[0] == 1 && d.f_per_sr[1] == 4);
    dataset_clear(&d);
    f.without_deg[f.without_count++] = 0;
    d = taken(text, NULL, &f);
    assert_true(d.count == 1 && d.left_out == 3 && d.f_per_sr[0] == 4);
    dataset_clear(&d);
    f.theta_i_deg[0] = f.theta_i_deg[1] = 12;
    struct gon_error err;
    assert_int_equal(dataset_from_csv(path, NULL, &f, &d, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "excludes all 4"));
}

static void bad_fields_are_named_with_line_and_column(void **state)
{
    (void)state;
    refused(HEAD "1,2,3\n1,,3\n", NULL,
            ":3: theta_r_signed_deg = : an empty field; leave the row out or give a number");
    refused(HEAD "1,2,nan\n", NULL, ":2: f_r = nan: not a number");
    refused(HEAD "1,2,inf\n", NULL, ":2: f_r = inf: not a number");
    refused(HEAD "1,2,1e999\n", NULL, ":2: f_r = 1e999: too large");
    refused(HEAD "1,2,0x10\n", NULL, ":2: f_r = 0x10: not a number");
    refused(HEAD "1,2,3e\n", NULL, ":2: f_r = 3e: not a number");
    refused(HEAD "1,2,1 2\n", NULL, ":2: f_r = 1 2: not a number");
    refused(HEAD "# c\n\n1,2\n", NULL, ":4: 2 fields where the header names 3");
    refused(
        HEAD "1,2,0,5\n", NULL,
        ":2: 4 fields where the header names 3 (a decimal comma? numbers have a decimal point)");
    refused(HEAD "90,2,3\n", NULL,
            ":2: theta_i_deg = 90: out of range; allowed 0..90 (90 excluded) deg");
    refused(HEAD "-1,2,3\n", NULL,
            ":2: theta_i_deg = -1: out of range; allowed 0..90 (90 excluded) deg");
    refused(HEAD "1,-90,3\n", NULL,
            ":2: theta_r_signed_deg = -90: out of range; allowed -90..90 (both excluded) deg");
    refused("theta_i_deg,theta_r_deg,dphi_deg,f_r\n1,-2,180,3\n", NULL,
            ":2: theta_r_deg = -2: out of range; allowed 0..90 (90 excluded) deg");
    refused("theta_i_deg,theta_r_signed_deg,f_r,u_f_r\n1,2,3,0\n", NULL,
            ":2: u_f_r = 0: a standard uncertainty is above zero");
    refused("theta_i_deg,theta_r_signed_deg,f_r,pol_out\n1,2,3,u\n1,2,3,45\n", NULL,
            ":3: pol_out = 45: no state of polarisation; allowed u, s, p, +45, -45, R, L");
    refused("theta_i_deg,theta_r_signed_deg,f_r,pol_in\n1,2,3,unpolarised\n", NULL,
            ":2: pol_in = unpolarised: no state of polarisation; allowed u, s, p, +45, -45, R, L");
    refused("theta_i_deg,theta_r_signed_deg,f_r,pol_in\n1,2,3,\n", NULL,
            ":2: pol_in = : no state of polarisation; allowed u, s, p, +45, -45, R, L");
}

static void bad_files_are_refused(void **state)
{
    (void)state;
    refused("theta_i_deg,theta_r_signed_deg,f_450nm,f_550nm\n1,2,3,4\n", "f_45nm",
            ":1: no column 'f_45nm'; did you mean 'f_450nm'?");
    refused("theta_i_deg,theta_r_signed_deg,value\n1,2,3\n", NULL,
            ":1: no column 'f_r'; there are theta_i_deg, theta_r_signed_deg, value");
    refused("theta_i,theta_r_signed_deg,f_r\n1,2,3\n", NULL,
            ":1: no column 'theta_i_deg'; rename 'theta_i' to it");
    refused("theta_i,theta_r_deg,dphi_deg,f_r\n1,2,3,4\n", NULL,
            ":1: no column 'theta_i_deg'; rename 'theta_i' to it"); // theta_r_deg is no misspelling
    refused("theta_r_deg,dphi_deg,f_r\n1,2,3\n", NULL,
            ":1: no column 'theta_i_deg'; there are theta_r_deg, dphi_deg, f_r");
    refused("theta_i_deg,theta_r_signed_deg,fr\n1,2,3\n", NULL,
            ":1: no column 'f_r'; rename 'fr' to it");
    const char *const configurations[] = {"campaign: {\n", "campaign:\n{\n", "name = \"a, b\";\n",
                                          "theta_i_deg = (0, 10, 20);\n", "bench = {\n"};
    for (int i = 0; i < 5; i++)
        refused(configurations[i], NULL,
                ":1: this is no table but looks like a configuration; the first line must name the "
                "columns");
    refused("theta_i_deg,theta_r_deg,f_r\n1,2,3\n", NULL,
            ":1: no column 'dphi_deg'; there are theta_i_deg, theta_r_deg, f_r");
    refused("theta_i_deg,theta_r_signed_deg,f_r,f_r\n1,2,3,4\n", NULL,
            ":1: column 'f_r' is there twice");
    refused("theta_i_deg,theta_r_signed_deg,f_r,pol_in,pol_in\n1,2,3,s,s\n", NULL,
            ":1: column 'pol_in' is there twice"); // not taken for unpolarised
    refused("theta_i_deg,theta_r_signed_deg,f_r,u_f_r,u_f_r\n1,2,3,1,1\n", NULL,
            ":1: column 'u_f_r' is there twice");
    refused("theta_i_deg,theta_r_signed_deg,f_r\r1,2,3\r", NULL,
            ":1: a line ends with a carriage return alone; end lines with LF or CRLF");
    refused(HEAD "1,2,0\n1,3,-0.0\n", NULL, ": f_r is zero in all 2 rows");
    refused(HEAD, NULL, ": no data");
    refused("", NULL, ":1: empty; the first line must name the columns");
    refused("# only a comment\n", NULL, ":2: empty; the first line must name the columns");
    refused("theta_i_deg;theta_r_signed_deg;f_r\n1;2;0,5\n", NULL,
            ":1: fields are separated by ';' or tabs; use commas, and decimal points in numbers");
    struct gon_error err;
    struct dataset d;
    const struct dataset_filter all = dataset_filter_all();
    assert_int_equal(dataset_from_csv("/nowhere/x.csv", NULL, &all, &d, &err), GON_E_INPUT);
    assert_string_equal(err.text, "/nowhere/x.csv: No such file or directory");
    assert_int_equal(dataset_from_csv("/tmp", NULL, &all, &d, &err), GON_E_INPUT);
    int fd = open(path, O_WRONLY | O_TRUNC);
    assert_int_equal(write(fd, "a\0b", 3), 3);
    close(fd);
    assert_int_equal(dataset_from_csv(path, NULL, &all, &d, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "zero byte"));
}

// A file's text must not reach a terminal as commands: escape sequences, bells, C1 controls in
// UTF-8.
static void control_characters_are_not_repeated(void **state)
{
    (void)state;
    refused("theta_i_deg,theta_r_signed_deg,\x1b[31mred\x07\n1,2,3\n", NULL,
            ":1: no column 'f_r'; there are theta_i_deg, theta_r_signed_deg, ?[31mred?");
    refused("theta_i_deg,theta_r_signed_deg,f\xc2\x9b"
            "31m\xc3\xa9\n1,2,3\n",
            "v", ":1: no column 'v'; there are theta_i_deg, theta_r_signed_deg, f?31m\xc3\xa9");
    refused(HEAD "1,2,\x1b]0;title\x07\n", NULL, ":2: f_r = ?]0;title?: not a number");
    refused("theta_i_deg,theta_r_signed_deg,f_r,pol_in\n1,2,3,\x1b[2J\n", NULL,
            ":2: pol_in = ?[2J: no state of polarisation; allowed u, s, p, +45, -45, R, L");
    refused(HEAD "1,2,123456789012345678901234567890123456789\xc3\xa9 and more\n", NULL,
            ":2: f_r = 123456789012345678901234567890123456789...: not a number");
}

// Every number as strtod reads it, to the bit: short and long ones, edges of the fast way.
static void numbers_are_rounded_as_strtod_does(void **state)
{
    (void)state;
    const char *const fixed[] = {"9007199254740993",
                                 "9007199254740992e22",
                                 "1e22",
                                 "1e23",
                                 "1e-22",
                                 "1e-23",
                                 "0.1",
                                 "123456789012345678901234567890",
                                 "4.9e-324",
                                 "1.7976931348623157e308",
                                 "5e-400",
                                 "0.000000000000000000000000000001",
                                 "-0",
                                 "00012.50",
                                 "2.2250738585072011e-308"};
    struct rng g;
    char text[80];
    rng_seed(&g, 5);
    for (int i = 0; i < 20000; i++) {
        struct csv *c;
        double value;
        if (i < (int)(sizeof fixed / sizeof *fixed)) {
            snprintf(text, sizeof text, "x\n%s\n", fixed[i]);
        } else {
            const double v = (rng_uniform(&g) - 0.5) * pow(10, 60 * (rng_uniform(&g) - 0.5));
            snprintf(text, sizeof text, "x\n%.*g\n", 1 + (int)rng_below(&g, 20), v);
        }
        assert_int_equal(csv_parse(text, strlen(text), "t", &c, NULL), 0);
        assert_int_equal(csv_next(c, NULL), 1);
        assert_int_equal(csv_real(c, 0, &value, NULL), 0);
        const double expected = strtod(text + 2, NULL);
        assert_memory_equal(&value, &expected, sizeof value);
        csv_close(c);
    }
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// 200,000 rows of 45 bytes; the time is printed, and bounded only against something quadratic.
static void large_files_take_their_time_linearly(void **state)
{
    (void)state;
    enum { ROWS = 200000 };
    const struct dataset_filter all = dataset_filter_all();
    struct dataset d;
    FILE *out = fopen(path, "w");
    fputs("theta_i_deg,theta_r_signed_deg,f_r,u_f_r\n", out);
    for (int i = 0; i < ROWS; i++)
        fprintf(out, "%d,%.4f,%.9e,%.4e\n", i % 10 * 6, -85 + 170.0 * i / ROWS, 0.05 + 1e-7 * i,
                1e-4);
    fclose(out);
    const double start_s = now_s();
    assert_int_equal(dataset_from_csv(path, NULL, &all, &d, NULL), 0);
    const double elapsed_s = now_s() - start_s;
    print_message("%d rows in %.0f ms of processor time\n", ROWS, 1e3 * elapsed_s);
    assert_int_equal(d.count, ROWS);
    assert_true(elapsed_s < 10);
    dataset_clear(&d);
}

static void measured_paints_are_read(void **state)
{
    (void)state;
    const struct dataset_filter all = dataset_filter_all();
    struct dataset d;
    if (access("../shared/real/krylon_blue_inplane.csv", R_OK)) {
        print_message("../shared/real: no measured BRDFs beside the checkout\n");
        skip();
    }
    assert_int_equal(
        dataset_from_csv("../shared/real/krylon_blue_inplane.csv", "f_700nm", &all, &d, NULL), 0);
    assert_int_equal(d.count, 125);
    dataset_clear(&d);
    assert_int_equal(
        dataset_from_csv("../shared/real/garnet_red_all.csv", "f_450nm", &all, &d, NULL), 0);
    assert_int_equal(d.count, 1439);
    dataset_clear(&d);
}

// --- campaign files ------------------------------------------------------------------------------

#define CAMPAIGN                                                                                   \
    "campaign: { name = \"a\"; theta_i_deg = (0, 30, 60); theta_r: { from_deg = -60; to_deg = "    \
    "60; step_deg = 30; };"                                                                        \
    " dense: { half_width_deg = 0; }; %s };"

static struct store *measured_with(const struct fixture_folder *folder, const char *more,
                                   const char *bench_text)
{
    char text[600], file[128];
    snprintf(text, sizeof text, CAMPAIGN, more);
    const struct campaign_config config = fixture_campaign(text);
    struct bench_config bench;
    assert_int_equal(bench_config_parse(bench_text, "bench.cfg", (struct cfg_sink){0}, &bench), 0);
    struct plan plan;
    struct store *s;
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, text, "c.cfg", &bench, bench_text, &plan, 1, NULL, 0};
    assert_int_equal(
        store_create(fixture_path(folder, "0001-a.gonio", file, sizeof file), &what, &s, NULL), 0);
    for (int i = 0; i < plan.count; i++) {
        const struct plan_point *p = &plan.points[i];
        const double signal_v = p->kind == PLAN_DARK   ? 0
                                : p->kind == PLAN_BEAM ? 1
                                                       : 1e-4 * cos(units_rad(p->theta_r_deg));
        const struct store_reading r = {.sweep = p->sweep,
                                        .point = p->point,
                                        .attempt = 1,
                                        .signal_v = signal_v,
                                        .signal_sd_v = 1e-8,
                                        .monitor_v = p->kind == PLAN_DARK ? 0 : 1,
                                        .monitor_sd_v = 0,
                                        .count = 4,
                                        .theta_i_udeg =
                                            (int32_t)units_udeg(p->theta_i_deg - 0.0003),
                                        .theta_r_udeg = (int32_t)units_udeg(p->theta_r_deg)};
        assert_int_equal(store_append_reading(s, &r, NULL), 0);
    }
    plan_clear(&plan);
    return s;
}

static struct store *measured(const struct fixture_folder *folder, const char *more)
{
    return measured_with(folder, more, FIXTURE_BENCH);
}

static void a_campaign_becomes_a_data_set(void **state)
{
    (void)state;
    const struct fixture_folder folder = fixture_folder();
    struct store *s = measured(&folder, "");
    struct dataset_filter f = dataset_filter_all();
    struct dataset d;
    struct reduction r;
    assert_int_equal(dataset_from_store(s, &f, &d, &r, NULL), 0);
    assert_true(d.count == 15 && r.count == 15 && d.u_per_sr);
    assert_true(fabs(d.u_scale - r.u_scale_rel) < 1e-15 && d.u_scale > 0);
    for (size_t i = 0; i < d.count; i++)
        assert_true(fabs(d.f_per_sr[i] * r.omega_sr - 1e-4) < 1e-12);
    // An encoder at -0.0003 deg of incidence looks from the other side.
    assert_true(fabs(d.theta_i_rad[0] - units_rad(0.0003)) < 1e-12);
    assert_true(d.theta_r_rad[0] == units_rad(60) && d.dphi_rad[0] == UNITS_PI);
    assert_true(d.theta_r_rad[5] == units_rad(60) && d.dphi_rad[5] == 0);
    dataset_clear(&d);
    reduction_clear(&r);
    f.theta_i_deg[f.theta_i_count++] = 30; // nominal
    assert_int_equal(dataset_from_store(s, &f, &d, NULL, NULL), 0);
    assert_true(d.count == 5 && d.left_out == 10);
    dataset_clear(&d);
    store_close(s, NULL);
    fixture_remove(&folder);
}

static void a_campaign_tells_its_channel(void **state)
{
    (void)state;
    const struct fixture_folder folder = fixture_folder();
    const struct dataset_filter f = dataset_filter_all();
    struct store *s = measured(&folder, "pol_in = \"s\"; pol_out = \"+45\";");
    struct dataset d;
    assert_int_equal(dataset_from_store(s, &f, &d, NULL, NULL), 0);
    assert_true(d.pol_in && d.pol_out);
    for (size_t i = 0; i < d.count; i++)
        assert_true(d.pol_in[i] == BRDF_STATE_S && d.pol_out[i] == BRDF_STATE_PLUS45);
    assert_string_equal(d.note, "");
    dataset_clear(&d);
    store_close(s, NULL);
    fixture_remove(&folder);
}

static void every_row_has_its_own_states(void **state)
{
    (void)state;
    const struct fixture_folder folder = fixture_folder();
    struct dataset_filter f = dataset_filter_all();
    char text[4000];
    struct store *s = measured_with(&folder, "pol_in = (\"s\", \"p\"); pol_out = (\"u\", \"p\");",
                                    fixture_polarised_text(text, sizeof text));
    struct dataset d;
    const int states[4][2] = {{BRDF_STATE_S, BRDF_STATE_U},
                              {BRDF_STATE_S, BRDF_STATE_P},
                              {BRDF_STATE_P, BRDF_STATE_U},
                              {BRDF_STATE_P, BRDF_STATE_P}};
    assert_int_equal(dataset_from_store(s, &f, &d, NULL, NULL), 0);
    assert_true(d.count == 60 && d.pol_in && d.pol_out);
    for (size_t i = 0; i < d.count; i++)
        assert_true(d.pol_in[i] == states[i / 5 % 4][0] && d.pol_out[i] == states[i / 5 % 4][1]);
    dataset_clear(&d);
    f.theta_i_deg[f.theta_i_count++] = 30;
    assert_int_equal(dataset_from_store(s, &f, &d, NULL, NULL), 0);
    assert_true(d.count == 20 && d.left_out == 40);
    assert_true(fabs(d.f_per_sr[0] * UNITS_PI * 0.016 * 0.016 - 1e-4) < 1e-9);
    assert_true(fabs(d.f_per_sr[5] / d.f_per_sr[0] * 0.8 - 1) < 1e-9); // over T
    dataset_clear(&d);
    store_close(s, NULL);
    fixture_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(signs_become_half_planes),
        cmocka_unit_test(what_other_programs_write_is_fine),
        cmocka_unit_test(uncertainties_belong_to_their_column),
        cmocka_unit_test(columns_that_look_misspelt_are_noted),
        cmocka_unit_test(angles_that_may_be_radians_are_noted),
        cmocka_unit_test(states_of_polarisation_are_read),
        cmocka_unit_test(filters_choose_sweeps),
        cmocka_unit_test(bad_fields_are_named_with_line_and_column),
        cmocka_unit_test(bad_files_are_refused),
        cmocka_unit_test(control_characters_are_not_repeated),
        cmocka_unit_test(numbers_are_rounded_as_strtod_does),
        cmocka_unit_test(large_files_take_their_time_linearly),
        cmocka_unit_test(measured_paints_are_read),
        cmocka_unit_test(a_campaign_becomes_a_data_set),
        cmocka_unit_test(a_campaign_tells_its_channel),
        cmocka_unit_test(every_row_has_its_own_states),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
