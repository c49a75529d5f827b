// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include "campaign/catalog.h"

#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <sys/wait.h>

static struct fixture_folder folder;

static int begin(void **state)
{
    (void)state;
    folder = fixture_folder();
    return 0;
}

static int end(void **state)
{
    (void)state;
    fixture_remove(&folder);
    return 0;
}

static struct store *created_above(int above, const char *name, int *ret_id)
{
    char text[300];
    snprintf(text, sizeof text,
             "campaign: { name = \"%s\"; sample = \"panel\"; theta_i_deg = 10;"
             " theta_r: { step_deg = 60; }; dense: { half_width_deg = 0; }; };",
             name);
    const struct campaign_config config = fixture_campaign(text);
    const struct bench_config bench = fixture_bench();
    struct plan plan;
    struct store *s = NULL;
    assert_int_equal(plan_make(&config, &bench, &plan, NULL), 0);
    const struct store_new what = {&config, text, "c.cfg", &bench, FIXTURE_BENCH, &plan, 1000, NULL, 0};
    assert_int_equal(catalog_create(folder.path, above, &what, &s, ret_id, NULL), 0);
    plan_clear(&plan);
    return s;
}

static struct store *created(const char *name, int *ret_id)
{
    return created_above(0, name, ret_id);
}

static void numbers_rise_and_names_are_plain(void **state)
{
    (void)state;
    int id;
    char file[128];
    store_close(created("Blue Öl-Paint  (2)", &id), NULL);
    assert_int_equal(id, 1);
    assert_int_equal(
        access(fixture_path(&folder, "0001-blue-l-paint-2.gonio", file, sizeof file), R_OK), 0);
    store_close(created("../../etc", &id), NULL);
    assert_int_equal(id, 2);
    assert_int_equal(access(fixture_path(&folder, "0002-etc.gonio", file, sizeof file), R_OK), 0);
    store_close(created("Öö", &id), NULL);
    assert_int_equal(id, 3);
    assert_int_equal(access(fixture_path(&folder, "0003.gonio", file, sizeof file), R_OK), 0);
    unlink(fixture_path(&folder, "0002-etc.gonio", file, sizeof file));
    store_close(created("x", &id), NULL);
    assert_int_equal(id, 4); // numbers are not given out twice while a later one exists
    store_close(created_above(2, "y", &id), NULL);
    assert_int_equal(id, 5);
    store_close(created_above(8, "z", &id), NULL);
    assert_int_equal(id, 9);
    assert_int_equal(catalog_id("/a/b/0012-x.gonio"), 12);
    assert_int_equal(catalog_id("12345.gonio"), 12345);
    assert_int_equal(catalog_id("12-x.gonio"), 0);
    assert_int_equal(catalog_id("0012x.gonio"), 0);
    assert_int_equal(catalog_id("0012-x.gonio-lock"), 0);
}

static void the_list_says_how_far_each_is(void **state)
{
    (void)state;
    int id;
    struct catalog_entry *list = NULL;
    struct store *a = created("a", &id), *b = created("b", &id), *c = created("c", &id);
    assert_int_equal(store_append_state(a, 2000, "preparing", "", NULL), 0);
    assert_int_equal(store_append_state(a, 2500, "running", "", NULL), 0);
    const struct store_reading r = {.sweep = 0, .point = 0, .attempt = 1, .count = 1};
    assert_int_equal(store_append_reading(a, &r, NULL), 0);
    assert_int_equal(store_append_state(b, 3000, "running", "", NULL), 0);
    assert_int_equal(store_append_state(b, 4000, "failed", "laser: on fire", NULL), 0);
    store_close(b, NULL);
    store_close(c, NULL);
    char file[128];
    close(open(fixture_path(&folder, "0009-junk.gonio", file, sizeof file), O_CREAT | O_WRONLY,
               0600));
    close(open(fixture_path(&folder, "notes.txt", file, sizeof file), O_CREAT | O_WRONLY, 0600));
    assert_int_equal(catalog_list(folder.path, &list, NULL), 4);
    assert_true(list[0].id == 1 && list[0].done == 1 && list[0].total == 7 &&
                list[0].writer_pid == getpid());
    assert_string_equal(list[0].state, "running");
    assert_true(list[0].created_utc_ms == 1000 && list[0].started_utc_ms == 2000 &&
                list[0].finished_utc_ms == 0);
    assert_string_equal(list[0].sample, "panel");
    assert_string_equal(list[1].state, "failed");
    assert_string_equal(list[1].problem, "laser: on fire");
    assert_true(list[1].finished_utc_ms == 4000 && list[1].writer_pid == 0);
    assert_string_equal(list[2].state, "new");
    assert_string_equal(list[3].state, "unreadable");
    assert_non_null(strstr(list[3].problem, "not a campaign file"));
    free(list);
    store_close(a, NULL); // nobody holds it any more, and it never said that it ended
    assert_int_equal(catalog_list(folder.path, &list, NULL), 4);
    assert_string_equal(list[0].state, "interrupted");
    free(list);
    assert_int_equal(catalog_list("/nowhere/at/all", &list, NULL), 0);
    free(list);
}

