// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit model base
// The store and fit cores, stepped by notes over a real campaign file; no threads.
#include "daemon/decision.h"
#include "daemon/fitter.h"
#include "daemon/material.h"
#include "daemon/note.h"
#include "daemon/queue.h"
#include "daemon/storer.h"

#include "base/cancel.h"
#include "base/clk.h"
#include "base/units.h"
#include "campaign/bench.h"
#include "campaign/reduce.h"
#include "campaign/state.h"
#include "campaign/store.h"
#include "model/brdf.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <dirent.h>
#include <jansson.h>
#include <math.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char bench_text[] =
    "bench: { name = \"test\"; wavelength_nm = 1060.0; regime = \"underfilled\"; "
    "aperture_radius_mm = 8.0;\n"
    "  u_aperture_radius_mm = 0.004; distance_mm = 500.0; u_distance_mm = 0.25; };\n"
    "buses: ( { name = \"axes\"; link = \"modbus-tcp:127.0.0.1:502\"; } );\n"
    "axes: ( { name = \"theta_i\"; driver = \"oriental-az\"; bus = \"axes\"; unit = 1; unit_name = "
    "\"deg\";\n"
    "    steps_per_unit = 1000.0; min = -5.0; max = 88.0; speed = 20.0; acceleration = 60.0; "
    "deadband = 0.003; },\n"
    "  { name = \"theta_r\"; driver = \"oriental-az\"; bus = \"axes\"; unit = 2; unit_name = "
    "\"deg\";\n"
    "    steps_per_unit = 1000.0; min = -180.0; max = 180.0; speed = 20.0; acceleration = 60.0;\n"
    "    deadband = 0.003; } );\n"
    "laser: { driver = \"cobolt-05\"; link = \"tcp:127.0.0.1:5000\"; power_w = 0.05; warmup_s = "
    "1.0;\n"
    "  polarisation = \"u\"; };\n"
    "detector: { driver = \"sr830\"; link = \"tcp:127.0.0.1:5001\"; time_constant_s = 0.001; "
    "slope_db = 12;\n"
    "  monitor_aux = 1; };\n"
    "stations: ( { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = 0.0; } "
    ");\n";

static const char campaign_text[] =
    "campaign: { name = \"Core test\"; theta_i_deg = [ 0.0, 30.0, 50.0 ];\n"
    "  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 5.0; }; };\n";

static const struct brdf_params truth = {1.5, 0.02, 0.15, 0.9, 0.05};

struct world {
    char folder[40];
    struct bench_config bench;
    struct clk_virtual clk;
    struct cancel *cancel;
    struct mail *to_main, *to_runner, *to_store;
    struct storer_links links;
    struct storer *storer;
    struct fitter *fitter;
};

static void say(void *ctx, const char *line)
{
    (void)ctx;
    print_message("%s\n", line);
}

static int set_up(void **state)
{
    struct world *w = calloc(1, sizeof *w);
    strcpy(w->folder, "/tmp/gonio-store-XXXXXX");
    assert_non_null(mkdtemp(w->folder));
    assert_int_equal(
        bench_config_parse(bench_text, "bench", (struct cfg_sink){say, NULL}, &w->bench), 0);
    w->cancel = cancel_new();
    w->to_main = mail_new();
    w->to_runner = mail_new();
    w->to_store = mail_new();
    w->links = (struct storer_links){clk_virtual_init(&w->clk, 0, CLK_S(1.8e9)),
                                     &w->bench,
                                     bench_text,
                                     w->folder,
                                     w->to_store,
                                     w->to_main,
                                     w->to_runner,
                                     NULL,
                                     0};
    w->storer = storer_new(&w->links);
    struct fitter_links f = {w->cancel, NULL, w->to_main, w->to_store};
    w->fitter = fitter_new(&f);
    *state = w;
    return 0;
}

static int tear_down(void **state)
{
    struct world *w = *state;
    storer_free(w->storer);
    fitter_free(w->fitter);
    mail_free(w->to_main, note_drop);
    mail_free(w->to_runner, note_drop);
    mail_free(w->to_store, note_drop);
    cancel_free(w->cancel);
    DIR *d = opendir(w->folder);
    for (struct dirent *e; (e = readdir(d));)
        unlinkat(dirfd(d), e->d_name, 0);
    closedir(d);
    assert_int_equal(rmdir(w->folder), 0);
    free(w);
    return 0;
}

