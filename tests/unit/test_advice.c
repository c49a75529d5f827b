// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/advice.h"
#include "fit/fit.h"
#include "fit/space.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static const struct brdf_params truth[] = {{1.5, 0.02, 0.15, 0.9, 0.05},
                                           {1.3, 7.5, 0.12, 1, 0.01},
                                           {5.345064, 5.345064, 0.123451, 0.95, 0.092414}};
static const struct noise noise = {0.02, 1e-5};

static void add_sweeps(struct readings *r, double from_deg, double to_deg)
{
    for (double ti = from_deg; ti <= to_deg; ti += 5)
        for (int i = -850; i <= 850; i += 5) {
            double tr = i / 10.0;
            bool dense = fabs(tr - ti) <= 5 && i % 10 == 0;
            if (tr != -ti && (i % 25 == 0 || dense))
                readings_add(r, ti, tr, 0);
        }
}

static struct advice_plan plan_of(const struct readings *r)
{
    return (struct advice_plan){.count = r->count,
                                .theta_i_rad = r->ti,
                                .theta_r_rad = r->tr,
                                .dphi_rad = r->dphi,
                                .channels = 1};
}

// Standard uncertainties in percent of the parameters, linear in k, no bounds.
static void percents(const struct advice_plan *plan, const struct brdf_params *p,
                     double ret[FIT_PARAMS])
{
    double x[FIT_PARAMS], info[FIT_PARAMS][FIT_PARAMS], c[FIT_PARAMS][FIT_PARAMS];
    struct fit_space wide = {.upper = {1e6, 1e6, 1e6, 1e6, 1e6}};
    space_of_params(p, x);
    advice_information(plan, x, BRDF_DIFFUSE_PAPER, &noise, info);
    covariance_combine(info, &wide, c);
    const double value[FIT_PARAMS] = {p->n, 2 * p->k * p->k, 1, p->ks, p->kd};
    for (int i = 0; i < FIT_PARAMS; i++)
        ret[i] = 100 * sqrt(c[i][i]) / value[i];
}

static enum brdf_state state_of(char letter)
{
    return letter == 's'   ? BRDF_STATE_S
           : letter == 'p' ? BRDF_STATE_P
           : letter == 'd' ? BRDF_STATE_PLUS45
                           : BRDF_STATE_U;
}

// A table of errors in percent of (n, k, sigma, ks, kd) by an independent program with a sampling
// of its own (850 readings for the ten sweeps, here 760), two digits: within 30 %, of which
// sampling and number of readings make 6 to 25 and rounding up to 25 for one-digit entries.
static void errors_are_those_of_an_independent_fisher_analysis(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int truth;
        const char *channels; // pairs of letters, in and out
        double last_theta_i_deg, want[FIT_PARAMS];
    } rows[] = {{"dielectric", 0, "uu", 60, {1.3, 3130, .16, 3.4, .11}},
                {"metal", 1, "uu", 60, {141, 91, .03, 3.9, .12}},
                {"paper's values", 2, "uu", 60, {35, 31, .06, 11, .11}},
                {"metal up to 80", 1, "uu", 80, {8.8, 8.6, .03, 1.0, .09}},
                {"metal, s and p laser", 1, "supu", 60, {33, 17, .02, .24, .08}},
                {"metal, ss and pp", 1, "sspp", 60, {33, 17, .02, .24, .08}},
                {"metal, ss and pp up to 80", 1, "sspp", 80, {3.8, 2.4, .02, .13, .07}},
                {"metal, 3x3", 1, "ssspsdpspppddsdpdd", 60, {1.1, .09, .01, .11, .03}}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct readings r = readings_paper();
        add_sweeps(&r, 65, rows[i].last_theta_i_deg);
        struct advice_plan plan = plan_of(&r);
        double u[FIT_PARAMS];
        plan.channels = 0;
        for (const char *c = rows[i].channels; *c; c += 2, plan.channels++) {
            plan.in[plan.channels] = state_of(c[0]);
            plan.out[plan.channels] = state_of(c[1]);
        }
        percents(&plan, &truth[rows[i].truth], u);
        print_message("%-28s %8.3g %8.3g %8.3g %8.3g %8.3g\n", rows[i].name, u[0], u[1], u[2], u[3],
                      u[4]);
        for (int p = 0; p < FIT_PARAMS; p++)
            assert_true(u[p] < 1.3 * rows[i].want[p] && u[p] > rows[i].want[p] / 1.3);
        readings_free(&r);
    }
}

