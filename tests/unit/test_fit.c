// SPDX-License-Identifier: MIT
// uses: fit model
// One test fits measured BRDFs beside the checkout, ../shared/real, when there; else skipped.
#include "fit/fit.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <time.h>

static const struct brdf_params paint = {1.5, 0.3, 0.2, 0.8, 0.1};

static struct readings measured(void)
{
    struct readings r = readings_paper();
    readings_measure(&r, &paint, 0.02, 1e-5, 17);
    return r;
}

static int run(const struct readings *r, const struct fit_options *o, struct fit_result *ret)
{
    struct fit_data data = readings_data(r, o->weighting == FIT_VARIANCE);
    return fit_run(&data, o, ret);
}

static void result_is_consistent_with_itself(void **state)
{
    (void)state;
    struct readings r = measured();
    for (int w = FIT_UNIFORM; w <= FIT_VARIANCE; w++)
        for (int diffuse = 0; diffuse < 2; diffuse++) {
            struct fit_options o = fit_options_default();
            struct fit_result f;
            double delta;
            o.weighting = (enum fit_weighting)w;
            o.diffuse = diffuse ? BRDF_DIFFUSE_LAMBERT : BRDF_DIFFUSE_PAPER;
            assert_int_equal(run(&r, &o, &f), 0);
            struct fit_data data = readings_data(&r, w == FIT_VARIANCE);
            assert_int_equal(fit_delta(&data, &o, &f.params, &delta), 0);
            assert_near(f.delta, delta, 0);
            assert_near(f.estimate[FIT_N].value, f.params.n, 0);
            assert_near(f.estimate[FIT_KD].value, f.params.kd, 0);
            assert_near(f.ks_r0.value,
                        f.params.ks * brdf_fresnel_mean(f.params.n, f.params.k, 0, 1), 1e-12);
            assert_near(f.dhr_45.value, brdf_dhr(&f.params, o.diffuse, golden_rad(45)), 0);
            assert_true(f.evaluations > 100 && f.elapsed_ms > 0 &&
                        f.elapsed_total_ms >= f.elapsed_ms);
            assert_true(isnan(f.chi2_per_dof) == (w != FIT_VARIANCE));
        }
    readings_free(&r);
}

static void same_seed_gives_the_same_result(void **state)
{
    (void)state;
    struct readings r = measured();
    struct fit_options o = fit_options_default();
    struct fit_result a, b;
    assert_int_equal(run(&r, &o, &a), 0);
    o.threads = 64; // changes nothing
    assert_int_equal(run(&r, &o, &b), 0);
    assert_memory_equal(&a.params, &b.params, sizeof a.params);
    assert_memory_equal(&a.estimate, &b.estimate, sizeof a.params);
    assert_memory_equal(&a.correlation, &b.correlation, sizeof a.correlation);
    assert_int_equal(a.evaluations, b.evaluations);
    readings_free(&r);
}

static void golden_data_recover_what_f00_identifies(void **state)
{
    (void)state;
    struct golden t;
    if (!golden_open(&t, "tests/golden/golden_fit_optima.csv"))
        fail_msg("no golden_fit_optima.csv: run the tests from the root of the repository");
    for (int i = 0; i < t.rows; i++) {
        char path[64];
        struct readings r = {.count = 0};
        struct fit_result f;
        snprintf(path, sizeof path, "tests/golden/golden_fit_%c.csv", 'a' + i / 2);
        assert_true(readings_load(&r, path, "f_r", 90));
        struct fit_options o = fit_options_default();
        o.weighting = i % 2 ? FIT_DENSE : FIT_UNIFORM;
        assert_int_equal(run(&r, &o, &f), 0);
        assert_near(f.delta / golden_at(&t, i, "delta_best"), 1, 1e-6);
        double n = golden_at(&t, i, "true_n"), k = golden_at(&t, i, "true_k");
        double ks = golden_at(&t, i, "true_ks");
        const struct fit_estimate *e = f.estimate;
        assert_near(e[FIT_SIGMA].value, golden_at(&t, i, "true_sigma"), 3 * e[FIT_SIGMA].u);
        assert_near(e[FIT_KD].value, golden_at(&t, i, "true_kd"), 3 * e[FIT_KD].u);
        assert_near(f.ks_r0.value, ks * brdf_fresnel_mean(n, k, 0, 1), 3 * f.ks_r0.u);
        assert_near(f.ks_r45.value, ks * brdf_fresnel_mean(n, k, 0.5, 0.5), 3 * f.ks_r45.u);
        assert_true(f.ks_r45.u < 0.02 * f.ks_r45.value); // and u is not just large
        assert_true(e[FIT_SIGMA].u < 0.01 * e[FIT_SIGMA].value);
        readings_free(&r);
    }
    golden_close(&t);
}

