// SPDX-License-Identifier: MIT
// uses: cli campaign drivers fit model base
#include "cli/fit_options.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

static void words_change_what_they_name(void **state)
{
    (void)state;
    struct fit_options o = fit_options_default(), before = o;
    struct fit_words w = {"dense:3.5", "paper", "lambert", "n=1:3,kd=0:0.1"};
    assert_int_equal(fit_words_take(&w, &o, NULL), 0);
    assert_int_equal(o.weighting, FIT_DENSE);
    assert_true(o.dense_g == 3.5);
    assert_int_equal(o.method, FIT_PAPER);
    assert_int_equal(o.diffuse, BRDF_DIFFUSE_LAMBERT);
    assert_true(o.lower.n == 1 && o.upper.n == 3 && o.lower.kd == 0 && o.upper.kd == 0.1);
    assert_true(o.lower.sigma == before.lower.sigma && o.upper.sigma == before.upper.sigma);
    w = (struct fit_words){.bounds = "k=0:0,n=1.5:1.5"}; // held
    assert_int_equal(fit_words_take(&w, &o, NULL), 0);
    assert_true(o.lower.k == 0 && o.upper.k == 0 && o.lower.n == 1.5 && o.upper.n == 1.5);
    w = (struct fit_words){"variance", NULL, NULL, NULL};
    assert_int_equal(fit_words_take(&w, &o, NULL), 0);
    assert_int_equal(o.weighting, FIT_VARIANCE);
    assert_int_equal(o.method, FIT_PAPER);
}

static void refuses(struct fit_words w, const char *text)
{
    struct gon_error err = {0};
    struct fit_options o = fit_options_default();
    assert_int_equal(fit_words_take(&w, &o, &err), GON_E_INPUT);
    if (!strstr(err.text, text))
        fail_msg("'%s' is not in '%s'", text, err.text);
}

static void wrong_words_are_refused_by_name(void **state)
{
    (void)state;
    refuses((struct fit_words){.weights = "unifrom"}, "did you mean 'uniform'");
    refuses((struct fit_words){.weights = "dense:x"}, "a number > 0 after the colon, not 'x'");
    refuses((struct fit_words){.weights = "dense:-1"}, "--weights dense:G");
    refuses((struct fit_words){.weights = "dense:G"}, "a number > 0");
    refuses((struct fit_words){.weights = "dense"}, "dense:G");
    refuses((struct fit_words){.method = "simplex"}, "allowed: memetic, paper");
    refuses((struct fit_words){.bounds = "n=1"}, "NAME=LOW:HIGH");
    refuses((struct fit_words){.bounds = "n=1:2,q=1:2"}, "no parameter 'q'");
    refuses((struct fit_words){.bounds = "n=2:1"},
            "--bounds n: 2:1 is empty; low must not be above high (equal: held)");
    refuses((struct fit_words){.bounds = "n=1:nan"}, "not two numbers");
    refuses((struct fit_words){.bounds = "k=-5:-1"},
            "--bounds k: -5:-1 is out of range; allowed 0..1000000");
    refuses((struct fit_words){.bounds = "sigma=0:0.1"},
            "--bounds sigma: 0:0.1 is out of range; allowed 0.000001..1000");
    refuses((struct fit_words){.bounds = "n=1:1e308"},
            "--bounds n: 1:1e308 is out of range; allowed 0.000001..1000000");
    refuses((struct fit_words){.bounds = "n=1:2,kd=0:1,n=1:3"}, "--bounds: n is given twice");
    refuses((struct fit_words){.weights = "dense:1e300"}, "not '1e300'; at most 1000000000000");
}

static void angles_are_a_list(void **state)
{
    (void)state;
    struct gon_error err;
    double deg[3];
    assert_int_equal(fit_angles_take("--theta-i", "0,10,20.5", deg, 3, &err), 3);
    assert_true(deg[0] == 0 && deg[1] == 10 && deg[2] == 20.5);
    assert_int_equal(fit_angles_take("--theta-i", "0,1,2,3", deg, 3, &err), GON_E_INPUT);
    assert_int_equal(fit_angles_take("--theta-i", "0,,3", deg, 3, &err), GON_E_INPUT);
    assert_int_equal(fit_angles_take("--theta-i", "90", deg, 3, &err), GON_E_INPUT);
    assert_int_equal(fit_angles_take("--theta-i", "-1", deg, 3, &err), GON_E_INPUT);
}

static void refuses_paper(struct fit_paper_words w, enum fit_method method, const char *text)
{
    struct gon_error err = {0};
    struct fit_options o = fit_options_default();
    o.method = method;
    assert_int_equal(fit_paper_take(&w, &o, &err), GON_E_INPUT);
    if (!strstr(err.text, text))
        fail_msg("'%s' is not in '%s'", text, err.text);
}

static void words_of_the_papers_algorithm(void **state)
{
    (void)state;
    struct fit_options o = fit_options_default(), before = o;
    struct fit_paper_words none = {0}, all = {40, 16, 200, "individual", "linear", true};
    assert_int_equal(fit_paper_take(&none, &o, NULL), 0);
    assert_memory_equal(&o.paper, &before.paper, sizeof o.paper);
    o.method = FIT_PAPER;
    assert_int_equal(fit_paper_take(&all, &o, NULL), 0);
    assert_true(o.paper.population == 40 && o.paper.bits == 16 && o.paper.generations == 200);
    assert_int_equal(o.paper.mutation, FIT_MUTATE_INDIVIDUAL);
    assert_int_equal(o.paper.scaling, FIT_SCALING_LINEAR);
    assert_true(o.paper.elitism);
    refuses_paper(all, FIT_MEMETIC, "belong to --method paper");
    refuses_paper((struct fit_paper_words){.population = 7}, FIT_PAPER, "an even number");
    refuses_paper((struct fit_paper_words){.mutation = "bits"}, FIT_PAPER, "did you mean 'bit'");
    refuses_paper((struct fit_paper_words){.scaling = "sigma"}, FIT_PAPER, "none, linear");
}

static void too_few_replicas_are_refused(void **state)
{
    (void)state;
    struct fit_options o = fit_options_default();
    struct gon_error err = {0};
    static const long wrong[] = {-1, 1, 39, 100001};
    assert_int_equal(fit_bootstrap_take(0, &o, &err), 0);
    assert_int_equal(fit_bootstrap_take(40, &o, &err), 0);
    assert_int_equal(o.bootstrap, 40);
    for (int i = 0; i < 4; i++)
        assert_int_equal(fit_bootstrap_take(wrong[i], &o, &err), GON_E_INPUT);
    fit_bootstrap_take(1, &o, &err);
    assert_non_null(strstr(err.text, "--bootstrap 1 is out of range; allowed 0, or 40..100000"));
    assert_int_equal(o.bootstrap, 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_change_what_they_name),
        cmocka_unit_test(wrong_words_are_refused_by_name),
        cmocka_unit_test(words_of_the_papers_algorithm),
        cmocka_unit_test(angles_are_a_list),
        cmocka_unit_test(too_few_replicas_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
