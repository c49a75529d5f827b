// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/bootstrap.h"
#include "fit/fit.h"
#include "fit/select.h"
#include "tests/unit/readings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>
#include <time.h>

static const struct brdf_params metal = {1.3, 7.5, 0.12, 1, 0.01};

static struct fit_result fit(const struct readings *r, const struct fit_options *o, bool with_u)
{
    struct fit_data data = readings_data(r, with_u);
    struct fit_result result;
    assert_int_equal(fit_run(&data, o, &result), 0);
    return result;
}

static struct readings measured(uint64_t seed)
{
    struct readings r = readings_paper();
    readings_measure(&r, &metal, 0.02, 1e-5, seed);
    return r;
}

static int by_value(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

static void quantiles_are_those_of_the_sorted_values(void **state)
{
    (void)state;
    struct rng rng;
    double values[200], sorted[200];
    rng_seed(&rng, 3);
    for (int round = 0; round < 2000; round++) {
        size_t count = 1 + rng_below(&rng, 200);
        for (size_t i = 0; i < count; i++)
            values[i] = round % 3 ? rng_normal(&rng) : (double)rng_below(&rng, 4);
        memcpy(sorted, values, count * sizeof *values);
        qsort(sorted, count, sizeof *sorted, by_value);
        double p = round % 5 == 0 ? 1 : round % 5 == 1 ? 0 : rng_uniform(&rng);
        double place = p * (double)(count - 1);
        size_t low = (size_t)place, high = low + 1 < count ? low + 1 : low;
        double want = sorted[low] + (place - (double)low) * (sorted[high] - sorted[low]);
        assert_near(select_quantile(values, count, p), want, 1e-15);
    }
}

// u of what the data identify, by repetition and by the sandwich. 2000 replicas: 4 sigma of their
// spread is 6 %; what is curved in between may add as much.
static void spread_is_the_covariance_where_the_model_is_nearly_linear(void **state)
{
    (void)state;
    struct readings r = measured(4);
    for (int kind = 0; kind < 3; kind++) { // variance with u, uniform with u, uniform without
        struct fit_options o = fit_options_default();
        o.weighting = kind == 0 ? FIT_VARIANCE : FIT_UNIFORM;
        o.bootstrap = 2000;
        struct fit_result f = fit(&r, &o, kind < 2);
        assert_int_equal(f.bootstrap.replicas, 2000);
        assert_true(f.bootstrap.parametric == (kind < 2));
        assert_near(f.bootstrap.param[FIT_SIGMA].u / f.estimate[FIT_SIGMA].u, 1, 0.12);
        assert_near(f.bootstrap.param[FIT_KD].u / f.estimate[FIT_KD].u, 1, 0.15);
        assert_near(f.bootstrap.ks_r0.u / f.ks_r0.u, 1, 0.12);
        assert_near(f.bootstrap.ks_r45.u / f.ks_r45.u, 1, 0.12);
        for (int i = 0; i < FIT_PARAMS; i++) {
            const struct fit_spread *s = &f.bootstrap.param[i];
            assert_true(s->lo95 <= s->hi95 && s->u > 0);
            assert_true(s->hi95 - s->lo95 < 8 * s->u);
        }
    }
    readings_free(&r);
}

// 2 % noise is large in the peak and small in the wings: residuals drawn from one urn would give
// kd, which the wings tell, the peak's noise.
static void wild_noise_stays_where_it_was(void **state)
{
    (void)state;
    struct readings r = measured(4);
    struct fit_options o = fit_options_default();
    o.bootstrap = 1000;
    struct fit_result f = fit(&r, &o, false);
    double spread = f.bootstrap.param[FIT_KD].u;
    assert_near(spread / f.estimate[FIT_KD].u, 1, 0.15);
    o.weighting = FIT_VARIANCE; // with known u and best weights kd is several times better known
    struct fit_result known = fit(&r, &o, true);
    assert_true(known.bootstrap.param[FIT_KD].u < 0.5 * spread);
    readings_free(&r);
}

static void same_seed_same_replicas_and_another_seed_others(void **state)
{
    (void)state;
    struct readings r = measured(5);
    struct fit_options o = fit_options_default();
    o.bootstrap = 50;
    struct fit_result a = fit(&r, &o, true);
    o.threads = 3;
    struct fit_result b = fit(&r, &o, true);
    o.seed = 2;
    struct fit_result c = fit(&r, &o, true);
    assert_memory_equal(a.bootstrap.param, b.bootstrap.param, sizeof a.bootstrap.param);
    assert_true(fabs(a.bootstrap.param[FIT_KD].u / c.bootstrap.param[FIT_KD].u - 1) > 1e-3);
    assert_near(a.params.sigma / c.params.sigma, 1, 1e-6);
    readings_free(&r);
}

static void a_common_scale_is_in_ks_and_kd(void **state)
{
    (void)state;
    struct readings r = measured(6);
    struct fit_options o = fit_options_default();
    o.bootstrap = 4000;
    o.u_scale = 0.03;
    struct fit_result f = fit(&r, &o, true);
    assert_near(f.bootstrap.ks_r0.u / (0.03 * f.ks_r0.value), 1, 0.06);
    assert_near(f.bootstrap.ks_r0.u / f.ks_r0.u, 1, 0.06);
    assert_near(f.bootstrap.param[FIT_SIGMA].u / f.estimate[FIT_SIGMA].u, 1, 0.12);
    readings_free(&r);
}

static void none_or_too_few_say_nothing(void **state)
{
    (void)state;
    struct readings r = measured(7);
    struct fit_options o = fit_options_default();
    for (int replicas = 0; replicas < 2; replicas++) {
        o.bootstrap = replicas;
        struct fit_result f = fit(&r, &o, true);
        assert_int_equal(f.bootstrap.replicas, 0);
        assert_true(isnan(f.bootstrap.param[FIT_N].u) && isnan(f.bootstrap.ks_r45.hi95));
    }
    r.count = 5; // no degree of freedom, no u: nothing tells noise
    o.bootstrap = 10;
    struct fit_result f = fit(&r, &o, false);
    assert_int_equal(f.bootstrap.replicas, 0);
    struct fit_data data = readings_data(&r, true);
    o.bootstrap = BOOTSTRAP_MOST + 1;
    assert_int_equal(fit_run(&data, &o, &f), FIT_E_OPTIONS);
    o.bootstrap = -1;
    assert_int_equal(fit_run(&data, &o, &f), FIT_E_OPTIONS);
    readings_free(&r);
}

// --- cancelling ----------------------------------------------------------------------------------

struct deadline {
    struct timespec asked;
    double after_s, longest_s; // between two questions, from after_s on
    double began_s;
};

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool ask(void *ctx)
{
    struct deadline *d = ctx;
    double now = now_s();
    if (now - d->began_s > d->longest_s)
        d->longest_s = now - d->began_s;
    d->began_s = now;
    return now > d->after_s;
}

// 100,000 replicas of a large set would take minutes. Processor time, so that other programs do not
// count; 10 ms is what is promised.
static void it_can_be_canceled_at_once(void **state)
{
    (void)state;
    enum { COPIES = 40 };
    struct readings one = measured(8), r = readings_new(COPIES * one.count);
    for (size_t i = 0; i < COPIES * one.count; i++) {
        r.ti[i] = one.ti[i % one.count];
        r.tr[i] = one.tr[i % one.count];
        r.dphi[i] = one.dphi[i % one.count];
        r.f[i] = one.f[i % one.count];
        r.u[i] = one.u[i % one.count];
    }
    r.count = COPIES * one.count;
    struct fit_options o = fit_options_default();
    o.bootstrap = BOOTSTRAP_MOST;
    struct deadline d = {.after_s = now_s() + 0.6, .began_s = now_s()};
    o.canceled = ask;
    o.cancel_ctx = &d;
    struct fit_data data = readings_data(&r, true);
    struct fit_result f;
    assert_int_equal(fit_run(&data, &o, &f), FIT_E_CANCELED);
    print_message("longest time between two questions: %.2f ms, after the last: %.2f ms\n",
                  1e3 * d.longest_s, 1e3 * (now_s() - d.began_s));
    assert_true(d.longest_s < 0.01 && now_s() - d.began_s < 0.01);
    readings_free(&r);
    readings_free(&one);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quantiles_are_those_of_the_sorted_values),
        cmocka_unit_test(spread_is_the_covariance_where_the_model_is_nearly_linear),
        cmocka_unit_test(wild_noise_stays_where_it_was),
        cmocka_unit_test(same_seed_same_replicas_and_another_seed_others),
        cmocka_unit_test(a_common_scale_is_in_ks_and_kd),
        cmocka_unit_test(none_or_too_few_say_nothing),
        cmocka_unit_test(it_can_be_canceled_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