static struct note *expect(struct mail *m, enum note_kind kind)
{
    struct note *n = note_take(m);
    assert_non_null(n);
    assert_int_equal(n->letter.kind, kind);
    return n;
}

static struct note *note_of(enum note_kind kind, int run, const char *name, const char *text)
{
    struct note *n = note_new(kind);
    n->run = run;
    n->name = note_text(name);
    n->text = note_text(text);
    return n;
}

// A new campaign: its run, to be freed.
static struct run *create(struct world *w)
{
    storer_step(w->storer, note_of(NOTE_CREATE, 0, "core.cfg", campaign_text));
    struct note *n = expect(w->to_main, NOTE_KNOWN);
    struct run *run = note_steal(n);
    assert_non_null(run);
    note_free(n);
    return run;
}

static struct run_material *open_run(struct world *w, const struct run *run)
{
    storer_step(w->storer, note_of(NOTE_OPEN, run->id, run->path, NULL));
    struct note *n = expect(w->to_main, NOTE_OPENED);
    struct run_material *m = note_steal(n);
    if (!m)
        fail_msg("%s", n->err.text);
    note_free(n);
    return m;
}

static void close_run(struct world *w, int run, enum run_state as)
{
    struct note *n = note_of(NOTE_CLOSE, run, NULL, "");
    n->state = as;
    storer_step(w->storer, n);
    n = expect(w->to_main, NOTE_CLOSED);
    assert_int_equal(n->err.code, 0);
    note_free(n);
}

// What a bench without noise would read.
static struct store_reading reading_of(const struct plan_point *p, const struct bench_config *bench)
{
    struct store_reading r = {.sweep = p->sweep,
                              .point = p->point,
                              .attempt = 1,
                              .t_utc_ms = 1800000000000,
                              .theta_i_udeg = (int32_t)units_udeg(p->theta_i_deg),
                              .theta_r_udeg = (int32_t)units_udeg(p->theta_r_deg),
                              .signal_sd_v = 1e-7,
                              .monitor_v = 2.0,
                              .monitor_sd_v = 1e-4,
                              .count = 4};
    double dphi_rad = p->theta_r_deg >= 0 ? UNITS_PI : 0,
           theta_r_rad = units_rad(fabs(p->theta_r_deg));
    if (p->kind == PLAN_DARK) {
        r.signal_v = 1e-6;
        r.monitor_v = 0.002;
    } else if (p->kind == PLAN_BEAM) {
        r.signal_v = 0.8 + 1e-6;
    } else {
        struct brdf_geometry g = brdf_geometry(units_rad(p->theta_i_deg), theta_r_rad, dphi_rad);
        double f = brdf_f00(&truth, BRDF_DIFFUSE_PAPER, &g);
        r.signal_v = 1e-6 + 0.8 * f * bench_omega_sr(bench) * cos(theta_r_rad);
    }
    return r;
}

// Returns the code of the acknowledgement.
static int append(struct world *w, int run, const struct store_reading *r, uint64_t sequence)
{
    struct note *n = note_of(NOTE_READING, run, NULL, NULL);
    n->sequence = sequence;
    n->thing = malloc(sizeof *r);
    memcpy(n->thing, r, sizeof *r);
    storer_step(w->storer, n);
    n = expect(w->to_runner, NOTE_STORED);
    int code = n->err.code;
    assert_int_equal(n->sequence, sequence);
    note_free(n);
    return code;
}

static void append_all(struct world *w, int run, const struct plan *plan, int most)
{
    for (int i = 0; i < plan->count && i < most; i++) {
        struct store_reading r = reading_of(&plan->points[i], &w->bench);
        assert_int_equal(append(w, run, &r, (uint64_t)i + 1), 0);
    }
}

