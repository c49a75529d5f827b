// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/rng.h"
#include "model/batch.h"
#include "model/brdf.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <complex.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
enum { POINTS = 403, TRIALS = 400, SEED = 20081 };

struct directions {
    double ti[POINTS], tr[POINTS], dphi[POINTS];
};

// Anywhere, and where digits are lost: grazing, backscatter, specular, normal incidence.
static struct directions directions_new(struct rng *rng)
{
    struct directions d;
    for (int i = 0; i < POINTS; i++) {
        d.ti[i] = rng_uniform(rng) * 1.57;
        d.tr[i] = rng_uniform(rng) * 1.57;
        d.dphi[i] = rng_uniform(rng) < 0.5 ? PI : 2 * PI * rng_uniform(rng);
        if (i % 7 == 0) {
            d.ti[i] = d.tr[i] = PI / 2 - pow(10, -6 * rng_uniform(rng));
            d.dphi[i] = PI;
        } else if (i % 7 == 1) {
            d.tr[i] = d.ti[i];
            d.dphi[i] = 0;
        } else if (i % 7 == 2) {
            d.ti[i] = 0;
        }
    }
    return d;
}

static struct batch batch_at(const struct directions *d)
{
    struct batch b;
    assert_true(batch_new(POINTS, d->ti, d->tr, d->dphi, BRDF_DIFFUSE_PAPER, &b));
    return b;
}

static double between(struct rng *rng, double low, double high) // log uniform
{
    return low * pow(high / low, rng_uniform(rng));
}

// Anything, transparent, next to nothing, total reflection, metals.
static struct brdf_params params_at(struct rng *rng, int trial)
{
    struct brdf_params p = {between(rng, 0.2, 8), between(rng, 1e-8, 10), between(rng, 0.01, 0.6),
                            0.8, 0};
    switch (trial % 5) {
    case 0: break;
    case 1: p.k = 0; break;
    case 2:
        p.n = 1 + (rng_uniform(rng) < 0.5 ? -1 : 1) * between(rng, 1e-12, 0.1);
        p.k = rng_uniform(rng) < 0.5 ? 0 : between(rng, 1e-12, 0.1);
        break;
    case 3: p.n = 0.2 + 0.8 * rng_uniform(rng), p.k = 0; break;
    case 4: p.n = between(rng, 1, 1e3), p.k = between(rng, 1, 1e3); break;
    }
    return p;
}

// Not within rounding of the critical angle, and above the floor of the exponent.
static bool well_posed(const struct brdf_params *p, const struct brdf_geometry *g)
{
    double re = p->n * p->n - p->k * p->k - g->sin2_beta, im = 2 * p->n * p->k;
    return hypot(re, im) > 1e-8 && g->tan2_theta / (2 * p->sigma * p->sigma) < 690;
}

static int levels(void)
{
    return (int)batch_best_level() + 1;
}

static void values_are_those_of_the_model_at_every_level(void **state)
{
    (void)state;
    struct rng rng;
    double worst = 0, apart = 0;
    rng_seed(&rng, SEED);
    for (int trial = 0; trial < TRIALS; trial++) {
        struct directions d = directions_new(&rng);
        struct batch b = batch_at(&d);
        struct brdf_params p = params_at(&rng, trial);
        double f[BATCH_LEVELS][POINTS + BATCH_PAD];
        p.kd = trial % 3 ? 0 : 0.1;
        for (int l = 0; l < levels(); l++)
            batch_f00(&b, (enum batch_level)l, &p, f[l]);
        for (int i = 0; i < POINTS; i++) {
            struct brdf_geometry g = brdf_geometry(d.ti[i], d.tr[i], d.dphi[i]);
            if (!well_posed(&p, &g))
                continue;
            double want = brdf_f00(&p, BRDF_DIFFUSE_PAPER, &g);
            for (int l = 0; l < levels(); l++) {
                worst = fmax(worst, fabs(f[l][i] - want) / want);
                apart = fmax(apart, fabs(f[l][i] - f[0][i]) / want);
                if (!(worst <= 1e-12 && apart <= 1e-13))
                    fail_msg("%s: n %.17g k %.17g sigma %g at %.17g %.17g %.17g: %.17g, model "
                             "%.17g, %s %.17g",
                             batch_level_name((enum batch_level)l), p.n, p.k, p.sigma, d.ti[i],
                             d.tr[i], d.dphi[i], f[l][i], want, batch_level_name(BATCH_PLAIN),
                             f[0][i]);
            }
        }
        batch_free(&b);
    }
    print_message("seed %d, %d levels: within %.1e of the model, %.1e of each other\n", SEED,
                  levels(), worst, apart);
}

