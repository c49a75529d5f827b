// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include "base/units.h"
#include "campaign/dataset.h"
#include "campaign/fitjson.h"
#include "campaign/reduce.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <sqlite3.h>

static struct fixture_folder folder;
static char path[128];

static int begin(void **state)
{
    (void)state;
    folder = fixture_folder();
    fixture_path(&folder, "0001-a.gonio", path, sizeof path);
    return 0;
}

static int end(void **state)
{
    (void)state;
    fixture_remove(&folder);
    return 0;
}

static const struct brdf_params truth = {.n = 1.5, .k = 0.02, .sigma = 0.15, .ks = 0.9, .kd = 0.05};

#define CAMPAIGN                                                                                   \
    "campaign: { name = \"a\"; theta_i_deg = (10, 30, 50); theta_r: { from_deg = -80; to_deg = "   \
    "80; step_deg = 10; };"                                                                        \
    " dense: { half_width_deg = 2; step_deg = 1; }; };"

// A campaign whose readings are the model's.
static struct store *measured(void)
{
    const struct campaign_config config = fixture_campaign(CAMPAIGN);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s;
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, CAMPAIGN, "c.cfg", &bench, FIXTURE_BENCH, &plan, 1, NULL, 0};
    assert_int_equal(store_create(path, &what, &s, NULL), 0);
    for (int i = 0; i < plan.count; i++) {
        const struct plan_point *p = &plan.points[i];
        const struct brdf_geometry g =
            brdf_geometry(units_rad(p->theta_i_deg), units_rad(fabs(p->theta_r_deg)),
                          p->theta_r_deg >= 0 ? UNITS_PI : 0);
        const double f = p->kind == PLAN_SAMPLE ? brdf_f00(&truth, BRDF_DIFFUSE_PAPER, &g) : 0;
        const double signal_v = p->kind == PLAN_DARK ? 0
                                : p->kind == PLAN_BEAM
                                    ? 1
                                    : f * bench_omega_sr(&bench) * cos(units_rad(p->theta_r_deg));
        const struct store_reading r = {.sweep = p->sweep,
                                        .point = p->point,
                                        .attempt = 1,
                                        .signal_v = signal_v,
                                        .signal_sd_v = 1e-8 + 1e-4 * signal_v,
                                        .monitor_v = p->kind == PLAN_DARK ? 0 : 1,
                                        .count = 4,
                                        .theta_i_udeg = (int32_t)units_udeg(p->theta_i_deg),
                                        .theta_r_udeg = (int32_t)units_udeg(p->theta_r_deg)};
        assert_int_equal(store_append_reading(s, &r, NULL), 0);
    }
    plan_clear(&plan);
    return s;
}

static void fitted(struct store *s, struct fit_record *ret_fit, struct reduction *ret_reduction)
{
    const struct dataset_filter all = dataset_filter_all();
    struct campaign_config c;
    struct dataset d;
    assert_int_equal(store_read_config(s, &c, NULL), 0);
    assert_int_equal(dataset_from_store(s, &all, &d, ret_reduction, NULL), 0);
    *ret_fit = (struct fit_record){.sweep = 3,
                                   .points = d.count,
                                   .options = campaign_fit_options(&c),
                                   .trace = "generation,best\n1,0.5\n"};
    ret_fit->options.u_scale = d.u_scale;
    const struct fit_data data = dataset_fit_data(&d);
    assert_int_equal(fit_run(&data, &ret_fit->options, &ret_fit->result), FIT_OK);
    dataset_clear(&d);
}

static double query(const char *sql)
{
    sqlite3 *db;
    sqlite3_stmt *q;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    if (sqlite3_prepare_v2(db, sql, -1, &q, NULL) != SQLITE_OK)
        print_error("%s\n", sqlite3_errmsg(db));
    assert_int_equal(sqlite3_step(q), SQLITE_ROW);
    const double value =
        sqlite3_column_type(q, 0) == SQLITE_NULL ? (double)NAN : sqlite3_column_double(q, 0);
    sqlite3_finalize(q);
    sqlite3_close(db);
    return value;
}