static struct fit_result fit(const struct readings *r, const struct fit_options *o, bool with_u)
{
    struct fit_data data = readings_data(r, with_u);
    struct fit_result result;
    assert_int_equal(fit_run(&data, o, &result), 0);
    return result;
}

// 2 % and 1e-5: from u exactly, from the residuals of 760 readings within 4 sigma.
static void noise_is_that_of_the_data(void **state)
{
    (void)state;
    for (int t = 0; t < 3; t++) {
        struct readings r = readings_paper();
        readings_measure(&r, &truth[t], 0.02, 1e-3, 11);
        double x[FIT_PARAMS];
        space_of_params(&truth[t], x);
        struct fit_data data = readings_data(&r, true);
        struct noise found = noise_of(&data, BRDF_DIFFUSE_PAPER, x);
        assert_near(found.relative, 0.02, 1e-7);
        assert_near(found.floor_per_sr, 1e-3, 1e-7);
        data.u_per_sr = NULL;
        found = noise_of(&data, BRDF_DIFFUSE_PAPER, x);
        print_message("from residuals: %.4f and %.2e\n", found.relative, found.floor_per_sr);
        assert_near(found.relative, 0.02, 0.003);
        assert_near(
            hypot(found.floor_per_sr, 0.02 * truth[t].kd), // they part badly where kd is large
            hypot(1e-3, 0.02 * truth[t].kd), 3e-4);
        readings_free(&r);
    }
}

static const struct fit_advice *advice_of(const struct fit_result *f, enum fit_measurement what)
{
    for (int i = 0; i < f->advice_count; i++)
        if (f->advice[i].what == what)
            return &f->advice[i];
    return NULL;
}

// What is predicted for more sweeps is what a fit of the longer data says: the paper's sweeps and
// as many readings again from 65 to 80 deg, which are three copies of four sweeps less a few.
static void a_prediction_is_what_the_longer_data_give(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    o.weighting = FIT_VARIANCE;
    readings_measure(&r, &truth[1], 0.02, 1e-5, 5);
    struct fit_result before = fit(&r, &o, true);
    const struct fit_advice *a = advice_of(&before, FIT_MEASURE_GRAZING);
    assert_non_null(a);
    assert_near(a->first_theta_i_rad, golden_rad(65), 1e-9);
    assert_near(a->last_theta_i_rad, golden_rad(80), 1e-9);
    struct readings more = readings_new(4000);
    struct readings paper = readings_paper();
    for (size_t i = 0; i < paper.count; i++)
        readings_add(&more, paper.ti[i] / golden_rad(1), 0, 0), more.tr[i] = paper.tr[i],
                                                                more.dphi[i] = paper.dphi[i];
    while (more.count < 2 * r.count)
        add_sweeps(&more, 65, 80);
    readings_measure(&more, &before.params, 0.02, 1e-5, 6); // from where it was predicted
    double added = (double)(more.count - r.count) / (double)r.count;
    struct fit_result after = fit(&more, &o, true);
    for (int i = 0; i < FIT_PARAMS; i++) {
        double ratio = after.estimate[i].u / a->u[i] * sqrt((1 + added) / 2);
        print_message("u(%s): %.3g, predicted %.3g, then %.3g\n", fit_param_name((enum fit_param)i),
                      before.estimate[i].u, a->u[i], after.estimate[i].u);
        assert_true(ratio > 0.75 && ratio < 1.33);
    }
    readings_free(&more);
    readings_free(&paper);
    readings_free(&r);
}

static void the_best_comes_first_and_says_its_numbers(void **state)
{
    (void)state;
    for (int t = 0; t < 3; t++) {
        struct readings r = readings_paper();
        struct fit_options o = fit_options_default();
        o.weighting = FIT_VARIANCE;
        readings_measure(&r, &truth[t], 0.02, 1e-5, 3);
        struct fit_result f = fit(&r, &o, true);
        assert_int_equal(f.advice_count, FIT_MEASUREMENTS - 1);
        assert_null(advice_of(&f, FIT_MEASURE_NOTHING)); // the weights are 1/u^2
        assert_int_equal(f.advice_readings, r.count);
        for (int i = 0; i < f.advice_count; i++) {
            char text[300];
            const struct fit_advice *a = &f.advice[i];
            assert_true(a->gain > 0 && (i == 0 || a->gain <= a[-1].gain));
            assert_true(fit_advice_text(&f, i, text, sizeof text) < 300);
            assert_non_null(strstr(text, " -> "));
            for (int p = 0; p < FIT_PARAMS; p++)
                assert_true(a->u[p] > 0 && a->u[p] <= f.estimate[p].u * (1 + 1e-9));
        }
        // Repeating all helps by the square root of two at most; every other one helps n, k or ks
        // more.
        assert_int_equal(f.advice[f.advice_count - 1].what, FIT_MEASURE_AGAIN);
        assert_true(f.advice[f.advice_count - 1].gain <= log(2) / 2 + 1e-9);
        readings_free(&r);
    }
}

