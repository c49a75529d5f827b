// SPDX-License-Identifier: MIT
// uses: model
// The paper's misprints. When model/ falls for one of them, the test says which. What the errata
// claim (doc/manual.md) is shown too.
#include "model/brdf.h"
#include "tests/unit/golden.h"
#include "tests/unit/randoms.h"
#include "tests/unit/transcription.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

struct place {
    struct brdf_params p;
    double ti, tr, dphi; // rad
};

static bool equal(double a[4][4], double b[4][4])
{
    for (int j = 0; j < 16; j++)
        if (!(fabs(a[j / 4][j % 4] - b[j / 4][j % 4]) <= 1e-10 * a[0][0]))
            return false;
    return true;
}

static struct place place_at(const struct golden *t, int i)
{
    return (struct place){{golden_at(t, i, "n"), golden_at(t, i, "k"), golden_at(t, i, "sigma"),
                           golden_at(t, i, "ks"), golden_at(t, i, "kd")},
                          golden_rad(golden_at(t, i, "theta_i_deg")),
                          golden_rad(golden_at(t, i, "theta_r_deg")),
                          golden_rad(golden_at(t, i, "dphi_deg"))};
}

// A model to be judged.
typedef void matrix_at(const struct place *at, enum misreading wrong, double ret_f[4][4]);

static void model_at(const struct place *at, enum misreading wrong, double ret_f[4][4])
{
    (void)wrong;
    const struct brdf_geometry g = brdf_geometry(at->ti, at->tr, at->dphi);
    const struct brdf_mueller f = brdf_mueller(&at->p, BRDF_DIFFUSE_PAPER, &g);
    memcpy(ret_f, f.m, sizeof f.m);
}

static void transcription_at(const struct place *at, enum misreading wrong, double ret_f[4][4])
{
    transcribe(&at->p, at->ti, at->tr, at->dphi, wrong, ret_f);
}

// How many rows of golden_mueller.csv each misreading explains; returns how many rows there are.
// A single row may have several explanations: at theta_i = 0 some misreadings agree.
static int explain(matrix_at *judged, enum misreading wrong, int ret_rows[MISREADINGS])
{
    struct golden t = golden_need("golden_mueller.csv");
    int rows = 0;
    memset(ret_rows, 0, MISREADINGS * sizeof *ret_rows);
    for (int i = 0; i < t.rows; i++) {
        const struct place at = place_at(&t, i);
        double f[4][4], own[4][4];
        if (brdf_geometry(at.ti, at.tr, at.dphi).sin2_beta < 1e-3)
            continue; // too near backscatter for the closed form
        rows++;
        judged(&at, wrong, f);
        for (int j = 0; j < MISREADINGS; j++) {
            transcription_at(&at, (enum misreading)j, own);
            ret_rows[j] += equal(own, f);
        }
    }
    golden_close(&t);
    return rows;
}

static int best_of(const int rows[MISREADINGS])
{
    int best = 0;
    for (int j = 1; j < MISREADINGS; j++)
        best = rows[j] > rows[best] ? j : best;
    return best;
}

static void the_model_falls_for_no_misreading(void **state)
{
    (void)state;
    int explained[MISREADINGS];
    const int rows = explain(model_at, MISREAD_NOTHING, explained);
    const int best = best_of(explained);
    if (best != MISREAD_NOTHING)
        fail_msg("looks like %s: that explains %d of %d matrices, the right model %d",
                 misreading_name[best], explained[best], rows, explained[0]);
    if (explained[0] != rows)
        fail_msg("%d of %d matrices are wrong, by none of the known misreadings",
                 rows - explained[0], rows);
}

static void each_misreading_is_called_by_its_name(void **state)
{
    (void)state;
    for (int wrong = 0; wrong < MISREADINGS; wrong++) {
        int explained[MISREADINGS];
        const int rows = explain(transcription_at, (enum misreading)wrong, explained);
        const int best = best_of(explained);
        explained[best] = 0;
        const int second = best_of(explained);
        print_message("explains %d rows, the next best %d: %s\n", rows, explained[second],
                      misreading_name[best]);
        assert_int_equal(best, wrong);
        assert_true(explained[second] < rows - 25);
    }
}

static const struct {
    const char *column;
    enum misreading what;
} traps[] = {{"f00_correct", MISREAD_NOTHING},
             {"f00_eps_is_n_plus_ik", MISREAD_INDEX},
             {"f00_eq5_exponent_no_2", MISREAD_EXPONENT},
             {"f00_no_masking", MISREAD_NO_SHADOWING},
             {"f00_dphi_flipped_180", MISREAD_HALF_PLANE}};
