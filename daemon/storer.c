// SPDX-License-Identifier: MIT
#include "daemon/storer.h"

#include "base/clk.h"
#include "campaign/catalog.h"
#include "campaign/plan_states.h"
#include "campaign/reduce.h"
#include "campaign/store.h"
#include "campaign/store_exclude.h"
#include "daemon/decision.h"
#include "daemon/keeper.h"
#include "daemon/material.h"
#include "daemon/note.h"
#include "daemon/outcome.h"
#include "daemon/queue.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct storer {
    struct storer_links links;
    pthread_t thread;
    struct store *store; // open for writing; NULL: none
    int run;
    char state[16]; // the last written
    struct keeper *keeper; // NULL: not opened yet, or it cannot be
    int highest;    // number that anybody was told: the next campaign's is above it
};

struct storer *storer_new(const struct storer_links *links)
{
    struct storer *s = calloc(1, sizeof *s);
    if (s)
        s->links = *links;
    return s;
}

void storer_free(struct storer *s)
{
    if (!s)
        return;
    store_close(s->store, NULL);
    keeper_free(s->keeper);
    free(s);
}

void run_material_free(void *material)
{
    struct run_material *m = material;
    if (m)
        plan_clear(&m->plan);
    free(m);
}

static int64_t utc_ms(const struct storer *s)
{
    return clk_utc_ns(s->links.clk) / 1000000;
}

// --- which campaigns there are -------------------------------------------------------------------

static enum run_state state_of(const char *name)
{
    if (!strcmp(name, "done"))
        return RUN_DONE;
    if (!strcmp(name, "failed") || !strcmp(name, "unreadable"))
        return RUN_FAILED;
    return RUN_STOPPED; // also of a daemon that died, or before it ever ran: it can go on
}

static struct run *run_of(struct storer *s, const struct catalog_entry *e)
{
    struct run *run = calloc(1, sizeof *run);
    if (!run)
        return NULL;
    s->highest = e->id > s->highest ? e->id : s->highest;
    const double unknown = (double)NAN;
    *run = (struct run){.id = e->id,
                        .state = state_of(e->state),
                        .done = e->done,
                        .total = e->total,
                        .theta_i_deg = unknown,
                        .theta_r_deg = unknown,
                        .f_per_sr = unknown,
                        .u_per_sr = unknown,
                        .left_s = unknown};
    snprintf(run->path, sizeof run->path, "%s", e->path);
    snprintf(run->name, sizeof run->name, "%s", e->name);
    snprintf(run->sample, sizeof run->sample, "%s", e->sample);
    if (!strcmp(e->state, "interrupted")) // why it was paused does not matter any more
        snprintf(run->text, sizeof run->text, "interrupted, the daemon died");
    else if (run->state != RUN_DONE)
        snprintf(run->text, sizeof run->text, "%s", e->problem);
    return run;
}

static struct run *listed_run(struct storer *s, const struct catalog_entry *e)
{
    struct run *run = e->id > 0 ? run_of(s, e) : NULL;
    if (run && s->keeper && keeper_had(s->keeper, e->id))
        run->left_s = catalog_left_s(e, s->links.bench);
    return run;
}

// The folder is this daemon's from here on, and what was queued in it is told after the runs.
static void list(struct storer *s)
{
    struct catalog_entry *entries = NULL;
    struct note *end = note_new(NOTE_LISTED), *unkept = note_new(NOTE_UNKEPT);
    s->keeper = keeper_new(s->links.directory, &unkept->err);
    int count = catalog_list(s->links.directory, &entries, &end->err);
    for (int i = 0; i < count; i++) {
        struct note *n = note_new(NOTE_LISTED);
        n->thing = listed_run(s, &entries[i]);
        if (n->thing)
            note_post(s->links.to_main, n);
        else
            note_free(n);
    }
    free(entries);
    note_post(s->links.to_main, s->keeper ? keeper_restored(s->keeper) : unkept);
    if (s->keeper)
        note_free(unkept);
    note_post(s->links.to_main, end);
}

static void keep_queue(struct storer *s, const struct note *n)
{
    struct note *complaint = s->keeper ? keeper_keep(s->keeper, n) : NULL;
    if (complaint)
        note_post(s->links.to_main, complaint);
}

