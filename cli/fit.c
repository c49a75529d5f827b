// SPDX-License-Identifier: MIT
// fit: the model's parameters from a CSV or a campaign file. Works without the daemon.
#include "base/units.h"
#include "campaign/catalog.h"
#include "campaign/dataset.h"
#include "campaign/fitjson.h"
#include "cli/fit_options.h"
#include "cli/fitview.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct options {
    bool json;
    const char *column, *angles, *hold_out, *trace, *dir;
    struct fit_words words;
    struct fit_paper_words paper;
    double theta_i_max_deg;
    long seed, threads, bootstrap;
};

static const struct option_row rows[] = {
    {"--column", OPTION_TEXT, offsetof(struct options, column), "NAME", 0, 0,
     "the CSV's value column (f_r)"},
    {"--theta-i-max", OPTION_REAL, offsetof(struct options, theta_i_max_deg), "DEG", 0, 90,
     "leave out larger angles of incidence"},
    {"--theta-i", OPTION_TEXT, offsetof(struct options, angles), "LIST", 0, 0,
     "only these: 0,10,20"},
    {"--hold-out", OPTION_TEXT, offsetof(struct options, hold_out), "LIST", 0, 0,
     "do not fit these theta_i, but say how well the fit describes them"},
    {"--weights", OPTION_TEXT, offsetof(struct options, words.weights), "W", 0, 0,
     "uniform, dense:G, relative or variance (variance when every value has u_f_r)"},
    {"--method", OPTION_TEXT, offsetof(struct options, words.method), "M", 0, 0,
     "memetic, or paper: its binary genetic algorithm (memetic)"},
    {"--population", OPTION_INT, offsetof(struct options, paper.population), "N", 4, 10000,
     "paper: individuals, an even number (100)"},
    {"--bits", OPTION_INT, offsetof(struct options, paper.bits), "N", 4, 30,
     "paper: of each of the five genes (20)"},
    {"--generations", OPTION_INT, offsetof(struct options, paper.generations), "N", 1,
     FIT_GENERATIONS_MOST, "paper: after the first (1000)"},
    {"--mutation", OPTION_TEXT, offsetof(struct options, paper.mutation), "M", 0, 0,
     "paper: bit: each with probability 0.05, or individual: one bit of it (bit)"},
    {"--scaling", OPTION_TEXT, offsetof(struct options, paper.scaling), "S", 0, 0,
     "paper: of the fitness 1/Delta: none, or linear: the best is twice the mean (none)"},
    {"--elitism", OPTION_FLAG, offsetof(struct options, paper.elitism), NULL, 0, 0,
     "paper: the best individual lives on"},
    {"--diffuse", OPTION_TEXT, offsetof(struct options, words.diffuse), "D", 0, 0,
     "paper: kd/cos(theta_i), or lambert: kd/pi (paper)"},
    {"--bounds", OPTION_TEXT, offsetof(struct options, words.bounds), "LIST", 0, 0,
     "of some or all, as NAME=LOW:HIGH; equal ones hold it, k=0:0 "
     "(n=0.2:8,k=0:10,sigma=0.01:0.6,ks=0:1.5,kd=0:0.5)"},
    {"--seed", OPTION_INT, offsetof(struct options, seed), "N", 0, 4294967295.0,
     "of the search (1)"},
    {"--threads", OPTION_INT, offsetof(struct options, threads), "N", 1, 64,
     "share the work; the result is the same (1)"},
    {"--bootstrap", OPTION_INT, offsetof(struct options, bootstrap), "N", 0, 0,
     "fit N data sets, 40 to 100000, that might have been measured: u and intervals by repetition "
     "(0: none)"},
    {"--trace", OPTION_TEXT, offsetof(struct options, trace), "FILE", 0, 0,
     "write each generation's Delta as CSV"},
    {"--dir", OPTION_TEXT, offsetof(struct options, dir), "DIR", 0, 0,
     "the folder of campaigns ($GONIO_DIR)"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "print JSON"},
    VERB_OPTIONS_END,
};

// Ctrl-C is blocked while the fit runs and seen here.
static bool canceled(void *ctx)
{
    sigset_t pending;
    (void)ctx;
    return sigpending(&pending) == 0 && sigismember(&pending, SIGINT) == 1;
}

static void add_trace(void *ctx, int generation, double best, double mean)
{
    fprintf(ctx, "%d,%.17g,%.17g\n", generation, best, mean);
}

