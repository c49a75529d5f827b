// SPDX-License-Identifier: MIT
#include "daemon/fitter.h"

#include "base/cancel.h"
#include "campaign/dataset.h"
#include "campaign/store.h"
#include "daemon/note.h"
#include "daemon/outcome.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_TRACE = 256 * 1024 };

struct fitter {
    struct fitter_links links;
    pthread_t thread;
};

struct trace {
    FILE *out;
    long written;
};

struct fitter *fitter_new(const struct fitter_links *links)
{
    struct fitter *f = calloc(1, sizeof *f);
    if (f)
        f->links = *links;
    return f;
}

void fitter_free(struct fitter *f)
{
    free(f);
}

void fit_outcome_free(void *outcome)
{
    struct fit_outcome *o = outcome;
    if (!o)
        return;
    reduction_clear(&o->reduction);
    free(o->trace);
    free(o);
}

// --- one fit -------------------------------------------------------------------------------------

static bool canceled(void *ctx)
{
    const struct fitter *f = ctx;
    return cancel_requested(f->links.cancel);
}

static void add_trace(void *ctx, int generation, double best, double mean)
{
    struct trace *t = ctx;
    if (t->out && t->written < MOST_TRACE)
        t->written += fprintf(t->out, "%d,%.9g,%.9g\n", generation, best, mean);
}

// The complete sweeps only: the next one may be under way.
static struct dataset_filter filter_of(const struct campaign_config *c, int sweep)
{
    struct dataset_filter filter = dataset_filter_all();
    filter.theta_i_max_deg = c->fit.theta_i_max_deg;
    for (int i = 0; i < sweep && i < c->theta_i_count; i++)
        filter.theta_i_deg[filter.theta_i_count++] = c->theta_i_deg[i];
    return filter;
}

static int run_fit(struct fitter *f, const struct campaign_config *config,
                   const struct dataset *data, struct fit_outcome *o, struct gon_error *err)
{
    size_t size;
    struct trace trace = {open_memstream(&o->trace, &size), 0};
    struct fit_data d = dataset_fit_data(data);
    struct fit_options options = campaign_fit_options(config);
    if (options.weighting == FIT_VARIANCE && !d.u_per_sr)
        options.weighting = FIT_UNIFORM; // one sample a reading says nothing about its noise
    options.u_scale = data->u_scale;
    options.canceled = canceled;
    options.cancel_ctx = f;
    options.trace = add_trace;
    options.trace_ctx = &trace;
    if (trace.out)
        fputs("generation,best_delta,mean_delta\n", trace.out);
    int stop = fit_run(&d, &options, &o->record.result);
    if (trace.out)
        fclose(trace.out);
    o->record.trace = o->trace;
    o->record.options = options;
    o->record.points = d.count;
    o->record.excluded = data->excluded;
    snprintf(o->record.note, sizeof o->record.note, "%s", data->note);
    if (stop == FIT_E_CANCELED)
        return gon_fail(err, GON_E_CANCELED, "fit: canceled");
    if (stop < 0)
        return gon_fail(err, GON_E_INPUT, "fit of %zu points: %s", d.count, fit_stop_text(stop));
    return GON_OK;
}

static int fit(struct fitter *f, const struct note *n, struct fit_outcome *o, struct gon_error *err)
{
    struct store *store = NULL;
    struct campaign_config config;
    struct dataset data = {0};
    if (canceled(f))
        return gon_fail(err, GON_E_CANCELED, "fit: canceled");
    int rc = store_open(n->name, STORE_READ, &store, err);
    if (rc == 0)
        rc = store_read_config(store, &config, err);
    if (rc == 0) {
        struct dataset_filter filter = filter_of(&config, n->sweep);
        rc = dataset_from_store(store, &filter, &data, &o->reduction, err);
    }
    store_close(store, NULL);
    if (rc == 0)
        rc = run_fit(f, &config, &data, o, err);
    o->record.sweep = n->sweep;
    dataset_clear(&data);
    return rc < 0 ? rc : GON_OK;
}

static struct note *answer_to(const struct note *n, enum note_kind kind)
{
    struct note *answer = note_new(kind);
    answer->run = n->run;
    answer->sweep = n->sweep;
    answer->last = n->last;
    return answer;
}

void fitter_step(struct fitter *f, struct note *n)
{
    struct gon_error err = {GON_E_SYSTEM, "fit: out of memory"};
    if (n->letter.kind == NOTE_FIT_WANTED) {
        struct fit_outcome *o = calloc(1, sizeof *o);
        if (o && fit(f, n, o, &err) == 0) {
            struct note *answer = answer_to(n, NOTE_FIT);
            answer->thing = o;
            answer->drop = fit_outcome_free;
            note_post(f->links.to_store, answer);
        } else {
            struct note *answer = answer_to(n, NOTE_FITTED);
            answer->err = err;
            fit_outcome_free(o);
            note_post(f->links.to_main, answer);
        }
    }
    note_free(n);
}

// --- the thread ----------------------------------------------------------------------------------

static void *thread_main(void *ctx)
{
    struct fitter *f = ctx;
    for (struct note *n; (n = note_wait(f->links.box, -1));) {
        bool quit = n->letter.kind == NOTE_QUIT;
        fitter_step(f, n);
        if (quit)
            break;
    }
    return NULL;
}

int fitter_start(const struct fitter_links *links, struct fitter **ret_fitter,
                 struct gon_error *err)
{
    struct fitter *f = fitter_new(links);
    if (!f)
        return gon_fail(err, GON_E_SYSTEM, "fit thread: out of memory");
    int failed = pthread_create(&f->thread, NULL, thread_main, f);
    if (failed) {
        fitter_free(f);
        return gon_fail(err, GON_E_SYSTEM, "fit thread: %s", strerror(failed));
    }
    (void)pthread_setname_np(f->thread, "fit"); // for top -H and debuggers
    *ret_fitter = f;
    return GON_OK;
}

void fitter_join(struct fitter *f)
{
    if (!f)
        return;
    pthread_join(f->thread, NULL);
    fitter_free(f);
}
