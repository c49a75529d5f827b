// SPDX-License-Identifier: MIT
#include "cli/profile_check.h"

#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/blocks.h"
#include "drivers/profile_golden.h"
#include "drivers/safing.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FILES_MOST = 100 };

static const struct option_row none[] = {VERB_OPTIONS_END};

static const struct verb check = {"profile check",
                                  "PROFILE...",
                                  "whether profiles are right",
                                  "Checks every setting, name, pattern and condition, plays the "
                                  "golden entries through the code that talks to instruments, and "
                                  "prints what is in the profile; of a laser also whether the "
                                  "guard can switch it off and see that.\n",
                                  none,
                                  NULL};
static const struct verb settings = {"profile settings",
                                     "",
                                     "all settings of profiles as manual text",
                                     "Prints all settings of profiles as manual text.\n",
                                     none,
                                     NULL};

static void say(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

struct profile *profile_take(const char *name, char *ret_path, unsigned long size)
{
    struct profile *p = NULL;
    struct gon_error err;
    if (access(name, F_OK) == 0 || strchr(name, '/')) {
        snprintf(ret_path, size, "%s", name);
    } else if (profile_find(name, NULL, ret_path, size, &err) < 0) {
        out_say("%s", err.text);
        return NULL;
    }
    return profile_load(ret_path, (struct cfg_sink){say, NULL}, &p, NULL) == 0 ? p : NULL;
}

// How many pass.
static int play_golden(const struct profile *p, const char *path)
{
    int good = 0;
    for (int i = 0; i < p->golden_count; i++) {
        struct gon_error err;
        const struct profile_golden *g = &p->golden[i];
        if (profile_golden_check(p, i, &err) == 0)
            good++;
        else
            fprintf(stderr, "%s: golden[%d] (%s): %s\n", path, i, *g->does ? g->does : g->asks[0],
                    err.text);
    }
    return good;
}

static void print_summary(const struct profile *p, int golden)
{
    const bool modbus = p->protocol == PROFILE_MODBUS;
    printf("%s: %s\n", p->name, p->title);
    printf("  role        %s, over %s\n", profile_roles[p->role],
           modbus ? "Modbus" : "lines of text");
    printf("  values      %d\n", p->values_count);
    printf("  %s   %d\n", modbus ? "writes   " : "exchanges",
           modbus ? p->writes_count : p->exchanges_count);
    printf("  golden      %d of %d entries pass%s\n", golden, p->golden_count,
           p->golden_count ? "" : ": nothing shows that these bytes are right");
    for (int i = 0; i < p->unverified_count; i++)
        printf("  %s  %s\n", i ? "          " : "unverified", p->unverified[i]);
}

// Whether gonio-guard can switch this laser off and see it.
static bool check_guard(const struct profile *p, const char *path)
{
    struct guard_record record;
    struct gon_error err;
    if (p->role != PROFILE_LASER)
        return true;
    if (safing_of(p, p->link, &record, &err) == 0) {
        printf("  guard       can switch it off and see it\n");
        return true;
    }
    fprintf(stderr, "%s: laser: %s\n", path, err.text);
    return false;
}

static int check_one(const char *name)
{
    char path[PATH_MAX];
    struct profile *p = profile_take(name, path, sizeof path);
    if (!p)
        return EXIT_INPUT;
    const int golden = play_golden(p, path);
    print_summary(p, golden);
    int wrong = 0;
    if (p->protocol == PROFILE_MODBUS) {
        printf("  requests\n");
        wrong = blocks_print(p, stdout);
    }
    const bool guarded = check_guard(p, path);
    const bool good = golden == p->golden_count && wrong == 0 && guarded;
    free(p);
    return good ? EXIT_OK : EXIT_INPUT;
}

int profile_check_files(int argc, char **argv)
{
    const char *names[FILES_MOST];
    char nothing;
    int status = EXIT_OK;
    const int count = verb_take(&check, argc, argv, &nothing, names, 1, FILES_MOST);
    if (count < 0)
        return EXIT_INPUT;
    for (int i = 0; i < count; i++)
        if (check_one(names[i]) != EXIT_OK)
            status = EXIT_INPUT;
    return out_finish(status);
}

int profile_settings(int argc, char **argv)
{
    char nothing;
    if (verb_take(&settings, argc, argv, &nothing, NULL, 0, 0) < 0)
        return EXIT_INPUT;
    cfg_describe(stdout, profile_schema);
    return out_finish(EXIT_OK);
}
