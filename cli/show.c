// SPDX-License-Identifier: MIT
// show: what is in a campaign file.
#include "campaign/catalog.h"
#include "campaign/reduce.h"
#include "cli/fitview.h"
#include "cli/out.h"
#include "cli/show_exclusions.h"
#include "cli/show_profiles.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { EVENTS_SHOWN = 20 };

struct options {
    bool json;
    const char *dir;
    long sweep;
    bool profiles;
    const char *profile;
};

static const struct option_row rows[] = {
    {"--sweep", OPTION_INT, offsetof(struct options, sweep), "N", 0, 1000,
     "the readings of sweep N; 0 and the last are the references"},
    {"--profiles", OPTION_FLAG, offsetof(struct options, profiles), NULL, 0, 0,
     "the instruments' profiles that are kept in it"},
    {"--profile", OPTION_TEXT, offsetof(struct options, profile), "NAME", 0, 0,
     "the text of one: the newest of that name, or of a number that --profiles shows"},
    {"--dir", OPTION_TEXT, offsetof(struct options, dir), "DIR", 0, 0,
     "the folder of campaigns ($GONIO_DIR)"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "print JSON"},
    VERB_OPTIONS_END,
};

struct campaign {
    struct store *store;
    struct catalog_entry entry;
    struct store_progress progress;
    struct plan plan;
    struct reduction reduction;
    struct exclusions exclusions;
    bool reduced;
    char no_reduction[480];
};

static int open_file(const char *dir, const char *file, struct store **ret_store,
                     struct gon_error *err)
{
    char directory[CATALOG_PATH], path[CATALOG_PATH];
    int rc = catalog_directory(dir, directory, sizeof directory, err);
    rc = rc < 0 ? rc : catalog_resolve(directory, file, path, sizeof path, err);
    return rc < 0 ? rc : store_open(path, STORE_READ, ret_store, err);
}

static int campaign_open(struct campaign *c, const char *dir, const char *file,
                         struct gon_error *err)
{
    struct gon_error why;
    int rc = open_file(dir, file, &c->store, err);
    rc = rc < 0 ? rc : store_read_progress(c->store, &c->progress, err);
    rc = rc < 0 ? rc : store_read_plan(c->store, &c->plan, err);
    rc = rc < 0 ? rc : exclusions_read(c->store, &c->exclusions, err);
    if (rc < 0)
        return rc;
    catalog_read(store_path(c->store), &c->entry);
    c->reduced = reduce_campaign(c->store, &c->reduction, &why) >= 0;
    if (!c->reduced)
        snprintf(c->no_reduction, sizeof c->no_reduction, "%s", why.text);
    return GON_OK;
}

static void campaign_close(struct campaign *c)
{
    reduction_clear(&c->reduction);
    exclusions_clear(&c->exclusions);
    plan_clear(&c->plan);
    store_close(c->store, NULL);
}