// The mail is read in its order: what was to be kept before is on the disk now.
static void send_back(struct storer *s, const struct note *n)
{
    struct note *kept = note_new(NOTE_KEPT);
    kept->ticket = n->ticket;
    kept->run = n->run;
    kept->text = note_text(n->text);
    note_post(s->links.to_main, kept);
}

// --- a new campaign ------------------------------------------------------------------------------

static void add_line(void *ctx, const char *line)
{
    char **text = ctx;
    char *more = NULL;
    if (asprintf(&more, "%s%s%s", *text ? *text : "", *text ? "\n" : "", line) < 0)
        return;
    free(*text);
    *text = more;
}

static int create_file(struct storer *s, const struct campaign_config *config, const struct note *n,
                       char *ret_path, size_t size, struct gon_error *err)
{
    struct plan plan = {0};
    struct store *store = NULL;
    int id, rc = plan_make(config, s->links.bench, &plan, err);
    if (rc >= 0)
        rc = plan_check_states(&plan, s->links.bench, err);
    if (rc < 0) {
        plan_clear(&plan);
        return rc;
    }
    struct store_new what = {
        config, n->text,   n->name,           s->links.bench,         s->links.bench_text,
        &plan,  utc_ms(s), s->links.profiles, s->links.profiles_count};
    rc = catalog_create(s->links.directory, s->highest, &what, &store, &id, err);
    if (rc == 0)
        snprintf(ret_path, size, "%s", store_path(store));
    store_close(store, NULL); // opened again when its turn comes
    plan_clear(&plan);
    return rc;
}

static int read_entry(const char *path, struct catalog_entry *ret_entry, struct gon_error *err)
{
    int rc = catalog_read(path, ret_entry);
    if (rc < 0)
        return gon_fail(err, (enum gon_code)rc, "%s", ret_entry->problem);
    if (ret_entry->id <= 0)
        return gon_fail(err, GON_E_INPUT, "%s: not a numbered campaign file; see: gonio list",
                        path);
    return GON_OK;
}

// entry NULL: it could not be made or found, as err says.
static void answer_known(struct storer *s, const struct note *question, enum note_kind kind,
                         const struct catalog_entry *entry, const struct gon_error *err,
                         char *complaints)
{
    struct note *n = note_new(kind);
    n->ticket = question->ticket;
    n->by = note_text(question->by);
    n->run = question->run;
    n->last = question->last;
    n->count = question->count;
    n->text = complaints;
    n->thing = entry ? run_of(s, entry) : NULL;
    if (!entry)
        n->err = *err;
    else if (!n->thing)
        gon_fail(&n->err, GON_E_SYSTEM, "store: out of memory");
    else
        ((struct run *)n->thing)->left_s = catalog_left_s(entry, s->links.bench);
    note_post(s->links.to_main, n);
}

static void create(struct storer *s, const struct note *n)
{
    struct campaign_config config;
    char path[CATALOG_PATH] = "", *complaints = NULL;
    struct gon_error err = {GON_E_INPUT, "the campaign is wrong"};
    int rc =
        campaign_config_parse(n->text, n->name, (struct cfg_sink){add_line, &complaints}, &config);
    struct catalog_entry e;
    if (rc == 0)
        rc = create_file(s, &config, n, path, sizeof path, &err);
    rc = rc < 0 ? rc : read_entry(path, &e, &err);
    answer_known(s, n, NOTE_KNOWN, rc < 0 ? NULL : &e, &err, complaints);
}

// --- the campaign that is measured ---------------------------------------------------------------

static int same_number(const char *what, double then, double now, const char *unit,
                       struct gon_error *err)
{
    if (then == now)
        return GON_OK;
    return gon_fail(
        err, GON_E_REFUSED,
        "the campaign was begun on another bench: %s %g %s then, %g now; go on with that bench",
        what, then, unit, now);
}