static bool has(const struct fit_result *f, enum fit_warning w, const char *part)
{
    char text[512];
    int length = fit_warning_text(f, w, text, sizeof text);
    assert_in_range(length, 20, sizeof text - 1);
    return (f->warnings & (unsigned)w) && strstr(text, part);
}

// Best known least squares of measured paints (40 starts elsewhere), theta_i <= 60 deg.
static void measured_paints_reach_the_best_known_delta(void **state)
{
    (void)state;
    static const struct {
        const char *file, *column;
        double delta;
    } paints[] = {{"garnet_red", "f_450nm", 0.0060}, {"garnet_red", "f_700nm", 0.0129},
                  {"krylon_blue", "f_550nm", 0.0525}, {"krylon_blue", "f_700nm", 0.0640}};
    for (int i = 0; i < 4; i++) {
        char path[96];
        struct readings r = {.count = 0};
        struct fit_result f;
        snprintf(path, sizeof path, "../shared/real/%s_inplane.csv", paints[i].file);
        if (!readings_load(&r, path, paints[i].column, 60)) {
            print_message("%s: no measured BRDFs beside the checkout\n", path);
            skip();
        }
        struct fit_options o = fit_options_default();
        assert_int_equal(run(&r, &o, &f), 0);
        if (f.delta > paints[i].delta)
            fail_msg("%s %s: Delta %.5f, known %.5f", paints[i].file, paints[i].column, f.delta,
                     paints[i].delta);
        assert_true(f.warnings & FIT_WARN_NOT_IDENTIFIED);
        if (i >= 2)
            assert_true(has(&f, FIT_WARN_N_BELOW_ONE, "below 1"));
        readings_free(&r);
    }
}

static void unidentified_and_unphysical_fits_are_said_to_be(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    struct fit_result f;
    readings_measure(&r, &(struct brdf_params){5.345064, 5.345064, 0.123451, 0.95, 0.092414}, 0.02,
                     1e-5, 1);
    assert_int_equal(run(&r, &o, &f), 0);
    assert_true(has(&f, FIT_WARN_DHR_ABOVE_ONE, "more than it receives"));
    assert_true(has(&f, FIT_WARN_NOT_IDENTIFIED, "n, k and ks"));
    assert_false(f.warnings & (FIT_WARN_FEW_SWEEPS | FIT_WARN_N_BELOW_ONE | FIT_WARN_MODEL_ERROR));
    o.upper.n = 2;
    assert_int_equal(run(&r, &o, &f), 0);
    assert_true(has(&f, FIT_WARN_AT_BOUND, "n = 2"));
    // A ripple of 3 % along theta_r is nothing that the model can follow, and no noise.
    for (size_t i = 0; i < r.count; i++)
        r.f[i] *= 1 + 0.03 * sin(20 * r.tr[i]);
    o.weighting = FIT_VARIANCE;
    assert_int_equal(run(&r, &o, &f), 0);
    assert_true(has(&f, FIT_WARN_MODEL_ERROR, "chi2"));
    assert_true(f.residual_lag1 > 0.1);
    o.weighting = FIT_RELATIVE;
    assert_int_equal(run(&r, &o, &f), 0);
    assert_true(has(&f, FIT_WARN_MODEL_ERROR, "smoother than noise"));
    readings_free(&r);
}