static void a_campaign_goes_on_where_it_was_stopped(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    assert_int_equal(run->id, 1);
    assert_string_equal(run->name, "Core test");
    struct run_material *m = open_run(w, run);
    assert_false(m->has_opening);
    assert_false(m->plan.points[0].done);
    append_all(w, run->id, &m->plan, 10);
    close_run(w, run->id, RUN_STOPPED);
    run_material_free(m);

    m = open_run(w, run);
    for (int i = 0; i < m->plan.count; i++)
        assert_int_equal(m->plan.points[i].done, i < 10);
    assert_true(m->has_opening);
    assert_true(fabs(m->opening.beam_signal_v[POL_U] - 0.800001) < 1e-9);
    assert_true(fabs(m->opening.dark_monitor_v - 0.002) < 1e-9);
    assert_int_equal(m->opening.last_utc_ms, 1800000000000);
    run_material_free(m);
    close_run(w, run->id, RUN_STOPPED);
    free(run);
}

// Returns the answer, to be freed.
static struct note *decide(struct world *w, int run, const char *body)
{
    struct note *n = note_of(NOTE_DECIDE, run, NULL, NULL);
    struct decision *d = NULL;
    assert_int_equal(decision_parse(body, strlen(body), "Max", &d, NULL), 0);
    n->last = d->verb == DECISION_REMEASURE;
    n->thing = d;
    n->drop = decision_free;
    storer_step(w->storer, n);
    return expect(w->to_main, NOTE_DECIDED);
}

static void decides(struct world *w, int run, const char *body, int readings, int done)
{
    struct note *n = decide(w, run, body);
    if (n->err.code)
        print_error("%s\n", n->err.text);
    assert_int_equal(n->count, readings);
    assert_int_equal(((struct run *)n->thing)->done, done);
    note_free(n);
}

// In the file that is written, in one that is not, and what the next opening makes of it.
static void readings_are_decided_about_wherever_the_file_is(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    append_all(w, run->id, &m->plan, m->plan.count);
    const int total = m->plan.count;
    int sweep_2 = 0;
    for (int i = 0; i < total; i++)
        sweep_2 += m->plan.points[i].sweep == 2;
    decides(w, run->id, "{\"do\":\"exclude\",\"readings\":\"1/3\",\"reason\":\"dust\"}", 1, total);
    close_run(w, run->id, RUN_DONE);
    decides(w, run->id, "{\"do\":\"restore\",\"readings\":\"1/3\",\"reason\":\"none\"}", 1, total);
    decides(w, run->id, "{\"do\":\"remeasure\",\"sweep\":2,\"reason\":\"door\"}", sweep_2,
            total - sweep_2 - 4);
    run_material_free(m);
    m = open_run(w, run);
    for (int i = 0; i < total; i++) {
        const struct plan_point *p = &m->plan.points[i];
        assert_int_equal(p->done, p->sweep == 1 || p->sweep == 3);
        assert_int_equal(p->attempts, 1);
    }
    run_material_free(m);
    close_run(w, run->id, RUN_STOPPED);
    struct note *n = decide(w, 9, "{\"do\":\"remeasure\",\"sweep\":2,\"reason\":\"x\"}");
    assert_true(!n->thing && n->err.code == GON_E_INPUT);
    note_free(n);
    free(run);
}

static void a_run_is_not_done_while_a_sweep_is_open_again(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    append_all(w, run->id, &m->plan, m->plan.count);
    note_free(decide(w, run->id, "{\"do\":\"remeasure\",\"sweep\":1,\"reason\":\"door\"}"));
    run_material_free(m);
    struct note *n = note_of(NOTE_CLOSE, run->id, NULL, "");
    n->state = RUN_DONE;
    storer_step(w->storer, n);
    n = expect(w->to_main, NOTE_CLOSED);
    assert_true(n->last && n->err.code == 0);
    note_free(n);
    char text[16], why[80];
    struct store *s;
    assert_int_equal(store_open(run->path, STORE_READ, &s, NULL), 0);
    assert_int_equal(store_read_state(s, text, sizeof text, why, sizeof why, NULL, NULL), 0);
    assert_string_equal(text, "stopped");
    assert_string_equal(why, "what is to be measured again comes next");
    store_close(s, NULL);
    free(run);
}

