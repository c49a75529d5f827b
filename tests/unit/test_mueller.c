// SPDX-License-Identifier: MIT
// uses: model
// The whole matrix against the reference tables, its identities, and its accuracy where the closed
// form of the paper has none.
#include "model/brdf.h"
#include "model/shadowing.h"
#include "tests/unit/golden.h"
#include "tests/unit/randoms.h"
#include "tests/unit/transcription.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define PI 3.14159265358979323846L
#define EVERY 200000 // random cases of each identity

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

// --- identities ----------------------------------------------------------------------------------

struct sample {
    struct brdf_params p;
    struct random_angles a;
    struct brdf_mueller f;
};

static struct brdf_mueller matrix(const struct brdf_params *p, struct random_angles a)
{
    const struct brdf_geometry g = brdf_geometry(a.theta_i, a.theta_r, a.dphi);
    return brdf_mueller(p, BRDF_DIFFUSE_PAPER, &g);
}

// The next case whose f_00 has not underflowed.
static struct sample next_sample(uint64_t *random)
{
    for (;;) {
        struct sample s = {.p = random_params(random), .a = random_angles(random)};
        s.f = matrix(&s.p, s.a);
        if (s.f.m[0][0] > 1e-290)
            return s;
    }
}

static void fail_at(const char *what, const struct sample *s, double error)
{
    fail_msg("%s: off by %.3g f_00 at n %.17g, k %.17g, sigma %.17g, theta_i %.17g, theta_r %.17g, "
             "dphi %.17g rad",
             what, error, s->p.n, s->p.k, s->p.sigma, s->a.theta_i, s->a.theta_r, s->a.dphi);
}

static void squares_add_up_to_four_f00_squared(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    double worst = 0;
    for (int i = 0; i < EVERY; i++) {
        const struct sample s = next_sample(&random);
        double sum = 0;
        for (int j = 0; j < 16; j++)
            sum += pow(s.f.m[j / 4][j % 4] / s.f.m[0][0], 2);
        const double error = fabs(sum / 4 - 1);
        worst = fmax(worst, error);
        if (!(error <= 2e-14))
            fail_at("sum f_jk^2 = 4 f_00^2", &s, error);
    }
    print_message("sum f_jk^2 = 4 f_00^2: worst of %d: %.2g\n", EVERY, worst);
}

// Both symmetries are exact: model/geometry.h.
// sign[j] sign[k] f_jk, or f_kj when transposed, has to be the other's f_jk.
static double distance(const struct brdf_mueller *f, const struct brdf_mueller *other,
                       const int sign[4], bool transposed)
{
    double most = 0;
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++) {
            const double want = sign[j] * sign[k] * (transposed ? other->m[k][j] : other->m[j][k]);
            most = fmax(most, fabs(f->m[j][k] - want) / f->m[0][0]);
        }
    return most;
}

static void mirror_image_changes_the_signs_of_two_blocks(void **state)
{
    (void)state;
    static const int sign[4] = {1, 1, -1, -1};
    uint64_t random = random_seed();
    double worst = 0;
    for (int i = 0; i < EVERY; i++) {
        const struct sample s = next_sample(&random);
        const struct brdf_mueller other =
            matrix(&s.p, (struct random_angles){s.a.theta_i, s.a.theta_r, -s.a.dphi});
        const double error = distance(&s.f, &other, sign, false);
        worst = fmax(worst, error);
        if (error != 0)
            fail_at("mirror", &s, error);
    }
    print_message("f(-dphi) = P f P: worst of %d: %.2g f_00\n", EVERY, worst);
}

static void light_goes_both_ways(void **state)
{
    (void)state;
    static const int sign[4] = {1, 1, -1, 1};
    uint64_t random = random_seed();
    double worst = 0;
    for (int i = 0; i < EVERY; i++) {
        const struct sample s = next_sample(&random);
        const struct brdf_mueller other =
            matrix(&s.p, (struct random_angles){s.a.theta_r, s.a.theta_i, -s.a.dphi});
        const double error = distance(&s.f, &other, sign, true);
        worst = fmax(worst, error);
        if (error != 0)
            fail_at("reciprocity", &s, error);
    }
    print_message("f(i, r) = Q f(r, i)^T Q: worst of %d: %.2g f_00\n", EVERY, worst);
}

// --- the vector form -----------------------------------------------------------------------------

typedef long double vec[3];