static bool ends_with(const char *text, const char *end)
{
    size_t n = strlen(text), m = strlen(end);
    return n >= m && !strcmp(text + n - m, end);
}

static int filter_of(const struct options *o, struct dataset_filter *ret_filter,
                     struct gon_error *err)
{
    struct dataset_filter f = dataset_filter_all();
    if (isfinite(o->theta_i_max_deg))
        f.theta_i_max_deg = o->theta_i_max_deg;
    if (o->angles) {
        int count = fit_angles_take("--theta-i", o->angles, f.theta_i_deg, FIT_MOST_ANGLES, err);
        if (count < 0)
            return count;
        f.theta_i_count = count;
    }
    if (o->hold_out) {
        int count =
            fit_angles_take("--hold-out", o->hold_out, f.without_deg, FIT_MOST_ANGLES, err);
        if (count < 0)
            return count;
        f.without_count = count;
    }
    *ret_filter = f;
    return GON_OK;
}

// Each angle must be there: a mistyped one would pass for a good validation of the others, or for
// a smaller fit. The encoder's angle may differ from the plan's by a little.
static int check_angle(const struct dataset *data, const char *option, double theta_i_deg,
                       struct gon_error *err)
{
    for (size_t i = 0; i < data->count; i++)
        if (fabs(units_deg(data->theta_i_rad[i]) - theta_i_deg) < 0.01)
            return GON_OK;
    return gon_fail(err, GON_E_INPUT, "%s %g: %s has no sweep at that theta_i", option, theta_i_deg,
                    data->source);
}

static int check_held_out(const struct dataset *data, const struct fit_hold_out *h,
                          struct gon_error *err)
{
    int rc = GON_OK;
    for (int i = 0; i < h->count && rc == GON_OK; i++)
        rc = check_angle(data, "--hold-out", h->theta_i_deg[i], err);
    return rc;
}

// What --hold-out takes out again is looked for when it is read.
static int check_chosen(const struct dataset *data, const struct dataset_filter *f,
                        struct gon_error *err)
{
    int rc = GON_OK;
    for (int i = 0; i < f->theta_i_count && rc == GON_OK; i++) {
        const double angle_deg = f->theta_i_deg[i];
        bool held_out = false;
        for (int j = 0; j < f->without_count; j++)
            held_out = held_out || f->without_deg[j] == angle_deg;
        if (held_out)
            continue;
        if (angle_deg > f->theta_i_max_deg)
            return gon_fail(err, GON_E_INPUT, "--theta-i %g is above the largest theta_i, %g deg",
                            angle_deg, f->theta_i_max_deg);
        rc = check_angle(data, "--theta-i", angle_deg, err);
    }
    return rc;
}

// A number, a name, or a .gonio file is a campaign; anything else is a CSV. A campaign brings the
// options of its configuration.
static int load_campaign(const struct options *o, const char *file, struct dataset_filter *filter,
                         struct dataset *ret_data, struct fit_options *options,
                         struct gon_error *err)
{
    char directory[CATALOG_PATH], path[CATALOG_PATH];
    struct store *store = NULL;
    struct campaign_config config;
    if (o->column)
        return gon_fail(err, GON_E_INPUT,
                        "--column is for CSV files; a campaign has one value column");
    int rc = catalog_directory(o->dir, directory, sizeof directory, err);
    rc = rc < 0 ? rc : catalog_resolve(directory, file, path, sizeof path, err);
    rc = rc < 0 ? rc : store_open(path, STORE_READ, &store, err);
    rc = rc < 0 ? rc : store_read_config(store, &config, err);
    if (rc == 0) {
        *options = campaign_fit_options(&config);
        if (!isfinite(filter->theta_i_max_deg))
            filter->theta_i_max_deg = config.fit.theta_i_max_deg;
        rc = dataset_from_store(store, filter, ret_data, NULL, err);
    }
    store_close(store, NULL);
    return rc;
}

static bool is_file(const char *path) // "-" is standard input
{
    if (!strcmp(path, "-"))
        return true;
    return access(path, F_OK) == 0 || errno != ENOENT; // opening a FIFO would wait for its writer
}

static int load_file(const struct options *o, const char *file, struct dataset_filter *filter,
                     struct dataset *ret_data, struct fit_options *options, bool *ret_campaign,
                     struct gon_error *err)
{
    *ret_campaign = ends_with(file, STORE_SUFFIX) || !is_file(file);
    return *ret_campaign ? load_campaign(o, file, filter, ret_data, options, err)
                         : dataset_from_csv(file, o->column, filter, ret_data, err);
}

