// SPDX-License-Identifier: MIT
// uses: model
// What the model says of the paper's figures: where the peaks are, how they move with the
// parameters, and where the shadowing has its kink.
#include "model/brdf.h"
#include "model/shadowing.h"
#include "tests/unit/golden.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define LAST_DEG 89.9 // the scan of theta_r ends here, on both sides

static const struct brdf_params papers_fit = {5.345064, 5.345064, 0.123451, 0.95, 0.092414};

static double f00_deg(const struct brdf_params *p, double ti, double tr, double dphi)
{
    const struct brdf_geometry g = brdf_geometry(golden_rad(ti), golden_rad(tr), golden_rad(dphi));
    return brdf_f00(p, BRDF_DIFFUSE_PAPER, &g);
}

// In plane at theta_i = 45 deg, theta_r with its sign.
static double f00_at(const struct brdf_params *p, double tr)
{
    return f00_deg(p, 45, fabs(tr), tr >= 0 ? 180 : 0);
}

// Over theta_r >= 0 at an azimuth from the specular half plane.
static double peak_deg(const struct brdf_params *p, double azimuth_deg, double *ret_f00)
{
    double best = 0, at = 0;
    for (int i = 0; i <= 1000 * LAST_DEG; i++) {
        const double f = f00_deg(p, 45, i / 1000.0, 180 - azimuth_deg);
        at = f > best ? i / 1000.0 : at;
        best = fmax(f, best);
    }
    *ret_f00 = best;
    return at;
}

static struct brdf_params params_at(const struct golden *t, int i)
{
    return (struct brdf_params){golden_at(t, i, "n"), golden_at(t, i, "k"),
                                golden_at(t, i, "sigma"), 1, 0};
}

// From the peak outwards until half the height, or the end of the scan.
static double half_height_deg(const struct brdf_params *p, double from, double half, double step)
{
    double tr = from;
    while (fabs(tr + step) <= LAST_DEG && f00_at(p, tr) >= half)
        tr += step;
    return tr;
}

// --- figure 5 ------------------------------------------------------------------------------------

static void figure_5_has_the_reference_peaks(void **state)
{
    (void)state;
    struct golden t = golden_need("fig5_facts.csv");
    for (int i = 0; i < t.rows; i++) {
        const struct brdf_params p = params_at(&t, i);
        double height, at = peak_deg(&p, 0, &height);
        assert_near(f00_at(&p, 45) / golden_at(&t, i, "f00_at_45"), 1, 1e-11); // has 12 digits
        assert_near(at, golden_at(&t, i, "peak_theta_r_deg"), 0.0011);         // steps of 0.001
        assert_near(height / golden_at(&t, i, "peak_f00"), 1, 3e-5);
        const double width = half_height_deg(&p, at, height / 2, 0.001) -
                             half_height_deg(&p, at, height / 2, -0.001);
        assert_near(width, golden_at(&t, i, "fwhm_deg"), 0.004);
    }
    golden_close(&t);
}

static void figure_5_has_the_reference_curves(void **state)
{
    (void)state;
    struct golden t = golden_need("fig5_curves.csv");
    double worst = 0;
    for (int i = 0; i < t.rows; i++) {
        const struct brdf_params p = params_at(&t, i);
        const double want = golden_at(&t, i, "f00");
        const double got = f00_at(&p, golden_at(&t, i, "theta_r_signed_deg"));
        if (want < 2.3e-308) { // subnormal: few digits
            assert_near(got, want, 1e-8 * want + 1e-322);
            continue;
        }
        worst = fmax(worst, fabs(got / want - 1));
        assert_near(got / want, 1, 1e-10);
    }
    print_message("fig5_curves.csv: worst of %d values %.2g\n", t.rows, worst);
    golden_close(&t);
}

// Errata 10.
static void a_rougher_surface_has_a_lower_and_wider_peak(void **state)
{
    (void)state;
    double last = (double)INFINITY, width = 0;
    for (double sigma = 0.02; sigma < 0.6; sigma += 0.02) {
        const struct brdf_params p = {1.3, 7.5, sigma, 1, 0};
        assert_near(f00_at(&p, 45) * sigma * sigma, 0.0725273, 5e-8);
        double height, at = peak_deg(&p, 0, &height);
        assert_true(height < last);
        last = height;
        if (sigma > 0.15)
            continue; // the width runs into the horizon
        const double w =
            half_height_deg(&p, at, height / 2, 0.01) - half_height_deg(&p, at, height / 2, -0.01);
        assert_true(w > width);
        width = w;
    }
}

static void the_peak_moves_off_specular_and_sticks_at_the_kink(void **state)
{
    (void)state;
    static const double want[][2] = {{.02, 45.091}, {.05, 45.583}, {.1, 47.577}, {.15, 52.158},
                                     {.2, 75},      {.25, 75},     {.3, 75}};
    for (size_t i = 0; i < sizeof want / sizeof *want; i++) {
        const struct brdf_params p = {1.3, 7.5, want[i][0], 1, 0};
        double height;
        assert_near(peak_deg(&p, 0, &height), want[i][1], 0.0011);
    }
}