// It would be measured with another beam: nothing is written then.
static void another_bench_measures_nothing_again(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    append_all(w, run->id, &m->plan, m->plan.count);
    close_run(w, run->id, RUN_DONE);
    run_material_free(m);
    w->bench.distance_mm += 1;
    struct note *n = decide(w, run->id, "{\"do\":\"remeasure\",\"sweep\":1,\"reason\":\"x\"}");
    assert_true(!n->thing && n->err.code == GON_E_REFUSED);
    note_free(n);
    decides(w, run->id, "{\"do\":\"exclude\",\"readings\":\"1/3\",\"reason\":\"dust\"}", 1, run->total);
    free(run);
}

static bool list_profile(void *ctx, const struct store_kept_profile *p)
{
    char *texts = ctx;
    strcat(strcat(strcat(strcat(texts, p->profile.name), "="), p->profile.text), " ");
    return true;
}

static bool list_event(void *ctx, const struct store_event *e)
{
    char *texts = ctx;
    strcat(strcat(texts, e->level), ": ");
    strcat(strcat(texts, e->text), "\n");
    return true;
}

// What it is measured with today is kept, too, when a campaign goes on another day.
static void profiles_are_kept_at_the_beginning_and_when_it_goes_on(void **state)
{
    struct world *w = *state;
    struct store_profile profiles[] = {{"sr830", "detector", "one"}, {"az", "axis", "two"}};
    struct storer_links links = w->links;
    char texts[200] = "", events[2000] = "";
    links.profiles = profiles;
    links.profiles_count = 2;
    storer_free(w->storer);
    w->storer = storer_new(&links);
    struct run *run = create(w);
    run_material_free(open_run(w, run));
    close_run(w, run->id, RUN_STOPPED);
    profiles[1].text = "three";
    run_material_free(open_run(w, run));
    close_run(w, run->id, RUN_STOPPED);
    struct store *s;
    assert_int_equal(store_open(run->path, STORE_READ, &s, NULL), 0);
    assert_int_equal(store_each_profile(s, list_profile, texts, NULL), 3);
    assert_string_equal(texts, "sr830=one az=two az=three ");
    store_each_event(s, 0, list_event, events, NULL);
    assert_string_equal(events, "");
    store_close(s, NULL);
    free(run);
}

static void an_older_file_that_goes_on_says_what_became_of_it(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct store *s;
    char events[2000] = "", wanted[700];
    sqlite3 *db;
    assert_int_equal(sqlite3_open(run->path, &db), SQLITE_OK);
    assert_int_equal(
        sqlite3_exec(db,
                     "DROP TABLE profile; DROP VIEW excluded; DROP VIEW reading_brdf;"
                     "DROP TABLE exclusion; ALTER TABLE reduction DROP COLUMN excluded;"
                     "CREATE VIEW reading_brdf AS SELECT 1; PRAGMA user_version = 2",
                     NULL, NULL, NULL),
        SQLITE_OK);
    sqlite3_close(db);
    run_material_free(open_run(w, run));
    close_run(w, run->id, RUN_STOPPED);
    assert_int_equal(store_open(run->path, STORE_READ, &s, NULL), 0);
    assert_int_equal(store_each_event(s, 0, list_event, events, NULL), 1);
    snprintf(wanted, sizeof wanted,
             "notice: the file was of version 2 and is now of version 4; as it was it is kept as "
             "%s.v2-backup\n",
             run->path);
    assert_string_equal(events, wanted);
    store_close(s, NULL);
    free(run);
}

static void a_row_offered_again_is_accepted_only_when_it_is_the_same(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    struct store_reading r = reading_of(&m->plan.points[0], &w->bench);
    assert_int_equal(append(w, run->id, &r, 1), 0);
    assert_int_equal(append(w, run->id, &r, 2), 0);
    r.signal_v *= 2;
    assert_int_equal(append(w, run->id, &r, 3), GON_E_INPUT);
    assert_int_equal(append(w, run->id + 1, &r, 4), GON_E_STORE); // not the run that is open
    run_material_free(m);
    close_run(w, run->id, RUN_STOPPED);
    assert_int_equal(append(w, run->id, &r, 5), GON_E_STORE);
    free(run);
}

