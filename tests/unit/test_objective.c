// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/objective.h"
#include "fit/kernel.h"
#include "fit/passes.h"
#include "fit/space.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

// The rows of golden_inplane.csv that golden_objective.csv was computed on.
static struct readings objective_readings(void)
{
    struct golden t;
    if (!golden_open(&t, "tests/golden/golden_inplane.csv"))
        fail_msg("no golden_inplane.csv: run the tests from the root of the repository");
    struct readings r = readings_new((size_t)t.rows);
    for (int i = 0; i < t.rows; i++)
        if (fabs(golden_at(&t, i, "n") - 5.345064) < 1e-9)
            readings_add(&r, golden_at(&t, i, "theta_i_deg"),
                         golden_at(&t, i, "theta_r_signed_deg"), golden_at(&t, i, "f00"));
    golden_close(&t);
    assert_int_equal(r.count, 340);
    return r;
}

static void delta_equals_the_reference(void **state)
{
    (void)state;
    struct readings r = objective_readings();
    struct fit_data data = readings_data(&r, false);
    struct golden t;
    assert_true(golden_open(&t, "tests/golden/golden_objective.csv"));
    for (int i = 0; i < t.rows; i++)
        for (int dense = 0; dense < 2; dense++) {
            struct brdf_params p = {golden_at(&t, i, "n"), golden_at(&t, i, "k"),
                                    golden_at(&t, i, "sigma"), golden_at(&t, i, "ks"),
                                    golden_at(&t, i, "kd")};
            struct fit_options o = fit_options_default();
            o.weighting = dense ? FIT_DENSE : FIT_UNIFORM;
            double delta = -1, want = golden_at(&t, i, dense ? "delta_g3" : "delta_g1");
            assert_int_equal(fit_delta(&data, &o, &p, &delta), 0);
            assert_near(delta, want, 1e-10 * want + 1e-25); // the first row is rounding alone
        }
    golden_close(&t);
    readings_free(&r);
}

static void dense_zone_includes_its_edges_forward_only(void **state)
{
    (void)state;
    struct readings r = readings_new(8);
    static const double tr[] = {35, 45, 34.999, 45.001, -40, 40, -35};
    for (int i = 0; i < 7; i++)
        readings_add(&r, 40, tr[i], 1);
    struct fit_data data = readings_data(&r, false);
    struct fit_options o = fit_options_default();
    o.weighting = FIT_DENSE;
    struct fit_set set;
    struct fit_control control = {.stop = false};
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    static const double g[] = {3, 3, 1, 1, 1, 3, 1};
    for (int i = 0; i < 7; i++)
        assert_near(set.all.f[i] * set.all.f[i] * set.g_scale, g[i], 1e-12);
    set_free(&set);
    readings_free(&r);
}

static void relative_and_variance_weights_are_the_inverse_squares(void **state)
{
    (void)state;
    struct readings r = readings_new(5);
    for (int i = 0; i < 5; i++) {
        readings_add(&r, 10 * i, 10, 0.1 + i);
        r.u[i] = 0.01 * (i + 1);
    }
    struct fit_data data = readings_data(&r, true);
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    o.weighting = FIT_VARIANCE;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    for (int i = 0; i < 5; i++) {
        assert_near(set.all.f[i] * set.all.f[i] * set.g_scale, pow(r.f[i] / r.u[i], 2), 1e-9);
        assert_near(set.u[i] * set.u[i] * set.g_scale, 1, 1e-12);
    }
    set_free(&set);
    o.weighting = FIT_RELATIVE;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    for (int i = 0; i < 5; i++)
        assert_near(set.all.f[i] * set.all.f[i] * set.g_scale, 1, 1e-12);
    set_free(&set);
    readings_free(&r);
}

