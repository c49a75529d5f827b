// SPDX-License-Identifier: MIT
// uses: model
#include "model/brdf.h"
#include "tests/unit/golden.h"
#include "tests/unit/randoms.h"

#include <complex.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define PI 3.14159265358979323846

static struct brdf_params params_at(const struct golden *t, int i)
{
    return (struct brdf_params){golden_at(t, i, "n"), golden_at(t, i, "k"),
                                golden_at(t, i, "sigma"), golden_at(t, i, "ks"),
                                golden_at(t, i, "kd")};
}

static double f00_at_deg(const struct brdf_params *p, double ti, double tr, double dphi)
{
    struct brdf_geometry g = brdf_geometry(golden_rad(ti), golden_rad(tr), golden_rad(dphi));
    return brdf_f00(p, BRDF_DIFFUSE_PAPER, &g);
}

// 1e-10 of f_00 without its diffuse part, which is what the reference program gives.
static void check_rows(const char *name, bool in_plane)
{
    struct golden t = golden_need(name);
    for (int i = 0; i < t.rows; i++) {
        struct brdf_params p = params_at(&t, i);
        double ti = golden_at(&t, i, "theta_i_deg");
        double tr = golden_at(&t, i, in_plane ? "theta_r_signed_deg" : "theta_r_deg");
        double dphi = in_plane ? (tr >= 0 ? 180 : 0) : golden_at(&t, i, "dphi_deg");
        double want = golden_at(&t, i, "f00");
        double got = f00_at_deg(&p, ti, fabs(tr), dphi);
        double specular = want - p.kd / cos(golden_rad(ti));
        // The table's own rounding (17 digits of the sum) is all that is added to the tolerance.
        double tolerance = 1e-10 * fabs(specular) + 4e-16 * want;
        if (!(fabs(got - want) <= tolerance))
            fail_msg("%s row %d (theta_i %g, theta_r %g, dphi %g): f00 %.17g, reference %.17g",
                     name, i, ti, tr, dphi, got, want);
    }
    golden_close(&t);
}

static void f00_in_plane_equals_the_reference(void **state)
{
    (void)state;
    check_rows("golden_inplane.csv", true);
}

static void f00_out_of_plane_equals_the_reference(void **state)
{
    (void)state;
    check_rows("golden_mueller.csv", false);
}

static void f00_at_the_edges_equals_the_reference(void **state)
{
    (void)state;
    check_rows("golden_edge.csv", false);
}

static void diffuse_part_is_kd_over_cos_or_kd_over_pi(void **state)
{
    (void)state;
    struct brdf_params p = {1.5, 0, 0.1, 0, 0.3};
    struct brdf_geometry g = brdf_geometry(golden_rad(60), golden_rad(20), 1);
    assert_near(brdf_f00(&p, BRDF_DIFFUSE_PAPER, &g), 0.6, 1e-15);
    assert_near(brdf_f00(&p, BRDF_DIFFUSE_LAMBERT, &g), 0.3 / PI, 1e-16);
}

static double complex_fresnel(double n, double k, double s2, double c2)
{
    double complex index = n + k * (double complex)_Complex_I;
    double complex eps = index * index, q = csqrt(eps - s2);
    double c = sqrt(c2), rs = cabs((c - q) / (c + q)), rp = cabs((eps * c - q) / (eps * c + q));
    return (rs * rs + rp * rp) / 2;
}

static void real_fresnel_equals_the_complex_form(void **state)
{
    (void)state;
    static const double n[] = {0.2, 0.72, 0.9, 1.2, 1.5, 5.345, 8}, k[] = {0, 1e-3, 0.2, 1, 7.5};
    for (size_t i = 0; i < 7; i++)
        for (size_t j = 0; j < 5; j++)
            for (double b = 0; b < 90; b += 1.7) {
                double s2 = pow(sin(golden_rad(b)), 2), c2 = pow(cos(golden_rad(b)), 2);
                double want = complex_fresnel(n[i], k[j], s2, c2);
                assert_near(brdf_fresnel_mean(n[i], k[j], s2, c2), want, 2e-14);
            }
}

