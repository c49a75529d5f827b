// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/kernel.h"
#include "fit/passes.h"
#include "fit/objective.h"
#include "fit/repeats.h"
#include "fit/space.h"
#include "model/channel.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <complex.h>

#define PI 3.14159265358979323846
enum { SEED = 2008 };

static const struct brdf_params surfaces[] = {
    {1.5, 0.02, .15, .9, .05},     {1.3, 7.5, .05, 1, .01}, {.6, .01, .3, .7, .1},
    {5.345, 5.345, .12, .95, .09}, {1.5, 0, .2, .8, .1},    {.6, 0, .3, .7, .1}};
enum { SURFACES = sizeof surfaces / sizeof surfaces[0] };

// Readings at `distinct` directions out of plane, each measured `times` times with values and
// uncertainties of its own, in random order; states of polarisation where `polarised`.
struct measured {
    struct readings r;
    unsigned char *in, *out;
};

static struct measured measured_new(size_t distinct, int times, bool polarised, struct rng *rng)
{
    struct measured m = {.r = readings_new(distinct * (size_t)times)};
    size_t count = m.r.count = distinct * (size_t)times;
    m.in = test_calloc(count, 1);
    m.out = test_calloc(count, 1);
    for (size_t i = 0; i < count; i++) {
        size_t from = i < distinct ? i : rng_below(rng, i);
        m.r.ti[i] = i < distinct ? 1.5 * rng_uniform(rng) : m.r.ti[from];
        m.r.tr[i] = i < distinct ? 1.5 * rng_uniform(rng) : m.r.tr[from];
        m.r.dphi[i] = i < distinct ? PI * rng_uniform(rng) : m.r.dphi[from];
        if (polarised) {
            m.in[i] = i < distinct ? (unsigned char)rng_below(rng, BRDF_STATES) : m.in[from];
            m.out[i] = i < distinct ? (unsigned char)rng_below(rng, BRDF_STATES) : m.out[from];
        }
        m.r.f[i] = 0.1 + rng_uniform(rng);
        m.r.u[i] = 0.01 + 0.01 * rng_uniform(rng);
    }
    return m;
}

static void measured_free(struct measured *m)
{
    readings_free(&m->r);
    test_free(m->in);
    test_free(m->out);
}

static struct fit_set compiled(const struct measured *m, bool polarised,
                               enum fit_weighting weighting)
{
    struct fit_data data = readings_data(&m->r, true);
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    data.pol_in = polarised ? m->in : NULL;
    data.pol_out = polarised ? m->out : NULL;
    o.weighting = weighting;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    return set;
}

// The same set as if nothing were known of repeats.
static struct fit_set undone(const struct fit_set *set)
{
    struct fit_set s = *set;
    s.distinct = s.all;
    s.row = NULL;
    s.scatter = 0;
    return s;
}

static struct kernel_gram gram_of(const struct fit_set *set, const struct brdf_params *p)
{
    double x[FIT_PARAMS];
    struct kernel_gram g;
    struct fit_control control = {.stop = false};
    space_of_params(p, x);
    assert_true(passes_gram(set, x, &control, &g));
    return g;
}

static struct kernel_gram moments_of(const struct fit_set *set, const struct brdf_params *p)
{
    double x[FIT_PARAMS];
    struct kernel_gram g;
    struct fit_control control = {.stop = false};
    space_of_params(p, x);
    assert_true(passes_moments(set, x, &control, &g));
    return g;
}

// The largest difference in units of the columns' lengths, from column `first` on.
static double apart(const struct kernel_gram *a, const struct kernel_gram *b, int first)
{
    double worst = 0;
    for (int i = first; i < KERNEL_COLUMNS; i++)
        for (int j = first; j < KERNEL_COLUMNS; j++)
            worst = fmax(worst, fabs(a->m[i][j] - b->m[i][j]) / sqrt(b->m[i][i] * b->m[j][j]));
    return worst;
}

