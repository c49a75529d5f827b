// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "store_fixture.h"

#include "campaign/reduce.h"
#include "campaign/store_exclude.h"
#include "campaign/store_verify.h"

#include <fcntl.h>
#include <sys/stat.h>

static struct {
    char texts[8000];
    struct store_finding last; // its texts are not kept
} found;

static void note(void *ctx, const struct store_finding *f)
{
    (void)ctx;
    const size_t used = strlen(found.texts);
    snprintf(found.texts + used, sizeof found.texts - used, "%s: %s\n", f->what, f->text);
    found.last = *f;
}

static struct store_verified verified(void)
{
    struct store_verified seen;
    struct store *s = opened(STORE_READ);
    memset(&found, 0, sizeof found);
    assert_int_equal(store_verify(s, note, NULL, &seen, NULL), 0);
    store_close(s, NULL);
    return seen;
}

static void expect_whole(void)
{
    const struct store_verified seen = verified();
    assert_string_equal(found.texts, "");
    assert_int_equal(seen.findings, 0);
}

// All points but the last, each with a good reading; point 2 of sweep 1 at its third attempt.
static void fill(struct store *s)
{
    struct plan p;
    assert_int_equal(store_read_plan(s, &p, NULL), 0);
    for (int i = 0; i + 1 < p.count; i++) {
        struct store_reading r = reading(p.points[i].sweep, p.points[i].point, 1);
        r.monitor_v = p.points[i].kind == PLAN_DARK ? 0 : 1;
        r.signal_v = p.points[i].kind == PLAN_BEAM ? 2 : p.points[i].kind == PLAN_DARK ? 0 : 1e-3;
        r.theta_i_udeg = (int32_t)(1e6 * p.points[i].theta_i_deg);
        r.theta_r_udeg = (int32_t)(1e6 * p.points[i].theta_r_deg);
        if (r.sweep == 1 && r.point == 2)
            for (; r.attempt < 3; r.attempt++) {
                struct store_reading bad = r;
                bad.flags = STORE_SATURATED;
                append(s, &bad);
            }
        append(s, &r);
    }
    plan_clear(&p);
}

static struct store *filled(void)
{
    static const struct store_profile profile = {"sr830", "detector", "profile: {};\n"};
    struct store *s = created();
    struct reduction r;
    fill(s);
    assert_int_equal(store_append_profiles(s, 1, &profile, 1, NULL), 0);
    assert_int_equal(reduce_campaign(s, &r, NULL), 0);
    assert_int_equal(store_append_reduction(s, 1, &r, NULL, NULL), 0);
    reduction_clear(&r);
    assert_int_equal(
        store_exclude(s, "3/1-2", &(struct store_decision){1, "dust", "Max"}, NULL), 2);
    return s;
}

static void a_whole_file_is_whole_also_while_it_is_written(void **state)
{
    (void)state;
    struct store *s = filled();
    struct store_verified seen = verified();
    assert_string_equal(found.texts, "");
    assert_true(seen.version == 4 && seen.profiles == 1 && seen.reductions == 1);
    assert_int_equal(seen.readings, seen.points - 1 + 2);
    assert_int_equal(seen.exclusions, 2);
    store_close(s, NULL);
    expect_whole();
}

static void older_files_are_whole(void **state)
{
    (void)state;
    make_from_sql("tests/golden/campaign_v1.sql");
    expect_whole();
    unlink(path);
    make_from_sql("tests/golden/campaign_v2.sql");
    expect_whole();
    unlink(path);
    make_from_sql("tests/golden/campaign_v3.sql");
    expect_whole();
}

struct damage {
    const char *sql, *says;
    int sweep, point, attempt;
    int findings;
};

