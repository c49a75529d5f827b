// SPDX-License-Identifier: MIT
#include "tests/dst/trial.h"

#include "daemon/queue.h"
#include "tests/dst/libc.h"

#include <dirent.h>
#include <fcntl.h>
#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SPAN_DEG 170.0
#define NOTHING_NS OS_S(3 * 3600) // without a reading

const char *const trial_moment_names[MOMENTS] = {"idle",    "preparing", "warming",
                                                 "moving",  "settling",  "sampling",
                                                 "storing", "paused",    "stopping"};

static void complain(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

static _Noreturn void give_up(const char *what, const char *why)
{
    fprintf(stderr, "dst: %s: %s\n", what, why);
    exit(2);
}

// --- the campaign --------------------------------------------------------------------------------

// Some angles of incidence, the rest directions: about so many points, and not always the same.
static void write_campaign(const struct trial_spec *spec, char *text, size_t size)
{
    struct dice d = dice_of(spec->seed, 2);
    const int most = spec->readings / 40 < 80 ? spec->readings / 40 : 80;
    const int sweeps = most < 2 ? 1 : most / 2 + (int)dice_below(&d, (unsigned)most / 2 + 1);
    const double step = SPAN_DEG / fmax(spec->readings / sweeps - 1, 2);
    size_t used = (size_t)snprintf(
        text, size, "campaign: { name = \"dst\"; sample = \"paint\"; theta_i_deg = (");
    for (int i = 0; i < sweeps; i++)
        used += (size_t)snprintf(text + used, size - used, "%s%.2f", i ? ", " : "",
                                 sweeps > 1 ? 80.0 * i / (sweeps - 1) : 30.0);
    snprintf(text + used, size - used,
             ");\n  theta_r: { from_deg = -85.0; to_deg = 85.0; step_deg = %.4f; };\n"
             "  dense: { half_width_deg = 0.0; };\n  readings: { count = %u; };\n"
             "  beam: { count = 4; };\n  dark: { count = 4; }; };\n",
             fmax(step, 0.01), 1 + dice_below(&d, 3));
}

static void create(struct trial *t)
{
    char text[3000];
    write_campaign(&t->spec, text, sizeof text);
    struct note *n = note_new(NOTE_CREATE);
    n->text = note_text(text);
    n->name = note_text("dst.cfg");
    n = shop_ask(&t->shop, n, NOTE_KNOWN);
    struct run *run = n ? n->thing : NULL;
    if (!run)
        give_up("the campaign", n && n->text ? n->text : n ? n->err.text : "no answer");
    t->id = run->id;
    snprintf(t->path, sizeof t->path, "%s", run->path);
    note_free(n);
}

// While its disk is broken a file cannot be opened: somebody tries again.
static void open_campaign(struct trial *t)
{
    struct gon_error err = {0};
    for (int i = 0; i < 100; i++) {
        struct note *n = note_new(NOTE_OPEN);
        n->run = t->id;
        n->name = note_text(t->path);
        n = shop_ask(&t->shop, n, NOTE_OPENED);
        t->material = n ? note_steal(n) : NULL;
        err = n ? n->err : err;
        note_free(n);
        if (t->material)
            return;
        os_sleep(OS_S(5));
    }
    give_up(t->path, err.text);
}

static void close_campaign(struct trial *t, enum run_state as)
{
    struct note *n = note_new(NOTE_CLOSE);
    n->run = t->id;
    n->state = as;
    n->text = note_text("");
    note_free(shop_ask(&t->shop, n, NOTE_CLOSED));
}

// --- the simulation ------------------------------------------------------------------------------

static void strike(void *ctx, int arg)
{
    struct trial *t = ctx;
    (void)arg;
    fault_begin(t, t->spec.fault, t->spec.variant);
    t->seen.begun = true;
    t->homings_before = t->watch.homings;
}

static void ask_for(struct trial *t, enum trial_moment moment)
{
    if (moment == MOMENT_PAUSED)
        t->wants_pause = true;
    if (moment == MOMENT_STOPPING) {
        watch_stop(&t->watch);
        cancel_request(t->cancel);
    }
}

// Not at the first chance but amid the campaign, where there is one.
void trial_aim(struct trial *t, enum trial_moment now, int64_t at_ns)
{
    const bool early = now <= MOMENT_WARMING || now >= MOMENT_PAUSED;
    if (t->spec.fault < 0 || t->aimed || now != t->spec.moment || (!early && t->watch.rows < 5))
        return;
    t->aimed = true;
    os_at(at_ns, strike, t, 0);
}

static void step(void *ctx, int64_t t_ns)
{
    struct trial *t = ctx;
    if (!t->watch.rig)
        return;
    const int64_t until_ns = t->watch.moving_until_ns;
    rig_step(&t->rig);
    watch_step(&t->watch, t_ns);
    if (t->ask_ns && t_ns >= t->ask_ns) {
        t->ask_ns = 0;
        t->asked = true;
        ask_for(t, t->spec.moment);
    }
    if (t->watch.moving_until_ns > until_ns && !t->paused) {
        trial_aim(t, MOMENT_MOVING, t_ns + (t->watch.moving_until_ns - t_ns) / 2);
        trial_aim(t, MOMENT_SETTLING, t->watch.moving_until_ns + OS_MS(8));
    }
    if (t->watch.running && t_ns > t->row_ns + NOTHING_NS && !cancel_requested(t->cancel)) {
        watch_violate(&t->watch, WATCH_WORDS, "no reading for 3 h, and it is %s",
                      run_state_name(t->watch.state));
        cancel_request(t->cancel);
    }
}

static void breathed(void *ctx)
{
    watch_breath(&((struct trial *)ctx)->watch);
}

static void heard(void *ctx, const uint8_t *bytes, size_t size)
{
    struct trial *t = ctx;
    if (!t->watch.rig)
        return;
    watch_heard(&t->watch, bytes, size);
    if (t->watch.samples > 0)
        trial_aim(t, MOMENT_SAMPLING, os.now_ns + OS_MS(1));
}

static void begin(struct trial *t, const struct trial_spec *spec)
{
    struct rig_spec rig;
    struct gon_error err = {0};
    memset(t, 0, sizeof *t);
    t->spec = *spec;
    os_begin(step, t);
    os.trace = spec->trace;
    disk_begin();
    t->dice = dice_of(spec->seed, 3);
    rig_draw(&rig, spec->seed);
    rig_init(&t->rig, spec->rig ? spec->rig : &rig);
    t->rig.line[RIG_DETECTOR].heard = heard;
    t->rig.line[RIG_DETECTOR].ctx = t;
    if (bench_config_parse(t->rig.bench_text, "goniod.cfg", (struct cfg_sink){complain, NULL},
                           &t->bench) < 0)
        give_up("goniod.cfg", t->rig.bench_text);
    snprintf(t->bench.folder, sizeof t->bench.folder, "%s", spec->profiles);
    t->box = mail_new();
    t->to_main = mail_new();
    t->cancel = cancel_new();
    shop_begin(&t->shop, &t->bench, t->rig.bench_text, t->box, t->to_main);
    create(t);
    open_campaign(t);
    t->plan = t->material->plan;
    t->plan.points = malloc((size_t)t->plan.count * sizeof *t->plan.points);
    if (!t->plan.points)
        abort();
    memcpy(t->plan.points, t->material->plan.points,
           (size_t)t->plan.count * sizeof *t->plan.points);
    watch_init(&t->watch, &t->rig, &t->bench, &t->plan);
    if (instrument_open(&t->bench, NULL, clk_system(), &t->in, &err) < 0)
        give_up("the bench", err.text);
    instrument_watch(t->in, breathed, t);
    trial_arm(t);
}

// Whoever starts a run or goes on with one answers for the light.
void trial_arm(struct trial *t)
{
    (void)arm_set(instrument_arm(t->in), "operator", NULL, ARM_MOST_S, instrument_now_ns(t->in), 0,
                  NULL);
}

static uint64_t hash_rows(sqlite3 *db, const char *sql, uint64_t hash)
{
    sqlite3_stmt *q;
    if (sqlite3_prepare_v2(db, sql, -1, &q, NULL) != SQLITE_OK)
        return hash;
    while (sqlite3_step(q) == SQLITE_ROW)
        for (int i = 0; i < sqlite3_column_count(q); i++) {
            const unsigned char *text = sqlite3_column_text(q, i);
            for (; text && *text; text++)
                hash = (hash ^ *text) * 1099511628211u;
            hash = (hash ^ 0xff) * 1099511628211u;
        }
    sqlite3_finalize(q);
    return hash;
}

// What sqlite3 FILE .dump would show, as one number.
static uint64_t hash_file(const char *path)
{
    static const char *const tables[] = {"meta", "plan", "reading", "state", "event", NULL};
    sqlite3 *db;
    uint64_t hash = 14695981039346656037u;
    if (sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL) == SQLITE_OK)
        for (int i = 0; tables[i]; i++) {
            char sql[60];
            snprintf(sql, sizeof sql, "SELECT * FROM %s ORDER BY 1, 2, 3", tables[i]);
            hash = hash_rows(db, sql, hash);
        }
    sqlite3_close(db);
    return hash;
}