// A result of which only sigma, kd and ks R(45) matter here.
static struct fit_result told(bool sigma, bool kd, double u_ks_r45)
{
    struct fit_result r = {.ks_r45 = {0.04528, u_ks_r45}, .warnings = FIT_WARN_NOT_IDENTIFIED};
    r.estimate[FIT_N] = (struct fit_estimate){.value = 1.3, .u = 0.9};
    r.estimate[FIT_K] = (struct fit_estimate){.value = 2, .at_bound = true}; // held
    r.estimate[FIT_SIGMA] = (struct fit_estimate){.value = 0.15004, .u = 3e-4, .identified = sigma};
    r.estimate[FIT_KS] = (struct fit_estimate){.value = 0.9, .u = 0.02, .identified = true};
    r.estimate[FIT_KD] = (struct fit_estimate){.value = 0.00737, .u = 0.0051, .identified = kd};
    return r;
}

static void only_what_is_identified_is_to_be_used(void **state)
{
    (void)state;
    char text[600];
    struct fit_result r = told(true, true, 1.2e-4);
    fit_warning_text(&r, FIT_WARN_NOT_IDENTIFIED, text, sizeof text);
    assert_string_equal(text, "These readings do not separate n, k and ks (n = 1.30): use sigma = "
                              "0.15004, kd = 0.0074, ks R(45 deg) = 0.04528.");
    r = told(true, false, 0.02);
    fit_warning_text(&r, FIT_WARN_NOT_IDENTIFIED, text, sizeof text);
    assert_string_equal(text, "These readings do not separate n, k and ks (n = 1.30), nor do they "
                              "identify kd = 0.0074: use sigma = 0.15004.");
    r = told(true, true, (double)NAN);
    r.estimate[FIT_K] = (struct fit_estimate){.value = 0.4812, .u = 200}; // not "0"
    r.estimate[FIT_KS] = (struct fit_estimate){.value = 1.5e99, .u = 1e99};
    fit_warning_text(&r, FIT_WARN_NOT_IDENTIFIED, text, sizeof text);
    assert_non_null(strstr(text, "(n = 1.30, k = 0.48, ks = 1.5e+99): use sigma = 0.15004, kd = "));
    r = told(false, false, (double)NAN);
    fit_warning_text(&r, FIT_WARN_NOT_IDENTIFIED, text, sizeof text);
    assert_string_equal(text, "These readings do not separate n, k and ks (n = 1.30), nor do they "
                              "identify sigma = 0.15004, kd = 0.0074: use none of them.");
}

static void a_model_error_is_said_by_what_showed_it(void **state)
{
    (void)state;
    struct fit_result r = {.warnings = FIT_WARN_MODEL_ERROR,
                           .residual_lag1 = 0.02,
                           .residual_signs_z = 4.21,
                           .least_chi2_per_dof = 3.456,
                           .model_error = FIT_RESIDUALS_SIGNS};
    assert_true(has(&r, FIT_WARN_MODEL_ERROR,
                    "Residuals are of one sign in runs (neighbours share it more often than noise "
                    "would, by 4.2 standard deviations): the intervals hold noise only"));
    r.model_error = FIT_RESIDUALS_LARGE;
    assert_true(has(&r, FIT_WARN_MODEL_ERROR,
                    "larger than noise (chi2 per degree of freedom 3.46 with weights 1/u^2): the"));
    r.residual_lag1 = 0.4;
    r.model_error = FIT_RESIDUALS_LARGE | FIT_RESIDUALS_SMOOTH | FIT_RESIDUALS_SIGNS;
    assert_true(has(&r, FIT_WARN_MODEL_ERROR, "1/u^2), smoother than noise (neighbours correlate "
                                              "by 0.40): the intervals"));
}

