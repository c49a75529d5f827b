// SPDX-License-Identifier: MIT
#include "cli/profile_check.h"

#include "base/paths.h"
#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/profile.h"

#include <glob.h>
#include <jansson.h>
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct options {
    bool json;
};

static const struct option_row rows[] = {
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "the list as JSON"},
    VERB_OPTIONS_END};

static const struct verb list = {"profile list",
                                 "",
                                 "the profiles that are known",
                                 "Names the profiles in the folder profiles, in those of "
                                 "GONIO_PROFILES and those that came with gonio.\n",
                                 rows,
                                 NULL};

static void add_folder(glob_t *files, const char *folder, size_t length, const char *more)
{
    char pattern[2 * PATH_MAX];
    snprintf(pattern, sizeof pattern, "%.*s%s/*.cfg", (int)length, folder, more);
    if (length > 0)
        glob(pattern, files->gl_pathc > 0 ? GLOB_APPEND : 0, NULL, files);
}

// In the order in which profile_find looks.
static void find_all(glob_t *files)
{
    const char *folders = getenv("GONIO_PROFILES");
    char program[PATH_MAX];
    add_folder(files, ".", 1, "/profiles");
    for (size_t n; folders && *folders; folders += n + (folders[n] == ':')) {
        n = strcspn(folders, ":");
        add_folder(files, folders, n, "");
    }
    paths_program("gonio", program, sizeof program);
    const char *slash = strrchr(program, '/');
    if (slash)
        add_folder(files, program, (size_t)(slash - program), "/../share/gonio/profiles");
}

// --- what is found -------------------------------------------------------------------------------

// Of each file that is right; mistakes go to the sink. How many files have some.
static int each(const glob_t *files, struct cfg_sink sink,
                void (*take)(void *ctx, const struct profile *p, const char *file), void *ctx)
{
    int wrong = 0;
    for (size_t i = 0; i < files->gl_pathc; i++) {
        struct profile *p;
        if (profile_load(files->gl_pathv[i], sink, &p, NULL) < 0) {
            wrong++;
            continue;
        }
        take(ctx, p, files->gl_pathv[i]);
        free(p);
    }
    return wrong;
}

static void mistake(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

static void add_row(void *ctx, const struct profile *p, const char *file)
{
    (void)file;
    table_cell(ctx, "%s", p->name);
    table_cell(ctx, "%s", profile_roles[p->role]);
    table_cell(ctx, "%s", p->title);
}

static int list_text(const glob_t *files)
{
    struct table *t = table_new(3);
    table_cell(t, "name");
    table_cell(t, "role");
    table_cell(t, "title");
    const int wrong = each(files, (struct cfg_sink){mistake, NULL}, add_row, t);
    table_print(t, stdout);
    return wrong;
}

static void json_mistake(void *ctx, const char *line)
{
    json_array_append_new(ctx, out_json_text(line));
}

static void add_object(void *ctx, const struct profile *p, const char *file)
{
    json_array_append_new(ctx, json_pack("{s:s, s:s, s:s, s:o}", "name", p->name, "role",
                                         profile_roles[p->role], "title", p->title, "file",
                                         out_json_text(file)));
}

static int list_json(const glob_t *files)
{
    json_t *profiles = json_array(), *mistakes = json_array();
    const int wrong = each(files, (struct cfg_sink){json_mistake, mistakes}, add_object, profiles);
    json_t *o = json_pack("{s:o, s:o}", "profiles", profiles, "mistakes", mistakes);
    out_json(o);
    json_decref(o);
    return wrong;
}

int profile_list(int argc, char **argv)
{
    struct options o = {false};
    glob_t files = {0};
    if (verb_take(&list, argc, argv, &o, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    find_all(&files);
    const int wrong = o.json ? list_json(&files) : list_text(&files);
    globfree(&files);
    return out_finish(wrong ? EXIT_INPUT : EXIT_OK);
}
