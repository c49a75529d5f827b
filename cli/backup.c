// SPDX-License-Identifier: MIT
// backup: a verified copy of a campaign file.
#include "campaign/catalog.h"
#include "campaign/store_verify.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <string.h>
#include <sys/stat.h>

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

// Into a folder under the file's own name.
static int name_copy(const char *file, const char *wanted, char *ret_copy, size_t size,
                     struct gon_error *err)
{
    struct stat st;
    const char *slash = strrchr(file, '/'), *name = slash ? slash + 1 : file;
    const bool folder = stat(wanted, &st) == 0 && S_ISDIR(st.st_mode);
    if (snprintf(ret_copy, size, folder ? "%s/%s" : "%s", wanted, name) >= (int)size)
        return gon_fail(err, GON_E_INPUT, "%.80s...: the path is too long", wanted);
    return GON_OK;
}

static int copy_file(const char *file, const char *copy, struct gon_error *err)
{
    struct store *s = NULL;
    int rc = store_open(file, STORE_READ, &s, err);
    rc = rc < 0 ? rc : store_copy(s, copy, err);
    store_close(s, NULL);
    return rc;
}

static void say_finding(void *ctx, const struct store_finding *f)
{
    out_say("%s: %s", (const char *)ctx, f->text);
}

static int verify_copy(char *copy, struct store_verified *ret_seen, struct gon_error *err)
{
    struct store *s = NULL;
    int rc = store_open(copy, STORE_READ, &s, err);
    rc = rc < 0 ? rc : store_verify(s, say_finding, copy, ret_seen, err);
    store_close(s, NULL);
    if (rc >= 0 && ret_seen->findings)
        rc = gon_fail(err, GON_E_STORE,
                      "%s is damaged; is what it was made of whole? see: gonio verify", copy);
    return rc;
}

static void print(const char *file, const char *copy, const struct store_verified *seen, bool json)
{
    if (!json) {
        printf("%s: a copy of %s, whole: %lld readings of %lld points\n", copy, file,
               (long long)seen->readings, (long long)seen->points);
        return;
    }
    json_t *o = json_pack("{s:s, s:s, s:I, s:I}", "file", file, "copy", copy, "points",
                          (json_int_t)seen->points, "readings", (json_int_t)seen->readings);
    out_json(o);
    json_decref(o);
}

static int run_backup(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    struct gon_error err;
    struct store_verified seen;
    const char *words[2];
    char directory[CATALOG_PATH], file[CATALOG_PATH], copy[CATALOG_PATH];
    if (verb_take(verb, argc, argv, &o, words, 2, 2) < 0)
        return EXIT_INPUT;
    int rc = catalog_directory(o.dir, directory, sizeof directory, &err);
    rc = rc < 0 ? rc : catalog_resolve(directory, words[0], file, sizeof file, &err);
    rc = rc < 0 ? rc : name_copy(file, words[1], copy, sizeof copy, &err);
    rc = rc < 0 ? rc : copy_file(file, copy, &err);
    rc = rc < 0 ? rc : verify_copy(copy, &seen, &err);
    if (rc < 0)
        return out_fail(&err);
    print(file, copy, &seen, o.json);
    return EXIT_OK;
}

const struct verb verb_backup = {
    "backup",
    "FILE COPY",
    "a verified copy of a campaign file",
    "Copies FILE as it is in one moment, also while it is measured, to COPY, a new file or a "
    "folder. "
    "The copy is a single file, on the disk and verified (as by gonio verify) when this ends with "
    "0. A COPY that is there already is never replaced.\n",
    rows,
    run_backup};