enum { TRAPS = sizeof traps / sizeof *traps };

static struct place trap_at(const struct golden *t, int i)
{
    return (struct place){
        {golden_at(t, i, "n"), golden_at(t, i, "k"), golden_at(t, i, "sigma"), 1, 0},
        golden_rad(golden_at(t, i, "theta_i_deg")),
        golden_rad(golden_at(t, i, "theta_r_deg")),
        golden_rad(golden_at(t, i, "dphi_deg"))};
}

static void f00_falls_into_none_of_the_traps(void **state)
{
    (void)state;
    struct golden t = golden_need("golden_traps.csv");
    assert_int_equal(t.columns, 6 + TRAPS); // no column is left out
    for (int i = 0; i < t.rows; i++) {
        const struct place at = trap_at(&t, i);
        const struct brdf_geometry g = brdf_geometry(at.ti, at.tr, at.dphi);
        const double want = golden_at(&t, i, "f00_correct");
        const double got = brdf_f00(&at.p, BRDF_DIFFUSE_PAPER, &g);
        if (fabs(got - want) <= 1e-10 * want)
            continue;
        for (int j = 1; j < TRAPS; j++) {
            const double wrong = golden_at(&t, i, traps[j].column);
            if (fabs(got - wrong) <= 1e-9 * wrong)
                fail_msg("golden_traps.csv row %d: f00 %.17g instead of %.17g: looks like %s", i,
                         got, want, misreading_name[traps[j].what]);
        }
        fail_msg("golden_traps.csv row %d: f00 %.17g instead of %.17g: none of the known "
                 "misreadings",
                 i, got, want);
    }
    golden_close(&t);
}

// The table was made elsewhere: this is what the names above rest on.
static void the_transcription_makes_the_mistakes_of_the_table(void **state)
{
    (void)state;
    struct golden t = golden_need("golden_traps.csv");
    for (int i = 0; i < t.rows; i++)
        for (int j = 0; j < TRAPS; j++) {
            const struct place at = trap_at(&t, i);
            double f[4][4], want = golden_at(&t, i, traps[j].column);
            transcribe(&at.p, at.ti, at.tr, at.dphi, traps[j].what, f);
            if (!isnan(f[0][0])) // exact backscatter has no alpha in the closed form
                assert_near(f[0][0], want, 1e-10 * want);
        }
    golden_close(&t);
}

// --- what the errata claim -----------------------------------------------------------------------

// 1: glass reflects 4 %.
static void index_is_squared(void **state)
{
    (void)state;
    assert_near(brdf_fresnel_mean(1.5, 0, 0, 1), 0.04, 1e-16);
    assert_near(brdf_fresnel_mean(1.3, 7.5, 0, 1), 0.9155, 5e-5);
    assert_near(brdf_fresnel_mean(5.345064, 5.345064, 0, 1), 0.6894, 5e-5);
    // What the misprint gives is an index of sqrt(n + ik).
    assert_near(brdf_fresnel_mean(sqrt(1.5), 0, 0, 1), 0.0102, 5e-5);
    const double complex misread = csqrt(5.345064 + 5.345064 * (double complex)_Complex_I);
    assert_near(brdf_fresnel_mean(creal(misread), cimag(misread), 0, 1), 0.2551, 5e-5);
}

// 3: a printed cosine above 1 in 36 % of random geometries; the model's are cosines everywhere.
static void alpha_is_an_angle(void **state)
{
    (void)state;
    uint64_t random = random_seed();
    int impossible = 0;
    double worst = 0;
    for (int i = 0; i < 10000; i++) {
        const double ti = random_between(&random, 0, 1.57), tr = random_between(&random, 0, 1.57);
        const double dphi = random_between(&random, -RANDOM_PI, RANDOM_PI);
        const struct brdf_geometry g = brdf_geometry(ti, tr, dphi);
        const struct brdf_rotation *r = &g.rotation;
        const struct alphas printed =
            transcribe_alphas(ti, tr, dphi, sqrt(g.cos2_beta), sqrt(g.sin2_beta), MISREAD_ALPHA_R);
        const struct alphas mended =
            transcribe_alphas(ti, tr, dphi, sqrt(g.cos2_beta), sqrt(g.sin2_beta), MISREAD_NOTHING);
        impossible += fabs(printed.cos_r) > 1;
        worst = fmax(worst, fabs(r->cos_i * r->cos_i + r->sin_i * r->sin_i - 1));
        worst = fmax(worst, fabs(r->cos_r * r->cos_r + r->sin_r * r->sin_r - 1));
        if (g.sin2_beta > 1e-3) {
            assert_near(r->cos_i * r->cos_r, mended.cos_i * mended.cos_r, 1e-12);
            assert_near(r->sin_i * r->cos_r, mended.sin_i * mended.cos_r, 1e-12);
            assert_near(r->cos_i * r->sin_r, mended.cos_i * mended.sin_r, 1e-12);
        }
    }
    print_message("printed |cos alpha_r| > 1 in %d of 10000; cos^2 + sin^2 off 1 by %.2g\n",
                  impossible, worst);
    assert_true(worst <= 2e-15);
    // Expected 3600 with a standard deviation of 48: false alarms one in a million.
    assert_true(impossible > 3360 && impossible < 3840);
}