// The vectorised kernel against the model, for every length of the last block.
static void kernel_sums_are_those_of_the_model(void **state)
{
    (void)state;
    struct readings all = objective_readings();
    static const struct brdf_params p[] = {{1.5, 0, .15, .9, .05},
                                           {1.3, 7.5, .02, 1, .01},
                                           {.4, 0, .5, .7, .1},
                                           {5.3, 5.3, .6, 1.2, 0}};
    for (size_t count = 5; count <= all.count; count = count < 20 ? count + 1 : count + 61)
        for (int j = 0; j < 4; j++) {
            struct readings r = all;
            r.count = count;
            struct fit_data data = readings_data(&r, false);
            struct fit_options o = fit_options_default();
            struct fit_control control = {.stop = false};
            struct fit_set set;
            struct kernel_gram gram, full;
            double x[FIT_PARAMS], rr = 0;
            assert_int_equal(set_compile(&data, &o, &control, &set), 0);
            space_of_params(&p[j], x);
            assert_true(passes_moments(&set, x, &control, &gram));
            assert_true(passes_gram(&set, x, &control, &full));
            for (size_t i = 0; i < count; i++)
                rr += pow(objective_residual(&set, &p[j], i), 2);
            assert_near(gram.m[KERNEL_R][KERNEL_R] / rr, 1, 1e-11);
            for (int a = KERNEL_A; a < KERNEL_COLUMNS; a++)
                for (int b = KERNEL_A; b < KERNEL_COLUMNS; b++)
                    assert_near(full.m[a][b], gram.m[a][b], 1e-13 * (1 + fabs(gram.m[a][b])));
            set_free(&set);
        }
    readings_free(&all);
}

// d r / d x by central differences of the residuals against the kernel's columns.
static void kernel_derivatives_are_those_of_the_model(void **state)
{
    (void)state;
    struct readings r = objective_readings();
    struct fit_data data = readings_data(&r, false);
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    static const struct brdf_params p[] = {
        {1.5, .1, .15, .9, .05}, {1.3, 7.5, .1, 1, .01}, {.8, .3, .3, .7, .1}};
    for (int j = 0; j < 3; j++)
        for (size_t at = 0; at < set.padded; at += KERNEL_BLOCK) {
            struct kernel_block b;
            double x[FIT_PARAMS];
            space_of_params(&p[j], x);
            size_t count = kernel_jacobian(&set, x, at, &b);
            for (int c = 0; c < FIT_PARAMS; c++)
                for (size_t i = 0; i < count && at + i < set.count; i++) {
                    double h = 1e-5, up[FIT_PARAMS], down[FIT_PARAMS];
                    memcpy(up, x, sizeof up);
                    memcpy(down, x, sizeof down);
                    up[c] += h;
                    down[c] -= h;
                    struct brdf_params high = space_params(up), low = space_params(down);
                    double slope = (objective_residual(&set, &low, at + i) -
                                    objective_residual(&set, &high, at + i)) / (2 * h);
                    assert_near(b.j[c][i], slope, 2e-7 * (1 + fabs(slope)));
                }
        }
    set_free(&set);
    readings_free(&r);
}

static void sample_is_a_reproducible_subset_in_order(void **state)
{
    (void)state;
    struct readings r = objective_readings();
    for (size_t i = 0; i < r.count; i++)
        r.f[i] = (double)((i + 1) * (i + 1)); // no two means alike
    struct fit_data data = readings_data(&r, false);
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set, a, b;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    assert_int_equal(set_sample(&set, 100, 5, &control, &a), 0);
    assert_int_equal(set_sample(&set, 100, 5, &control, &b), 0);
    assert_int_equal(a.count, 100);
    for (size_t i = 0, from = 0; i < a.count; i++, from++) {
        assert_near(a.all.f[i], b.all.f[i], 0);
        while (from < set.distinct.count && set.distinct.f[from] != a.all.f[i])
            from++;
        assert_true(from < set.distinct.count);
        assert_near(a.all.spec[i], set.distinct.spec[from], 0);
    }
    set_free(&a);
    set_free(&b);
    set_free(&set);
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(delta_equals_the_reference),
        cmocka_unit_test(dense_zone_includes_its_edges_forward_only),
        cmocka_unit_test(relative_and_variance_weights_are_the_inverse_squares),
        cmocka_unit_test(kernel_sums_are_those_of_the_model),
        cmocka_unit_test(kernel_derivatives_are_those_of_the_model),
        cmocka_unit_test(sample_is_a_reproducible_subset_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