static long double dot(const vec a, const vec b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const vec a, const vec b, vec ret)
{
    const vec c = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(ret, c, sizeof c);
}

// The matrix of a facet over its m_00, from unit vectors in extended precision: stable down to
// exact backscatter, and shares nothing with model/ but the conventions.
static void vector_form(double n, double k, struct random_angles a, double m[4][4])
{
    const long double ti = (long double)a.theta_i, tr = (long double)a.theta_r;
    const long double sin_d = sinl((long double)a.dphi), cos_d = cosl((long double)a.dphi);
    const vec wi = {sinl(ti), 0, cosl(ti)};
    const vec wr = {sinl(tr) * cos_d, sinl(tr) * sin_d, cosl(tr)};
    const vec ki = {-wi[0], -wi[1], -wi[2]}, h = {wi[0] + wr[0], wi[1] + wr[1], wi[2] + wr[2]};
    const vec d = {wi[0] - wr[0], wi[1] - wr[1], wi[2] - wr[2]};
    const vec si = {0, -1, 0}, sr = {-sin_d, cos_d, 0};
    vec pi, pr, s, li, lr;
    cross(ki, si, pi);
    cross(wr, sr, pr);
    cross(ki, d, s); // = wi x wr, without its cancellation near backscatter
    const long double length = sqrtl(dot(s, s));
    for (int j = 0; j < 3; j++)
        s[j] = length > 0 ? s[j] / length : si[j];
    cross(ki, s, li);
    cross(wr, s, lr);
    const long double c2 = dot(h, h) / 4, s2 = dot(d, d) / 4, c = sqrtl(c2);
    const long double complex index =
        (long double)n + (long double)k * (long double complex)_Complex_I;
    const long double complex eps = index * index;
    const long double complex q = csqrtl(eps - s2);
    const long double complex rs = (c - q) / (c + q), rp = (eps * c - q) / (eps * c + q);
    const long double *out[2] = {sr, pr}, *in[2] = {si, pi};
    double complex jones[2][2]; // [out][in]
    for (int o = 0; o < 2; o++)
        for (int i = 0; i < 2; i++)
            jones[o][i] = (double complex)(rs * dot(out[o], s) * dot(s, in[i]) +
                                           rp * dot(out[o], lr) * dot(li, in[i]));
    mueller_of_jones(jones[0][0], jones[0][1], jones[1][0], jones[1][1], m);
    const double m00 = m[0][0];
    for (int j = 0; j < 16; j++)
        m[j / 4][j % 4] /= m00;
}

static void check_vector_form(const struct brdf_params *p, struct random_angles a, double *worst)
{
    double want[4][4];
    vector_form(p->n, p->k, a, want);
    const struct brdf_geometry g = brdf_geometry(a.theta_i, a.theta_r, a.dphi);
    const struct brdf_fresnel r = brdf_fresnel(p->n, p->k, g.sin2_beta, g.cos2_beta);
    const struct brdf_mueller got = brdf_mueller_of_facet(&g.rotation, &r);
    for (int j = 0; j < 16; j++) {
        const double error = fabs(got.m[j / 4][j % 4] / got.m[0][0] - want[j / 4][j % 4]);
        *worst = fmax(*worst, error);
        if (!(error <= 2e-14)) {
            const struct sample s = {*p, a, got};
            fail_at("vector form", &s, error);
        }
    }
}

// n > 1: near the critical angle of n < 1 the last bit of beta moves rs and rp by its square root.
static void matrix_equals_the_vector_form_everywhere(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    double worst = 0, near = 0;
    for (int i = 0; i < EVERY; i++) {
        struct brdf_params p = random_params(&random);
        p.n = random_log(&random, 1.01, 8);
        p.k = i % 2 ? 0 : random_log(&random, 1e-6, 10);
        check_vector_form(&p, random_angles(&random), &worst);
        // beta of 1e-15 rad to 6 deg
        const double ti = random_between(&random, 0, 1.47), off = random_log(&random, 1e-15, 0.1);
        const double turn = random_between(&random, -3.1, 3.1);
        check_vector_form(
            &p, (struct random_angles){ti, fabs(ti + off * cos(turn)), off * sin(turn)}, &near);
    }
    print_message("vector form: worst of %d: %.2g f_00; near backscatter %.2g f_00\n", EVERY, worst,
                  near);
}

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

// --- the rest ------------------------------------------------------------------------------------