// Errata 11: with k always, with n only above a minimum.
static void the_peak_grows_with_k_always_and_with_n_not_always(void **state)
{
    (void)state;
    // Six digits each.
    static const double at_n[][2] = {{1.3, .266664}, {1.5, .456611}, {2, 1.00814}, {3, 2.04256}};
    static const double at_k[][2] = {
        {0, .976024}, {.2, 1.00814}, {1, 1.68187}, {3, 4.38826}, {7.5, 6.93788}};
    for (int i = 0; i < 4; i++) {
        const struct brdf_params p = {at_n[i][0], 0.2, 0.1, 1, 0};
        assert_near(f00_at(&p, 45) / at_n[i][1], 1, 5e-6);
    }
    for (int i = 0; i < 5; i++) {
        const struct brdf_params p = {2, at_k[i][0], 0.1, 1, 0};
        assert_near(f00_at(&p, 45) / at_k[i][1], 1, 5e-6);
    }
    static const double minimum[][2] = {{.2, 1.0471}, {7.5, 7.5829}}; // k, n
    for (int i = 0; i < 2; i++) {
        double least = (double)INFINITY, at = 0;
        for (double n = 0.5; n < 9; n += 0.001) {
            const struct brdf_params p = {n, minimum[i][0], 0.1, 1, 0};
            at = f00_at(&p, 45) < least ? n : at;
            least = fmin(least, f00_at(&p, 45));
        }
        assert_near(at, minimum[i][1], 0.0011);
    }
}

// --- figure 4 ------------------------------------------------------------------------------------

// Errata 12.
static void the_peak_moves_inwards_with_the_azimuth(void **state)
{
    (void)state;
    static const double want[][2] = {{0, 49.1}, {15, 44.7}, {30, 35.8}, {45, 26.4}, {60, 17.3}};
    for (size_t i = 0; i < sizeof want / sizeof *want; i++) {
        double height;
        assert_near(peak_deg(&papers_fit, want[i][0], &height), want[i][1], 0.051);
    }
}

// --- shadowing -----------------------------------------------------------------------------------

static double g_deg(double ti, double tr, double dphi)
{
    const struct brdf_geometry g = brdf_geometry(golden_rad(ti), golden_rad(tr), golden_rad(dphi));
    const double cos_ratio = 1 / sqrt((1 + g.tan2_theta) * g.cos2_beta);
    return shadowing(cos(golden_rad(ti)), cos(golden_rad(tr)), cos_ratio);
}

static double slope(const struct brdf_params *p, double ti, double tr, double step)
{
    return (f00_deg(p, ti, tr + step, 180) - f00_deg(p, ti, tr, 180)) / step;
}

static void g_has_its_kink_at_60_deg_plus_a_third_of_theta_i(void **state)
{
    (void)state;
    const struct brdf_params p = {1.3, 7.5, 0.2, 1, 0};
    for (double ti = 0; ti <= 60; ti += 5) {
        const double kink = 60 + ti / 3;
        assert_near(g_deg(ti, kink - 0.01, 180), 1, 0);
        assert_true(g_deg(ti, kink + 0.01, 180) < 1);
        const double f = f00_deg(&p, ti, kink, 180);
        // Per degree, in units of f: the slope jumps there and nowhere near.
        const double jump = (slope(&p, ti, kink, 1e-4) - slope(&p, ti, kink, -1e-4)) / f;
        const double before = (slope(&p, ti, kink - 1, 1e-4) - slope(&p, ti, kink - 1, -1e-4)) / f;
        assert_true(jump < -0.02 && fabs(before) < 1e-4);
    }
}

// Errata 14.
static void g_depends_on_the_azimuth(void **state)
{
    (void)state;
    assert_near(g_deg(45, 80, 180), 0.7173, 5e-5);
    assert_true(fabs(g_deg(45, 80, 90) - g_deg(45, 80, 180)) > 0.05);
    assert_near(g_deg(30, 30, 0), 1, 0); // backscatter: theta = 30 deg, 2 cos^2 theta > 1
    assert_near(g_deg(50, 50, 0), 2 * pow(cos(golden_rad(50)), 2), 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figure_5_has_the_reference_peaks),
        cmocka_unit_test(figure_5_has_the_reference_curves),
        cmocka_unit_test(a_rougher_surface_has_a_lower_and_wider_peak),
        cmocka_unit_test(the_peak_moves_off_specular_and_sticks_at_the_kink),
        cmocka_unit_test(the_peak_grows_with_k_always_and_with_n_not_always),
        cmocka_unit_test(the_peak_moves_inwards_with_the_azimuth),
        cmocka_unit_test(g_has_its_kink_at_60_deg_plus_a_third_of_theta_i),
        cmocka_unit_test(g_depends_on_the_azimuth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