// --- repeated geometries -------------------------------------------------------------------------
static void rows_are_numbered_in_order_of_appearance(void **state)
{
    (void)state;
    const double a[] = {1, 2, 1, 3, 2, 1, 0}, b[] = {5, 5, 5, 5, 5, 6, 5};
    const double *const column[] = {a, b};
    static const uint32_t want[] = {0, 1, 0, 2, 1, 3, 4};
    struct fit_control control = {.stop = false};
    uint32_t group[7];
    size_t groups;
    assert_int_equal(repeats_find(column, 2, 7, &control, group, &groups), 0);
    assert_int_equal(groups, 5);
    assert_memory_equal(group, want, sizeof want);
    assert_int_equal(repeats_find(column, 1, 7, &control, group, &groups), 0);
    assert_int_equal(groups, 4);
}

static void repeated_geometries_are_evaluated_once_with_the_same_sums(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    for (int polarised = 0; polarised < 2; polarised++)
        for (int w = FIT_UNIFORM; w <= FIT_VARIANCE; w++) {
            struct measured m = measured_new(300, 7, polarised, &rng);
            struct fit_set set = compiled(&m, polarised, (enum fit_weighting)w);
            struct fit_set plain = undone(&set);
            assert_int_equal(set.distinct.count, 300);
            assert_int_equal(set.count, 2100);
            for (int j = 0; j < SURFACES; j++) {
                struct kernel_gram a = gram_of(&set, &surfaces[j]);
                struct kernel_gram b = gram_of(&plain, &surfaces[j]);
                struct kernel_gram c = moments_of(&set, &surfaces[j]);
                assert_near(apart(&a, &b, 0), 0, 1e-13);
                assert_near(apart(&c, &b, KERNEL_A), 0, 1e-13);
                assert_near(a.m[KERNEL_R][KERNEL_R] / b.m[KERNEL_R][KERNEL_R], 1, 1e-12);
            }
            set_free(&set);
            measured_free(&m);
        }
}

static void searching_repeated_readings_costs_their_geometries(void **state)
{
    (void)state;
    struct rng rng;
    struct fit_control control = {.stop = false};
    double x[FIT_PARAMS];
    struct kernel_gram g;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(100, 50, false, &rng);
    struct fit_set set = compiled(&m, false, FIT_UNIFORM);
    space_of_params(&surfaces[0], x);
    assert_true(passes_moments(&set, x, &control, &g));
    assert_near(control.points, 104, 0); // padded
    set_free(&set);
    measured_free(&m);
}

static void a_replica_is_a_set_compiled_with_its_values(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    for (int times = 1; times <= 3; times += 2) {
        struct measured m = measured_new(200, times, false, &rng);
        struct fit_set set = compiled(&m, false, FIT_VARIANCE), replica;
        struct fit_control control = {.stop = false};
        double ff = set.ff;
        assert_int_equal(set_replica(&set, &replica), 0);
        for (size_t i = 0; i < set.count; i++) {
            m.r.f[i] = rng_uniform(&rng);
            replica.all.f[i] = m.r.f[i] * set.all.root_g[i];
        }
        assert_int_equal(set_revalue(&replica, &control), 0);
        struct fit_set want = compiled(&m, false, FIT_VARIANCE);
        struct kernel_gram a = gram_of(&replica, &surfaces[0]), b = gram_of(&want, &surfaces[0]);
        assert_near(apart(&a, &b, 0), 0, 1e-14);
        assert_near(replica.ff / want.ff, 1, 1e-14);
        assert_near(set.ff, ff, 0);
        set_free(&replica);
        set_free(&want);
        set_free(&set);
        measured_free(&m);
    }
}

// --- levels and parts ----------------------------------------------------------------------------
static void levels_agree(void **state)
{
    (void)state;
    struct rng rng;
    double worst = 0;
    rng_seed(&rng, SEED);
    for (int polarised = 0; polarised < 2; polarised++) {
        struct measured m = measured_new(1003, 1, polarised, &rng);
        struct fit_set set = compiled(&m, polarised, FIT_VARIANCE);
        for (int j = 0; j < SURFACES; j++) {
            set.level = BATCH_PLAIN;
            struct kernel_gram plain = gram_of(&set, &surfaces[j]);
            for (int l = BATCH_PLAIN; l <= (int)batch_best_level(); l++) {
                set.level = (enum batch_level)l;
                struct kernel_gram g = gram_of(&set, &surfaces[j]);
                struct kernel_gram o = moments_of(&set, &surfaces[j]);
                worst = fmax(worst, fmax(apart(&g, &plain, 0), apart(&o, &plain, KERNEL_A)));
                assert_near(worst, 0, 1e-13);
            }
        }
        set_free(&set);
        measured_free(&m);
    }
    print_message("within %.1e\n", worst);
}

