// SPDX-License-Identifier: MIT
#include "tests/dst/trial.h"

#include "daemon/queue.h"
#include "tests/dst/libc.h"

#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SPAN_DEG 170.0

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
    size_t used = (size_t)snprintf(text, size,
                                   "campaign: { name = \"dst\"; sample = \"paint\"; theta_i_deg = (");
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

static void open_campaign(struct trial *t)
{
    struct note *n = note_new(NOTE_OPEN);
    n->run = t->id;
    n->name = note_text(t->path);
    n = shop_ask(&t->shop, n, NOTE_OPENED);
    if (!n || !n->thing)
        give_up(t->path, n ? n->err.text : "no answer");
    t->material = note_steal(n);
    note_free(n);
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

static void step(void *ctx, int64_t t_ns)
{
    struct trial *t = ctx;
    if (t->watch.rig)
        watch_step(&t->watch, t_ns);
}

static void breathed(void *ctx)
{
    watch_breath(&((struct trial *)ctx)->watch);
}

static void heard(void *ctx, const uint8_t *bytes, size_t size)
{
    struct trial *t = ctx;
    if (t->watch.rig)
        watch_heard(&t->watch, bytes, size);
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
    rig_draw(&rig, spec->seed);
    rig_init(&t->rig, &rig);
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
    watch_init(&t->watch, &t->rig, &t->bench, &t->material->plan);
    if (instrument_open(&t->bench, clk_system(), &t->in, &err) < 0)
        give_up("the bench", err.text);
    instrument_watch(t->in, breathed, t);
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

static void end(struct trial *t, struct trial_result *r)
{
    if (!instrument_free(t->in) && rig_emits(&t->rig))
        watch_violate(&t->watch, WATCH_EMISSION, "on after the instrument was closed");
    *r = (struct trial_result){.state = r->state,
                               .hash = os.hash,
                               .traced = os.traced,
                               .virtual_s = (double)os.now_ns * 1e-9 - 1000,
                               .rows = t->watch.rows,
                               .points = t->material->plan.count,
                               .pauses = t->pauses,
                               .worst_gap_ns = t->watch.worst_gap_ns};
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
    snprintf(r->text, sizeof r->text, "%s", t->watch.text);
    watch_free(&t->watch);
    run_material_free(t->material);
    unlink(t->path);
}

void trial_run(const struct trial_spec *spec, struct trial_result *ret_result)
{
    struct engine_ports ports;
    struct gon_error err = {0};
    struct trial *t = malloc(sizeof *t);
    if (!t)
        abort();
    begin(t, spec);
    trial_ports(t, &ports);
    ret_result->state =
        engine_run(&ports, t->in, &t->material->config, &t->material->plan, &err);
    watch_end(&t->watch, ret_result->state);
    if (ret_result->state == RUN_FAILED)
        watch_violate(&t->watch, WATCH_WORDS, "failed: %s", err.text);
    t->watch.running = false;
    end(t, ret_result);
    free(t);
}