// F in complex numbers: analytic in n and kappa, so that the imaginary part of F(x + ih) is h F'(x)
// to the last digit (complex step, Squire and Trapp 1998).
static double complex fresnel(double complex n, double complex kappa, double c2)
{
    double s2 = 1 - c2;
    double complex above = (n - 1) * (n + 1) - kappa, im2 = 4 * n * n * kappa, re = above + c2;
    double complex m = csqrt(re * re + im2);
    double complex y = csqrt(2 * c2 * (creal(re) >= 0 ? m + re : im2 / (m - re)));
    double complex z = m * c2 + s2 * s2, s = m + c2 + y;
    return (above * above + im2) * z / (s * s * (z + y * s2));
}

static void jacobian_is_the_complex_step_at_every_level(void **state)
{
    (void)state;
    static const struct brdf_params all[] = {
        {1.5, 0.3, 0.2, 0.8, 0.1}, {1.3, 7.5, 0.1, 1, 0.05},         {0.7, 0.2, 0.4, 0.5, 0},
        {0.5, 1e-3, 0.3, 1, 0.1},  {5.345, 5.345, 0.12, 0.95, 0.09}, {1.0001, 1e-4, 0.15, 1, 0}};
    struct rng rng;
    double worst = 0, apart = 0;
    rng_seed(&rng, SEED);
    struct directions d = directions_new(&rng);
    struct batch b = batch_at(&d);
    double *column[BATCH_LEVELS][BATCH_COLUMNS];
    for (int l = 0; l < levels(); l++)
        for (int c = 0; c < BATCH_COLUMNS; c++)
            column[l][c] = test_malloc(b.padded * sizeof(double));
    for (size_t j = 0; j < sizeof all / sizeof all[0]; j++) {
        const struct brdf_params *p = &all[j];
        const double h = 1e-40, kappa = p->k * p->k, v = 1 / (2 * p->sigma * p->sigma);
        for (int l = 0; l < levels(); l++)
            batch_jacobian(&b, (enum batch_level)l, p, column[l]);
        for (size_t i = 0; i < POINTS; i++) {
            double c2 = b.cos_beta[i] * b.cos_beta[i],
                   height = b.spec[i] * v * exp(-v * b.tan2_theta[i]);
            double f = creal(fresnel(p->n, kappa, c2));
            double fn = cimag(fresnel(p->n + (double complex)I * h, kappa, c2)) / h;
            double fk = cimag(fresnel(p->n, kappa + (double complex)I * h, c2)) / h;
            const double want[BATCH_COLUMNS] = {p->ks * height * fn,
                                                p->ks * height * fk,
                                                p->ks * height * f * (2 * v * b.tan2_theta[i] - 2),
                                                height * f,
                                                b.diffuse[i],
                                                p->ks * height * f + p->kd * b.diffuse[i]};
            if (v * b.tan2_theta[i] > 690)
                continue;
            // What a derivative by n and kappa is the difference of.
            double w = pow((p->n - 1) * (p->n + 1) - kappa, 2) + 4 * p->n * p->n * kappa;
            double wn = 4 * p->n * (p->n * p->n + kappa - 1), wk = 2 * (p->n * p->n + kappa + 1);
            double size = p->ks * height * f;
            const double scale[BATCH_COLUMNS] = {fabs(want[0]) + size * fabs(wn / w),
                                                 fabs(want[1]) + size * fabs(wk / w),
                                                 size * (2 * v * b.tan2_theta[i] + 2),
                                                 want[3],
                                                 want[4],
                                                 want[5]};
            for (int c = 0; c < BATCH_COLUMNS; c++)
                for (int l = 0; l < levels(); l++) {
                    worst = fmax(worst, fabs(column[l][c][i] - want[c]) / scale[c]);
                    apart = fmax(apart, fabs(column[l][c][i] - column[0][c][i]) / scale[c]);
                    if (!(worst <= 1e-12 && apart <= 1e-13))
                        fail_msg("column %d, %s, set %zu, cos2 beta %.17g: %.17g, not %.17g", c,
                                 batch_level_name((enum batch_level)l), j, c2, column[l][c][i],
                                 want[c]);
                }
        }
    }
    print_message("within %.1e of the complex step, %.1e of each other\n", worst, apart);
    for (int l = 0; l < levels(); l++)
        for (int c = 0; c < BATCH_COLUMNS; c++)
            test_free(column[l][c]);
    batch_free(&b);
}

