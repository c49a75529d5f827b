// SPDX-License-Identifier: MIT
#include "drivers/profile.h"

#include "drivers/profile_check.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// --- loading -------------------------------------------------------------------------------------

static int take(struct cfg_file *f, struct profile **ret_profile, char **ret_text)
{
    struct profile *p = calloc(1, sizeof *p);
    char *text = ret_text && f ? strdup(cfg_text(f)) : NULL;
    int rc = GON_E_INPUT;
    if (!p || (ret_text && f && !text))
        rc = GON_E_SYSTEM;
    else if (f && cfg_take(f, profile_schema, p) == 0 && profile_check(f, p) == 0)
        rc = 0;
    if (rc < 0) {
        free(p);
        free(text);
        return rc;
    }
    *ret_profile = p;
    if (ret_text)
        *ret_text = text;
    return 0;
}

int profile_load(const char *path, struct cfg_sink sink, struct profile **ret_profile,
                 char **ret_text)
{
    struct cfg_file *f = cfg_open(path, sink);
    int rc = take(f, ret_profile, ret_text);
    cfg_close(f);
    return rc;
}

int profile_parse(const char *text, const char *name, struct cfg_sink sink,
                  struct profile **ret_profile)
{
    struct cfg_file *f = cfg_parse(text, name, sink);
    int rc = take(f, ret_profile, NULL);
    cfg_close(f);
    return rc;
}

// --- finding -------------------------------------------------------------------------------------

// Where one may be, and where it was looked for.
struct search {
    char *path;
    size_t size;
    char tried[400];
};

static bool try_path(struct search *s, const char *folder, const char *middle, const char *name)
{
    const int n = snprintf(s->path, s->size, "%s%s%s%s", folder, *folder ? "/" : "", middle, name);
    const size_t used = strlen(s->tried);
    if (n < 0 || (size_t)n >= s->size)
        return false;
    snprintf(s->tried + used, sizeof s->tried - used, "%s%s", used ? ", " : "", s->path);
    return access(s->path, R_OK) == 0;
}

static bool try_list(struct search *s, const char *folders, const char *file)
{
    char folder[PATH_MAX];
    for (const char *at = folders; at && *at;) {
        const size_t length = strcspn(at, ":");
        if (length > 0 && length < sizeof folder) {
            memcpy(folder, at, length);
            folder[length] = 0;
            if (try_path(s, folder, "", file))
                return true;
        }
        at += length + (at[length] == ':');
    }
    return false;
}

static bool try_program(struct search *s, const char *file)
{
    char self[PATH_MAX];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    if (n <= 0)
        return false;
    self[n] = 0;
    char *slash = strrchr(self, '/');
    if (!slash)
        return false;
    *slash = 0;
    return try_path(s, self, "../share/gonio/profiles/", file);
}

int profile_find(const char *name, const char *folder, char *ret_path, size_t size,
                 struct gon_error *err)
{
    struct search s = {.path = ret_path, .size = size};
    char file[PATH_MAX];
    folder = folder ? folder : "";
    const bool is_path = strchr(name, '/') != NULL;
    snprintf(file, sizeof file, "%s%s", name, is_path ? "" : ".cfg");
    const bool found = is_path ? try_path(&s, *name == '/' ? "" : folder, "", file)
                               : try_path(&s, folder, "profiles/", file) ||
                                     try_list(&s, getenv("GONIO_PROFILES"), file) ||
                                     try_program(&s, file);
    if (found)
        return 0;
    return gon_fail(err, GON_E_INPUT, "no profile '%s': looked for %s%s", name, s.tried,
                    is_path ? "" : "; a file of your own is given as a path: ./NAME.cfg");
}