static int load(const struct options *o, const char *file, struct dataset *ret_data,
                struct fit_options *options, struct gon_error *err)
{
    struct dataset_filter filter;
    bool campaign;
    int rc = filter_of(o, &filter, err);
    rc = rc < 0 ? rc : load_file(o, file, &filter, ret_data, options, &campaign, err);
    rc = rc < 0 ? rc : check_chosen(ret_data, &filter, err);
    if (rc < 0)
        return rc;
    if (!campaign && ret_data->u_per_sr)
        options->weighting = FIT_VARIANCE;
    if (options->weighting == FIT_VARIANCE && !ret_data->u_per_sr)
        options->weighting = FIT_UNIFORM;
    return GON_OK;
}

static int set_options(const struct options *o, struct fit_options *options, struct gon_error *err)
{
    int rc = fit_words_take(&o->words, options, err);
    rc = rc < 0 ? rc : fit_paper_take(&o->paper, options, err);
    rc = rc < 0 ? rc : fit_bootstrap_take(o->bootstrap, options, err);
    if (o->seed >= 0)
        options->seed = (uint64_t)o->seed;
    options->threads = o->threads > 0 ? (int)o->threads : 1;
    options->canceled = canceled;
    return rc;
}

// A campaign's configuration falls back to uniform weights by itself; what was asked for does not.
static int check_weights(const struct fit_options *options, const struct dataset *data,
                         const char *column, struct gon_error *err)
{
    if (options->weighting != FIT_VARIANCE || data->u_per_sr)
        return GON_OK;
    return gon_fail(
        err, GON_E_INPUT,
        "--weights variance: %s has no uncertainty for every value (column u_%s); allowed "
        "without: uniform, dense:G, relative",
        data->source, column ? column : "f_r");
}

static int search(const struct dataset *data, const struct options *o, struct fit_options *options,
                  struct fit_result *ret_result, struct gon_error *err)
{
    FILE *trace = o->trace ? fopen(o->trace, "w") : NULL;
    if (o->trace && !trace)
        return gon_fail(err, GON_E_INPUT, "--trace %s: %s", o->trace, strerror(errno));
    if (trace) {
        fputs("generation,best_delta,mean_delta\n", trace);
        options->trace = add_trace;
        options->trace_ctx = trace;
    }
    options->u_scale = data->u_scale;
    struct fit_data d = dataset_fit_data(data);
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigprocmask(SIG_BLOCK, &set, NULL); // until the end: what is left is printing
    int stop = fit_run(&d, options, ret_result), rc = GON_OK;
    if (stop == FIT_E_CANCELED)
        rc = gon_fail(err, GON_E_CANCELED, "interrupted; nothing was fitted");
    else if (stop == FIT_E_OPTIONS || stop == FIT_E_DATA || stop == FIT_E_ALL_ZERO ||
             stop == FIT_E_FEW_POINTS)
        rc = gon_fail(err, GON_E_INPUT, "%s: %s (%zu points)", data->source, fit_stop_text(stop),
                      data->count);
    else if (stop < 0)
        rc = gon_fail(err, GON_E_SYSTEM, "%s: %s", data->source, fit_stop_text(stop));
    if (trace && fclose(trace) != 0 && rc == 0)
        rc = gon_fail(err, GON_E_SYSTEM, "--trace %s: %s", o->trace, strerror(errno));
    return rc;
}