static const struct damage damages[] = {
    {"UPDATE reading SET signal_v = signal_v * 1.0001 WHERE sweep = 2 AND point = 3",
     "reading: sweep 2, point 3, attempt 1: its check value is wrong", 2, 3, 1, 1},
    {"UPDATE reading SET crc32c = crc32c + 1 WHERE sweep = 1 AND point = 2 AND attempt = 3",
     "reading: sweep 1, point 2, attempt 3: its check value is wrong", 1, 2, 3, 1},
    {"DELETE FROM reading WHERE sweep = 1 AND point = 2 AND attempt = 2",
     "hole: sweep 1, point 2: attempt 2 is missing before attempt 3", 1, 2, 2, 1},
    {"DELETE FROM reading WHERE sweep = 1 AND point = 2 AND attempt = 1",
     "hole: sweep 1, point 2: attempt 1 is missing before attempt 2", 1, 2, 1, 1},
    {"DELETE FROM reduced; DELETE FROM reduction; DELETE FROM reading WHERE sweep = 2 AND"
     " point BETWEEN 3 AND 5",
     "hole: sweep 2, point 3 and 2 more: no accepted reading, though sweep 2, point 6 came later",
     2, 3, -1, 1},
    {"DELETE FROM reduced; DELETE FROM reduction; DELETE FROM reading WHERE sweep = 1 AND"
     " point = 2 AND attempt = 3",
     "hole: sweep 1, point 2: no accepted reading, though sweep 1, point 3 came later", 1, 2, -1,
     1},
    {"DELETE FROM reduced; DELETE FROM reduction; DELETE FROM reading WHERE sweep = 0",
     "hole: sweep 0, point 0 and 1 more: no accepted reading, though sweep 1, point 0 came later",
     0, 0, -1, 1},
    {"UPDATE plan SET weight = 3 WHERE sweep = 2 AND point = 1", "plan: the plan kept in it is", -1,
     -1, -1, 1},
    {"DELETE FROM plan WHERE sweep = 2 AND point = 1",
     "reference: sweep 2, point 1, attempt 1: not in the plan", 2, 1, 1, 2},
    {"UPDATE meta SET value = value || ' ' WHERE key = 'config'", "config: the config kept in it",
     -1, -1, -1, 1},
    {"UPDATE meta SET value = value || ' ' WHERE key = 'bench'", "bench: the bench kept in it", -1,
     -1, -1, 1},
    {"DELETE FROM meta WHERE key = 'sample'",
     "meta: meta: sample is '(missing)', the configuration says 'panel 3'", -1, -1, -1, 1},
    {"UPDATE meta SET value = 1061.0 WHERE key = 'wavelength_nm'",
     "meta: meta: wavelength_nm is 1061, the configuration or bench says 1060", -1, -1, -1, 1},
    {"DROP TRIGGER profile_UPDATE; UPDATE profile SET text = 'x'",
     "profile: profile 1 (sr830): its check value is wrong", -1, -1, -1, 2},
    {"DROP TRIGGER exclusion_UPDATE; UPDATE exclusion SET point = 5 WHERE id = 2",
     "exclusion: exclusion 2 (sweep 3, point 5, attempt 1): its check value is wrong", 3, 5, 1, 2},
    {"DROP TRIGGER exclusion_DELETE; DELETE FROM exclusion WHERE id = 1",
     "exclusion: exclusion 1 is missing before 2", -1, -1, -1, 2},
    {"DROP TRIGGER exclusion_UPDATE; UPDATE exclusion SET what = 'gone' WHERE id = 1",
     "exclusion: exclusion 1 (sweep 3, point 1, attempt 1): its check value", 3, 1, 1, 2},
    {"INSERT INTO exclusion VALUES (3, 1, 3, 99, 1, 'excluded', 'x', 'x', 0)",
     "reference: exclusion 3 is of sweep 3, point 99, attempt 1, which is not there", 3, 99, 1, 2},
    {"INSERT INTO exclusion VALUES (3, 1, 3, 2, 1, 'replaced', 'x', 'x', 0);"
     "INSERT INTO state (t_utc_ms, state, why) VALUES (1, 'done', '')",
     "reference: the state is done, but sweep 3, point 2 is to be measured again, as exclusion 3", 3,
     2, 1, 3},
    {"UPDATE reduced SET attempt = 7 WHERE sweep = 3 AND point = 0",
     "reference: reduction 1 uses sweep 3, point 0, attempt 7, which is not there", 3, 0, 7, 1},
    {"DELETE FROM reduced WHERE sweep = 3 AND point = 0", "reference: reduction 1 is of ", -1, -1,
     -1, 1},
    {"DELETE FROM reduction", "reference: table reduced: reduction 1 is not there", -1, -1, -1, 1},
    {"INSERT INTO fit (t_utc_ms, gonio_version, sweep, reduction, method, weights, diffuse, seed,"
     " points, warnings, json) VALUES (1, '', 2, 9, '', '', '', 1, 1, 0, '{}')",
     "reference: fit 1 is of reduction 9, which is not there", 2, -1, -1, 1},
    {"INSERT INTO fit (t_utc_ms, gonio_version, sweep, reduction, method, weights, diffuse, seed,"
     " points, warnings, json) VALUES (1, '', 2, 1, '', '', '', 1, 1, 0, '{')",
     "reference: fit 1: its JSON cannot be read", 2, -1, -1, 1},
    {"INSERT INTO state (t_utc_ms, state, why) VALUES (1, 'done', '')",
     "state: the state is done, but from sweep 4, point 1 on 1 points have no", 4, 1, -1, 1},
    {"DROP VIEW fit_result", "structure: the view fit_result is missing", -1, -1, -1, 1},
};

