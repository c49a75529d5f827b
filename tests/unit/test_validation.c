// SPDX-License-Identifier: MIT
// uses: campaign fit model base
// Sweeps held out of a fit, and what of bootstrap, hold-out and advice reaches the JSON.
#include "campaign/fitjson.h"
#include "fit/fit.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <jansson.h>
#include <string.h>

static const struct brdf_params paint = {1.5, 0.02, 0.15, 0.9, 0.05};

static void what_the_model_says_itself_is_described_perfectly(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct fit_options o = fit_options_default();
    struct fit_validation v;
    readings_measure(&r, &paint, 0, 0, 1);
    struct fit_data d = readings_data(&r, false);
    assert_int_equal(fit_validate(&d, &o, &paint, &v), 0);
    assert_int_equal(v.points, r.count);
    assert_true(v.delta < 1e-20 && v.rms_relative < 1e-10 && isnan(v.chi2_per_point));
    readings_free(&r);
}

// 10 % too much everywhere, u a fifth of the excess: by hand.
static void a_wrong_scale_is_what_it_is(void **state)
{
    (void)state;
    for (int weighting = FIT_UNIFORM; weighting <= FIT_VARIANCE; weighting++) {
        struct readings r = readings_paper();
        struct fit_options o = fit_options_default();
        struct fit_validation v;
        readings_measure(&r, &paint, 0, 0, 1);
        for (size_t i = 0; i < r.count; i++) {
            r.u[i] = 0.02 * r.f[i];
            r.f[i] *= 1.1;
        }
        o.weighting = (enum fit_weighting)weighting;
        struct fit_data d = readings_data(&r, true);
        assert_int_equal(fit_validate(&d, &o, &paint, &v), 0);
        assert_near(v.rms_relative, 0.1, 1e-9);
        assert_near(v.delta, 0.01 / 1.21, 1e-9);
        assert_near(v.chi2_per_point, 25, 1e-6);
        d.count = 4;
        assert_int_equal(fit_validate(&d, &o, &paint, &v), FIT_E_FEW_POINTS);
        readings_free(&r);
    }
}

static double at(const json_t *o, const char *key)
{
    const json_t *v = json_object_get(o, key);
    assert_true(json_is_number(v));
    return json_number_value(v);
}

static void the_json_holds_what_was_asked_for(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    readings_measure(&r, &paint, 0.02, 1e-5, 3);
    struct fit_data d = readings_data(&r, true);
    struct fit_record f = {.sweep = -1, .points = r.count, .options = fit_options_default()};
    for (int asked = 0; asked < 2; asked++) {
        f.options.bootstrap = asked ? 20 : 0;
        f.hold_out = (struct fit_hold_out){.count = asked, .theta_i_deg = {30}};
        f.hold_out.validation = (struct fit_validation){77, 0.5, (double)NAN, 0.25};
        assert_int_equal(fit_run(&d, &f.options, &f.result), 0);
        char *text = fit_json(&f, 0);
        json_t *o = json_loads(text, 0, NULL);
        const json_t *b = json_object_get(o, "bootstrap"), *h = json_object_get(o, "hold_out");
        const json_t *advice = json_object_get(o, "advice"), *best = json_array_get(advice, 0);
        assert_true(fabs(at(o, "residual_lag1")) < 0.2);
        assert_int_equal(json_array_size(advice), f.result.advice_count);
        assert_non_null(strstr(json_string_value(json_object_get(best, "text")), " -> "));
        assert_near(at(json_object_get(best, "u"), "n"), f.result.advice[0].u[FIT_N], 1e-15);
        assert_true((b != NULL) == asked && (h != NULL) == asked);
        if (asked) {
            const json_t *n = json_object_get(json_object_get(b, "params"), "n");
            assert_near(at(n, "u"), f.result.bootstrap.param[FIT_N].u, 1e-15);
            assert_near(at(b, "replicas"), 20, 0);
            assert_string_equal(json_string_value(json_object_get(b, "noise")), "parametric");
            at(json_object_get(json_object_get(b, "derived"), "ks_r45"), "hi95");
            assert_near(at(h, "points"), 77, 0);
            assert_near(at(h, "rms_relative"), 0.25, 0);
            assert_true(json_is_null(json_object_get(h, "chi2_per_point")));
            assert_near(json_number_value(json_array_get(json_object_get(h, "theta_i_deg"), 0)), 30,
                        0);
        }
        json_decref(o);
        free(text);
    }
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_the_model_says_itself_is_described_perfectly),
        cmocka_unit_test(a_wrong_scale_is_what_it_is),
        cmocka_unit_test(the_json_holds_what_was_asked_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