static void a_wrong_campaign_is_complained_of_line_by_line(void **state)
{
    struct world *w = *state;
    storer_step(w->storer,
                note_of(NOTE_CREATE, 0, "x.cfg",
                        "campaign: {\n name = \"x\";\n theta_i_deg = [ 95.0 ];\n stpe = 1;\n};\n"));
    struct note *n = expect(w->to_main, NOTE_KNOWN);
    assert_null(n->thing);
    assert_int_equal(n->err.code, GON_E_INPUT);
    assert_non_null(strstr(n->text, "x.cfg:3: "));
    assert_non_null(strstr(n->text, "\nx.cfg:4: "));
    note_free(n);
}

static void another_bench_is_refused(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    w->bench.distance_mm = 400;
    storer_step(w->storer, note_of(NOTE_OPEN, run->id, run->path, NULL));
    struct note *n = expect(w->to_main, NOTE_OPENED);
    assert_null(n->thing);
    assert_int_equal(n->err.code, GON_E_REFUSED);
    assert_non_null(strstr(n->err.text, "distance 500 mm then, 400 now"));
    note_free(n);
    w->bench.distance_mm = 500;
    snprintf(w->bench.monitor.driver, sizeof w->bench.monitor.driver, "thorlabs-pm100");
    storer_step(w->storer, note_of(NOTE_OPEN, run->id, run->path, NULL));
    n = expect(w->to_main, NOTE_OPENED);
    assert_int_equal(n->err.code, GON_E_REFUSED);
    assert_non_null(strstr(n->err.text, "the bench has a thorlabs-pm100"));
    note_free(n);
    w->bench.monitor.driver[0] = 0;
    run_material_free(open_run(w, run)); // and the file was let go of
    close_run(w, run->id, RUN_STOPPED);
    free(run);
}

static void campaigns_are_listed_with_their_states(void **state)
{
    struct world *w = *state;
    struct run *a = create(w), *b = create(w);
    run_material_free(open_run(w, b));
    close_run(w, b->id, RUN_DONE);
    storer_step(w->storer, note_of(NOTE_LIST, 0, NULL, NULL));
    const enum run_state wanted[] = {RUN_STOPPED, RUN_DONE};
    for (int i = 0; i < 2; i++) {
        struct note *n = expect(w->to_main, NOTE_LISTED);
        const struct run *run = n->thing;
        assert_int_equal(run->id, i + 1);
        assert_int_equal(run->state, wanted[i]);
        note_free(n);
    }
    struct note *queue = expect(w->to_main, NOTE_RESTORED);
    assert_int_equal(((const struct state_queue *)queue->thing)->count, 0);
    note_free(queue);
    struct note *end = expect(w->to_main, NOTE_LISTED);
    assert_null(end->thing);
    note_free(end);
    free(a);
    free(b);
}

// What another storer on the same folder, later, says was queued.
static void the_queue_outlives_the_storer(void **state)
{
    struct world *w = *state;
    struct run *a = create(w), *b = create(w);
    assert_true(a->left_s > 0); // the estimate of the plan
    storer_step(w->storer, note_of(NOTE_LIST, 0, NULL, NULL));
    for (int i = 0; i < 4; i++)
        note_free(note_take(w->to_main));
    struct note *n = note_of(NOTE_QUEUE, 0, NULL, NULL);
    struct state_queue *q = state_queue_new(2);
    q->entries[0] = (struct state_entry){.run = b->id, .active = true};
    q->entries[1] = (struct state_entry){.run = a->id, .held = true};
    n->thing = q;
    storer_step(w->storer, n);
    assert_null(note_take(w->to_main)); // kept
    storer_free(w->storer);
    w->storer = storer_new(&w->links);
    storer_step(w->storer, note_of(NOTE_LIST, 0, NULL, NULL));
    for (int i = 0; i < 2; i++) {
        n = expect(w->to_main, NOTE_LISTED);
        assert_true(((const struct run *)n->thing)->left_s > 0);
        note_free(n);
    }
    n = expect(w->to_main, NOTE_RESTORED);
    q = n->thing;
    assert_int_equal(q->count, 2);
    assert_true(q->entries[0].run == b->id && q->entries[0].active && !q->entries[0].held);
    assert_true(q->entries[1].run == a->id && !q->entries[1].active && q->entries[1].held);
    note_free(n);
    note_free(expect(w->to_main, NOTE_LISTED));
    free(a);
    free(b);
}

