// SPDX-License-Identifier: MIT
// uses: drivers base
// The text profiles of configs/profiles against the bytes that manuals and others' programs show.
#include "drivers/profile_data.h"
#include "drivers/profile_text.h"
#include "tests/unit/profiles.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static void assigned(const struct profile *p, const char *text, struct profile_data *d)
{
    struct gon_error err;
    profile_data_clear(d);
    if (*text && profile_assign_data(p, text, NULL, d, &err) < 0)
        fail_msg("%s: '%s': %s", p->name, text, err.text);
}

static void check_sent(const struct profile *p, const struct profile_exchange *x,
                       const struct profile_golden *g)
{
    struct profile_data d;
    char command[200];
    struct gon_error err;
    assigned(p, g->with, &d);
    if (profile_text_write(p, x->send, &d, command, sizeof command, &err) < 0)
        fail_msg("%s: %s: %s", p->name, x->name, err.text);
    assert_string_equal(command, g->sent);
}

static void check_received(const struct profile *p, const struct profile_exchange *x,
                           const struct profile_golden *g)
{
    struct profile_data d, gives;
    struct gon_error err;
    assigned(p, g->gives, &gives);
    profile_data_clear(&d);
    if (profile_text_read(p, x->answer, g->received, &d, &err) < 0)
        fail_msg("%s: %s: '%s': %s", p->name, x->name, g->received, err.text);
    for (int i = 0; i < p->values_count; i++) {
        if (!gives.known[i])
            continue;
        assert_true(d.known[i]);
        if (p->values[i].type == PROFILE_STRING)
            assert_string_equal(d.text[i], gives.text[i]);
        else
            assert_true(fabs(d.number[i] - gives.number[i]) <= 1e-12 * fabs(gives.number[i]));
    }
}

static int check_profile(const struct profile *p)
{
    for (int i = 0; i < p->golden_count; i++) {
        const int x = profile_exchange(p, p->golden[i].does);
        assert_true(x >= 0);
        check_sent(p, &p->exchanges[x], &p->golden[i]);
        if (*p->golden[i].received)
            check_received(p, &p->exchanges[x], &p->golden[i]);
    }
    return p->golden_count;
}

static void profiles_write_and_read_what_others_show(void **state)
{
    static const char *const names[] = {
        "cobolt-05", "coherent-obis",   "keithley-6485",    "laser-quantum",  "sr830",
        "sr860",     "thorlabs-fw102c", "thorlabs-mc2000b", "thorlabs-pm100", "thorlabs-sc10"};
    int entries = 0;
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const struct profile *p = profiles_get(names[i]);
        assert_true(p->golden_count > 0);
        entries += check_profile(p);
    }
    print_message("%zu profiles, %d exchanges as others show them\n",
                  sizeof names / sizeof names[0], entries);
    assert_true(entries >= 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_write_and_read_what_others_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