// Links, names and speeds may change between two days of a campaign; what its numbers mean may not.
static int same_bench(const struct bench_config *then, const struct bench_config *now,
                      struct gon_error *err)
{
    int rc = same_number("wavelength", then->wavelength_nm, now->wavelength_nm, "nm", err);
    rc = rc < 0 ? rc
                : same_number("aperture radius", then->aperture_radius_mm, now->aperture_radius_mm,
                              "mm", err);
    rc = rc < 0 ? rc : same_number("distance", then->distance_mm, now->distance_mm, "mm", err);
    rc =
        rc < 0 ? rc : same_number("laser power", then->laser.power_w, now->laser.power_w, "W", err);
    if (rc == 0 && then->regime != now->regime)
        rc = gon_fail(err, GON_E_REFUSED,
                      "the campaign was begun in the other regime; go on with that bench");
    if (rc == 0 && then->laser.polarisation != now->laser.polarisation)
        rc = gon_fail(
            err, GON_E_REFUSED,
            "the campaign was begun with polarisation %s, the bench has %s; go on with that bench",
            polarisation_name((enum polarisation)then->laser.polarisation),
            polarisation_name((enum polarisation)now->laser.polarisation));
    rc = rc < 0 ? rc : bench_same_states(&then->polarisation, &now->polarisation, err);
    return rc < 0 ? rc : bench_same_devices(then, now, err);
}

static int read_opening(struct store *store, struct run_material *m, struct gon_error *err)
{
    struct store_reading *rows = NULL;
    int count = store_read_readings(store, -1, &rows, err);
    if (count < 0)
        return count;
    struct reduce_reference r = reduce_opening(&m->plan, rows, count);
    m->opening = (struct engine_opening){.dark_signal_v = r.dark_signal_v,
                                         .dark_monitor_v = r.dark_monitor_v};
    memcpy(m->opening.beam_signal_v, r.beam_signal_v, sizeof r.beam_signal_v);
    memcpy(m->opening.beam_monitor_v, r.beam_monitor_v, sizeof r.beam_monitor_v);
    for (int i = 0; i < count; i++)
        if (rows[i].t_utc_ms > m->opening.last_utc_ms)
            m->opening.last_utc_ms = rows[i].t_utc_ms;
    m->has_opening = count > 0;
    free(rows);
    return GON_OK;
}

static int check_bench(const struct storer *s, struct store *store, struct gon_error *err)
{
    struct bench_config then;
    int rc = store_read_bench(store, &then, err);
    return rc < 0 ? rc : same_bench(&then, s->links.bench, err);
}

static int read_material(const struct storer *s, struct store *store, struct run_material *m,
                         struct gon_error *err)
{
    int rc = store_read_config(store, &m->config, err);
    rc = rc < 0 ? rc : check_bench(s, store, err);
    rc = rc < 0 ? rc : store_reopen_closing(store, utc_ms(s), err);
    rc = rc < 0 ? rc : store_read_plan(store, &m->plan, err);
    return rc < 0 ? rc : read_opening(store, m, err);
}

// What opening the file did to it.
static int keep_notice(const struct storer *s, struct store *store, struct gon_error *err)
{
    const char *notice = store_notice(store);
    return *notice ? store_append_event(store, utc_ms(s), "notice", "store", notice, err) : GON_OK;
}

// What was measured with from now on.
static int keep_today(const struct storer *s, struct store *store, struct gon_error *err)
{
    int rc =
        store_append_profiles(store, utc_ms(s), s->links.profiles, s->links.profiles_count, err);
    return rc < 0 ? rc : keep_notice(s, store, err);
}

static int open_file(const struct storer *s, const char *path, struct store **ret_store,
                     struct run_material **ret_material, struct gon_error *err)
{
    struct store *store = NULL;
    struct run_material *m = calloc(1, sizeof *m);
    int rc = m ? store_open(path, STORE_WRITE, &store, err)
               : gon_fail(err, GON_E_SYSTEM, "store: out of memory");
    rc = rc < 0 ? rc : read_material(s, store, m, err);
    rc = rc < 0 ? rc : keep_today(s, store, err);
    if (rc < 0) {
        store_close(store, NULL);
        run_material_free(m);
        return rc;
    }
    *ret_store = store;
    *ret_material = m;
    return GON_OK;
}

static void open_run(struct storer *s, const struct note *n)
{
    struct note *answer = note_new(NOTE_OPENED);
    struct run_material *m = NULL;
    answer->run = n->run;
    if (open_file(s, n->name, &s->store, &m, &answer->err) == 0) {
        s->run = n->run;
        *s->state = 0;
        answer->thing = m;
        answer->drop = run_material_free;
    }
    note_post(s->links.to_main, answer);
}