static void results_are_columns_and_views(void **state)
{
    (void)state;
    struct store *s = measured();
    struct fit_record fit;
    struct reduction r;
    int64_t reduction = 0, id = 0, ids[4];
    int sweeps[4];
    fitted(s, &fit, &r);
    assert_true(
        isnan(query("SELECT max(f_r) FROM reading_brdf"))); // nothing before a reduction is stored
    assert_int_equal(store_append_reduction(s, 5000, &r, &reduction, NULL), 0);
    fit.reduction = reduction;
    assert_int_equal(store_append_fit(s, 6000, &fit, &id, NULL), 0);
    assert_true(reduction == 1 && id == 1);
    assert_int_equal(store_read_fits(s, ids, sweeps, 4, NULL), 1);
    assert_true(ids[0] == 1 && sweeps[0] == 3);
    char *json = store_read_fit(s, -1), *none = store_read_fit(s, 2), *expected = fit_json(&fit, 0);
    assert_string_equal(json, expected);
    assert_null(none);
    free(json);
    free(expected);
    store_close(s, NULL);
    const int samples = (int)query("SELECT count(*) FROM plan WHERE kind = 'sample'");
    assert_int_equal(
        query("SELECT count(*) FROM reading_brdf WHERE f_r > 0 AND u_A > 0 AND u_B > 0"), samples);
    const double f =
        query("SELECT f_r FROM reading_brdf WHERE theta_i_deg = 30 AND theta_r_signed_deg = 31");
    const struct brdf_geometry g = brdf_geometry(units_rad(30), units_rad(31), UNITS_PI);
    assert_true(fabs(f / brdf_f00(&truth, BRDF_DIFFUSE_PAPER, &g) - 1) < 1e-9);
    assert_true(query("SELECT sigma FROM fit_result") == fit.result.params.sigma);
    assert_true(query("SELECT u_kd FROM fit_result") == fit.result.estimate[FIT_KD].u);
    assert_true(query("SELECT n_hi95 FROM fit_result") == fit.result.estimate[FIT_N].hi95);
    assert_true(query("SELECT sigma_identified FROM fit_result") == 1);
    assert_true(query("SELECT sigma_at_bound FROM fit_result") == 0);
    assert_true(query("SELECT k_at_bound FROM fit_result") == fit.result.estimate[FIT_K].at_bound);
    assert_true(query("SELECT ks_r45 FROM fit_result") == fit.result.ks_r45.value);
    assert_true(query("SELECT u_dhr_60 FROM fit_result") == fit.result.dhr_60.u);
    assert_int_equal(query("SELECT warnings FROM fit_result"), fit.result.warnings);
    assert_true(query("SELECT points FROM fit_result") == samples);
    assert_true(query("SELECT length(trace) FROM fit") == (double)strlen(fit.trace));
    assert_true(query("SELECT u_scale_rel FROM reduction") == r.u_scale_rel);
    assert_true(query("SELECT noise_floor_v FROM reduction") == r.noise.floor_v);
    assert_true(query("SELECT beam_signal_v FROM reduction") == 1);
    // The way back: exact readings give the parameters that the data identify.
    assert_true(fabs(fit.result.params.sigma / truth.sigma - 1) < 1e-3);
    assert_true(fabs(fit.result.params.kd / truth.kd - 1) < 1e-3);
    reduction_clear(&r);
}

static void a_new_reduction_leaves_the_old_one(void **state)
{
    (void)state;
    struct store *s = measured();
    struct reduction r;
    int64_t id = 0;
    assert_int_equal(reduce_campaign(s, &r, NULL), 0);
    assert_int_equal(store_append_reduction(s, 1, &r, &id, NULL), 0);
    for (int i = 0; i < r.count; i++)
        r.points[i].f_per_sr *= 2;
    assert_int_equal(store_append_reduction(s, 2, &r, &id, NULL), 0);
    assert_int_equal(id, 2);
    store_close(s, NULL);
    assert_true(query("SELECT sum(f_r_per_sr) FROM reduced WHERE reduction = 2") ==
                2 * query("SELECT sum(f_r_per_sr) FROM reduced WHERE reduction = 1"));
    assert_true(query("SELECT count(*) = (SELECT count(*) FROM plan WHERE kind = 'sample') FROM "
                      "reading_brdf") == 1);
    assert_true(query("SELECT sum(f_r) FROM reading_brdf") ==
                query("SELECT sum(f_r_per_sr) FROM reduced WHERE reduction = 2"));
    reduction_clear(&r);
}