static void check_file(struct trial *t)
{
    struct store *s = NULL;
    struct store_reading *rows = NULL;
    struct gon_error err = {0};
    int count = store_open(t->path, STORE_READ, &s, &err);
    if (count >= 0)
        count = store_read_readings(s, -1, &rows, &err);
    if (count < 0)
        watch_violate(&t->watch, WATCH_ROWS, "the file: %s", err.text);
    else
        watch_file(&t->watch, rows, count);
    free(rows);
    store_close(s, NULL);
}

static void sweep_folder(void)
{
    DIR *d = opendir(".");
    for (struct dirent *e; d && (e = readdir(d));)
        unlinkat(dirfd(d), e->d_name, 0);
    if (d)
        closedir(d);
}

static void end(struct trial *t, struct trial_result *r)
{
    faults_mend(t, true);
    if (!instrument_free(t->in) && rig_emits(&t->rig))
        watch_violate(&t->watch, WATCH_EMISSION, "on after the instrument was closed");
    t->seen.homings = t->watch.homings - t->homings_before;
    *r = (struct trial_result){.state = r->state,
                               .seen = t->seen,
                               .faults = t->injected,
                               .hash = os.hash,
                               .traced = os.traced,
                               .virtual_s = (double)os.now_ns * 1e-9 - 1000,
                               .rows = t->watch.rows,
                               .points = t->material->plan.count,
                               .pauses = t->pauses,
                               .worst_gap_ns = t->watch.worst_gap_ns};
    memcpy(r->counts, t->counts, sizeof r->counts);
    rig_describe(&t->rig, r->bench, sizeof r->bench);
    close_campaign(t, r->state);
    shop_end(&t->shop);
    mail_free(t->box, note_drop);
    mail_free(t->to_main, note_drop);
    cancel_free(t->cancel);
    check_file(t);
    os_end();
    libc_forget();
    r->dump = hash_file(t->path);
    r->violations = t->watch.all;
    memcpy(r->rules, t->watch.violations, sizeof r->rules);
    memcpy(r->texts, t->watch.texts, sizeof r->texts);
    snprintf(r->text, sizeof r->text, "%s", t->watch.text);
    watch_free(&t->watch);
    free(t->plan.points);
    run_material_free(t->material);
    sweep_folder();
}