static void a_file_is_found_by_path_number_and_name(void **state)
{
    (void)state;
    int id;
    char found[CATALOG_PATH], expected[128];
    struct gon_error err;
    store_close(created("paint", &id), NULL);
    store_close(created("other", &id), NULL);
    store_close(created("paint", &id), NULL);
    const char *const asked[][2] = {{"1", "0001-paint.gonio"},
                                    {"0002", "0002-other.gonio"},
                                    {"paint", "0003-paint.gonio"},
                                    {"0002-other.gonio", "0002-other.gonio"}};
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        assert_int_equal(catalog_resolve(folder.path, asked[i][0], found, sizeof found, NULL), 0);
        assert_string_equal(found, fixture_path(&folder, asked[i][1], expected, sizeof expected));
    }
    assert_int_equal(catalog_resolve(folder.path, "./x/y", found, sizeof found, NULL), 0);
    assert_string_equal(found, "./x/y");
    assert_int_equal(catalog_resolve(folder.path, "7", found, sizeof found, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no campaign of that number"));
    assert_int_equal(catalog_resolve(folder.path, "pain", found, sizeof found, &err), GON_E_INPUT);
}

// Eight processes, three campaigns each: every number once.
static void numbers_are_given_out_once(void **state)
{
    (void)state;
    enum { PROCESSES = 8, EACH = 3 };
    struct catalog_entry *list = NULL;
    for (int k = 0; k < PROCESSES; k++)
        if (fork() == 0) {
            for (int i = 0; i < EACH; i++) {
                int id;
                char name[40];
                snprintf(name, sizeof name, "p%d-%d", k, i);
                store_close(created(name, &id), NULL);
            }
            _exit(0);
        }
    for (int k = 0; k < PROCESSES; k++) {
        int status;
        assert_true(wait(&status) > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    assert_int_equal(catalog_list(folder.path, &list, NULL), PROCESSES * EACH);
    for (int i = 0; i < PROCESSES * EACH; i++)
        assert_int_equal(list[i].id, i + 1);
    free(list);
    assert_int_equal(fixture_files(&folder), PROCESSES * EACH);
}

static void the_directory_is_chosen_in_order(void **state)
{
    (void)state;
    char path[CATALOG_PATH], nested[128];
    setenv("GONIO_DIR", "/data/gonio", 1);
    assert_int_equal(catalog_directory("/mine", path, sizeof path, NULL), 0);
    assert_string_equal(path, "/mine");
    assert_int_equal(catalog_directory("", path, sizeof path, NULL), 0);
    assert_string_equal(path, "/data/gonio");
    unsetenv("GONIO_DIR");
    setenv("XDG_DATA_HOME", "/home/x/data", 1);
    assert_int_equal(catalog_directory(NULL, path, sizeof path, NULL), 0);
    assert_string_equal(path, geteuid() == 0 ? "/var/lib/gonio" : "/home/x/data/gonio");
    fixture_path(&folder, "a/b", nested, sizeof nested);
    assert_int_equal(catalog_make_directory(nested, NULL), 0);
    assert_int_equal(catalog_make_directory(nested, NULL), 0);
    assert_int_equal(rmdir(nested), 0);
    close(open(nested, O_CREAT | O_WRONLY, 0600));
    assert_int_equal(catalog_make_directory(nested, NULL), GON_E_INPUT);
    unlink(nested);
    rmdir(fixture_path(&folder, "a", nested, sizeof nested));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(numbers_rise_and_names_are_plain),        TEST(the_list_says_how_far_each_is),
        TEST(a_file_is_found_by_path_number_and_name), TEST(numbers_are_given_out_once),
        TEST(the_directory_is_chosen_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