static json_t *number(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

// --- one sweep -----------------------------------------------------------------------------------

static const struct reduced_point *reduced(const struct campaign *c, const struct store_reading *r)
{
    for (int i = 0; c->reduced && i < c->reduction.count; i++) {
        const struct reduced_point *p = &c->reduction.points[i];
        if (p->sweep == r->sweep && p->point == r->point && p->attempt == r->attempt)
            return p;
    }
    return NULL;
}

static const char *kind_of(const struct campaign *c, const struct store_reading *r)
{
    for (int i = 0; i < c->plan.count; i++)
        if (c->plan.points[i].sweep == r->sweep && c->plan.points[i].point == r->point)
            return plan_kind_name(c->plan.points[i].kind);
    return "";
}

static void value_cell(struct table *t, double v)
{
    if (isfinite(v))
        table_cell(t, out_is_terminal(stdout) ? "%.4g" : "%.9g", v);
    else
        table_cell(t, "%s", "");
}

static void print_readings(const struct campaign *c, const struct store_reading *r, int count)
{
    static const char *const head[] = {"kind",       "theta_i_deg", "theta_r_deg", "f_r_per_sr",
                                       "u_a_per_sr", "u_b_per_sr",  "signal_v",    "monitor_v",
                                       "count",      "attempt",     "flags",
                                      "point",      "excluded"};
    struct table *t = table_new(13);
    for (int i = 0; i < 13; i++) {
        table_cell(t, "%s", head[i]);
        if (i > 0 && i != 10 && i < 12)
            table_right(t, i);
    }
    for (; count > 0; count--, r++) {
        char flags[200];
        const struct reduced_point *p = reduced(c, r);
        store_flags_text(r->flags, flags, sizeof flags);
        table_cell(t, "%s", kind_of(c, r));
        table_cell(t, "%.6g", r->theta_i_udeg / 1e6);
        table_cell(t, "%.6g", r->theta_r_udeg / 1e6);
        value_cell(t, p ? p->f_per_sr : (double)NAN);
        value_cell(t, p ? p->u_a_per_sr : (double)NAN);
        value_cell(t, p ? p->u_b_per_sr : (double)NAN);
        value_cell(t, r->signal_v);
        value_cell(t, r->monitor_v);
        table_cell(t, "%d", r->count);
        table_cell(t, "%d", r->attempt);
        table_cell(t, "%s", flags);
        table_cell(t, "%d/%d", r->sweep, r->point);
        const struct exclusion *x = exclusions_find(&c->exclusions, r);
        table_cell(t, "%s%s%s", x ? x->what : "", x ? ": " : "", x ? x->reason : "");
    }
    table_print(t, stdout);
}

static json_t *reading_json(const struct campaign *c, const struct store_reading *r)
{
    char flags[200];
    const struct reduced_point *p = reduced(c, r);
    store_flags_text(r->flags, flags, sizeof flags);
    json_t *o = json_pack("{s:i, s:i, s:i, s:s, s:I, s:f, s:f, s:f, s:f, s:i, s:i, s:s, s:b}",
                          "sweep", r->sweep, "point", r->point, "attempt", r->attempt, "kind",
                          kind_of(c, r), "t_utc_ms", (json_int_t)r->t_utc_ms, "theta_i_deg",
                          r->theta_i_udeg / 1e6, "theta_r_deg", r->theta_r_udeg / 1e6, "signal_v",
                          r->signal_v, "signal_sd_v", r->signal_sd_v, "count", r->count, "range",
                          r->range, "flags", flags, "accepted", (r->flags & STORE_REJECTING) == 0);
    const struct exclusion *x = exclusions_find(&c->exclusions, r);
    json_object_set_new(o, "counts", json_boolean(store_reading_counts(r)));
    json_object_set_new(o, "excluded", store_reading_counts(r) || !x ? json_null()
                                                                     : json_string(x->reason));
    json_object_set_new(o, "monitor_v", number(r->monitor_v));
    json_object_set_new(o, "monitor_sd_v", number(r->monitor_sd_v));
    json_object_set_new(o, "f_r_per_sr", number(p ? p->f_per_sr : (double)NAN));
    json_object_set_new(o, "u_a_per_sr", number(p ? p->u_a_per_sr : (double)NAN));
    json_object_set_new(o, "u_b_per_sr", number(p ? p->u_b_per_sr : (double)NAN));
    return o;
}

static int show_sweep(struct campaign *c, const struct options *o)
{
    struct gon_error err;
    struct store_reading *r = NULL;
    int most = c->plan.sweeps + 1;
    if (o->sweep > most) {
        out_say("show: there is no sweep %ld; allowed 0..%d", o->sweep, most);
        return EXIT_INPUT;
    }
    int count = store_read_readings(c->store, (int)o->sweep, &r, &err);
    if (count < 0)
        return out_fail(&err);
    if (o->json) {
        json_t *all = json_array();
        for (int i = 0; i < count; i++)
            json_array_append_new(all, reading_json(c, &r[i]));
        json_t *object = json_pack("{s:i, s:i, s:o}", "run", c->entry.id, "sweep", (int)o->sweep,
                                   "readings", all);
        out_json(object);
        json_decref(object);
    } else {
        print_readings(c, r, count);
    }
    free(r);
    return EXIT_OK;
}

// --- the whole campaign --------------------------------------------------------------------------

struct events {
    json_t *list;
};

static bool take_event(void *ctx, const struct store_event *e)
{
    struct events *all = ctx;
    json_array_append_new(all->list,
                          json_pack("{s:I, s:s, s:s, s:s}", "t_utc_ms", (json_int_t)e->t_utc_ms,
                                    "level", e->level, "source", e->source, "text", e->text));
    if (json_array_size(all->list) > EVENTS_SHOWN)
        json_array_remove(all->list, 0); // the newest stay
    return true;
}

static json_t *reduction_json(const struct campaign *c)
{
    const struct reduction *r = &c->reduction;
    if (!c->reduced)
        return json_null();
    json_t *o = json_pack("{s:i, s:i, s:i, s:f}", "points", r->count, "left_out", r->left_out,
                          "excluded", r->excluded, "omega_sr", r->omega_sr);
    json_object_set_new(o, "u_scale_rel", number(r->u_scale_rel));
    json_object_set_new(o, "noise_floor_v", number(r->noise.floor_v));
    json_object_set_new(o, "noise_rel", number(r->noise.rel));
    return o;
}

static json_t *describe(struct campaign *c)
{
    const struct catalog_entry *e = &c->entry;
    struct events events = {json_array()};
    char *text = store_read_fit(c->store, -1);
    json_t *fit = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    store_each_event(c->store, 0, take_event, &events, NULL);
    json_t *o = json_pack("{s:i, s:s, s:s, s:s, s:s, s:s, s:i, s:i, s:I, s:i, s:i}", "run", e->id,
                          "file", e->path, "name", e->name, "sample", e->sample, "state", e->state,
                          "problem", e->problem, "done", c->progress.done, "total",
                          c->progress.total, "readings", (json_int_t)c->progress.readings,
                          "sweeps_done", c->progress.sweeps_done, "sweeps", c->progress.sweeps);
    json_object_set_new(o, "excluded", json_integer(c->progress.excluded));
    json_object_set_new(o, "exclusions", exclusions_json(&c->exclusions));
    json_object_set_new(o, "reduction", reduction_json(c));
    json_object_set_new(o, "events", events.list);
    json_object_set_new(o, "fit", fit ? fit : json_null());
    return o;
}

static void print_description(const struct campaign *c, const json_t *o)
{
    const struct catalog_entry *e = &c->entry;
    const json_t *each;
    size_t i;
    printf("run %d    %s%s%s\n", e->id, e->state, *e->problem ? ": " : "", e->problem);
    printf("name      %s%s%s%s\n", e->name, *e->sample ? "   (" : "", e->sample,
           *e->sample ? ")" : "");
    printf("file      %s\n", e->path);
    printf("readings  %d of %d points, %lld with every attempt; %d of %d sweeps complete\n",
           c->progress.done, c->progress.total, (long long)c->progress.readings,
           c->progress.sweeps_done, c->progress.sweeps);
    if (c->progress.excluded)
        printf("out       %lld readings do not count, as somebody decided\n",
               (long long)c->progress.excluded);
    exclusions_print(&c->exclusions);
    if (c->reduced)
        printf("scale     u %.2g %% common to all, Omega %.4g sr\n", 100 * c->reduction.u_scale_rel,
               c->reduction.omega_sr);
    else
        printf("scale     not yet: %s\n", c->no_reduction);
    json_array_foreach(json_object_get(o, "events"), i, each)
        if (strcmp(json_string_value(json_object_get(each, "level")), "info"))
            printf("event     %s: %s\n", json_string_value(json_object_get(each, "level")),
                   json_string_value(json_object_get(each, "text")));
    putchar('\n');
    if (json_is_object(json_object_get(o, "fit")))
        fitview_print(json_object_get(o, "fit"));
    else
        out_say("no fit stored yet; fit what is there: gonio fit %s", e->path);
}

// Nothing else of the file need be whole.
static int show_kept(const struct options *o, const char *file)
{
    struct store *store = NULL;
    struct gon_error err;
    int rc = open_file(o->dir, file, &store, &err);
    if (rc >= 0 && o->profile)
        rc = show_profile(store, o->profile, o->json, &err);
    else if (rc >= 0)
        rc = show_profiles(store, o->json, &err);
    store_close(store, NULL);
    return rc < 0 ? out_fail(&err) : EXIT_OK;
}

static int run_show(const struct verb *verb, int argc, char **argv)
{
    struct options o = {.sweep = -1};
    struct campaign c = {0};
    struct gon_error err;
    const char *file;
    int status = EXIT_OK;
    if (verb_take(verb, argc, argv, &o, &file, 1, 1) < 0)
        return EXIT_INPUT;
    if (o.profiles || o.profile)
        return show_kept(&o, file);
    if (campaign_open(&c, o.dir, file, &err) < 0) {
        status = out_fail(&err);
    } else if (o.sweep >= 0) {
        status = show_sweep(&c, &o);
    } else {
        json_t *description = describe(&c);
        if (o.json)
            out_json(description);
        else
            print_description(&c, description);
        json_decref(description);
    }
    campaign_close(&c);
    return status;
}

const struct verb verb_show = {"show",
                               "FILE",
                               "what is in a campaign: state, readings, fit",
                               "FILE is a campaign file, or the name or number that gonio list "
                               "shows. With --sweep N its readings as a\n"
                               "table: angles from the encoders, f_r with its uncorrelated (u_a) "
                               "and common (u_b) uncertainty, raw\n"
                               "voltages, every attempt with its flags, its name for gonio exclude, and why it does not "
                               "count. --profiles lists the "
                               "instruments' profiles that the file keeps, since when each was "
                               "used; --profile NAME prints one as it was read.\n",
                               rows,
                               run_show};