// As the instrument thread does while it has no campaign.
static void idle(struct trial *t, double s)
{
    const int64_t until_ns = os.now_ns + OS_S(s);
    trial_aim(t, MOMENT_IDLE, os.now_ns + OS_S(0.5));
    while (os.now_ns < until_ns) {
        instrument_tend(t->in);
        os_sleep(OS_S(1));
        watch_breath(&t->watch);
    }
}

static enum run_state run_once(struct trial *t)
{
    struct engine_ports ports;
    struct gon_error err = {0};
    if (!t->asked && (t->spec.moment == MOMENT_STOPPING || t->spec.moment == MOMENT_PAUSED))
        t->ask_ns = os.now_ns + OS_S(12);
    trial_ports(t, &ports);
    t->row_ns = os.now_ns;
    watch_breath(&t->watch);
    const enum run_state s =
        engine_run(&ports, t->in, &t->material->config, &t->material->plan, &err);
    if (s == RUN_FAILED)
        watch_violate(&t->watch, WATCH_WORDS, "failed: %s", err.text);
    watch_end(&t->watch, s);
    return s;
}

// A campaign that was stopped is closed, opened again and goes on.
static void go_on(struct trial *t)
{
    close_campaign(t, RUN_STOPPED);
    run_material_free(t->material);
    open_campaign(t);
    cancel_reset(t->cancel);
    t->seen.stops += t->seen.begun;
    t->reading_open = t->resume = t->wants_pause = t->paused = false;
    watch_resume(&t->watch);
    trial_arm(t);
}

void trial_run(const struct trial_spec *spec, struct trial_result *ret_result)
{
    struct trial *t = malloc(sizeof *t);
    if (!t)
        abort();
    begin(t, spec);
    idle(t, 2);
    while ((ret_result->state = run_once(t)) == RUN_STOPPED && t->watch.stop) {
        idle(t, 2);
        go_on(t);
    }
    t->watch.running = false;
    idle(t, 2);
    end(t, ret_result);
    free(t);
}