static void a_bound_of_nature_is_not_to_be_widened(void **state)
{
    (void)state;
    char text[600];
    struct fit_result r = {.warnings = FIT_WARN_AT_BOUND};
    struct fit_estimate low = {.value = 0, .u = 0.1, .hi95 = 0.43, .at_bound = true};
    low.at_lower = true;
    r.estimate[FIT_K] = low;
    fit_warning_text(&r, FIT_WARN_AT_BOUND, text, sizeof text);
    assert_string_equal(text, "k = 0, the least it can be: the readings show no absorption (k up "
                              "to 0.43 is within the 95 % interval).");
    r.estimate[FIT_SIGMA] = (struct fit_estimate){.value = 0.6, .u = 0.1, .at_bound = true};
    r.estimate[FIT_KD] = low;
    r.estimate[FIT_KD].u = 0; // held there
    r.estimate[FIT_KD].at_lower = false;
    fit_warning_text(&r, FIT_WARN_AT_BOUND, text, sizeof text);
    assert_string_equal(text, "On a bound: sigma = 0.6; widen the bounds or measure more angles. "
                              "k = 0, the least it can be: the readings show no absorption (k up "
                              "to 0.43 is within the 95 % interval).");
    r = (struct fit_result){.warnings = FIT_WARN_AT_BOUND};
    r.estimate[FIT_N] = low;
    r.estimate[FIT_N].value = 1;
    fit_warning_text(&r, FIT_WARN_AT_BOUND, text, sizeof text);
    assert_string_equal(text, "n = 1, its lower bound: the readings want n below 1. Wider bounds "
                              "do not help: the model does not describe this sample.");
    r.estimate[FIT_N].value = 1.4; // somebody's choice
    fit_warning_text(&r, FIT_WARN_AT_BOUND, text, sizeof text);
    assert_string_equal(text, "On a bound: n = 1.4; widen the bounds or measure more angles.");
    assert_true(has(&r, FIT_WARN_AT_BOUND, "n = 1.4"));
}

static void neighbours_are_found_along_the_signed_angle(void **state)
{
    (void)state;
    struct readings r = measured();
    struct fit_options o = fit_options_default();
    struct fit_result f;
    o.weighting = FIT_RELATIVE;
    // 10 % more forward than backward: smooth along each sweep, alternating when the two are mixed.
    for (size_t i = 0; i < r.count; i++)
        r.f[i] *= r.dphi[i] > 1 ? 1.05 : 0.95;
    for (size_t i = r.count - 1; i > 0; i--) { // and whatever order they come in
        size_t j = (i * 7919) % (i + 1);
        double *array[] = {r.ti, r.tr, r.dphi, r.f, r.u};
        for (int a = 0; a < 5; a++) {
            double swap = array[a][i];
            array[a][i] = array[a][j];
            array[a][j] = swap;
        }
    }
    assert_int_equal(run(&r, &o, &f), 0);
    assert_true(f.residual_lag1 > 0.3);
    assert_true(f.warnings & FIT_WARN_MODEL_ERROR);
    readings_free(&r);
}

static void one_sweep_and_few_points_are_fitted_with_a_warning(void **state)
{
    (void)state;
    struct readings all = measured(), r = all;
    struct fit_options o = fit_options_default();
    struct fit_result f;
    for (r.count = 5; r.count <= 76;
         r.count += r.count < 9 ? 1 : 22) { // the first sweep is theta_i = 0
        assert_int_equal(run(&r, &o, &f), 0);
        assert_true(has(&f, FIT_WARN_FEW_SWEEPS, "3 angles"));
        assert_true(isfinite(f.delta) && isfinite(f.dhr_0.value));
        for (int i = 0; i < FIT_PARAMS;
             i++) // 5 readings leave no degree of freedom: documented NAN
            assert_true(isnan(f.estimate[i].u) == (r.count == 5) &&
                        isnan(f.estimate[i].lo95) == (r.count == 5));
        o.weighting = FIT_VARIANCE;
        assert_int_equal(run(&r, &o, &f), 0);
        for (int i = 0; i < FIT_PARAMS; i++)
            assert_true(isfinite(f.estimate[i].u) && isfinite(f.estimate[i].hi95));
        o.weighting = FIT_UNIFORM;
    }
    readings_free(&all);
}

// 100 times the same direction fits exactly, with a curvature of nothing: that is no knowledge.
static void one_direction_identifies_nothing(void **state)
{
    (void)state;
    enum { N = 100 };
    double i[N], r[N], d[N], f[N];
    for (int j = 0; j < N; j++) {
        i[j] = r[j] = 0.35;
        d[j] = 3.14159265358979;
        f[j] = 0.5;
    }
    const struct fit_data data = {
        .count = N, .theta_i_rad = i, .theta_r_rad = r, .dphi_rad = d, .f_per_sr = f};
    const struct fit_options o = fit_options_default();
    struct fit_result result;
    assert_int_equal(fit_run(&data, &o, &result), 0);
    for (int p = 0; p < FIT_PARAMS; p++)
        assert_false(result.estimate[p].identified);
    assert_true(result.warnings & FIT_WARN_NOT_IDENTIFIED);
}

