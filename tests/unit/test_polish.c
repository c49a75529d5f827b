// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/polish.h"
#include "fit/kernel.h"
#include "fit/passes.h"
#include "fit/rng.h"
#include "fit/varpro.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static struct varpro solve(double aa, double ab, double bb, double af, double bf,
                           const double box[4])
{
    struct kernel_gram g = {.m = {{0}}};
    struct fit_space s = {{0}, {0}};
    double x[FIT_PARAMS] = {0};
    g.m[KERNEL_A][KERNEL_A] = aa;
    g.m[KERNEL_A][KERNEL_B] = g.m[KERNEL_B][KERNEL_A] = ab;
    g.m[KERNEL_B][KERNEL_B] = bb;
    g.m[KERNEL_A][KERNEL_R] = af;
    g.m[KERNEL_B][KERNEL_R] = bf;
    g.m[KERNEL_R][KERNEL_R] = 100;
    s.lower[FIT_KS] = box[0];
    s.upper[FIT_KS] = box[1];
    s.lower[FIT_KD] = box[2];
    s.upper[FIT_KD] = box[3];
    return varpro_solve(&g, x, &s);
}

// Random convex quadratics (seed 11) over random boxes against a grid: nothing on the grid is
// lower.
static void box_solution_is_not_beaten_by_a_grid(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, 11);
    for (int t = 0; t < 400; t++) {
        double a1 = rng_normal(&rng), a2 = rng_normal(&rng), b1 = rng_normal(&rng),
               b2 = rng_normal(&rng);
        if (t % 4 == 0) { // parallel columns
            b1 = 2 * a1;
            b2 = 2 * a2;
        }
        double aa = a1 * a1 + a2 * a2, ab = a1 * b1 + a2 * b2, bb = b1 * b1 + b2 * b2;
        double f1 = 2 * rng_normal(&rng), f2 = 2 * rng_normal(&rng);
        double af = a1 * f1 + a2 * f2, bf = b1 * f1 + b2 * f2;
        double box[4] = {rng_uniform(&rng), 0, rng_uniform(&rng), 0};
        box[1] = box[0] + (t % 5 ? rng_uniform(&rng) : 0); // sometimes a fixed parameter
        box[3] = box[2] + rng_uniform(&rng);
        struct varpro v = solve(aa, ab, bb, af, bf, box);
        assert_true(v.ks >= box[0] && v.ks <= box[1] && v.kd >= box[2] && v.kd <= box[3]);
        for (int i = 0; i <= 40; i++)
            for (int j = 0; j <= 40; j++) {
                double s = box[0] + (box[1] - box[0]) * i / 40,
                       d = box[2] + (box[3] - box[2]) * j / 40;
                double q = 100 + s * (aa * s + 2 * ab * d - 2 * af) + d * (bb * d - 2 * bf);
                if (q < v.q - 1e-9)
                    fail_msg("case %d: (%g, %g) gives %.12g, solution (%g, %g) %.12g", t, s, d, q,
                             v.ks, v.kd, v.q);
            }
    }
}

static void zero_columns_are_left_at_their_lower_bounds(void **state)
{
    (void)state;
    static const double box[4] = {0, 1.5, 0, 0.5};
    struct varpro v = solve(0, 0, 0, 0, 0, box);
    assert_near(v.ks, 0, 0);
    assert_near(v.kd, 0, 0);
    v = solve(0, 0, 4, 0, 1, box);
    assert_near(v.kd, 0.25, 1e-15);
    assert_near(v.q, 100 - 0.25, 1e-12);
}

static double reduced_q(const struct fit_set *set, const struct fit_space *space, const double *x)
{
    struct kernel_gram g;
    struct fit_control control = {.stop = false};
    assert_true(passes_moments(set, x, &control, &g));
    return varpro_solve(&g, x, space).q;
}

