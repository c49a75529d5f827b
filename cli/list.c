// SPDX-License-Identifier: MIT
// list: the campaigns of a folder, read from the files themselves.
#include "campaign/catalog.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <stdlib.h>
#include <time.h>

struct options {
    bool json;
    const char *dir;
};

static const struct option_row rows[] = {
    {"--dir", OPTION_TEXT, offsetof(struct options, dir), "DIR", 0, 0,
     "the folder of campaigns ($GONIO_DIR)"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "print JSON"},
    VERB_OPTIONS_END,
};

static json_t *utc(int64_t ms)
{
    char text[40];
    time_t s = (time_t)(ms / 1000);
    struct tm tm;
    if (ms <= 0)
        return json_null();
    gmtime_r(&s, &tm);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &tm);
    return json_string(text);
}

static void print_json(const struct catalog_entry *e, int count)
{
    json_t *all = json_array();
    for (int i = 0; i < count; i++, e++) {
        json_t *o =
            json_pack("{s:i, s:s, s:s, s:s, s:s, s:s, s:i, s:i, s:i}", "id", e->id, "name", e->name,
                      "sample", e->sample, "state", e->state, "problem", e->problem, "file",
                      e->path, "done", e->done, "total", e->total, "writer_pid", e->writer_pid);
        json_object_set_new(o, "created_utc", utc(e->created_utc_ms));
        json_object_set_new(o, "started_utc", utc(e->started_utc_ms));
        json_object_set_new(o, "finished_utc", utc(e->finished_utc_ms));
        json_array_append_new(all, o);
    }
    out_json(all);
    json_decref(all);
}

static void print_table(const struct catalog_entry *e, int count)
{
    static const char *const head[] = {"run",    "state",   "readings", "name",
                                       "sample", "created", "finished"};
    struct table *t = table_new(7);
    for (int i = 0; i < 7; i++)
        table_cell(t, "%s", head[i]);
    table_right(t, 0);
    table_right(t, 2);
    for (int i = 0; i < count; i++, e++) {
        char created[40], finished[40];
        out_local(e->created_utc_ms, created, sizeof created);
        out_local(e->finished_utc_ms, finished, sizeof finished);
        table_cell(t, "%d", e->id);
        table_cell(t, "%s", e->state);
        table_cell(t, "%d/%d", e->done, e->total);
        table_cell(t, "%s", e->name);
        table_cell(t, "%s", e->sample);
        table_cell(t, "%s", created);
        table_cell(t, "%s", finished);
    }
    table_print(t, stdout);
}

static int run_list(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    struct gon_error err;
    struct catalog_entry *entries = NULL;
    char directory[CATALOG_PATH];
    if (verb_take(verb, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    if (catalog_directory(o.dir, directory, sizeof directory, &err) < 0)
        return out_fail(&err);
    int count = catalog_list(directory, &entries, &err);
    if (count < 0)
        return out_fail(&err);
    if (o.json)
        print_json(entries, count);
    else if (count)
        print_table(entries, count);
    else
        out_say("no campaigns in %s; start one: gonio run FILE.cfg", directory);
    fflush(stdout);
    for (int i = 0; i < count && !o.json; i++)
        if (*entries[i].problem)
            fprintf(stderr, "run %d %s: %s\n", entries[i].id, entries[i].state, entries[i].problem);
    free(entries);
    return EXIT_OK;
}

const struct verb verb_list = {"list",
                               "",
                               "campaigns with their numbers and states",
                               "Lists the campaign files of a folder, oldest first. The number "
                               "stands for the file in every verb.\n",
                               rows,
                               run_list};
