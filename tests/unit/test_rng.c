// SPDX-License-Identifier: MIT
// uses: fit model
#include "fit/rng.h"
#include "tests/unit/golden.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static void sequence_is_that_of_the_published_generator(void **state)
{
    (void)state;
    struct rng r = {{1, 2, 3, 4}}; // xoshiro256** from this state, by hand and in its authors' code
    static const uint64_t want[] = {11520, 0, 1509978240, 1215971899390074240};
    for (int i = 0; i < 4; i++)
        assert_true(rng_next(&r) == want[i]);
    rng_seed(&r, 0);
    assert_true(r.s[0] == 0xe220a8397b1dcdafu); // splitmix64's first output for seed 0
}

static void same_seed_same_sequence_other_seed_another(void **state)
{
    (void)state;
    struct rng a, b, c;
    rng_seed(&a, 7);
    rng_seed(&b, 7);
    rng_seed(&c, 8);
    int differ = 0;
    for (int i = 0; i < 100; i++) {
        uint64_t x = rng_next(&a);
        assert_true(x == rng_next(&b));
        differ += x != rng_next(&c);
    }
    assert_int_equal(differ, 100);
}

// Means and variances of 1e6 draws of seed 42: fixed numbers; bounds are 5 sigma.
static void uniform_and_normal_have_their_moments(void **state)
{
    (void)state;
    struct rng r;
    rng_seed(&r, 42);
    double u = 0, u2 = 0, z = 0, z2 = 0, z4 = 0, n = 1e6;
    for (int i = 0; i < 1000000; i++) {
        double x = rng_uniform(&r), y = rng_normal(&r);
        assert_true(x >= 0 && x < 1);
        u += x;
        u2 += x * x;
        z += y;
        z2 += y * y;
        z4 += y * y * y * y;
    }
    assert_near(u / n, 0.5, 5 * 0.289e-3);
    assert_near(u2 / n, 1.0 / 3, 5 * 0.298e-3);
    assert_near(z / n, 0, 5e-3);
    assert_near(z2 / n, 1, 5 * 1.42e-3);
    assert_near(z4 / n, 3, 5 * 9.8e-3);
}

static void below_takes_every_value_about_equally(void **state)
{
    (void)state;
    struct rng r;
    int seen[7] = {0};
    rng_seed(&r, 3);
    for (int i = 0; i < 70000; i++)
        seen[rng_below(&r, 7)]++;
    for (int i = 0; i < 7; i++)
        assert_in_range(seen[i], 10000 - 500, 10000 + 500); // 5.4 sigma
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sequence_is_that_of_the_published_generator),
        cmocka_unit_test(same_seed_same_sequence_other_seed_another),
        cmocka_unit_test(uniform_and_normal_have_their_moments),
        cmocka_unit_test(below_takes_every_value_about_equally),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
