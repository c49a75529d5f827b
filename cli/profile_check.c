// SPDX-License-Identifier: MIT
#include "cli/profile_check.h"

#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/blocks.h"
#include "drivers/profile_golden.h"
#include "drivers/safing.h"

#include <jansson.h>
#include <limits.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FILES_MOST = 100 };

struct options {
    bool json;
};

static const struct option_row none[] = {VERB_OPTIONS_END};
static const struct option_row rows[] = {
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "all of it as JSON"},
    VERB_OPTIONS_END};

static const struct verb check = {"profile check",
                                  "PROFILE...",
                                  "whether profiles are right",
                                  "Checks every setting, name, pattern and condition, plays the "
                                  "golden entries through the code that talks to instruments, and "
                                  "prints what is in the profile; of a laser also whether the "
                                  "guard can switch it off and see that.\n",
                                  rows,
                                  NULL};
static const struct verb settings = {"profile settings",
                                     "",
                                     "all settings of profiles as manual text",
                                     "Prints all settings of profiles as manual text.\n",
                                     none,
                                     NULL};

// --- reading one ---------------------------------------------------------------------------------

static void say(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

static struct profile *take(const char *name, struct cfg_sink sink, char *ret_path,
                            unsigned long size)
{
    struct profile *p = NULL;
    struct gon_error err;
    if (access(name, F_OK) == 0 || strchr(name, '/')) {
        snprintf(ret_path, size, "%s", name);
    } else if (profile_find(name, NULL, ret_path, size, &err) < 0) {
        *ret_path = 0; // it is what was tried last
        sink.say(sink.ctx, err.text);
        return NULL;
    }
    return profile_load(ret_path, sink, &p, NULL) == 0 ? p : NULL;
}

// Not found is no mistake of a file: there is no line of one to name.
static void say_of(void *ctx, const char *line)
{
    if (*(const char *)ctx)
        say(NULL, line);
    else
        out_say("%s", line);
}

struct profile *profile_take(const char *name, char *ret_path, unsigned long size)
{
    *ret_path = 0;
    return take(name, (struct cfg_sink){say_of, ret_path}, ret_path, size);
}

// --- checking it ---------------------------------------------------------------------------------

static bool is_recorded(const struct profile_golden *g)
{
    return strncmp(g->source, "recorded ", 9) == 0;
}

static int recorded_count(const struct profile *p)
{
    int count = 0;
    for (int i = 0; i < p->golden_count; i++)
        count += is_recorded(&p->golden[i]);
    return count;
}

// Called for each entry that fails.
typedef void fails(void *ctx, const struct profile *p, int entry, const char *text);

// How many pass.
static int play_golden(const struct profile *p, fails *failed, void *ctx)
{
    int good = 0;
    for (int i = 0; i < p->golden_count; i++) {
        struct gon_error err;
        if (profile_golden_check(p, i, &err) == 0)
            good++;
        else
            failed(ctx, p, i, err.text);
    }
    return good;
}

static const char *entry_name(const struct profile_golden *g)
{
    return *g->does ? g->does : g->asks[0];
}

// --- as text -------------------------------------------------------------------------------------

static void say_failure(void *ctx, const struct profile *p, int entry, const char *text)
{
    fprintf(stderr, "%s: golden[%d] (%s): %s\n", (const char *)ctx, entry,
            entry_name(&p->golden[entry]), text);
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
    if (recorded_count(p) > 0)
        printf("  recorded    %d of them, from an instrument\n", recorded_count(p));
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
    const int golden = play_golden(p, say_failure, path);
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

// --- as JSON -------------------------------------------------------------------------------------

static void add_line(void *ctx, const char *line)
{
    json_array_append_new(ctx, out_json_text(line));
}

static void add_failure(void *ctx, const struct profile *p, int entry, const char *text)
{
    json_array_append_new(ctx,
                          json_pack("{s:i, s:s, s:o}", "entry", entry, "does",
                                    entry_name(&p->golden[entry]), "text", out_json_text(text)));
}

static json_t *requests_of(const struct profile *p, int *ret_wrong)
{
    json_t *lines = json_array();
    char *text = NULL, *rest = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    *ret_wrong = out ? blocks_print(p, out) : 0;
    if (out)
        fclose(out);
    for (char *line = text ? strtok_r(text, "\n", &rest) : NULL; line;
         line = strtok_r(NULL, "\n", &rest))
        add_line(lines, line);
    free(text);
    return lines;
}

static void describe(json_t *o, const struct profile *p)
{
    const bool modbus = p->protocol == PROFILE_MODBUS;
    json_t *unverified = json_array(), *failures = json_array();
    int wrong = 0;
    json_t *requests = modbus ? requests_of(p, &wrong) : json_array();
    const int pass = play_golden(p, add_failure, failures);
    for (int i = 0; i < p->unverified_count; i++)
        add_line(unverified, p->unverified[i]);
    json_object_set_new(o, "name", json_string(p->name));
    json_object_set_new(o, "title", json_string(p->title));
    json_object_set_new(o, "role", json_string(profile_roles[p->role]));
    json_object_set_new(o, "protocol", json_string(modbus ? "modbus" : "message"));
    json_object_set_new(o, "values", json_integer(p->values_count));
    json_object_set_new(o, "exchanges", json_integer(p->exchanges_count));
    json_object_set_new(o, "writes", json_integer(p->writes_count));
    json_object_set_new(o, "golden",
                        json_pack("{s:i, s:i, s:i, s:o}", "entries", p->golden_count, "pass", pass,
                                  "recorded", recorded_count(p), "failures", failures));
    json_object_set_new(o, "unverified", unverified);
    json_object_set_new(o, "requests", requests);
    json_object_set_new(o, "requests_wrong", json_integer(wrong));
    json_object_set_new(o, "well", json_boolean(pass == p->golden_count && wrong == 0));
}

// All members are there, whatever is wrong; null is what is not known of a file with mistakes.
static json_t *json_one(const char *name)
{
    static const char *const unknown[] = {"name",       "title",     "role",          "protocol",
                                          "values",     "exchanges", "writes",        "golden",
                                          "unverified", "requests",  "requests_wrong"};
    char path[PATH_MAX] = "";
    json_t *mistakes = json_array();
    struct profile *p = take(name, (struct cfg_sink){add_line, mistakes}, path, sizeof path);
    json_t *o = json_pack("{s:o, s:b, s:o}", "file", out_json_text(*path ? path : name), "well", 0,
                          "mistakes", mistakes);
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++)
        json_object_set_new(o, unknown[i], json_null());
    if (p)
        describe(o, p);
    free(p);
    return o;
}

static int check_json(const char *const *names, int count)
{
    json_t *all = json_array();
    bool well = true;
    for (int i = 0; i < count; i++) {
        json_t *one = json_one(names[i]);
        well = well && json_is_true(json_object_get(one, "well"));
        json_array_append_new(all, one);
    }
    json_t *o = json_pack("{s:b, s:o}", "well", well, "profiles", all);
    out_json(o);
    json_decref(o);
    return out_finish(well ? EXIT_OK : EXIT_INPUT);
}

// --- the words -----------------------------------------------------------------------------------

int profile_check_files(int argc, char **argv)
{
    const char *names[FILES_MOST];
    struct options o = {false};
    int status = EXIT_OK;
    const int count = verb_take(&check, argc, argv, &o, names, 1, FILES_MOST);
    if (count < 0)
        return EXIT_INPUT;
    if (o.json)
        return check_json(names, count);
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
