// SPDX-License-Identifier: MIT
// uses: model
#include "model/brdf.h"
#include "model/channel.h"
#include "tests/unit/golden.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define PI 3.14159265358979323846

static const double stokes[BRDF_STATES][4] = {{1, 0, 0, 0}, {1, 1, 0, 0},  {1, -1, 0, 0},
                                              {1, 0, 1, 0}, {1, 0, -1, 0}, {1, 0, 0, 1},
                                              {1, 0, 0, -1}};

static struct brdf_geometry geometry_at(const struct golden *t, int row)
{
    return brdf_geometry(golden_rad(golden_at(t, row, "theta_i_deg")),
                         golden_rad(golden_at(t, row, "theta_r_deg")),
                         golden_rad(golden_at(t, row, "dphi_deg")));
}

// 1/2 a^T F g, or (F g)_0 without an analyser, from the table's sixteen numbers.
static double want_at(const struct golden *t, int row, int in, int out)
{
    double sum = 0;
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++) {
            const char name[] = {'f', (char)('0' + j), (char)('0' + k), 0};
            sum += stokes[out][j] * golden_at(t, row, name) * stokes[in][k];
        }
    return out == BRDF_STATE_U ? sum : sum / 2;
}

// The formula of model/channel.h, word by word.
static double channel_at(const struct golden *t, int row, int in, int out)
{
    const struct brdf_geometry g = geometry_at(t, row);
    const struct brdf_channel w = brdf_channel(&g, (enum brdf_state)in, (enum brdf_state)out);
    const struct brdf_fresnel r =
        brdf_fresnel(golden_at(t, row, "n"), golden_at(t, row, "k"), g.sin2_beta, g.cos2_beta);
    const double sigma = golden_at(t, row, "sigma"), v = 1 / (2 * sigma * sigma);
    return golden_at(t, row, "ks") * v * g.spec_per_sr * exp(-v * g.tan2_theta) *
               (w.w_ss * r.ss + w.w_pp * r.pp + w.w_re * r.re + w.w_im * r.im) +
           golden_at(t, row, "kd") * w.w_kd * g.inv_cos_i;
}

static void check_channels(const char *name)
{
    struct golden t = golden_need(name);
    double worst = 0;
    for (int i = 0; i < t.rows; i++)
        for (int in = 0; in < BRDF_STATES; in++)
            for (int out = 0; out < BRDF_STATES; out++) {
                const double f00 = golden_at(&t, i, "f00");
                const double diffuse =
                    golden_at(&t, i, "kd") / cos(golden_rad(golden_at(&t, i, "theta_i_deg")));
                const double want = want_at(&t, i, in, out), got = channel_at(&t, i, in, out);
                // The sum's own rounding where the diffuse part hides the specular one.
                const double error = fabs(got - want) - 1e-15 * diffuse;
                worst = fmax(worst, error / (f00 - diffuse));
                if (!(error <= 1e-10 * (f00 - diffuse)))
                    fail_msg("%s row %d, %s to %s: %.17g, reference %.17g", name, i,
                             brdf_state_name((enum brdf_state)in),
                             brdf_state_name((enum brdf_state)out), got, want);
            }
    print_message("%s: worst of %d x 49 channels %.2g f_00\n", name, t.rows, worst);
    golden_close(&t);
}

static void channels_out_of_plane_equal_the_reference_matrix(void **state)
{
    (void)state;
    check_channels("golden_mueller.csv");
}

static void channels_at_the_edges_equal_the_reference_matrix(void **state)
{
    (void)state;
    check_channels("golden_edge.csv");
}

static void unpolarised_channel_without_analyser_is_f00(void **state)
{
    (void)state;
    const struct brdf_geometry g = brdf_geometry(0.7, 0.4, 2.0);
    const struct brdf_channel w = brdf_channel(&g, BRDF_STATE_U, BRDF_STATE_U);
    assert_near(w.w_ss, 0.5, 0);
    assert_near(w.w_pp, 0.5, 0);
    assert_near(w.w_re, 0, 0);
    assert_near(w.w_im, 0, 0);
    assert_near(w.w_kd, 1, 0);
}