static double polarised_share(double f[4][4], enum brdf_state in)
{
    const struct brdf_stokes g = brdf_state_stokes(in);
    double out[4] = {0};
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++)
            out[j] += f[j][k] * g.s[k];
    return sqrt(out[1] * out[1] + out[2] * out[2] + out[3] * out[3]) / out[0];
}

// 8: with kd in all elements light would leave more polarised than it can be.
static void light_is_never_more_than_polarised(void **state)
{
    (void)state;
    double printed = 0;
    for (int i = 0; i < 2000; i++) {
        const struct brdf_params p = {1.5, 0, 0.1, 1, i % 2 ? 0.05 : 0.092414};
        const double dphi = i * 0.00314, ti = golden_rad(45), tr = golden_rad(10);
        const struct brdf_geometry g = brdf_geometry(ti, tr, dphi);
        struct brdf_mueller f = brdf_mueller(&p, BRDF_DIFFUSE_PAPER, &g);
        double wrong[4][4];
        transcribe(&p, ti, tr, dphi, MISREAD_DIFFUSE, wrong);
        for (int in = 0; in < BRDF_STATES; in++) {
            assert_true(polarised_share(f.m, (enum brdf_state)in) <= 1 + 1e-15);
            printed = fmax(printed, polarised_share(wrong, (enum brdf_state)in));
        }
    }
    print_message("degree of polarisation, as printed: up to %.3g\n", printed);
    assert_true(printed > 1.7);
}

// 9: kd/cos theta_i is not reciprocal; kd/pi is.
static void papers_diffuse_term_is_not_reciprocal(void **state)
{
    (void)state;
    const struct brdf_params p = {1.5, 0, 0.1, 0, 0.092414};
    const struct brdf_geometry there = brdf_geometry(golden_rad(75), golden_rad(10), 1),
                               back = brdf_geometry(golden_rad(10), golden_rad(75), -1);
    assert_near(brdf_f00(&p, BRDF_DIFFUSE_PAPER, &there) / brdf_f00(&p, BRDF_DIFFUSE_PAPER, &back),
                cos(golden_rad(10)) / cos(golden_rad(75)), 1e-14); // 3.8
    assert_near(brdf_f00(&p, BRDF_DIFFUSE_LAMBERT, &there),
                brdf_f00(&p, BRDF_DIFFUSE_LAMBERT, &back), 0);
}

// 13: 180 deg is the specular half plane.
static void specular_half_plane_is_at_180_deg(void **state)
{
    (void)state;
    const struct brdf_params p = {1.5, 0, 0.1, 1, 0};
    const struct brdf_geometry specular = brdf_geometry(0.7, 0.7, RANDOM_PI),
                               backscatter = brdf_geometry(0.7, 0.7, 0);
    assert_near(specular.tan2_theta, 0, 0);
    assert_near(backscatter.sin2_beta, 0, 0);
    assert_true(brdf_f00(&p, BRDF_DIFFUSE_PAPER, &specular) >
                1e10 * brdf_f00(&p, BRDF_DIFFUSE_PAPER, &backscatter));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_model_falls_for_no_misreading),
        cmocka_unit_test(each_misreading_is_called_by_its_name),
        cmocka_unit_test(f00_falls_into_none_of_the_traps),
        cmocka_unit_test(the_transcription_makes_the_mistakes_of_the_table),
        cmocka_unit_test(index_is_squared),
        cmocka_unit_test(alpha_is_an_angle),
        cmocka_unit_test(light_is_never_more_than_polarised),
        cmocka_unit_test(papers_diffuse_term_is_not_reciprocal),
        cmocka_unit_test(specular_half_plane_is_at_180_deg),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