static void fresnel_keeps_its_digits_where_it_nearly_vanishes(void **state)
{
    (void)state;
    double d = 1.0 / (1 << 20); // exactly representable: R(0) = (d / (2 + d))^2
    assert_near(brdf_fresnel_mean(1 + d, 0, 0, 1) / pow(d / (2 + d), 2), 1, 1e-15);
    assert_near(brdf_fresnel_mean(1, 0, 0.5, 0.5), 0, 0);
    assert_near(brdf_fresnel_mean(0.4, 0, 0.5, 0.5), 1, 1e-15); // total reflection
}

// Random indices, near 1 and extreme, to the last degree before grazing, in extended precision.
static void fresnel_keeps_its_digits_everywhere(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    double worst = 0;
    for (int i = 0; i < 200000; i++) {
        const struct brdf_params p = random_params(&random);
        const double n = i % 2 ? p.n : 1 + random_log(&random, 1e-12, 1e-3);
        const double k = i % 2 ? p.k : i % 4 ? 0 : random_log(&random, 1e-12, 1e-3);
        const double c2 = random_log(&random, 1e-12, 1), s2 = 1 - c2;
        if (n < 1)
            continue; // near the critical angle the last bit of beta moves R by its square root
        const long double complex index =
            (long double)n + (long double)k * (long double complex)_Complex_I;
        const long double complex above = (index - 1) * (index + 1);
        const long double complex q = csqrtl(above + (long double)c2);
        const long double c = sqrtl((long double)c2), sin2 = 1 - (long double)c2;
        const long double rs = cabsl(above / ((c + q) * (c + q)));
        const long double rp = rs * cabsl((sin2 - q * c) / (sin2 + q * c));
        const double want = (double)((rs * rs + rp * rp) / 2);
        const double error = fabs(brdf_fresnel_mean(n, k, s2, c2) / want - 1);
        worst = fmax(worst, want > 0 ? error : 0);
        if (want > 0 && !(error <= 1e-12))
            fail_msg("n %.17g, k %.17g, cos^2 beta %.17g: off by %.3g", n, k, c2, error);
    }
    print_message("worst relative error %.2g\n", worst);
}

static void outside_the_domain_everything_is_nan(void **state)
{
    (void)state;
    struct brdf_params good = {1.5, 0.1, 0.2, 1, 0.1};
    static const double angles[][3] = {
        {-0.1, 0, 0},        {90, 0, 0},          {0, 90, 180},        {0, -1, 180},
        {(double)NAN, 0, 0}, {0, (double)NAN, 0}, {0, 0, (double)NAN}, {0, 0, (double)INFINITY}};
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i++)
        assert_true(isnan(f00_at_deg(&good, angles[i][0], angles[i][1], angles[i][2])));
    static const struct brdf_params bad[] = {{0, 0, .1, 1, 0},
                                             {-1, 0, .1, 1, 0},
                                             {1.5, -1e-9, .1, 1, 0},
                                             {1.5, 0, 0, 1, 0},
                                             {1.5, 0, -.1, 1, 0},
                                             {1.5, 0, .1, -1, 0},
                                             {1.5, 0, .1, 1, -1},
                                             {(double)NAN, 0, .1, 1, 0},
                                             {1.5, (double)NAN, .1, 1, 0},
                                             {1.5, 0, (double)NAN, 1, 0},
                                             {1.5, 0, .1, (double)NAN, 0},
                                             {1.5, 0, .1, 1, (double)NAN},
                                             {1.5, (double)INFINITY, .1, 1, 0}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_true(isnan(f00_at_deg(&bad[i], 30, 30, 180)));
        assert_true(isnan(brdf_dhr(&bad[i], BRDF_DIFFUSE_PAPER, 0)));
    }
    assert_true(isnan(brdf_dhr(&good, BRDF_DIFFUSE_PAPER, PI / 2)));
    assert_false(isnan(f00_at_deg(&good, 89.999999, 89.999999, 180)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(f00_in_plane_equals_the_reference),
        cmocka_unit_test(f00_out_of_plane_equals_the_reference),
        cmocka_unit_test(f00_at_the_edges_equals_the_reference),
        cmocka_unit_test(diffuse_part_is_kd_over_cos_or_kd_over_pi),
        cmocka_unit_test(real_fresnel_equals_the_complex_form),
        cmocka_unit_test(fresnel_keeps_its_digits_where_it_nearly_vanishes),
        cmocka_unit_test(fresnel_keeps_its_digits_everywhere),
        cmocka_unit_test(outside_the_domain_everything_is_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
