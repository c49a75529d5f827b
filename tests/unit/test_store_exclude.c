// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "store_fixture.h"

#include "campaign/dataset.h"
#include "campaign/reading_pick.h"
#include "campaign/reduce.h"
#include "campaign/store_exclude.h"
#include "campaign/store_verify.h"

#include <math.h>

static const struct store_decision dust = {1700000009000, "dust on the sample", "Max"};

static void measure(struct store *s, const struct plan_point *p, int attempt, double signal_v)
{
    struct store_reading r = reading(p->sweep, p->point, attempt);
    r.monitor_v = p->kind == PLAN_DARK ? 0 : 1;
    r.signal_v = signal_v;
    r.t_utc_ms = 1700000000000 + number("SELECT count(*) FROM reading") * 1000;
    r.theta_i_udeg = (int32_t)(1e6 * p->theta_i_deg);
    r.theta_r_udeg = (int32_t)(1e6 * p->theta_r_deg);
    append(s, &r);
}

static double signal_of(const struct plan_point *p)
{
    return p->kind == PLAN_DARK   ? 0.0
           : p->kind == PLAN_BEAM ? 2.0
                                  : 1e-3 * (1 + p->sweep) + 1e-5 * p->point;
}

// Every point that is open, as the engine goes through them; the attempts go on counting.
static int measure_open(struct store *s, double factor)
{
    struct plan p;
    int measured = 0;
    assert_int_equal(store_read_plan(s, &p, NULL), 0);
    for (int i = 0; i < p.count; i++)
        if (!p.points[i].done) {
            measure(s, &p.points[i], p.points[i].attempts + 1, factor * signal_of(&p.points[i]));
            measured++;
        }
    plan_clear(&p);
    return measured;
}

static struct store *measured(void)
{
    struct store *s = created();
    measure_open(s, 1);
    assert_int_equal(store_append_state(s, 1, "done", "", NULL), 0);
    return s;
}

static int excludes(struct store *s, const char *which)
{
    struct gon_error err = {0};
    int rc = store_exclude(s, which, &dust, &err);
    if (rc < 0)
        print_error("%s\n", err.text);
    return rc;
}

static struct reduction reduced(struct store *s)
{
    struct reduction r;
    struct gon_error err = {0};
    int rc = reduce_campaign(s, &r, &err);
    if (rc < 0)
        print_error("%s\n", err.text);
    assert_int_equal(rc, 0);
    return r;
}

static struct store_progress progress(struct store *s)
{
    struct store_progress p;
    assert_int_equal(store_read_progress(s, &p, NULL), 0);
    return p;
}

static void count_finding(void *ctx, const struct store_finding *f)
{
    print_error("%s: %s\n", f->what, f->text);
    ++*(int *)ctx;
}

static int findings(void)
{
    int n = 0;
    struct store_verified seen;
    struct store *s = opened(STORE_READ);
    assert_int_equal(store_verify(s, count_finding, &n, &seen, NULL), 0);
    store_close(s, NULL);
    return n;
}

static void what_names_readings(void **state)
{
    (void)state;
    static struct reading_pick p[READING_PICKS];
    static const char *const wrong[] = {
        "",   "x",       "1/",   "1/2-", "1/5-3", "1/2/0", "1/2/", "1,",
        ",1", "1/2/3/4", "-1/2", "1 /2", "1/2;3", "1/-2",  "1/2x", "1/99999999999999999999"};
    struct gon_error err;
    assert_int_equal(reading_picks_take("1/3,2/5-9,4,1/2/7,0/0", p, NULL), 5);
    assert_true(p[0].sweep == 1 && p[0].first == 3 && p[0].last == 3 && p[0].attempt == 0);
    assert_true(p[1].sweep == 2 && p[1].first == 5 && p[1].last == 9);
    assert_true(p[2].sweep == 4 && p[2].first == 0 && p[2].last == READING_PICK_ALL);
    assert_true(p[3].sweep == 1 && p[3].first == 2 && p[3].last == 2 && p[3].attempt == 7);
    assert_true(p[4].sweep == 0 && p[4].first == 0 && p[4].last == 0);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(reading_picks_take(wrong[i], p, &err), GON_E_INPUT);
        assert_non_null(strstr(err.text, "names no reading"));
    }
    char many[3 * READING_PICKS + 10] = "1";
    for (int i = 0; i < READING_PICKS; i++)
        memcpy(many + 1 + 2 * i, ",1", 3);
    assert_int_equal(reading_picks_take(many, p, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "more than 1000"));
}