static void what_is_damaged_is_named(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof damages / sizeof *damages; i++) {
        const struct damage *d = &damages[i];
        store_close(filled(), NULL);
        tamper("DROP TRIGGER reading_UPDATE; DROP TRIGGER reading_DELETE");
        tamper(d->sql);
        tamper("CREATE TRIGGER reading_UPDATE BEFORE UPDATE ON reading BEGIN SELECT 1; END;"
               "CREATE TRIGGER reading_DELETE BEFORE DELETE ON reading BEGIN SELECT 1; END;");
        const struct store_verified seen = verified();
        if (!strstr(found.texts, d->says) || seen.findings != d->findings)
            print_error("%s\nfound %d: %s\n", d->sql, (int)seen.findings, found.texts);
        assert_non_null(strstr(found.texts, d->says));
        assert_int_equal(seen.findings, d->findings);
        if (d->findings == 1)
            assert_true(found.last.sweep == d->sweep && found.last.point == d->point &&
                        found.last.attempt == d->attempt);
        assert_int_equal(unlink(path), 0);
    }
}

// Bytes of a page changed below SQLite: what is still readable is looked at all the same.
static void a_broken_page_is_a_finding(void **state)
{
    (void)state;
    static char bytes[400000];
    store_close(filled(), NULL);
    int fd = open(path, O_RDWR);
    const ssize_t size = read(fd, bytes, sizeof bytes);
    const double wanted = 1e-3;
    unsigned char big[8]; // a real as the file holds it
    for (int i = 0; i < 8; i++)
        big[i] = ((const unsigned char *)&wanted)[7 - i];
    char *at = memmem(bytes, (size_t)size, big, 8);
    assert_non_null(at);
    at[5] ^= 1;
    assert_int_equal(pwrite(fd, at + 5, 1, at + 5 - bytes), 1);
    struct store_verified seen = verified();
    assert_int_equal(seen.findings, 1); // one reading, named
    assert_true(found.last.sweep >= 0 && found.last.point >= 0 && found.last.attempt >= 1);
    assert_int_equal(pwrite(fd, "\xff\xff\xff\xff\xff\xff\xff\xff", 8, (at - bytes) / 4096 * 4096),
                     8);
    seen = verified();
    assert_true(seen.findings > 1);
    assert_non_null(strstr(found.texts, "structure: "));
    assert_non_null(strstr(found.texts, "reading: "));
    assert_true(seen.points > 0); // the plan was still read
    close(fd);
}

// What no query would notice: the count of lost bytes in the last page's header.
static void a_wrong_page_header_is_a_finding(void **state)
{
    (void)state;
    struct stat st;
    store_close(filled(), NULL);
    int fd = open(path, O_RDWR);
    assert_int_equal(fstat(fd, &st), 0);
    assert_int_equal(pwrite(fd, "\x2a", 1, st.st_size - 4096 + 7), 1);
    close(fd);
    assert_int_equal(verified().findings, 1);
    assert_non_null(strstr(found.texts, "structure: "));
    assert_non_null(strstr(found.texts, "reported as 42"));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_whole_file_is_whole_also_while_it_is_written),
        TEST(older_files_are_whole),
        TEST(what_is_damaged_is_named),
        TEST(a_broken_page_is_a_finding),
        TEST(a_wrong_page_header_is_a_finding),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