static void append_reading(struct storer *s, const struct note *n)
{
    struct note *answer = note_new(NOTE_STORED);
    answer->sequence = n->sequence;
    if (!s->store || n->run != s->run)
        gon_fail(&answer->err, GON_E_STORE, "store: run %d has no open file", n->run);
    else if (store_append_reading(s->store, n->thing, &answer->err) == 0)
        answer->err.code = GON_OK;
    note_post(s->links.to_runner, answer);
}

static int append_state(struct storer *s, const struct note *n, struct gon_error *err)
{
    const char *name = n->state == RUN_PREPARING ? "running" : run_state_name(n->state);
    const char *why = n->text ? n->text : "";
    if (!s->store || n->run != s->run || (!strcmp(name, s->state) && !*why))
        return GON_OK;
    snprintf(s->state, sizeof s->state, "%s", name);
    return store_append_state(s->store, utc_ms(s), name, why, err);
}

static void append_fit(struct storer *s, const struct note *n)
{
    struct fit_outcome *o = n->thing;
    struct note *answer = note_new(NOTE_FITTED);
    int64_t id;
    answer->run = n->run;
    answer->sweep = n->sweep;
    answer->last = n->last;
    int rc = s->store && n->run == s->run
                 ? store_append_reduction(s->store, utc_ms(s), &o->reduction, &o->record.reduction,
                                          &answer->err)
                 : gon_fail(&answer->err, GON_E_STORE, "store: run %d has no open file", n->run);
    if (rc == 0)
        rc = store_append_fit(s->store, utc_ms(s), &o->record, &id, &answer->err);
    if (rc == 0) {
        answer->text = fit_json(&o->record, 0);
        answer->err.code = GON_OK;
    }
    note_post(s->links.to_main, answer);
}

// The engine is done with the plan that it was given; since then somebody may have had a sweep of it
// measured again.
static bool is_open_again(const struct storer *s, const struct note *n)
{
    struct store_progress p;
    return n->state == RUN_DONE && s->store && n->run == s->run &&
           store_read_progress(s->store, &p, NULL) == 0 && p.again > 0;
}

static void close_run(struct storer *s, struct note *n)
{
    struct note *answer = note_new(NOTE_CLOSED);
    answer->run = n->run;
    answer->last = is_open_again(s, n);
    if (answer->last) {
        n->state = RUN_STOPPED;
        free(n->text);
        n->text = note_text("what is to be measured again comes next");
    }
    if (append_state(s, n, &answer->err) == 0)
        answer->err.code = GON_OK;
    store_close(s->store,
                NULL); // a checkpoint that failed loses nothing: the next opening makes it
    s->store = NULL;
    s->run = 0;
    note_post(s->links.to_main, answer);
}

// --- what was measured before --------------------------------------------------------------------

// Only files of our own directory: a number elsewhere would be somebody else's.
static int own_file(const struct storer *s, const char *name, char *path, size_t size,
                    struct gon_error *err)
{
    char folder[CATALOG_PATH];
    int rc = catalog_resolve(s->links.directory, name, path, size, err);
    if (rc < 0)
        return rc;
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (slash)
        *slash = 0;
    char *real = realpath(slash ? folder : ".", NULL), *ours = realpath(s->links.directory, NULL);
    if (!real || !ours || strcmp(real, ours))
        rc = gon_fail(err, GON_E_INPUT, "%s is not in the daemon's folder; copy it to %s first",
                      path, s->links.directory);
    free(real);
    free(ours);
    return rc;
}

// Whether it could be opened when its turn comes. While another one is measured only what takes no
// time is tried, because that one's readings wait here.
static int try_file(const struct storer *s, const struct catalog_entry *e, struct gon_error *err)
{
    struct store *store;
    struct run_material *m;
    if ((s->store && s->run == e->id) || !strcmp(e->state, run_state_name(RUN_DONE)))
        return GON_OK; // the queue knows what to say
    if (e->writer_pid)
        return gon_fail(err, GON_E_REFUSED, "%s: in use by process %d", e->path, e->writer_pid);
    if (s->store)
        return GON_OK;
    int rc = open_file(s, e->path, &store, &m, err);
    if (rc < 0)
        return rc;
    store_close(store, NULL);
    run_material_free(m);
    return GON_OK;
}

