// SPDX-License-Identifier: MIT
// uses: model
#include "model/brdf.h"
#include "tests/unit/golden.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define PI 3.14159265358979323846

static const struct brdf_params mirror = {1, 1e9, 0.1, 1, 0}; // Fresnel reflectance 1 within 1e-9

// The definition, by midpoints in theta_r and dphi: slow, and shares nothing with model/dhr.c.
static double brute_force(const struct brdf_params *p, double theta_i_rad, int rings, int sectors)
{
    double sum = 0;
    for (int i = 0; i < rings; i++) {
        double tr = (i + 0.5) / rings * (PI / 2), ring = 0;
        for (int j = 0; j < sectors; j++) {
            struct brdf_geometry g = brdf_geometry(theta_i_rad, tr, (j + 0.5) / sectors * PI);
            ring += brdf_f00(p, BRDF_DIFFUSE_PAPER, &g);
        }
        sum += ring * cos(tr) * sin(tr);
    }
    return sum * (PI / 2 / rings) * (2 * PI / sectors);
}

static void dhr_equals_brute_force(void **state)
{
    (void)state;
    static const struct {
        struct brdf_params p;
        double theta_i_deg;
    } at[] = {{{1, 1e9, .3, 1, 0}, 45},      {{1, 1e9, .6, 1, 0}, 60},
              {{1.5, 0, .1, 1, 0}, 60},      {{1.5, 0, .3, .9, .05}, 75},
              {{1.3, 7.5, .12, 1, .01}, 45}, {{5.345, 5.345, .123451, .95, .0924}, 60},
              {{.72, 0, .2, 1, 0}, 20},      {{.4, .1, .15, 1, 0}, 50}};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        double ti = golden_rad(at[i].theta_i_deg);
        double got = brdf_dhr(&at[i].p, BRDF_DIFFUSE_PAPER, ti);
        // Midpoints twice, the h^2 error taken out (Richardson); the kinks leave some 1e-7.
        double coarse = brute_force(&at[i].p, ti, 360, 180),
               fine = brute_force(&at[i].p, ti, 720, 360);
        double want = fine + (fine - coarse) / 3;
        if (fabs(got - want) > 1e-6)
            fail_msg("case %zu: %.9f, brute force %.9f", i, got, want);
    }
}

static void perfect_mirror_reflects_all_when_smooth(void **state)
{
    (void)state;
    // At theta_i = 0 shadowing begins at a slope of tan 30 deg; the rest is one-dimensional:
    // integral 2 v rho exp(-v rho^2) min(1, 4/(1 + rho^2) - 2) d rho, by adaptive quadrature
    // elsewhere.
    static const double want[][2] = {{.01, 1},           {.05, 1},
                                     {.1, 0.9999999975}, {.123451, 0.9999988312},
                                     {.3, 0.9495532310}, {.6, 0.5638721105}};
    for (size_t i = 0; i < sizeof want / sizeof *want; i++) {
        struct brdf_params p = mirror;
        p.sigma = want[i][0];
        assert_near(brdf_dhr(&p, BRDF_DIFFUSE_PAPER, 0), want[i][1], 1e-6);
    }
}

// A smooth mirror reflects all from everywhere: shadowing begins at a slope of tan(30 deg -
// theta_i/3), 7 sigma or more here, so that 1 is exact to 1e-9, the mirror's own loss.
static void perfect_mirror_reflects_all_from_all_sides(void **state)
{
    (void)state;
    double worst = 0;
    for (double sigma = 0.01; sigma < 0.036; sigma += 0.005)
        for (double deg = 0; deg <= 45; deg += 5) {
            struct brdf_params p = mirror;
            p.sigma = sigma;
            const double dhr = brdf_dhr(&p, BRDF_DIFFUSE_PAPER, golden_rad(deg));
            worst = fmax(worst, fabs(dhr - 1));
            if (fabs(dhr - 1) > 1e-6)
                fail_msg("sigma %g, theta_i %g deg: %.9f", sigma, deg, dhr);
        }
    print_message("mirror: off 1 by %.2g\n", worst);
}

static void dhr_of_a_smooth_surface_is_fresnel_s(void **state)
{
    (void)state;
    struct brdf_params p = {1.5, 0, 0.01, 1, 0};
    for (double deg = 0; deg <= 60; deg += 15) {
        double s = sin(golden_rad(deg));
        double fresnel = brdf_fresnel_mean(p.n, p.k, s * s, 1 - s * s);
        assert_near(brdf_dhr(&p, BRDF_DIFFUSE_PAPER, golden_rad(deg)), fresnel, 2e-4);
    }
}

static void dhr_near_grazing_incidence_is_converged(void **state)
{
    (void)state;
    // From a nested 2400 x 2000-point quadrature over slopes, written separately.
    static const double want[][3] = {
        {.05, 85, 0.494028368}, {.3, 89.9, 0.407957913}, {.01, 89.9, 0.934644556}};
    for (size_t i = 0; i < 3; i++) {
        struct brdf_params p = {1.5, 0, want[i][0], 1, 0};
        assert_near(brdf_dhr(&p, BRDF_DIFFUSE_PAPER, golden_rad(want[i][1])), want[i][2], 1e-6);
    }
}

static void dhr_follows_total_reflection(void **state)
{
    (void)state;
    // n < 1, where the reflectance has a square root's edge, sharp or rounded a little by k. From
    // 6000 x 6000 midpoints over the hemisphere, written separately.
    static const struct {
        struct brdf_params p;
        double theta_i_deg, want;
    } at[] = {{{.573492, 0, .215573, 1, 0}, 45.3574, .77704583},
              {{.41034, .00219401, .227964, 1, 0}, 12.1213, .39327764},
              {{.725138, 0, .214878, 1, 0}, 28.5103, .09709337}};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        assert_near(brdf_dhr(&at[i].p, BRDF_DIFFUSE_PAPER, golden_rad(at[i].theta_i_deg)),
                    at[i].want, 5e-7);
}

static void diffuse_albedo_of_both_forms(void **state)
{
    (void)state;
    struct brdf_params p = {1.5, 0, 0.1, 0, 0.092414};
    assert_near(brdf_dhr(&p, BRDF_DIFFUSE_PAPER, golden_rad(75)), 1.1217, 1e-4); // erratum 9
    assert_near(brdf_dhr(&p, BRDF_DIFFUSE_LAMBERT, golden_rad(75)), 0.092414, 1e-15);
}

static void the_papers_own_fit_violates_energy_conservation(void **state)
{
    (void)state;
    struct brdf_params p = {5.345064, 5.345064, 0.123451, 0.95, 0.092414};
    // Erratum 17; the digits are from 2000 x 1000 midpoints over the hemisphere.
    static const double want[][2] = {{0, .945200}, {45, 1.053462}, {60, 1.189449}, {70, 1.411509}};
    for (size_t i = 0; i < 4; i++)
        assert_near(brdf_dhr(&p, BRDF_DIFFUSE_PAPER, golden_rad(want[i][0])), want[i][1], 1.5e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dhr_equals_brute_force),
        cmocka_unit_test(perfect_mirror_reflects_all_when_smooth),
        cmocka_unit_test(perfect_mirror_reflects_all_from_all_sides),
        cmocka_unit_test(dhr_of_a_smooth_surface_is_fresnel_s),
        cmocka_unit_test(dhr_near_grazing_incidence_is_converged),
        cmocka_unit_test(dhr_follows_total_reflection),
        cmocka_unit_test(diffuse_albedo_of_both_forms),
        cmocka_unit_test(the_papers_own_fit_violates_energy_conservation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