// 40 samples, many with their optimum on bounds of k or ks: at what the polish returns no
// coordinate can be moved to a lower q (steps of 1e-4 within the bounds), and polishing again gains
// nothing.
static void polish_ends_at_a_minimum_within_the_bounds(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct rng rng;
    rng_seed(&rng, 77);
    int on_bound = 0;
    for (int t = 0; t < 40; t++) {
        double k = 2.8 * rng_uniform(&rng);
        struct brdf_params p = {1.1 + 5 * rng_uniform(&rng), k * k,
                                0.03 * exp(2 * rng_uniform(&rng)), 0.3 + 1.2 * rng_uniform(&rng),
                                0.1 * rng_uniform(&rng)};
        readings_measure(&r, &p, 0.02, 1e-5, rng_next(&rng));
        struct fit_options o = fit_options_default();
        o.weighting = FIT_RELATIVE;
        struct fit_data data = readings_data(&r, false);
        struct fit_control control = {.stop = false};
        struct fit_set set;
        assert_int_equal(set_compile(&data, &o, &control, &set), 0);
        struct fit_space space = space_of_options(&o);
        struct fit_optimum at, again;
        space_of_params(&p, at.x);
        assert_true(polish(&set, &space, 200, &control, &at));
        for (int i = 0; i < 3; i++)
            for (int sign = -1; sign <= 1; sign += 2) {
                double x[FIT_PARAMS];
                memcpy(x, at.x, sizeof x);
                x[i] += sign * 1e-4;
                if (x[i] < space.lower[i] || x[i] > space.upper[i])
                    on_bound++;
                else if (reduced_q(&set, &space, x) < at.q * (1 - 1e-9))
                    fail_msg("sample %d: q falls along coordinate %d", t, i);
            }
        on_bound += at.x[FIT_KS] >= space.upper[FIT_KS];
        again = at;
        assert_true(polish(&set, &space, 200, &control, &again));
        assert_true(again.q > at.q * (1 - 1e-9));
        set_free(&set);
    }
    assert_true(on_bound > 10); // the samples do test what they are meant to
    readings_free(&r);
}

static void noiseless_readings_give_their_parameters_back(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    struct brdf_params p = {1.6, 0.4, 0.17, 0.8, 0.06};
    readings_measure(&r, &p, 0, 0, 1);
    struct fit_options o = fit_options_default();
    struct fit_data data = readings_data(&r, false);
    struct fit_control control = {.stop = false};
    struct fit_set set;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    struct fit_space space = space_of_options(&o);
    struct fit_optimum at;
    space_of_params(&(struct brdf_params){2, 0.1, 0.25, 1, 0}, at.x);
    assert_true(polish(&set, &space, 300, &control, &at));
    struct brdf_params got = space_params(at.x);
    assert_true(at.q / set.ff < 1e-20);
    assert_near(got.n, p.n, 1e-6);
    assert_near(got.k, p.k, 1e-6);
    assert_near(got.sigma, p.sigma, 1e-9);
    assert_near(got.ks, p.ks, 1e-6);
    assert_near(got.kd, p.kd, 1e-9);
    set_free(&set);
    readings_free(&r);
}

static void parameters_with_equal_bounds_are_held(void **state)
{
    (void)state;
    struct readings r = readings_paper();
    readings_measure(&r, &(struct brdf_params){1.6, 0.4, 0.17, 0.8, 0.06}, 0.02, 0, 1);
    struct fit_options o = fit_options_default();
    o.lower.n = o.upper.n = 1.7;
    o.lower.ks = o.upper.ks = 0.9;
    struct fit_data data = readings_data(&r, false);
    struct fit_control control = {.stop = false};
    struct fit_set set;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    struct fit_space space = space_of_options(&o);
    struct fit_optimum at;
    space_of_params(&(struct brdf_params){1.2, 0.1, 0.25, 1, 0}, at.x);
    assert_true(polish(&set, &space, 300, &control, &at));
    assert_near(at.x[FIT_N], 1.7, 0);
    assert_near(at.x[FIT_KS], 0.9, 0);
    assert_near(exp(at.x[FIT_SIGMA]), 0.17, 0.01);
    set_free(&set);
    readings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(box_solution_is_not_beaten_by_a_grid),
        cmocka_unit_test(zero_columns_are_left_at_their_lower_bounds),
        cmocka_unit_test(polish_ends_at_a_minimum_within_the_bounds),
        cmocka_unit_test(noiseless_readings_give_their_parameters_back),
        cmocka_unit_test(parameters_with_equal_bounds_are_held),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
