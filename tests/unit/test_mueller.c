// SPDX-License-Identifier: MIT
// uses: model
// The whole matrix against the reference tables.
#include "model/brdf.h"
#include "model/shadowing.h"
#include "tests/unit/golden.h"
#include "tests/unit/transcription.h"

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

static struct brdf_geometry geometry_deg(double ti, double tr, double dphi)
{
    return brdf_geometry(golden_rad(ti), golden_rad(tr), golden_rad(dphi));
}

// --- reference tables ----------------------------------------------------------------------------

// 1e-10 of the specular f_00, and the table's own rounding (17 digits) where kd hides it. Returns
// the error in units of the specular f_00.
static double check(const char *name, int row, const char *column, double got, double want,
                    double f00, double kd_per_sr)
{
    const double specular = f00 - kd_per_sr;
    if (!(fabs(got - want) <= 1e-10 * specular + 4e-16 * f00))
        fail_msg("%s row %d: %s %.17g, reference %.17g", name, row, column, got, want);
    return fmax(0, fabs(got - want) - 4e-16 * f00) / specular;
}

static void check_matrices(const char *name)
{
    struct golden t = golden_need(name);
    double worst = 0;
    for (int i = 0; i < t.rows; i++) {
        const struct brdf_params p = params_at(&t, i);
        const double ti = golden_at(&t, i, "theta_i_deg");
        const struct brdf_geometry g =
            geometry_deg(ti, golden_at(&t, i, "theta_r_deg"), golden_at(&t, i, "dphi_deg"));
        const struct brdf_mueller f = brdf_mueller(&p, BRDF_DIFFUSE_PAPER, &g);
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 4; k++) {
                const char column[] = {'f', (char)('0' + j), (char)('0' + k), 0};
                worst = fmax(worst, check(name, i, column, f.m[j][k], golden_at(&t, i, column),
                                          golden_at(&t, i, "f00"), p.kd / cos(golden_rad(ti))));
            }
    }
    print_message("%s: worst of %d matrices %.2g f_00\n", name, t.rows, worst);
    golden_close(&t);
}

static void matrices_out_of_plane_equal_the_reference(void **state)
{
    (void)state;
    check_matrices("golden_mueller.csv");
}

static void matrices_at_the_edges_equal_the_reference(void **state)
{
    (void)state;
    check_matrices("golden_edge.csv");
}

static void matrices_in_plane_equal_the_reference(void **state)
{
    (void)state;
    struct golden t = golden_need("golden_inplane.csv");
    double worst = 0;
    for (int i = 0; i < t.rows; i++) {
        const struct brdf_params p = params_at(&t, i);
        const double ti = golden_at(&t, i, "theta_i_deg");
        const double tr = golden_at(&t, i, "theta_r_signed_deg");
        const struct brdf_geometry g = geometry_deg(ti, fabs(tr), tr >= 0 ? 180 : 0);
        const struct brdf_mueller f = brdf_mueller(&p, BRDF_DIFFUSE_PAPER, &g);
        const struct {
            const char *column;
            double got;
        } values[] = {
            {"f00", f.m[0][0]},
            {"f01", f.m[0][1]},
            {"f22", f.m[2][2]},
            {"f23", f.m[2][3]},
            {"f_ss", brdf_between(&p, BRDF_DIFFUSE_PAPER, &g, BRDF_STATE_S, BRDF_STATE_S)},
            {"f_pp", brdf_between(&p, BRDF_DIFFUSE_PAPER, &g, BRDF_STATE_P, BRDF_STATE_P)},
        };
        for (size_t j = 0; j < sizeof values / sizeof *values; j++)
            worst = fmax(worst, check("golden_inplane.csv", i, values[j].column, values[j].got,
                                      golden_at(&t, i, values[j].column), golden_at(&t, i, "f00"),
                                      p.kd / cos(golden_rad(ti))));
        static const int zero[8][2] = {{0, 2}, {0, 3}, {1, 2}, {1, 3},
                                       {2, 0}, {2, 1}, {3, 0}, {3, 1}};
        for (int j = 0; j < 8; j++)
            assert_near(f.m[zero[j][0]][zero[j][1]], 0, 0);
        assert_near(f.m[1][0], f.m[0][1], 0);
        assert_near(f.m[3][3], f.m[2][2], 0);
        assert_near(f.m[3][2], -f.m[2][3], 0);
        assert_near(f.m[1][1] + p.kd / cos(golden_rad(ti)), f.m[0][0], 1e-15 * f.m[0][0]);
    }
    print_message("golden_inplane.csv: worst of %d rows %.2g f_00\n", t.rows, worst);
    golden_close(&t);
}

static double complex pair(const struct golden *t, int i, const char *name)
{
    char re[16], im[16];
    snprintf(re, sizeof re, "%s_re", name);
    snprintf(im, sizeof im, "%s_im", name);
    return golden_at(t, i, re) + golden_at(t, i, im) * (double complex)_Complex_I;
}