// Reads the sweeps that were not fitted and compares them with the fit.
static int validate(const struct options *o, const char *file, struct fit_record *record,
                    struct gon_error *err)
{
    struct dataset_filter filter = dataset_filter_all();
    struct fit_options ignored = record->options;
    struct dataset data = {0};
    bool campaign;
    int count =
        o->hold_out
            ? fit_angles_take("--hold-out", o->hold_out, filter.theta_i_deg, FIT_MOST_ANGLES, err)
            : 0;
    if (count <= 0)
        return count;
    if (!strcmp(file, "-"))
        return gon_fail(err, GON_E_INPUT,
                        "--hold-out %s: standard input cannot be read twice; give a file",
                        o->hold_out);
    filter.theta_i_count = record->hold_out.count = count;
    filter.theta_i_max_deg = 90;
    memcpy(record->hold_out.theta_i_deg, filter.theta_i_deg, sizeof filter.theta_i_deg);
    int rc = load_file(o, file, &filter, &data, &ignored, &campaign, err);
    if (rc == GON_E_INPUT) // the rest of the file has been read before
        rc = gon_fail(err, GON_E_INPUT, "--hold-out %s: %s has no sweep at %s", o->hold_out, file,
                      count == 1 ? "that theta_i" : "any of these theta_i");
    rc = rc < 0 ? rc : check_held_out(&data, &record->hold_out, err);
    if (rc == GON_OK) {
        struct fit_data d = dataset_fit_data(&data);
        int stop = fit_validate(&d, &record->options, &record->result.params,
                                &record->hold_out.validation);
        if (stop == FIT_E_CANCELED)
            rc = gon_fail(err, GON_E_CANCELED, "interrupted");
        else if (stop < 0)
            rc = gon_fail(err, GON_E_INPUT, "--hold-out %s: %s", o->hold_out, fit_stop_text(stop));
    }
    dataset_clear(&data);
    return rc;
}

// What was fitted and how, as far as it is not the paper's.
static void say_what(const struct fit_record *record, const struct dataset *data)
{
    const struct fit_options *o = &record->options;
    char factor[40] = "", diffuse[40] = "", excluded[40] = "";
    if (o->weighting == FIT_DENSE)
        snprintf(factor, sizeof factor, ":%.10g", o->dense_g);
    if (o->diffuse != BRDF_DIFFUSE_PAPER)
        snprintf(diffuse, sizeof diffuse, ", %s diffuse", fit_diffuse_name(o->diffuse));
    if (data->excluded)
        snprintf(excluded, sizeof excluded, ", %d readings excluded", data->excluded);
    fprintf(stderr, "%s: %zu points%s%s, %s%s weights%s, %s, seed %llu, %.0f ms\n", data->source,
            record->points, excluded, data->left_out ? " (others left out by the filter)" : "",
            fit_weighting_name(o->weighting), factor, diffuse, fit_method_name(o->method),
            (unsigned long long)o->seed, record->result.elapsed_total_ms);
}

static int print(const struct fit_record *record, const struct dataset *data, bool json)
{
    char *text = fit_json(record, json ? 2 : 0);
    if (!text) {
        out_say("out of memory");
        return EXIT_FAILED;
    }
    if (json) {
        puts(text);
    } else {
        json_t *o = json_loads(text, 0, NULL);
        say_what(record, data);
        fitview_print(o);
        json_decref(o);
    }
    free(text);
    return EXIT_OK;
}

static int run_fit(const struct verb *verb, int argc, char **argv)
{
    struct options o = {.theta_i_max_deg = (double)INFINITY, .seed = -1};
    struct fit_record record = {.sweep = -1, .options = fit_options_default()};
    struct dataset data = {0};
    struct gon_error err;
    const char *file;
    if (verb_take(verb, argc, argv, &o, &file, 1, 1) < 0)
        return EXIT_INPUT;
    int rc = load(&o, file, &data, &record.options, &err);
    rc = rc < 0 ? rc : set_options(&o, &record.options, &err);
    rc = rc < 0 ? rc : check_weights(&record.options, &data, o.column, &err);
    rc = rc < 0 ? rc : search(&data, &o, &record.options, &record.result, &err);
    rc = rc < 0 ? rc : validate(&o, file, &record, &err);
    record.points = data.count;
    record.excluded = data.excluded;
    snprintf(record.note, sizeof record.note, "%s", data.note);
    int status = rc < 0 ? out_fail(&err) : print(&record, &data, o.json);
    dataset_clear(&data);
    return status;
}

const struct verb verb_fit = {"fit",
                              "DATA",
                              "parameters with uncertainties, from a CSV or a campaign",
                              "DATA is a CSV with theta_i_deg, theta_r_signed_deg (or theta_r_deg "
                              "and dphi_deg), f_r and optionally\n"
                              "u_f_r, pol_in, pol_out; or a campaign: a file, or the name or "
                              "number that gonio list shows. Prints n, k,\n"
                              "sigma, ks, kd with standard uncertainty and 95 % interval, and what "
                              "the data identify better than n, k\n"
                              "and ks alone: ks*R at normal incidence and at 45 deg, and the "
                              "reflectance of the hemisphere.\n",
                              rows,
                              run_fit};