// An analyser and the one across share the light; so do the two halves of unpolarised light.
static void opposite_states_add_up_to_none(void **state)
{
    (void)state;
    static const enum brdf_state pairs[][2] = {{BRDF_STATE_S, BRDF_STATE_P},
                                               {BRDF_STATE_PLUS45, BRDF_STATE_MINUS45},
                                               {BRDF_STATE_R, BRDF_STATE_L}};
    const struct brdf_geometry g = brdf_geometry(0.9, 0.3, 1.1);
    for (int in = 0; in < BRDF_STATES; in++)
        for (int i = 0; i < 3; i++) {
            const struct brdf_channel none = brdf_channel(&g, (enum brdf_state)in, BRDF_STATE_U),
                                      one = brdf_channel(&g, (enum brdf_state)in, pairs[i][0]),
                                      other = brdf_channel(&g, (enum brdf_state)in, pairs[i][1]);
            assert_near(one.w_ss + other.w_ss, none.w_ss, 2e-16);
            assert_near(one.w_pp + other.w_pp, none.w_pp, 2e-16);
            assert_near(one.w_re + other.w_re, none.w_re, 2e-16);
            assert_near(one.w_im + other.w_im, none.w_im, 2e-16);
            assert_near(one.w_kd + other.w_kd, none.w_kd, 0);
        }
}

// A pure state into a pure state is |x rs + y rp|^2 for some x and y: never negative.
static void pure_channels_are_squares(void **state)
{
    (void)state;
    for (int i = 0; i < 500; i++) {
        const struct brdf_geometry g =
            brdf_geometry(fmod(i * 0.618, 1.57), fmod(i * 0.414, 1.57), fmod(i * 0.732, 6.28));
        for (int in = 1; in < BRDF_STATES; in++)
            for (int out = 1; out < BRDF_STATES; out++) {
                const struct brdf_channel w =
                    brdf_channel(&g, (enum brdf_state)in, (enum brdf_state)out);
                assert_true(w.w_ss >= -1e-16 && w.w_pp >= -1e-16);
                // Some ten roundings of numbers up to 1.
                assert_near(w.w_re * w.w_re + w.w_im * w.w_im, 4 * w.w_ss * w.w_pp, 2e-15);
            }
    }
}

static void states_are_found_by_the_names_they_print(void **state)
{
    (void)state;
    for (int i = 0; i < BRDF_STATES; i++) {
        assert_int_equal(brdf_state_find(brdf_state_name((enum brdf_state)i)), i);
        const struct brdf_stokes s = brdf_state_stokes((enum brdf_state)i);
        for (int j = 0; j < 4; j++)
            assert_near(s.s[j], stokes[i][j], 0);
    }
    static const char *const wrong[] = {"", "U", "45", "+4", "+455", "r", "unknown"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_int_equal(brdf_state_find(wrong[i]), -1);
}

static void channels_of_directions_outside_the_domain_are_nan(void **state)
{
    (void)state;
    const struct brdf_geometry g = brdf_geometry(PI / 2, 0, PI);
    const struct brdf_channel w = brdf_channel(&g, BRDF_STATE_S, BRDF_STATE_PLUS45);
    assert_true(isnan(w.w_ss) && isnan(w.w_pp) && isnan(w.w_re) && isnan(w.w_im));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(channels_out_of_plane_equal_the_reference_matrix),
        cmocka_unit_test(channels_at_the_edges_equal_the_reference_matrix),
        cmocka_unit_test(unpolarised_channel_without_analyser_is_f00),
        cmocka_unit_test(opposite_states_add_up_to_none),
        cmocka_unit_test(pure_channels_are_squares),
        cmocka_unit_test(states_are_found_by_the_names_they_print),
        cmocka_unit_test(channels_of_directions_outside_the_domain_are_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