static void parts_add_up_to_the_whole_to_the_bit(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(5000, 1, false, &rng);
    struct fit_set set = compiled(&m, false, FIT_UNIFORM);
    struct kernel_gram whole = gram_of(&set, &surfaces[0]), sum = {.m = {{0}}}, part[8];
    double x[FIT_PARAMS];
    size_t length = kernel_part(&set), parts = (set.distinct.padded + length - 1) / length;
    assert_in_range(parts, 2, 8);
    space_of_params(&surfaces[0], x);
    for (size_t i = parts; i-- > 0;) // whoever comes last
        kernel_gram_of(&set, x, i * length, i + 1 < parts ? (i + 1) * length : set.distinct.padded,
                       &part[i]);
    for (size_t i = 0; i < parts; i++)
        kernel_add(&sum, &part[i]);
    assert_memory_equal(&sum, &whole, sizeof sum);
    set_free(&set);
    measured_free(&m);
}

static bool count_and_stop(void *ctx)
{
    int *left = ctx;
    return --*left < 0;
}

static void passes_ask_often_and_stop(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(200000, 1, false, &rng);
    struct fit_set set = compiled(&m, false, FIT_UNIFORM);
    double x[FIT_PARAMS];
    struct kernel_gram g;
    space_of_params(&surfaces[0], x);
    for (int asks = 0; asks < 5; asks++) {
        int left = asks;
        struct fit_control control = {.canceled = count_and_stop, .ctx = &left};
        assert_false(passes_gram(&set, x, &control, &g));
        assert_true(control.points <= (asks + 1) * 1.2 * (double)CONTROL_SLICE);
        left = asks;
        control = (struct fit_control){.canceled = count_and_stop, .ctx = &left};
        assert_false(passes_moments(&set, x, &control, &g));
    }
    set_free(&set);
    measured_free(&m);
}

// --- polarised readings --------------------------------------------------------------------------
static void polarised_residuals_are_those_of_the_channels(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(700, 1, true, &rng);
    struct fit_set set = compiled(&m, true, FIT_VARIANCE);
    for (int j = 0; j < SURFACES; j++) {
        const struct brdf_params *p = &surfaces[j];
        double x[FIT_PARAMS], v = 1 / (2 * p->sigma * p->sigma), sum = 0;
        space_of_params(p, x);
        for (size_t at = 0; at < set.padded; at += KERNEL_BLOCK) {
            struct kernel_block b;
            size_t count = kernel_jacobian(&set, x, at, &b);
            for (size_t i = at; i < at + count && i < set.count; i++) {
                struct brdf_geometry g = brdf_geometry(m.r.ti[i], m.r.tr[i], m.r.dphi[i]);
                struct brdf_channel w = brdf_channel(&g, m.in[i], m.out[i]);
                struct brdf_fresnel r = brdf_fresnel(p->n, p->k, g.sin2_beta, g.cos2_beta);
                double height = p->ks * v * g.spec_per_sr * exp(-v * g.tan2_theta);
                double f =
                    height * (w.w_ss * r.ss + w.w_pp * r.pp + w.w_re * r.re + w.w_im * r.im) +
                    p->kd * w.w_kd * g.inv_cos_i;
                double scale = fmax(m.r.f[i], height * r.ss), root_g = set.all.root_g[i];
                sum += pow((m.r.f[i] - f) * root_g, 2);
                assert_near(b.r[i - at] / root_g, m.r.f[i] - f, 1e-13 * scale);
                assert_near(objective_residual(&set, p, i) / root_g, m.r.f[i] - f, 1e-13 * scale);
            }
        }
        struct kernel_gram g = moments_of(&set, p);
        assert_near(g.m[KERNEL_R][KERNEL_R] / sum, 1, 1e-12);
    }
    set_free(&set);
    measured_free(&m);
}