static void bad_readings_have_their_stop_codes(void **state)
{
    (void)state;
    struct readings r = measured();
    struct fit_options o = fit_options_default();
    struct fit_result f = {.delta = 42};
    o.weighting = FIT_VARIANCE;
    static const struct {
        int array; // 0 theta_i, 1 theta_r, 2 dphi, 3 f, 4 u
        double value;
    } bad[] = {{0, -1e-9},       {0, 1.5707963267948966}, {0, (double)NAN}, {1, 1.6},
               {1, -0.1},        {1, (double)NAN},        {2, (double)NAN}, {2, (double)INFINITY},
               {3, (double)NAN}, {3, (double)INFINITY},   {4, 0},           {4, -1},
               {4, (double)NAN}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        double *array[] = {r.ti, r.tr, r.dphi, r.f, r.u}, *at = &array[bad[i].array][r.count - 1],
               keep = *at;
        *at = bad[i].value;
        assert_int_equal(run(&r, &o, &f), FIT_E_DATA);
        *at = keep;
    }
    o.weighting = FIT_RELATIVE;
    r.f[3] = 0;
    assert_int_equal(run(&r, &o, &f), FIT_E_DATA);
    o.weighting = FIT_UNIFORM;
    assert_int_equal(run(&r, &o, &f), FIT_OK);
    f.delta = 42;
    for (size_t i = 0; i < r.count; i++)
        r.f[i] = 0;
    assert_int_equal(run(&r, &o, &f), FIT_E_ALL_ZERO);
    r.count = 4;
    assert_int_equal(run(&r, &o, &f), FIT_E_FEW_POINTS);
    r.count = 0;
    assert_int_equal(run(&r, &o, &f), FIT_E_FEW_POINTS);
    assert_near(f.delta, 42, 0); // written only on success
    for (int stop = FIT_E_MEMORY; stop <= FIT_OK; stop++)
        assert_string_not_equal(fit_stop_text(stop), fit_stop_text(1));
    readings_free(&r);
}