static void f00_of_the_matrix_is_f00(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    for (int i = 0; i < 20000; i++) {
        struct sample s = next_sample(&random);
        s.p.kd = random_between(&random, 0, 0.5);
        for (int d = 0; d < 2; d++) {
            const enum brdf_diffuse diffuse = (enum brdf_diffuse)d;
            const struct brdf_geometry g = brdf_geometry(s.a.theta_i, s.a.theta_r, s.a.dphi);
            const double f00 = brdf_f00(&s.p, diffuse, &g);
            assert_near(brdf_mueller(&s.p, diffuse, &g).m[0][0], f00, 4e-15 * f00);
            assert_near(brdf_between(&s.p, diffuse, &g, BRDF_STATE_U, BRDF_STATE_U), f00,
                        4e-15 * f00);
        }
    }
}

static void channels_are_products_of_the_matrix(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    for (int i = 0; i < 2000; i++) {
        struct sample s = next_sample(&random);
        s.p.kd = random_between(&random, 0, 0.5);
        const struct brdf_geometry g = brdf_geometry(s.a.theta_i, s.a.theta_r, s.a.dphi);
        const struct brdf_mueller f = brdf_mueller(&s.p, BRDF_DIFFUSE_LAMBERT, &g);
        for (int j = 0; j < BRDF_STATES * BRDF_STATES; j++) {
            const enum brdf_state in = (enum brdf_state)(j / BRDF_STATES);
            const enum brdf_state out = (enum brdf_state)(j % BRDF_STATES);
            assert_near(brdf_between(&s.p, BRDF_DIFFUSE_LAMBERT, &g, in, out),
                        brdf_mueller_between(&f, in, out), 4e-15 * f.m[0][0]);
        }
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
            assert_near(f.m[j / 4][j % 4], j ? 0 : d ? 0.3 / (double)PI : 0.6, 2e-16);
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

// At the corners of the domain nothing overflows, and nothing is lost in 0/0.
static void matrix_is_finite_in_the_whole_domain(void **state)
{
    (void)state;
    static const double n[] = {5e-324, 1e-160, 1e-9, 1, 1.5, 1e9, 1e50};
    static const double k[] = {0, 5e-324, 1e-9, 1, 1e50}, sigma[] = {1e-50, 1e-3, 0.3, 1, 1e50};
    static const double theta[] = {0, 5e-324, 1e-170, 1e-9, 0.7, 1.5, 1.5707963267948963};
    static const double dphi[] = {0, 1e-300, 1e-14, 1, 3.141592653589793, -3, 6.3};
    for (int i = 0; i < 7 * 5 * 5; i++)
        for (int j = 0; j < 7 * 7 * 7; j++) {
            const struct brdf_params p = {n[i % 7], k[i / 7 % 5], sigma[i / 35], 1e50, 1e50};
            const struct brdf_geometry g =
                brdf_geometry(theta[j % 7], theta[j / 7 % 7], dphi[j / 49]);
            const struct brdf_mueller f = brdf_mueller(&p, BRDF_DIFFUSE_PAPER, &g);
            for (int m = 0; m < 16; m++)
                if (!isfinite(f.m[m / 4][m % 4]))
                    fail_msg("n %g, k %g, sigma %g, theta_i %g, theta_r %g, dphi %g: m%d%d %g", p.n,
                             p.k, p.sigma, theta[j % 7], theta[j / 7 % 7], dphi[j / 49], m / 4,
                             m % 4, f.m[m / 4][m % 4]);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(matrices_out_of_plane_equal_the_reference),
        cmocka_unit_test(matrices_at_the_edges_equal_the_reference),
        cmocka_unit_test(matrices_in_plane_equal_the_reference),
        cmocka_unit_test(terms_equal_the_reference),
        cmocka_unit_test(squares_add_up_to_four_f00_squared),
        cmocka_unit_test(mirror_image_changes_the_signs_of_two_blocks),
        cmocka_unit_test(light_goes_both_ways),
        cmocka_unit_test(matrix_equals_the_vector_form_everywhere),
        cmocka_unit_test(exact_backscatter_is_a_mirror_at_normal_incidence),
        cmocka_unit_test(f00_of_the_matrix_is_f00),
        cmocka_unit_test(channels_are_products_of_the_matrix),
        cmocka_unit_test(diffuse_part_is_in_f00_alone),
        cmocka_unit_test(matrix_outside_the_domain_is_nan),
        cmocka_unit_test(matrix_is_finite_in_the_whole_domain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