// The numbers of a restored reading are those of before, bit by bit.
static void an_excluded_reading_is_not_reduced_until_it_is_restored(void **state)
{
    (void)state;
    struct store *s = measured();
    struct reduction before = reduced(s), without, after;
    assert_int_equal(before.excluded, 0);
    assert_int_equal(excludes(s, "1/3,2/0-1"), 3);
    without = reduced(s);
    assert_true(without.count == before.count - 3 && without.excluded == 3);
    for (int i = 0; i < without.count; i++)
        assert_true(without.points[i].sweep != 1 || without.points[i].point != 3);
    struct store_progress p = progress(s);
    assert_true(p.done == p.total && p.excluded == 3 && p.sweep == -1); // it was measured
    assert_int_equal(store_restore(s, "2/0-1,1/3", &dust, NULL), 3);
    after = reduced(s);
    assert_true(after.count == before.count && after.excluded == 0);
    assert_memory_equal(after.points, before.points, (size_t)before.count * sizeof *before.points);
    assert_true(after.noise.floor_v == before.noise.floor_v && after.noise.rel == before.noise.rel);
    assert_int_equal(number("SELECT count(*) FROM exclusion"), 6); // nothing was taken back
    reduction_clear(&before);
    reduction_clear(&without);
    reduction_clear(&after);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

static void a_reduction_is_kept_with_how_many_were_excluded(void **state)
{
    (void)state;
    struct store *s = measured();
    assert_int_equal(excludes(s, "1/3"), 1);
    struct reduction r = reduced(s);
    assert_int_equal(store_append_reduction(s, 1, &r, NULL, NULL), 0);
    reduction_clear(&r);
    assert_int_equal(number("SELECT excluded FROM reduction"), 1);
    assert_int_equal(number("SELECT count(*) FROM reading_brdf WHERE excluded = 'dust on the "
                            "sample' AND f_r IS NULL"),
                     1);
    assert_int_equal(excludes(s, "1/4"), 1); // after the reduction, which stays
    assert_int_equal(number("SELECT count(*) FROM reading_brdf WHERE f_r IS NULL"), 2);
    assert_int_equal(number("SELECT count(*) FROM reduced WHERE sweep = 1 AND point = 4"), 1);
    assert_int_equal(number("SELECT count(*) FROM excluded WHERE who = 'Max'"), 2);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

static void refuses(struct store *s, const char *which, const struct store_decision *d,
                    const char *says)
{
    struct gon_error err = {0};
    const int64_t rows = number("SELECT count(*) FROM exclusion"),
                  events = number("SELECT count(*) FROM event");
    assert_int_equal(store_exclude(s, which, d, &err), GON_E_INPUT);
    if (!strstr(err.text, says))
        fail_msg("'%s' instead of '%s'", err.text, says);
    assert_int_equal(number("SELECT count(*) FROM exclusion"), rows);
    assert_int_equal(number("SELECT count(*) FROM event"), events);
}

static void what_cannot_be_excluded_changes_nothing(void **state)
{
    (void)state;
    char long_reason[STORE_REASON + 2];
    memset(long_reason, 'x', sizeof long_reason - 1);
    long_reason[sizeof long_reason - 1] = 0;
    struct store *s = measured();
    refuses(s, "1/3", &(struct store_decision){1, "", "Max"}, "without a reason");
    refuses(s, "1/3", &(struct store_decision){1, "  ", "Max"}, "without a reason");
    refuses(s, "1/3", &(struct store_decision){1, NULL, "Max"}, "without a reason");
    refuses(s, "1/3", &(struct store_decision){1, "a\nb", "Max"}, "on one line");
    refuses(s, "1/3", &(struct store_decision){1, "\xff", "Max"}, "UTF-8");
    refuses(s, "1/3", &(struct store_decision){1, "why", NULL}, "the name must be text");
    refuses(s, "1/3", &(struct store_decision){1, long_reason, "Max"}, "401 bytes, at most 400");
    refuses(s, "1/3,1/99", &dust, "sweep 1, point 99: no reading of it counts");
    refuses(s, "9", &dust, "sweep 9: no reading of it counts");
    refuses(s, "1/3/2", &dust, "sweep 1, point 3, attempt 2: no reading of it counts");
    refuses(s, "1/3,1/3", &dust, "sweep 1, point 3: no reading of it counts");
    store_close(s, NULL);
}

static void an_exclusion_is_never_changed(void **state)
{
    (void)state;
    struct store *s = measured();
    sqlite3 *db;
    assert_int_equal(excludes(s, "1/3"), 1);
    store_close(s, NULL);
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "UPDATE exclusion SET reason = 'x'", NULL, NULL, NULL),
                     SQLITE_CONSTRAINT);
    assert_int_equal(sqlite3_exec(db, "DELETE FROM exclusion", NULL, NULL, NULL),
                     SQLITE_CONSTRAINT);
    sqlite3_close(db);
    tamper("DROP TRIGGER exclusion_UPDATE; UPDATE exclusion SET what = 'restored'");
    s = opened(STORE_READ);
    struct store_reading *rows;
    struct gon_error err;
    assert_int_equal(store_read_readings(s, 1, &rows, &err), GON_E_STORE);
    assert_non_null(strstr(err.text, "the exclusion 1 of sweep 1, point 3 is damaged"));
    store_close(s, NULL);
}