static void only_files_of_the_own_folder_are_taken(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    char elsewhere[] = "/tmp/gonio-other-XXXXXX", path[600];
    assert_non_null(mkdtemp(elsewhere));
    snprintf(path, sizeof path, "%s/0001-core-test.gonio", elsewhere);
    assert_int_equal(link(run->path, path), 0);
    storer_step(w->storer, note_of(NOTE_LOOK, 0, path, NULL));
    struct note *n = expect(w->to_main, NOTE_KNOWN);
    assert_null(n->thing);
    assert_non_null(strstr(n->err.text, "is not in the daemon's folder"));
    note_free(n);
    storer_step(w->storer, note_of(NOTE_LOOK, 0, run->path, NULL));
    n = expect(w->to_main, NOTE_KNOWN);
    assert_non_null(n->thing);
    note_free(n);
    unlink(path);
    rmdir(elsewhere);
    free(run);
}

static struct note *look(struct world *w, enum note_kind question, int run, const char *name)
{
    storer_step(w->storer, note_of(question, run, name, NULL));
    return expect(w->to_main, question == NOTE_LOOK ? NOTE_KNOWN : NOTE_FOUND);
}

static void looking_fails(struct world *w, int run, const char *name, int code, const char *says)
{
    struct note *n = look(w, NOTE_LOOK, run, name);
    assert_null(n->thing);
    assert_int_equal(n->err.code, code);
    if (!strstr(n->err.text, says))
        fail_msg("'%s' does not say '%s'", n->err.text, says);
    note_free(n);
}

static void finds(struct world *w, enum note_kind question, int run, const char *name)
{
    struct note *n = look(w, question, run, name);
    if (!n->thing)
        fail_msg("%s", n->err.text);
    assert_int_equal(((struct run *)n->thing)->id, run);
    note_free(n);
}

// Copied there while the daemon runs.
static void a_number_is_looked_for_in_the_folder(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    char copy[120];
    snprintf(copy, sizeof copy, "%s/0007-copy.gonio", w->folder);
    assert_int_equal(rename(run->path, copy), 0);
    finds(w, NOTE_LOOK, 7, NULL);
    finds(w, NOTE_LOOK, 7, copy);
    finds(w, NOTE_FIND, 7, NULL);
    looking_fails(w, 1, NULL, GON_E_INPUT, "there is no run 1 in ");
    struct note *n = look(w, NOTE_FIND, 1, NULL);
    assert_null(n->thing);
    note_free(n);
    free(run);
}

static void what_cannot_go_on_is_seen_at_once(void **state)
{
    struct world *w = *state;
    struct run *run = create(w), *other = create(w);
    struct store *held;
    assert_int_equal(store_open(run->path, STORE_WRITE, &held, NULL), 0);
    looking_fails(w, run->id, run->path, GON_E_REFUSED, "in use by process ");
    struct run_material *m = open_run(w, other);
    looking_fails(w, run->id, run->path, GON_E_REFUSED, "in use by process ");
    finds(w, NOTE_LOOK, other->id, other->path); // held by the daemon itself
    close_run(w, other->id, RUN_STOPPED);
    store_close(held, NULL);
    finds(w, NOTE_LOOK, run->id, run->path);
    w->bench.distance_mm = 400;
    looking_fails(w, run->id, NULL, GON_E_REFUSED, "distance 500 mm then, 400 now");
    w->bench.distance_mm = 500;
    assert_int_equal(truncate(run->path, 20000), 0);
    looking_fails(w, run->id, NULL, GON_E_STORE, run->path);
    assert_int_equal(truncate(run->path, 0), 0);
    looking_fails(w, run->id, NULL, GON_E_INPUT, "not a campaign file");
    run_material_free(m);
    free(run);
    free(other);
}