static void bad_options_have_their_stop_code(void **state)
{
    (void)state;
    struct readings r = measured();
    for (int i = 0; i < 16; i++) {
        struct fit_options o = fit_options_default();
        struct fit_result f;
        switch (i) {
        case 0: o.lower.n = 3, o.upper.n = 2; break;
        case 1: o.lower.n = 0; break;
        case 2: o.lower.k = -1; break;
        case 3: o.lower.sigma = 0; break;
        case 4: o.upper.ks = (double)NAN; break;
        case 5: o.lower.kd = -0.1; break;
        case 6: o.upper.n = (double)INFINITY; break;
        case 7: o.threads = 0; break;
        case 8: o.threads = 65; break;
        case 9: o.u_scale = -1; break;
        case 10: o.weighting = FIT_DENSE, o.dense_g = 0; break;
        case 11: o.weighting = FIT_DENSE, o.dense_half_width_rad = (double)NAN; break;
        case 12: o.method = FIT_PAPER, o.paper.population = 5; break;
        case 13: o.method = FIT_PAPER, o.paper.bits = 31; break;
        case 14: o.method = FIT_PAPER, o.paper.pm = 1.1; break;
        case 15: o.weighting = (enum fit_weighting)9; break;
        }
        assert_int_equal(run(&r, &o, &f), FIT_E_OPTIONS);
    }
    struct fit_options o = fit_options_default();
    struct fit_data no_u = readings_data(&r, false);
    struct fit_result f;
    o.weighting = FIT_VARIANCE;
    assert_int_equal(fit_run(&no_u, &o, &f), FIT_E_OPTIONS);
    readings_free(&r);
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

struct stopper {
    long asked, stop_at;
    double last_ms, longest_ms;
};

static bool ask(void *ctx)
{
    struct stopper *s = ctx;
    double t = now_ms();
    if (s->asked++ > 0)
        s->longest_ms = fmax(s->longest_ms, t - s->last_ms);
    s->last_ms = t;
    return s->stop_at >= 0 && s->asked > s->stop_at;
}

static struct readings many(size_t count)
{
    struct readings some = measured(), r = readings_new(count);
    for (size_t i = 0; i < count; i++) {
        size_t j = i % some.count;
        r.ti[i] = some.ti[j];
        r.tr[i] = fmin(1.5, some.tr[j] + 1e-9 * (double)i);
        r.dphi[i] = some.dphi[j];
    }
    r.count = count;
    readings_measure(&r, &paint, 0.02, 1e-5, 5);
    readings_free(&some);
    return r;
}

// Not a benchmark: that the work between two questions is bounded by a number of readings, whatever
// the size, and the whole by a few hundred passes. A machine 30 times slower than the one measured
// still passes.
static void large_sets_are_fitted_and_can_be_canceled(void **state)
{
    (void)state;
    struct readings r = many(200000);
    struct fit_options o = fit_options_default();
    struct fit_result f;
    struct stopper s = {.stop_at = -1};
    o.weighting = FIT_VARIANCE;
    o.canceled = ask;
    o.cancel_ctx = &s;
    assert_int_equal(run(&r, &o, &f), 0);
    print_message(
        "200000 readings: %.0f ms, %.0f with uncertainties, %ld passes, longest unasked %.2f ms\n",
        f.elapsed_ms, f.elapsed_total_ms, f.evaluations, s.longest_ms);
    assert_near(f.params.sigma, paint.sigma, 4 * f.estimate[FIT_SIGMA].u);
    assert_near(f.params.kd, paint.kd, 4 * f.estimate[FIT_KD].u);
    assert_true(f.estimate[FIT_N].identified); // so many readings do separate n, k and ks
    assert_true(f.evaluations < 1500);
    long total = s.asked;
    assert_true(total > f.evaluations * 4);
    const long places[] = {0, 1, total / 9, total / 3, total / 2, total - 20, total - 1};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        struct stopper at = {.stop_at = places[i]};
        o.cancel_ctx = &at;
        f.delta = 42;
        assert_int_equal(run(&r, &o, &f), FIT_E_CANCELED);
        assert_near(f.delta, 42, 0);
        assert_true(at.asked <= at.stop_at + 2); // once told, it asks no more and returns
    }
    readings_free(&r);
}

static void small_sets_can_be_canceled_by_either_method(void **state)
{
    (void)state;
    struct readings r = measured();
    for (int method = 0; method < 2; method++) {
        struct fit_options o = fit_options_default();
        struct stopper s = {.stop_at = 3};
        struct fit_result f;
        o.method = method ? FIT_PAPER : FIT_MEMETIC;
        o.canceled = ask;
        o.cancel_ctx = &s;
        assert_int_equal(run(&r, &o, &f), FIT_E_CANCELED);
        assert_int_equal(s.asked, 4);
    }
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_is_consistent_with_itself),
        cmocka_unit_test(same_seed_gives_the_same_result),
        cmocka_unit_test(golden_data_recover_what_f00_identifies),
        cmocka_unit_test(measured_paints_reach_the_best_known_delta),
        cmocka_unit_test(unidentified_and_unphysical_fits_are_said_to_be),
        cmocka_unit_test(only_what_is_identified_is_to_be_used),
        cmocka_unit_test(a_model_error_is_said_by_what_showed_it),
        cmocka_unit_test(a_bound_of_nature_is_not_to_be_widened),
        cmocka_unit_test(neighbours_are_found_along_the_signed_angle),
        cmocka_unit_test(one_sweep_and_few_points_are_fitted_with_a_warning),
        cmocka_unit_test(bad_readings_have_their_stop_codes),
        cmocka_unit_test(one_direction_identifies_nothing),
        cmocka_unit_test(bad_options_have_their_stop_code),
        cmocka_unit_test(large_sets_are_fitted_and_can_be_canceled),
        cmocka_unit_test(small_sets_can_be_canceled_by_either_method),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