static void terms_equal_the_reference(void **state)
{
    (void)state;
    struct golden t = golden_need("golden_terms.csv");
    double worst = 0;
    for (int i = 0; i < t.rows; i++) {
        const struct brdf_params p = {golden_at(&t, i, "n"), golden_at(&t, i, "k"),
                                      golden_at(&t, i, "sigma"), 1, 0};
        const double ti = golden_rad(golden_at(&t, i, "theta_i_deg"));
        const double tr = golden_rad(golden_at(&t, i, "theta_r_deg"));
        const struct brdf_geometry g =
            brdf_geometry(ti, tr, golden_rad(golden_at(&t, i, "dphi_deg")));
        const struct brdf_fresnel r = brdf_fresnel(p.n, p.k, g.sin2_beta, g.cos2_beta);
        const double beta = golden_rad(golden_at(&t, i, "beta_deg"));
        const double theta = golden_rad(golden_at(&t, i, "theta_deg"));
        const double complex rs = pair(&t, i, "rs"), rp = pair(&t, i, "rp"), cross = rs * conj(rp);
        const double pre = golden_at(&t, i, "pre"), f00 = brdf_f00(&p, BRDF_DIFFUSE_PAPER, &g);
        const double mean = (r.ss + r.pp) / 2;
        double m[4][4];
        mueller_of_jones(pair(&t, i, "Sss"), pair(&t, i, "Sps"), pair(&t, i, "Ssp"),
                         pair(&t, i, "Spp"), m);
        // got, reference, unit
        double terms[12 + 16][3] = {
            {sqrt(g.sin2_beta), sin(beta), 1},
            {sqrt(g.cos2_beta), cos(beta), 1},
            {sqrt(g.tan2_theta), tan(theta), 1},
            {shadowing(cos(ti), cos(tr), cos(theta) / cos(beta)), golden_at(&t, i, "G"), 1},
            {f00 / mean, pre, pre},
            {r.ss, pow(cabs(rs), 2), mean},
            {r.pp, pow(cabs(rp), 2), mean},
            {r.re, creal(cross), mean},
            {r.im, cimag(cross), mean},
            {g.rotation.cos_i * g.rotation.cos_r,
             golden_at(&t, i, "cos_ai") * golden_at(&t, i, "cos_ar"), 1},
            {g.rotation.sin_i * g.rotation.sin_r,
             golden_at(&t, i, "sin_ai") * golden_at(&t, i, "sin_ar"), 1},
            {g.rotation.sin_i * g.rotation.cos_r,
             golden_at(&t, i, "sin_ai") * golden_at(&t, i, "cos_ar"), 1},
        };
        const struct brdf_mueller own = brdf_mueller_of_facet(&g.rotation, &r);
        for (int j = 0; j < 16; j++) {
            terms[12 + j][0] = own.m[j / 4][j % 4];
            terms[12 + j][1] = m[j / 4][j % 4];
            terms[12 + j][2] = mean;
        }
        for (size_t j = 0; j < sizeof terms / sizeof *terms; j++) {
            const double error = fabs(terms[j][0] - terms[j][1]) / terms[j][2];
            worst = fmax(worst, error);
            if (!(error <= 1e-10))
                fail_msg("golden_terms.csv row %d, term %zu: %.17g, reference %.17g", i, j,
                         terms[j][0], terms[j][1]);
        }
    }
    print_message("golden_terms.csv: worst of %d x 28 terms %.2g\n", t.rows, worst);
    golden_close(&t);
}

// --- the rest ------------------------------------------------------------------------------------

static void exact_backscatter_is_a_mirror_at_normal_incidence(void **state)
{
    (void)state;
    for (double deg = 0; deg < 90; deg += 7.5) {
        const struct brdf_params p = {1.5, 0.3, 0.3, 1, 0};
        const struct brdf_geometry g = geometry_deg(deg, deg, 0);
        const struct brdf_mueller f = brdf_mueller(&p, BRDF_DIFFUSE_PAPER, &g);
        assert_near(g.sin2_beta, 0, 0);
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 4; k++)
                assert_near(f.m[j][k],
                            (j != k  ? 0
                             : j < 2 ? 1
                                     : -1) *
                                f.m[0][0],
                            2e-16 * f.m[0][0]);
    }
}

static void diffuse_part_is_in_f00_alone(void **state)
{
    (void)state;
    const struct brdf_params p = {1.5, 0.1, 0.1, 0, 0.3};
    const struct brdf_geometry g = geometry_deg(60, 20, 77);
    for (int d = 0; d < 2; d++) {
        const struct brdf_mueller f = brdf_mueller(&p, (enum brdf_diffuse)d, &g);
        for (int j = 0; j < 16; j++)
            assert_near(f.m[j / 4][j % 4], j ? 0 : d ? 0.3 / PI : 0.6, 2e-16);
    }
}

static void matrix_outside_the_domain_is_nan(void **state)
{
    (void)state;
    const struct brdf_params good = {1.5, 0.1, 0.2, 1, 0.1};
    const double nan = (double)NAN;
    static const double angles[][3] = {{90, 0, 0}, {0, 90, 0}, {-1, 0, 0}, {0, 0, (double)NAN}};
    const struct brdf_params bad[] = {{0, 0, .1, 1, 0},    {1.5, -1, .1, 1, 0}, {1.5, 0, 0, 1, 0},
                                      {1.5, 0, .1, -1, 0}, {1.5, 0, .1, 1, -1}, {nan, 0, .1, 1, 0},
                                      {1.5, 0, .1, 1, nan}};
    for (size_t i = 0; i < 4 + sizeof bad / sizeof *bad; i++) {
        const struct brdf_geometry g = i < 4
                                           ? geometry_deg(angles[i][0], angles[i][1], angles[i][2])
                                           : geometry_deg(30, 20, 90);
        const struct brdf_mueller f =
            brdf_mueller(i < 4 ? &good : &bad[i - 4], BRDF_DIFFUSE_PAPER, &g);
        for (int j = 0; j < 16; j++)
            assert_true(isnan(f.m[j / 4][j % 4]));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(matrices_out_of_plane_equal_the_reference),
        cmocka_unit_test(matrices_at_the_edges_equal_the_reference),
        cmocka_unit_test(matrices_in_plane_equal_the_reference),
        cmocka_unit_test(terms_equal_the_reference),
        cmocka_unit_test(exact_backscatter_is_a_mirror_at_normal_incidence),
        cmocka_unit_test(diffuse_part_is_in_f00_alone),
        cmocka_unit_test(matrix_outside_the_domain_is_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