static void sweeps_that_were_measured_are_not_advised(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    add_sweeps(&r, 65, 80);
    struct fit_options o = fit_options_default();
    readings_measure(&r, &truth[1], 0.02, 1e-5, 3);
    struct fit_result f = fit(&r, &o, true);
    assert_null(advice_of(&f, FIT_MEASURE_GRAZING));
    assert_non_null(advice_of(&f, FIT_MEASURE_NOTHING)); // uniform weights
    readings_free(&r);
}

// Uniform weights lose most of what the readings know of kd; saying so costs no reading.
static void all_channels_of_the_data_are_known(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    unsigned char in[2000], out[2000];
    for (size_t i = 0; i < r.count; i++) { // all 49, the linear block last
        in[i] = (unsigned char)(BRDF_STATES - 1 - i % BRDF_STATES);
        out[i] = (unsigned char)(BRDF_STATES - 1 - i / BRDF_STATES % BRDF_STATES);
    }
    readings_measure(&r, &truth[1], 0.02, 1e-5, 3);
    struct fit_data d = readings_data(&r, true);
    struct fit_options o = fit_options_default();
    struct fit_result f;
    o.weighting = FIT_VARIANCE;
    d.pol_in = in;
    d.pol_out = out;
    assert_int_equal(fit_run(&d, &o, &f), 0);
    assert_null(advice_of(&f, FIT_MEASURE_LINEAR_3X3));
    assert_null(advice_of(&f, FIT_MEASURE_LASER_SP));
    assert_null(advice_of(&f, FIT_MEASURE_PARALLEL));
    readings_free(&r);
}

static void better_weights_are_advised_for_nothing(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    readings_measure(&r, &truth[1], 0.02, 1e-5, 3);
    struct fit_result uniform = fit(&r, &o, true);
    const struct fit_advice *a = advice_of(&uniform, FIT_MEASURE_NOTHING);
    o.weighting = FIT_VARIANCE;
    struct fit_result variance = fit(&r, &o, true);
    assert_true(uniform.estimate[FIT_KD].u > 20 * variance.estimate[FIT_KD].u);
    assert_near(a->u[FIT_KD] / variance.estimate[FIT_KD].u, 1, 0.2);
    assert_near(a->u[FIT_SIGMA] / variance.estimate[FIT_SIGMA].u, 1, 0.2);
    readings_free(&r);
}

static void advice_speaks_of_no_parameter_that_is_held(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    o.lower.n = o.upper.n = 1.5;
    o.lower.k = o.upper.k = 0.02;
    readings_measure(&r, &truth[0], 0.02, 1e-5, 3);
    struct fit_result f = fit(&r, &o, true);
    for (int i = 0; i < f.advice_count; i++) {
        char text[300];
        fit_advice_text(&f, i, text, sizeof text);
        assert_null(strstr(text, "u(n)"));
        assert_null(strstr(text, "u(k)"));
    }
    readings_free(&r);
}

static void nothing_is_advised_where_nothing_tells_noise(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    readings_measure(&r, &truth[1], 0.02, 1e-5, 3);
    r.count = 5;
    struct fit_result f = fit(&r, &o, false);
    assert_int_equal(f.advice_count, 0);
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_are_those_of_an_independent_fisher_analysis),
        cmocka_unit_test(noise_is_that_of_the_data),
        cmocka_unit_test(a_prediction_is_what_the_longer_data_give),
        cmocka_unit_test(the_best_comes_first_and_says_its_numbers),
        cmocka_unit_test(sweeps_that_were_measured_are_not_advised),
        cmocka_unit_test(all_channels_of_the_data_are_known),
        cmocka_unit_test(better_weights_are_advised_for_nothing),
        cmocka_unit_test(advice_speaks_of_no_parameter_that_is_held),
        cmocka_unit_test(nothing_is_advised_where_nothing_tells_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
