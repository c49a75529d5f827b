// SPDX-License-Identifier: MIT
// uses: drivers base
// Every profile of configs/profiles: it can be loaded, and what is sent and read is what manuals
// and others' programs show.
#include "drivers/profile_golden.h"
#include "tests/unit/profiles.h"

#include <glob.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static int check_golden(const struct profile *p)
{
    struct gon_error err;
    for (int i = 0; i < p->golden_count; i++)
        if (profile_golden_check(p, i, &err) < 0)
            fail_msg("%s: golden[%d]: %s", p->name, i, err.text);
    return p->golden_count;
}

static void profiles_write_and_read_what_others_show(void **state)
{
    glob_t files;
    int entries = 0;
    (void)state;
    assert_int_equal(glob("configs/profiles/*.cfg", 0, NULL, &files), 0);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        struct profile *p;
        if (profile_load(files.gl_pathv[i], (struct cfg_sink){profiles_say, NULL}, &p, NULL) < 0)
            fail_msg("%s", files.gl_pathv[i]);
        entries += check_golden(p);
        free(p);
    }
    print_message("%zu profiles, %d exchanges as others show them\n", files.gl_pathc, entries);
    assert_true(files.gl_pathc >= 12 && entries >= 40);
    globfree(&files);
}

static void profiles_are_called_as_their_files(void **state)
{
    glob_t files;
    (void)state;
    assert_int_equal(glob("configs/profiles/*.cfg", 0, NULL, &files), 0);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        char name[64];
        struct profile *p;
        assert_int_equal(
            profile_load(files.gl_pathv[i], (struct cfg_sink){profiles_say, NULL}, &p, NULL), 0);
        snprintf(name, sizeof name, "configs/profiles/%s.cfg", p->name);
        assert_string_equal(name, files.gl_pathv[i]);
        free(p);
    }
    globfree(&files);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_write_and_read_what_others_show),
        cmocka_unit_test(profiles_are_called_as_their_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