// The Fresnel terms as functions analytic in n and kappa: ss, pp, re, im.
static void fresnel_terms(double complex n, double complex kappa, double c2, double complex ret[4])
{
    double s2 = 1 - c2, c = sqrt(c2);
    double complex above = (n - 1) * (n + 1) - kappa, im = 2 * n * csqrt(kappa), re = above + c2;
    double complex m = csqrt(re * re + im * im), a, b;
    if (creal(re) >= 0) {
        a = csqrt((m + re) / 2);
        b = im / (2 * a);
    } else {
        b = csqrt((m - re) / 2);
        a = im / (2 * b);
    }
    double complex s = m + c2 + 2 * c * a, t = m * c2 + s2 * s2 + 2 * c * a * s2;
    double complex unit = (above * above + im * im) / (s * s * t);
    ret[0] = unit * t;
    ret[1] = unit * ((s2 - a * c) * (s2 - a * c) + b * b * c2);
    ret[2] = unit * (s2 * s2 - m * c2);
    ret[3] = unit * 2 * s2 * c * b;
}

static double channel_step(const struct fit_set *set, size_t i, double complex n,
                           double complex kappa, double h)
{
    double complex term[4], sum = 0;
    fresnel_terms(n, kappa, set->all.cos_beta[i] * set->all.cos_beta[i], term);
    for (int c = 0; c < SET_CHANNELS; c++)
        sum += set->all.channel[c][i] * term[c];
    return h > 0 ? cimag(sum) / h : creal(sum);
}

static void polarised_derivatives_are_the_complex_step(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(700, 1, true, &rng);
    struct fit_set set = compiled(&m, true, FIT_UNIFORM);
    double worst = 0;
    for (int l = BATCH_PLAIN; l <= (int)batch_best_level(); l++)
        for (int j = 0; j < SURFACES; j++) {
            const struct brdf_params *p = &surfaces[j];
            const double h = 1e-40, v = 1 / (2 * p->sigma * p->sigma), kappa = p->k * p->k;
            double x[FIT_PARAMS];
            struct kernel_block b;
            if (p->k == 0) // its own test
                continue;
            space_of_params(p, x);
            set.level = (enum batch_level)l;
            for (size_t i = 0; i < set.count; i++) {
                if (i % KERNEL_BLOCK == 0)
                    kernel_jacobian(&set, x, i, &b);
                if (v * set.all.tan2_theta[i] > 290) // the exponent's floor
                    continue;
                double height = p->ks * v * exp(-v * set.all.tan2_theta[i]);
                double f = channel_step(&set, i, p->n, kappa, 0);
                double fn = channel_step(&set, i, p->n + (double complex)I * h, kappa, h);
                double fk = channel_step(&set, i, p->n, kappa + (double complex)I * h, h);
                double spec = height * set.all.spec[i], ks = p->ks;
                const double want[FIT_PARAMS] = {height * fn, height * fk,
                                                 height * f * (2 * v * set.all.tan2_theta[i] - 2),
                                                 height * f / ks, set.all.diffuse[i]};
                const double scale[FIT_PARAMS] = {spec * (1 + 1 / p->n), spec * (1 + 1 / kappa),
                                                  spec * 2 * (v * set.all.tan2_theta[i] + 1),
                                                  spec / ks, 1};
                for (int c = 0; c < FIT_PARAMS; c++) {
                    double off = fabs(b.j[c][i % KERNEL_BLOCK] - want[c]) / scale[c];
                    worst = fmax(worst, off);
                    if (!(off <= 1e-12))
                        fail_msg("column %d, surface %d, level %d, reading %zu: %.17g, not %.17g",
                                 c, j, l, i, b.j[c][i % KERNEL_BLOCK], want[c]);
                }
            }
        }
    print_message("within %.1e\n", worst);
    set_free(&set);
    measured_free(&m);
}

