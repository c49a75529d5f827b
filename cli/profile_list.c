// SPDX-License-Identifier: MIT
#include "cli/profile_check.h"

#include "base/paths.h"
#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/profile.h"

#include <glob.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

static const struct option_row none[] = {VERB_OPTIONS_END};

static const struct verb list = {"profile list",
                                 "",
                                 "the profiles that are known",
                                 "Names the profiles in the folder profiles, in those of "
                                 "GONIO_PROFILES and those that came with gonio.\n",
                                 none,
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

static void mistake(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

int profile_list(int argc, char **argv)
{
    char nothing;
    glob_t files = {0};
    int status = EXIT_OK;
    if (verb_take(&list, argc, argv, &nothing, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    find_all(&files);
    struct table *t = table_new(3);
    table_cell(t, "name");
    table_cell(t, "role");
    table_cell(t, "title");
    for (size_t i = 0; i < files.gl_pathc; i++) {
        struct profile *p;
        if (profile_load(files.gl_pathv[i], (struct cfg_sink){mistake, NULL}, &p, NULL) < 0) {
            status = EXIT_INPUT;
            continue;
        }
        table_cell(t, "%s", p->name);
        table_cell(t, "%s", profile_roles[p->role]);
        table_cell(t, "%s", p->title);
        free(p);
    }
    table_print(t, stdout);
    globfree(&files);
    return out_finish(status);
}