// Independently packed (Python's struct '<qqiii' and a bitwise CRC-32C over it and the texts).
static void the_check_value_is_as_documented(void **state)
{
    (void)state;
    struct store *s = measured();
    assert_int_equal(excludes(s, "1/3"), 1);
    assert_int_equal(number("SELECT crc32c FROM exclusion"), 0x0b3eb7df);
    store_close(s, NULL);
}

static bool note_row(void *ctx, const struct store_exclusion *e)
{
    char *text = ctx;
    sprintf(text + strlen(text), "%lld %d/%d/%d %s by %s: %s\n", (long long)e->id, e->sweep,
            e->point, e->attempt, e->what, e->who, e->reason);
    return true;
}

static bool note_event(void *ctx, const struct store_event *e)
{
    char *text = ctx;
    sprintf(text + strlen(text), "%s %s %s\n", e->level, e->source, e->text);
    return true;
}

static void the_history_tells_who_and_why(void **state)
{
    (void)state;
    char rows[400] = "", events[600] = "";
    struct store *s = measured();
    assert_int_equal(excludes(s, "1/3"), 1);
    assert_int_equal(
        store_restore(s, "1/3", &(struct store_decision){1, "it was none", "Eva"}, NULL), 1);
    assert_int_equal(store_each_exclusion(s, note_row, rows, NULL), 2);
    assert_string_equal(rows, "1 1/3/1 excluded by Max: dust on the sample\n"
                              "2 1/3/1 restored by Eva: it was none\n");
    store_each_event(s, 0, note_event, events, NULL);
    assert_string_equal(events, "notice store Max excludes 1 reading (1/3): dust on the sample\n"
                                "notice store Eva restores 1 reading (1/3): it was none\n");
    store_close(s, NULL);
}

