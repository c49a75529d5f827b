// SPDX-License-Identifier: MIT
// uses: drivers base
// Every text profile of configs/profiles against the bytes that manuals and others' programs show.
#include "drivers/profile_data.h"
#include "drivers/profile_text.h"
#include "tests/unit/profiles.h"

#include <glob.h>
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
    glob_t files;
    int profiles = 0, entries = 0;
    (void)state;
    assert_int_equal(glob("configs/profiles/*.cfg", 0, NULL, &files), 0);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        struct profile *p;
        if (profile_load(files.gl_pathv[i], (struct cfg_sink){profiles_say, NULL}, &p, NULL) < 0)
            fail_msg("%s", files.gl_pathv[i]);
        if (p->protocol == PROFILE_MESSAGE) {
            assert_true(p->golden_count > 0);
            profiles++;
            entries += check_profile(p);
        }
        free(p);
    }
    globfree(&files);
    print_message("%d text profiles, %d exchanges as others show them\n", profiles, entries);
    assert_true(profiles >= 10 && entries >= 30);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_write_and_read_what_others_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
