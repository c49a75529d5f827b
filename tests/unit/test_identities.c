// SPDX-License-Identifier: MIT
// uses: model
// What holds for every matrix of the model, over random and extreme geometries and parameters; and
// its accuracy where the paper's closed form has none.
#include "model/brdf.h"
#include "tests/unit/golden.h"
#include "tests/unit/randoms.h"
#include "tests/unit/transcription.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define EVERY 200000 // random cases of each identity

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

// f(theta_i, theta_r, dphi) has to be sign[j] sign[k] times what the mirror image, or the way back,
// has in jk, or in kj. Both symmetries are exact (model/geometry.h): no tolerance.
static void check_symmetry(const char *name, const int sign[4], bool back)
{
    uint64_t random = random_seed();
    double worst = 0;
    for (int i = 0; i < EVERY; i++) {
        const struct sample s = next_sample(&random);
        const struct random_angles image = {back ? s.a.theta_r : s.a.theta_i,
                                            back ? s.a.theta_i : s.a.theta_r, -s.a.dphi};
        const struct brdf_mueller f = matrix(&s.p, image);
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 4; k++) {
                const double want = sign[j] * sign[k] * (back ? f.m[k][j] : f.m[j][k]);
                const double error = fabs(s.f.m[j][k] - want) / s.f.m[0][0];
                worst = fmax(worst, error);
                if (error != 0)
                    fail_at(name, &s, error);
            }
    }
    print_message("%s: worst of %d: %.2g f_00\n", name, EVERY, worst);
}

static void mirror_image_changes_the_signs_of_two_blocks(void **state)
{
    (void)state;
    check_symmetry("f(-dphi) = P f P", (const int[4]){1, 1, -1, -1}, false);
}

static void light_goes_both_ways(void **state)
{
    (void)state;
    check_symmetry("f(i, r) = Q f(r, i)^T Q", (const int[4]){1, 1, -1, 1}, true);
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

// --- the parts agree -----------------------------------------------------------------------------

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

// --- the whole domain ----------------------------------------------------------------------------

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
            const double f00 = brdf_f00(&p, BRDF_DIFFUSE_PAPER, &g);
            assert_near(f00, f.m[0][0], 4e-15 * f00);
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
        cmocka_unit_test(squares_add_up_to_four_f00_squared),
        cmocka_unit_test(mirror_image_changes_the_signs_of_two_blocks),
        cmocka_unit_test(light_goes_both_ways),
        cmocka_unit_test(matrix_equals_the_vector_form_everywhere),
        cmocka_unit_test(f00_of_the_matrix_is_f00),
        cmocka_unit_test(channels_are_products_of_the_matrix),
        cmocka_unit_test(matrix_is_finite_in_the_whole_domain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