static void references_can_be_excluded_as_long_as_one_is_left(void **state)
{
    (void)state;
    struct store *s = measured();
    struct reduction r;
    struct gon_error err;
    assert_int_equal(excludes(s, "0/1"), 1);
    r = reduced(s);
    assert_true(r.beams == 1 && r.darks == 2 && r.excluded == 1);
    reduction_clear(&r);
    assert_int_equal(excludes(s, "4/0"), 1);
    assert_int_equal(reduce_campaign(s, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no beam reading is left, 2 are excluded"));
    assert_non_null(strstr(err.text, "gonio restore"));
    assert_int_equal(store_restore(s, "4/0", &dust, NULL), 1);
    assert_int_equal(excludes(s, "0/0,4/1"), 2);
    assert_int_equal(reduce_campaign(s, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no dark reading is left, 2 are excluded"));
    store_close(s, NULL);
}

static void nothing_left_on_the_sample_is_said(void **state)
{
    (void)state;
    struct store *s = measured();
    struct gon_error err;
    struct dataset d;
    const struct dataset_filter all = dataset_filter_all();
    assert_true(excludes(s, "1,2,3") > 0);
    assert_int_equal(dataset_from_store(s, &all, &d, NULL, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "readings are excluded"));
    store_close(s, NULL);
}

// --- measured again ------------------------------------------------------------------------------

static void a_sweep_is_measured_again_with_its_references(void **state)
{
    (void)state;
    struct store *s = measured();
    struct gon_error err;
    char text[16];
    struct store_progress p = progress(s);
    const int total = p.total;
    struct reduction before = reduced(s);
    const int64_t sweep_2 = number("SELECT count(*) FROM plan WHERE sweep = 2");
    const int all = store_remeasure(s, 2, &dust, &err);
    assert_int_equal(all, sweep_2);
    p = progress(s);
    assert_int_equal(p.done, total - sweep_2 - 4);
    assert_int_equal(p.again, sweep_2 + 4);
    assert_true(p.sweep == 0 && p.point == 0 && p.excluded == sweep_2);
    assert_int_equal(store_read_state(s, text, sizeof text, NULL, 0, NULL, NULL), 0);
    assert_string_equal(text, "stopped");
    struct reduction r = reduced(s); // without the sweep, with the references of before
    assert_true(r.beams == 2 && r.darks == 2 && r.excluded == sweep_2);
    assert_int_equal(r.count, number("SELECT count(*) FROM plan WHERE kind = 'sample'") - sweep_2);
    reduction_clear(&r);
    assert_int_equal(store_remeasure(s, 2, &dust, &err), GON_E_INPUT); // it waits already
    assert_non_null(strstr(err.text, "it is measured anyway"));

    assert_int_equal(measure_open(s, 1.02), sweep_2 + 4); // and the beam has 2 % more
    p = progress(s);
    assert_true(p.done == total && p.again == 0 && p.readings == total + sweep_2 + 4);
    r = reduced(s);
    assert_true(r.beams == 4 && r.darks == 4);
    assert_int_equal(r.count, before.count);
    for (int i = 0; i < r.count; i++) // each with the beam of its own day
        assert_true(fabs(r.points[i].f_per_sr / before.points[i].f_per_sr - 1) < 1e-12);
    reduction_clear(&before);
    assert_int_equal(r.count, number("SELECT count(*) FROM plan WHERE kind = 'sample'"));
    assert_true(fabs(r.reference.beam_signal_v[POL_U] - 2.02) < 1e-12);
    assert_true(fabs(r.u_beam_rel - 0.01 / 1.01) < 1e-6); // half of the 2 %, not a half of that
    for (int i = 0; i < r.count; i++)
        assert_int_equal(r.points[i].attempt, r.points[i].sweep == 2 ? 2 : 1);
    reduction_clear(&r);
    assert_int_equal(store_append_state(s, 2, "done", "", NULL), 0);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

static void a_sweep_that_is_not_there_is_not_measured_again(void **state)
{
    (void)state;
    struct store *s = created();
    struct gon_error err;
    assert_int_equal(store_remeasure(s, 0, &dust, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "allowed 1..3"));
    assert_int_equal(store_remeasure(s, 4, &dust, &err), GON_E_INPUT);
    assert_int_equal(store_remeasure(s, 1, &dust, &err), GON_E_INPUT); // not even once yet
    assert_int_equal(store_remeasure(s, 1, &(struct store_decision){1, "", "Max"}, &err),
                     GON_E_INPUT);
    assert_int_equal(number("SELECT count(*) FROM exclusion"), 0);
    store_close(s, NULL);
}

// What was decided of a sweep before it is measured again does not stick to what comes after.
static void an_excluded_point_is_measured_again_too(void **state)
{
    (void)state;
    struct store *s = measured();
    struct reduction r;
    assert_int_equal(excludes(s, "2/1,0/1"), 2);
    assert_true(store_remeasure(s, 2, &dust, NULL) > 0);
    measure_open(s, 1);
    struct store_progress p = progress(s);
    assert_int_equal(p.done, p.total);
    r = reduced(s);
    assert_int_equal(r.count, number("SELECT count(*) FROM plan WHERE kind = 'sample'"));
    assert_int_equal(r.beams, 3); // the excluded one stays out
    reduction_clear(&r);
    assert_int_equal(excludes(s, "2/1"), 1); // the new one
    assert_int_equal(number("SELECT attempt FROM exclusion ORDER BY id DESC"), 2);
    assert_int_equal(store_restore(s, "2/1", &dust, NULL), 1); // and not the old one with it
    r = reduced(s);
    for (int i = 0; i < r.count; i++)
        assert_true(r.points[i].sweep != 2 || r.points[i].attempt == 2);
    reduction_clear(&r);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

static void it_can_be_taken_back_before_it_is_measured(void **state)
{
    (void)state;
    struct store *s = measured();
    struct reduction before = reduced(s), after;
    assert_true(store_remeasure(s, 2, &dust, NULL) > 0);
    assert_true(store_restore(s, "0,2,4", &dust, NULL) > 0);
    after = reduced(s);
    assert_memory_equal(after.points, before.points, (size_t)before.count * sizeof *before.points);
    struct store_progress p = progress(s);
    assert_int_equal(p.done, p.total);
    reduction_clear(&before);
    reduction_clear(&after);
    store_close(s, NULL);
}

// A beam that waits to be measured again is still to be measured when it is excluded meanwhile.
static void an_excluded_reference_that_waits_goes_on_waiting(void **state)
{
    (void)state;
    struct store *s = measured();
    assert_true(store_remeasure(s, 2, &dust, NULL) > 0);
    const int done = progress(s).done;
    assert_int_equal(excludes(s, "0/1"), 1);
    assert_int_equal(progress(s).done, done);
    store_close(s, NULL);
}

// Sweep 1 is to be measured again while sweep 3 is under way: the closing references are measured
// first, as the run goes to its end, and belong after sweep 1 all the same.
static void closing_references_come_after_everything(void **state)
{
    (void)state;
    struct store *s = created();
    struct plan p;
    assert_int_equal(store_read_plan(s, &p, NULL), 0);
    for (int i = 0; i < p.count; i++) {
        measure(s, &p.points[i], 1, signal_of(&p.points[i]));
        if (p.points[i].sweep == 3 && p.points[i].point == 0)
            assert_true(store_remeasure(s, 1, &dust, NULL) > 0);
    }
    const int64_t sweep_1 = number("SELECT count(*) FROM plan WHERE sweep = 1");
    assert_int_equal(progress(s).done, p.count - sweep_1 - 2);
    assert_int_equal(store_reopen_closing(s, 5, NULL), 2);
    assert_int_equal(progress(s).done, p.count - sweep_1 - 4);
    assert_int_equal(store_reopen_closing(s, 5, NULL), 0); // they wait already
    assert_int_equal(measure_open(s, 1), sweep_1 + 4);
    assert_int_equal(store_reopen_closing(s, 5, NULL), 0);
    assert_int_equal(progress(s).done, p.count);
    plan_clear(&p);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

static void a_campaign_that_goes_on_normally_reopens_nothing(void **state)
{
    (void)state;
    struct store *s = created();
    assert_int_equal(progress(s).again, 0);
    assert_int_equal(store_reopen_closing(s, 5, NULL), 0);
    measure_open(s, 1);
    assert_int_equal(store_reopen_closing(s, 5, NULL), 0);
    store_close(s, NULL);
}

// An older file, with a reduction of before, after the change of its version.
static void an_older_file_learns_it(void **state)
{
    (void)state;
    make_from_sql("tests/golden/campaign_v3.sql");
    struct store *s = opened(STORE_READ);
    struct reduction before = reduced(s), after;
    store_close(s, NULL);
    s = opened(STORE_WRITE);
    assert_int_equal(number("SELECT excluded FROM reduction"), 0);
    assert_int_equal(excludes(s, "1/1"), 1);
    after = reduced(s);
    assert_int_equal(after.count, before.count - 1);
    assert_int_equal(store_append_reduction(s, 1, &after, NULL, NULL), 0);
    assert_int_equal(number("SELECT excluded FROM reduction ORDER BY id DESC"), 1);
    reduction_clear(&before);
    reduction_clear(&after);
    store_close(s, NULL);
    assert_int_equal(findings(), 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_names_readings),
        TEST(an_excluded_reading_is_not_reduced_until_it_is_restored),
        TEST(a_reduction_is_kept_with_how_many_were_excluded),
        TEST(what_cannot_be_excluded_changes_nothing),
        TEST(an_exclusion_is_never_changed),
        TEST(the_check_value_is_as_documented),
        TEST(the_history_tells_who_and_why),
        TEST(references_can_be_excluded_as_long_as_one_is_left),
        TEST(nothing_left_on_the_sample_is_said),
        TEST(a_sweep_is_measured_again_with_its_references),
        TEST(a_sweep_that_is_not_there_is_not_measured_again),
        TEST(an_excluded_point_is_measured_again_too),
        TEST(it_can_be_taken_back_before_it_is_measured),
        TEST(an_excluded_reference_that_waits_goes_on_waiting),
        TEST(closing_references_come_after_everything),
        TEST(a_campaign_that_goes_on_normally_reopens_nothing),
        TEST(an_older_file_learns_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
