// SPDX-License-Identifier: MIT
// verify: whether campaign files are whole.
#include "campaign/catalog.h"
#include "campaign/store_verify.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST_FINDINGS = 50 }; // shown of a file

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

// One file and what was found.
struct looked {
    char path[CATALOG_PATH];
    int writer_pid;
    struct store_verified seen;
    json_t *findings;
    struct gon_error err; // why it could not be looked at; GON_OK: it was
};

static json_t *index_json(int i)
{
    return i >= 0 ? json_integer(i) : json_null();
}

static void take(void *ctx, const struct store_finding *f)
{
    struct looked *l = ctx;
    json_t *text = json_string(f->text);
    if (json_array_size(l->findings) < MOST_FINDINGS)
        json_array_append_new(
            l->findings,
            json_pack("{s:s, s:o, s:o, s:o, s:o}", "what", f->what, "sweep", index_json(f->sweep),
                      "point", index_json(f->point), "attempt", index_json(f->attempt), "text",
                      text ? text : json_string("(what it says is damaged, too)")));
    else
        json_decref(text);
}

// A file of that name which SQLite takes for none, or for a broken one, was a campaign once.
static bool was_campaign(const char *path)
{
    const size_t size = strlen(path), suffix = strlen(STORE_SUFFIX);
    return size > suffix && !strcmp(path + size - suffix, STORE_SUFFIX) && access(path, R_OK) == 0;
}

static void look(struct looked *l, const char *directory, const char *file)
{
    struct store *s = NULL;
    int rc = catalog_resolve(directory, file, l->path, sizeof l->path, &l->err);
    if (rc < 0) {
        snprintf(l->path, sizeof l->path, "%s", file);
        return;
    }
    l->writer_pid = store_writer(l->path);
    rc = store_open(l->path, STORE_READ, &s, &l->err);
    rc = rc < 0 ? rc : store_verify(s, take, l, &l->seen, &l->err);
    store_close(s, NULL);
    if (rc >= 0)
        l->err = (struct gon_error){0};
    else if (rc == GON_E_STORE || (rc == GON_E_INPUT && was_campaign(l->path))) {
        const struct store_finding f = {"structure", -1, -1, -1, l->err.text};
        take(l, &f);
        l->seen.findings++;
        l->err = (struct gon_error){0};
    }
}

static void print(const struct looked *l)
{
    const json_t *f;
    size_t i;
    json_array_foreach(l->findings, i, f)
        printf("%s: %s\n", l->path, json_string_value(json_object_get(f, "text")));
    if (l->seen.findings > MOST_FINDINGS)
        printf("%s: and %lld more\n", l->path, (long long)l->seen.findings - MOST_FINDINGS);
    if (l->err.code == GON_OK && !l->seen.findings)
        printf("%s: whole: %lld readings of %lld points, %lld profiles, %lld fits%s\n", l->path,
               (long long)l->seen.readings, (long long)l->seen.points, (long long)l->seen.profiles,
               (long long)l->seen.fits, l->writer_pid ? "; being written" : "");
    fflush(stdout);
    if (l->err.code != GON_OK)
        out_say("%s", l->err.text);
}

static json_t *looked_json(const struct looked *l)
{
    const bool looked_at = l->err.code == GON_OK;
    json_t *o =
        json_pack("{s:s, s:i, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:O}", "file", l->path, "version",
                  l->seen.version, "points", (json_int_t)l->seen.points, "readings",
                  (json_int_t)l->seen.readings, "profiles", (json_int_t)l->seen.profiles,
                  "exclusions", (json_int_t)l->seen.exclusions, "reductions", (json_int_t)l->seen.reductions, "fits", (json_int_t)l->seen.fits,
                  "found", (json_int_t)l->seen.findings, "findings", l->findings);
    json_object_set_new(o, "whole", looked_at ? json_boolean(!l->seen.findings) : json_null());
    json_object_set_new(o, "error", looked_at ? json_null() : json_string(l->err.text));
    json_object_set_new(o, "writer_pid", l->writer_pid ? json_integer(l->writer_pid) : json_null());
    return o;
}

// Damage is the worst that can be said, then a file that could not be looked at.
static int status_of(const struct looked *l, int status)
{
    if (l->seen.findings)
        return EXIT_FAILED;
    if (l->err.code == GON_OK || status != EXIT_OK)
        return status;
    return l->err.code == GON_E_INPUT     ? EXIT_INPUT
           : l->err.code == GON_E_REFUSED ? EXIT_REFUSED
                                          : EXIT_FAILED;
}

static int verify_all(const struct options *o, const char *directory, const char *const *files,
                      int count)
{
    json_t *all = json_array();
    int status = EXIT_OK, damaged = 0;
    for (int i = 0; i < count; i++) {
        struct looked l = {.findings = json_array()};
        look(&l, directory, files[i]);
        if (o->json)
            json_array_append_new(all, looked_json(&l));
        else
            print(&l);
        status = status_of(&l, status);
        damaged += l.seen.findings > 0;
        json_decref(l.findings);
    }
    json_t *object = json_pack("{s:o}", "files", all);
    if (o->json)
        out_json(object);
    json_decref(object);
    if (damaged)
        out_say("verify: %d of %d files %s damaged; keep what is there and restore from a copy; "
                "without one: sqlite3 COPY .recover >rows.sql",
                damaged, count, damaged == 1 ? "is" : "are");
    return status;
}

static int run_verify(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    struct gon_error err;
    char directory[CATALOG_PATH];
    const char **files = calloc((size_t)argc, sizeof *files);
    int status = EXIT_FAILED, count = files ? verb_take(verb, argc, argv, &o, files, 1, argc) : 0;
    if (!files)
        out_say("verify: out of memory");
    else if (count < 0)
        status = EXIT_INPUT;
    else if (catalog_directory(o.dir, directory, sizeof directory, &err) < 0)
        status = out_fail(&err);
    else
        status = verify_all(&o, directory, files, count);
    free(files);
    return status;
}

const struct verb verb_verify = {
    "verify",
    "FILE...",
    "whether campaign files are whole",
    "Looks at each FILE as a whole: its structure, the check value of every reading, of the plan, "
    "the configuration, the bench, the profiles and the exclusions, attempts and points that are missing between "
    "others, reductions and fits of what is not there. Names sweep, point and attempt of what is "
    "damaged. A file that is being measured can be looked at, too. Ends with 0 when all are whole "
    "and with 1 when one is damaged.\n",
    rows,
    run_verify};