// The daemon still knows a run whose file was removed.
static void a_number_is_given_once_in_the_daemons_life(void **state)
{
    struct world *w = *state;
    struct run *first = create(w);
    assert_int_equal(first->id, 1);
    unlink(first->path);
    struct run *second = create(w);
    assert_int_equal(second->id, 2);

    char listed[120];
    snprintf(listed, sizeof listed, "%s/0041-core-test.gonio", w->folder);
    assert_int_equal(rename(second->path, listed), 0);
    storer_step(w->storer, note_of(NOTE_LIST, 0, NULL, NULL));
    note_free(expect(w->to_main, NOTE_LISTED));
    note_free(expect(w->to_main, NOTE_RESTORED));
    note_free(expect(w->to_main, NOTE_LISTED));
    unlink(listed);
    struct run *third = create(w);
    assert_int_equal(third->id, 42);
    free(first);
    free(second);
    free(third);
}

static struct note *fit_wanted(const struct run *run, int sweep)
{
    struct note *n = note_of(NOTE_FIT_WANTED, run->id, run->path, NULL);
    n->sweep = sweep;
    n->last = sweep == 3;
    return n;
}

// Reduction, data, fit, its way into the file, and the JSON that everybody gets.
static void readings_of_a_known_surface_give_its_parameters(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    append_all(w, run->id, &m->plan, m->plan.count);
    fitter_step(w->fitter, fit_wanted(run, 3));
    storer_step(w->storer, expect(w->to_store, NOTE_FIT));
    struct note *n = expect(w->to_main, NOTE_FITTED);
    assert_true(n->last);
    json_t *fit = json_loads(n->text, 0, NULL);
    json_t *params = json_object_get(fit, "params");
    double sigma = json_real_value(json_object_get(json_object_get(params, "sigma"), "value"));
    double kd = json_real_value(json_object_get(json_object_get(params, "kd"), "value"));
    assert_true(fabs(sigma - truth.sigma) < 1e-4);
    assert_true(fabs(kd - truth.kd) < 1e-4);
    assert_int_equal(json_integer_value(json_object_get(fit, "points")), m->plan.samples);
    json_decref(fit);
    note_free(n);
    run_material_free(m);
    close_run(w, run->id, RUN_DONE);

    struct store *store;
    assert_int_equal(store_open(run->path, STORE_READ, &store, NULL), 0);
    char *stored = store_read_fit(store, -1);
    assert_non_null(stored);
    free(stored);
    store_close(store, NULL);
    free(run);
}

// 0, or the code of the answer to the main thread.
static int fit_code(struct world *w, struct note *wanted)
{
    fitter_step(w->fitter, wanted);
    struct note *n = expect(w->to_main, NOTE_FITTED);
    int code = n->err.code;
    assert_null(n->text);
    note_free(n);
    return code;
}

static void a_fit_that_cannot_be_made_says_so(void **state)
{
    struct world *w = *state;
    struct run *run = create(w);
    struct run_material *m = open_run(w, run);
    assert_int_equal(fit_code(w, fit_wanted(run, 1)), GON_E_INPUT); // no beam yet
    append_all(w, run->id, &m->plan, 4);
    assert_int_equal(fit_code(w, fit_wanted(run, 1)), GON_E_INPUT); // two points
    append_all(w, run->id, &m->plan, m->plan.count);
    cancel_request(w->cancel);
    assert_int_equal(fit_code(w, fit_wanted(run, 3)), GON_E_CANCELED);
    run_material_free(m);
    close_run(w, run->id, RUN_STOPPED);
    free(run);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_campaign_goes_on_where_it_was_stopped),
        TEST(readings_are_decided_about_wherever_the_file_is),
        TEST(a_run_is_not_done_while_a_sweep_is_open_again),
        TEST(another_bench_measures_nothing_again),
        TEST(profiles_are_kept_at_the_beginning_and_when_it_goes_on),
        TEST(an_older_file_that_goes_on_says_what_became_of_it),
        TEST(a_row_offered_again_is_accepted_only_when_it_is_the_same),
        TEST(a_wrong_campaign_is_complained_of_line_by_line),
        TEST(another_bench_is_refused),
        TEST(campaigns_are_listed_with_their_states),
        TEST(the_queue_outlives_the_storer),
        TEST(only_files_of_the_own_folder_are_taken),
        TEST(a_number_is_looked_for_in_the_folder),
        TEST(what_cannot_go_on_is_seen_at_once),
        TEST(a_number_is_given_once_in_the_daemons_life),
        TEST(readings_of_a_known_surface_give_its_parameters),
        TEST(a_fit_that_cannot_be_made_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