// Far from the peak of a narrow lobe, and on the critical angle.
static void floors_keep_everything_finite_and_normal(void **state)
{
    (void)state;
    const double ti[] = {0, 0.5, 1.5707963, 2 * asin(0.6), 0.1}, tr[] = {1.5, 0.5, 1.5707963, 0, 1};
    const double dphi[] = {0, PI, 0, 0, 1};
    static const struct brdf_params all[] = {{1.5, 0, 0.01, 1, 0}, {0.6, 0, 0.01, 1, 0},
                                             {0.6, 0, 0.5, 1, 0},  {1, 0, 0.5, 1, 0.1},
                                             {1e-6, 0, 0.5, 1, 0}, {1e6, 1e6, 0.5, 1, 0}};
    struct batch b;
    assert_true(batch_new(5, ti, tr, dphi, BRDF_DIFFUSE_PAPER, &b));
    double memory[BATCH_COLUMNS][BATCH_PAD], f[BATCH_PAD], *column[BATCH_COLUMNS];
    for (int c = 0; c < BATCH_COLUMNS; c++)
        column[c] = memory[c];
    for (size_t j = 0; j < sizeof all / sizeof all[0]; j++)
        for (int l = 0; l < levels(); l++) {
            batch_f00(&b, (enum batch_level)l, &all[j], f);
            batch_jacobian(&b, (enum batch_level)l, &all[j], column);
            for (int i = 0; i < 5; i++) {
                assert_true(all[j].n == 1 ? f[i] >= 0 : f[i] > DBL_MIN);
                for (int c = 0; c < BATCH_COLUMNS; c++)
                    assert_true(isfinite(column[c][i]));
            }
        }
    batch_free(&b);
}

// A step from k = 0 must see which way is downhill: at total reflection the slope by k^2 is large.
static void slope_at_k_zero_is_that_of_the_least_k(void **state)
{
    (void)state;
    double at_zero[3], at_least[3];
    struct batch_point zero = batch_point(0.6, 0, 1);
    struct batch_point least = batch_point(0.6, BATCH_K_LEAST * BATCH_K_LEAST, 1);
    batch_fresnel(&zero, 0.5, at_zero);
    batch_fresnel(&least, 0.5, at_least);
    assert_true(at_zero[2] < -1e5 && fabs(at_zero[2] / at_least[2] - 1) < 1e-3);
}

static void outside_the_domain_everything_is_nan(void **state)
{
    (void)state;
    const double ti[] = {0.1, -0.1, 1.6, 0.1}, tr[] = {0.2, 0.2, 0.2, (double)NAN}, dphi[4] = {0};
    struct batch b;
    double f[BATCH_PAD];
    assert_true(batch_new(4, ti, tr, dphi, BRDF_DIFFUSE_PAPER, &b));
    for (int l = 0; l < levels(); l++) {
        struct brdf_params p = {1.5, 0, 0.1, 1, 0.1};
        batch_f00(&b, (enum batch_level)l, &p, f);
        assert_true(isfinite(f[0]) && isnan(f[1]) && isnan(f[2]) && isnan(f[3]));
        p.n = -1;
        batch_f00(&b, (enum batch_level)l, &p, f);
        assert_true(isnan(f[0]));
        p = (struct brdf_params){1.5, 0, (double)NAN, 1, 0.1};
        batch_f00(&b, (enum batch_level)l, &p, f);
        assert_true(isnan(f[0]));
        p = (struct brdf_params){1.5, 0, 0.1, 2 * BRDF_STRENGTH_MAX, 0.1};
        batch_f00(&b, (enum batch_level)l, &p, f);
        assert_true(isnan(f[0]));
    }
    batch_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_are_those_of_the_model_at_every_level),
        cmocka_unit_test(jacobian_is_the_complex_step_at_every_level),
        cmocka_unit_test(floors_keep_everything_finite_and_normal),
        cmocka_unit_test(slope_at_k_zero_is_that_of_the_least_k),
        cmocka_unit_test(outside_the_domain_everything_is_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