static void look(struct storer *s, const struct note *n)
{
    struct catalog_entry e;
    struct gon_error err;
    char path[CATALOG_PATH];
    int rc = n->name ? own_file(s, n->name, path, sizeof path, &err)
                     : catalog_find(s->links.directory, n->run, path, sizeof path, &err);
    rc = rc < 0 ? rc : read_entry(path, &e, &err);
    rc = rc < 0 || n->letter.kind == NOTE_FIND ? rc : try_file(s, &e, &err);
    answer_known(s, n, n->letter.kind == NOTE_FIND ? NOTE_FOUND : NOTE_KNOWN, rc < 0 ? NULL : &e,
                 &err, NULL);
}

// --- decisions about readings --------------------------------------------------------------------

// The run that is measured has its file open already; another's is opened for the moment.
static int decide_in(struct storer *s, const struct note *n, const char *path,
                     struct gon_error *err)
{
    struct store *store = NULL;
    if (s->store && n->run == s->run)
        return decision_make(n->thing, s->store, utc_ms(s), err);
    int rc = store_open(path, STORE_WRITE, &store, err);
    rc = rc < 0 ? rc : keep_notice(s, store, err);
    if (rc >= 0 && n->last) // it will be measured on this bench
        rc = check_bench(s, store, err);
    rc = rc < 0 ? rc : decision_make(n->thing, store, utc_ms(s), err);
    store_close(store, NULL);
    return rc;
}

static void decide(struct storer *s, struct note *n)
{
    struct catalog_entry e;
    struct gon_error err;
    char path[CATALOG_PATH];
    int rc = catalog_find(s->links.directory, n->run, path, sizeof path, &err);
    n->count = rc < 0 ? rc : decide_in(s, n, path, &err);
    rc = n->count < 0 ? n->count : read_entry(path, &e, &err);
    answer_known(s, n, NOTE_DECIDED, rc < 0 ? NULL : &e, &err, NULL);
}

void storer_step(struct storer *s, struct note *n)
{
    switch ((enum note_kind)n->letter.kind) {
    case NOTE_LIST: list(s); break;
    case NOTE_CREATE: create(s, n); break;
    case NOTE_LOOK:
    case NOTE_FIND: look(s, n); break;
    case NOTE_OPEN: open_run(s, n); break;
    case NOTE_READING: append_reading(s, n); break;
    case NOTE_EVENT:
        if (s->store && n->run == s->run)
            store_append_event(s->store, utc_ms(s), n->level, n->source, n->text ? n->text : "",
                               NULL);
        break;
    case NOTE_STATE: append_state(s, n, NULL); break;
    case NOTE_FIT: append_fit(s, n); break;
    case NOTE_CLOSE: close_run(s, n); break;
    case NOTE_QUEUE: keep_queue(s, n); break;
    case NOTE_DECIDE: decide(s, n); break;
    case NOTE_KEPT: send_back(s, n); break;
    default: break;
    }
    note_free(n);
}

// --- the thread ----------------------------------------------------------------------------------

static void *thread_main(void *ctx)
{
    struct storer *s = ctx;
    for (struct note *n; (n = note_wait(s->links.box, -1));) {
        bool quit = n->letter.kind == NOTE_QUIT;
        storer_step(s, n);
        if (quit)
            break;
    }
    return NULL;
}

int storer_start(const struct storer_links *links, struct storer **ret_storer,
                 struct gon_error *err)
{
    struct storer *s = storer_new(links);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, "store thread: out of memory");
    int failed = pthread_create(&s->thread, NULL, thread_main, s);
    if (failed) {
        storer_free(s);
        return gon_fail(err, GON_E_SYSTEM, "store thread: %s", strerror(failed));
    }
    (void)pthread_setname_np(s->thread, "store"); // for top -H and debuggers
    *ret_storer = s;
    return GON_OK;
}

void storer_join(struct storer *s)
{
    if (!s)
        return;
    pthread_join(s->thread, NULL);
    storer_free(s);
}