// Im(rs rp*) goes as k = sqrt(kappa): at k = 0 its slope is that at BATCH_K_LEAST, finite, and
// leads away from 0 when the data want it.
static void slope_at_k_zero_is_finite_and_points_the_right_way(void **state)
{
    (void)state;
    struct readings r = readings_new(8);
    unsigned char in[8], out[8];
    for (int i = 0; i < 8; i++) {
        readings_add(&r, 20 + 5 * i, 20 + 5 * i, 1);
        in[i] = BRDF_STATE_PLUS45;
        out[i] = BRDF_STATE_R;
    }
    struct fit_data data = readings_data(&r, false);
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    data.pol_in = in;
    data.pol_out = out;
    assert_int_equal(set_compile(&data, &o, &control, &set), 0);
    double zero[] = {1.5, 0, log(0.2), 1, 0},
           least[] = {1.5, pow(BATCH_K_LEAST, 2), log(0.2), 1, 0};
    double more[] = {1.5, pow(0.01, 2), log(0.2), 1, 0};
    struct kernel_block a, b, c;
    kernel_jacobian(&set, zero, 0, &a);
    kernel_jacobian(&set, least, 0, &b);
    kernel_jacobian(&set, more, 0, &c);
    for (int i = 0; i < 8; i++) {
        double rise = a.r[i] - c.r[i]; // of the model from k = 0 to 0.01
        assert_true(fabs(a.j[FIT_K][i]) > 1 && isfinite(a.j[FIT_K][i]));
        assert_near(a.j[FIT_K][i] / b.j[FIT_K][i], 1, 1e-5);
        assert_true(rise * a.j[FIT_K][i] > 0);
    }
    set_free(&set);
    readings_free(&r);
}

static void unpolarised_channels_are_f00(void **state)
{
    (void)state;
    struct rng rng;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(500, 1, false, &rng);
    struct fit_set plain = compiled(&m, false, FIT_UNIFORM);
    struct fit_set same = compiled(&m, true, FIT_UNIFORM); // all of them u
    assert_null(same.all.channel[0]);
    m.in[0] = BRDF_STATE_S; // s light and an analyser for s: its weight is another
    m.out[0] = BRDF_STATE_S;
    struct fit_set mixed = compiled(&m, true, FIT_UNIFORM);
    assert_non_null(mixed.all.channel[0]);
    for (int j = 0; j < SURFACES; j++) {
        struct kernel_block a, b;
        double x[FIT_PARAMS];
        space_of_params(&surfaces[j], x);
        kernel_jacobian(&plain, x, 0, &a);
        kernel_jacobian(&mixed, x, 0, &b);
        for (int i = 1; i < KERNEL_BLOCK; i++)
            for (int c = 0; c < FIT_PARAMS; c++)
                assert_near(b.j[c][i], a.j[c][i], 1e-12 * (fabs(a.j[c][i]) + plain.all.spec[i]));
    }
    set_free(&plain);
    set_free(&same);
    set_free(&mixed);
    measured_free(&m);
}

static void states_that_do_not_exist_are_refused(void **state)
{
    (void)state;
    struct rng rng;
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    rng_seed(&rng, SEED);
    struct measured m = measured_new(20, 1, false, &rng);
    struct fit_data data = readings_data(&m.r, false);
    data.pol_out = m.out;
    m.out[7] = BRDF_STATES;
    assert_int_equal(set_compile(&data, &o, &control, &set), FIT_E_DATA);
    measured_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_numbered_in_order_of_appearance),
        cmocka_unit_test(repeated_geometries_are_evaluated_once_with_the_same_sums),
        cmocka_unit_test(searching_repeated_readings_costs_their_geometries),
        cmocka_unit_test(a_replica_is_a_set_compiled_with_its_values),
        cmocka_unit_test(levels_agree),
        cmocka_unit_test(parts_add_up_to_the_whole_to_the_bit),
        cmocka_unit_test(passes_ask_often_and_stop),
        cmocka_unit_test(polarised_residuals_are_those_of_the_channels),
        cmocka_unit_test(polarised_derivatives_are_the_complex_step),
        cmocka_unit_test(slope_at_k_zero_is_finite_and_points_the_right_way),
        cmocka_unit_test(unpolarised_channels_are_f00),
        cmocka_unit_test(states_that_do_not_exist_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