static double number(const json_t *o, const char *key)
{
    const json_t *v = json_object_get(o, key);
    if (!json_is_number(v))
        print_error("%s is no number\n", key);
    assert_true(json_is_number(v));
    return json_number_value(v);
}

// The keys are a contract; numbers keep all their digits, and what is not a number is null.
static void the_json_of_a_fit_has_its_shape(void **state)
{
    (void)state;
    struct fit_record f = {
        .sweep = -1, .points = 850, .options = fit_options_default(), .note = "a note"};
    f.options.method = FIT_PAPER;
    f.options.weighting = FIT_RELATIVE;
    f.options.seed = 42;
    f.result.delta = 0.1;
    f.result.chi2_per_dof = (double)NAN;
    f.result.warnings = FIT_WARN_FEW_SWEEPS;
    for (int i = 0; i < FIT_PARAMS; i++)
        f.result.estimate[i] = (struct fit_estimate){.value = 1.0 / 3 + i,
                                                      .u = 0.01,
                                                      .lo95 = 0.3,
                                                      .hi95 = 0.4,
                                                      .identified = i == 2,
                                                      .at_bound = i == 3};
    f.result.dhr_45 = (struct fit_derived){1.0 / 7, 0.001};
    f.result.correlation[1][3] = -0.9998;
    f.result.evaluations = 12345;
    char *text = fit_json(&f, 0), *pretty = fit_json(&f, 2);
    assert_null(strchr(text, '\n'));
    assert_non_null(strchr(pretty, '\n'));
    json_t *o = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    assert_non_null(o);
    const char *const keys[] = {"method",       "weights",     "points",     "seed",
                                "delta",        "params",      "derived",    "correlation",
                                "chi2_per_dof", "evaluations", "elapsed_ms", "elapsed_total_ms",
                                "warnings"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        assert_non_null(json_object_get(o, keys[i]));
    assert_string_equal(json_string_value(json_object_get(o, "method")), "paper");
    assert_string_equal(json_string_value(json_object_get(o, "weights")), "relative");
    assert_true(number(o, "points") == 850 && number(o, "seed") == 42 && number(o, "delta") == 0.1);
    assert_true(json_is_null(json_object_get(o, "chi2_per_dof")) &&
                number(o, "evaluations") == 12345);
    const json_t *params = json_object_get(o, "params");
    const char *const names[] = {"n", "k", "sigma", "ks", "kd"};
    assert_int_equal(json_object_size(params), 5);
    for (int i = 0; i < FIT_PARAMS; i++) {
        const json_t *p = json_object_get(params, names[i]);
        assert_true(number(p, "value") == 1.0 / 3 + i && number(p, "u") == 0.01);
        assert_true(number(p, "lo95") == 0.3 && number(p, "hi95") == 0.4);
        assert_true(json_is_true(json_object_get(p, "identified")) == (i == 2));
        assert_true(json_is_true(json_object_get(p, "at_bound")) == (i == 3));
    }
    assert_true(number(json_object_get(json_object_get(o, "derived"), "dhr_45"), "value") ==
                1.0 / 7);
    assert_true(json_number_value(json_array_get(
                    json_array_get(json_object_get(o, "correlation"), 1), 3)) == -0.9998);
    const json_t *warnings = json_object_get(o, "warnings");
    assert_int_equal(json_array_size(warnings), 2);
    assert_string_equal(json_string_value(json_array_get(warnings, 1)), "a note");
    json_decref(o);
    free(text);
    free(pretty);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(results_are_columns_and_views),
        TEST(a_new_reduction_leaves_the_old_one),
        TEST(the_json_of_a_fit_has_its_shape),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
