// SPDX-License-Identifier: MIT
// check: validates a campaign or bench file and prints their tables of settings.
#include "cli/check.h"

#include "campaign/bench.h"
#include "campaign/config.h"
#include "cli/check_inside.h"
#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/link.h"
#include "drivers/profile.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct options {
    bool json;
    const char *settings;
};

static const struct option_row rows[] = {
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0,
     "print {\"file\", \"kind\", \"errors\": [...]}"},
    {"--settings", OPTION_TEXT, offsetof(struct options, settings), "KIND", 0, 0,
     "print all settings of campaign or bench files as manual text"},
    VERB_OPTIONS_END,
};

struct complaints {
    json_t *list; // NULL: said at once on stderr
    int count;
};

static void complain(void *ctx, const char *line)
{
    struct complaints *c = ctx;
    c->count++;
    if (c->list)
        json_array_append_new(c->list, json_string(line));
    else
        fprintf(stderr, "%s\n", line);
}

static void say_count(int count, const char *what)
{
    fprintf(stderr, "%d %s, %s\n", count, count == 1 ? "error" : "errors", what);
}

// --- what kind of file it is --------------------------------------------------------------------

// Whether a line begins with "name: {" or "name = {".
static bool has_group(const char *text, const char *name)
{
    size_t n = strlen(name);
    for (const char *at = text; (at = strstr(at, name)); at += n) {
        const char *line = at;
        while (line > text && (line[-1] == ' ' || line[-1] == '\t'))
            line--;
        const char *rest = at + n + strspn(at + n, " \t\r\n");
        if ((line == text || line[-1] == '\n') && (*rest == ':' || *rest == '=') &&
            rest[1 + strspn(rest + 1, " \t\r\n")] == '{')
            return true;
    }
    return false;
}

static void quiet(void *ctx, const char *line)
{
    (void)ctx;
    (void)line;
}

// "campaign", "bench" or "simulator", by a group that only files of that kind have; NULL: not seen.
static const char *kind_of(const char *path)
{
    static const char *const signs[][2] = {{"campaign", "campaign"},
                                           {"bench", "bench"},
                                           {"sample", "simulator"},
                                           {"optics", "simulator"},
                                           {"wires", "simulator"}};
    struct cfg_file *f = cfg_open(path, (struct cfg_sink){quiet, NULL});
    const char *text = f ? cfg_text(f) : "", *kind = NULL;
    for (size_t i = 0; i < sizeof signs / sizeof *signs && !kind; i++)
        kind = has_group(text, signs[i][0]) ? signs[i][1] : NULL;
    cfg_close(f);
    return kind;
}

// EXIT_INPUT when it is seen to be a file of another kind, and says for whom it is.
static int check_kind(const char *path, const char *wanted)
{
    const char *kind = kind_of(path);
    if (!kind || !strcmp(kind, wanted))
        return EXIT_OK;
    const char *whose = !strcmp(kind, "campaign") ? "gonio run FILE"
                        : !strcmp(kind, "bench")  ? "goniod --config FILE, gonio plan --bench FILE"
                                                  : "goniosim --run-dir DIR --config FILE";
    out_say("%s: a %s file, not a %s file; its use: %s", path, kind, wanted, whose);
    return EXIT_INPUT;
}

int check_campaign(const char *path, struct campaign_config *ret_config, char **ret_text)
{
    struct complaints c = {NULL, 0};
    if (check_kind(path, "campaign") != EXIT_OK)
        return EXIT_INPUT;
    if (campaign_config_load(path, (struct cfg_sink){complain, &c}, ret_config, ret_text) == 0)
        return EXIT_OK;
    say_count(c.count, "nothing started.");
    return EXIT_INPUT;
}

// --- links: campaign/ keeps them as text, drivers/ knows what they may say ----------------------

int check_line_of(const char *text, const char *word)
{
    const char *at = strstr(text, word);
    int line = 1;
    for (const char *p = text; at && p < at; p++)
        line += *p == '\n';
    return line;
}

int check_link(const char *path, const char *text, const char *link, enum link_use use,
               struct cfg_sink sink)
{
    struct link l;
    struct gon_error err;
    char line[800];
    int rc = link_parse(link, use, &l, &err);
    if (rc >= 0)
        return 0;
    snprintf(line, sizeof line, "%s:%d: %s", path, check_line_of(text, link), err.text);
    sink.say(sink.ctx, line);
    return rc;
}

static int check_role(const struct bench_config *bench, const char *name, enum profile_role role,
                      struct gon_error *err)
{
    struct profile *p;
    int rc = profile_open(name, bench->folder, &p, err);
    if (rc < 0)
        return rc;
    if (p->role != (int)role)
        rc = gon_fail(err, GON_E_INPUT, "profile %s is of a %s, not of a %s", name,
                      profile_roles[p->role], profile_roles[role]);
    free(p);
    return rc;
}

int check_profile(const char *path, const char *text, const struct bench_config *bench,
                  const char *name, enum profile_role role, struct cfg_sink sink)
{
    struct gon_error err;
    char line[800];
    int rc = check_role(bench, name, role, &err);
    if (rc >= 0)
        return 0;
    snprintf(line, sizeof line, "%s:%d: driver: %s", path, check_line_of(text, name), err.text);
    sink.say(sink.ctx, line);
    return rc;
}

static int load_bench(const char *path, struct bench_config *bench, struct cfg_sink sink)
{
    char *text;
    int rc = bench_config_load(path, sink, bench, &text), worst;
    if (rc < 0)
        return rc;
    worst = check_link(path, text, bench->laser.link, LINK_TEXT, sink);
    for (int i = 0; i < bench->axes_count; i++)
        if ((rc = check_profile(path, text, bench, bench->axes[i].driver, PROFILE_AXIS, sink)) < 0)
            worst = rc;
    if ((rc = check_profile(path, text, bench, bench->laser.driver, PROFILE_LASER, sink)) < 0)
        worst = rc;
    if ((rc = check_profile(path, text, bench, bench->detector.driver, PROFILE_DETECTOR, sink)) < 0)
        worst = rc;
    for (int i = 0; i < bench->buses_count; i++)
        if ((rc = check_link(path, text, bench->buses[i].link, LINK_MODBUS, sink)) < 0)
            worst = rc;
    if ((rc = check_link(path, text, bench->detector.link, LINK_TEXT, sink)) < 0)
        worst = rc;
    if ((rc = check_devices(path, text, bench, sink)) < 0)
        worst = rc;
    free(text);
    return worst;
}

int check_bench(const char *path, struct bench_config *ret_bench)
{
    struct complaints c = {NULL, 0};
    if (check_kind(path, "bench") != EXIT_OK)
        return EXIT_INPUT;
    if (load_bench(path, ret_bench, (struct cfg_sink){complain, &c}) == 0)
        return EXIT_OK;
    say_count(c.count, "nothing started.");
    return EXIT_INPUT;
}

// --- the verb -----------------------------------------------------------------------------------

static int print_settings(const char *kind)
{
    if (!strcmp(kind, "campaign"))
        cfg_describe(stdout, campaign_config_schema);
    else if (!strcmp(kind, "bench"))
        cfg_describe(stdout, bench_config_schema);
    else {
        out_say("check: --settings %s: allowed: campaign, bench", kind);
        return EXIT_INPUT;
    }
    return EXIT_OK;
}

static void print_report(const char *path, const char *kind, json_t *errors) // takes errors
{
    json_t *report = json_pack("{s:s, s:s, s:o}", "file", path, "kind", kind, "errors", errors);
    out_json(report);
    json_decref(report);
}

static int refuse_simulator(const char *path, bool json)
{
    static const char why[] = "a simulator file, which goniosim checks when it starts: "
                              "goniosim --run-dir DIR --config FILE";
    if (json)
        print_report(path, "simulator", json_pack("[s]", why));
    else
        out_say("%s: %s", path, why);
    return EXIT_INPUT;
}

static int run_check(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *path;
    int count = verb_take(verb, argc, argv, &o, &path, 0, 1);
    if (count < 0)
        return EXIT_INPUT;
    if (o.settings)
        return print_settings(o.settings);
    if (count == 0) {
        out_say("check: needs %s; see: gonio help check", verb->operands);
        return EXIT_INPUT;
    }
    const char *kind = kind_of(path);
    if (!kind)
        kind = strstr(path, "goniod") || strstr(path, "bench") ? "bench" : "campaign";
    else if (!strcmp(kind, "simulator"))
        return refuse_simulator(path, o.json);
    struct complaints c = {o.json ? json_array() : NULL, 0};
    struct cfg_sink sink = {complain, &c};
    struct campaign_config *campaign = malloc(sizeof *campaign);
    struct bench_config *bench = malloc(sizeof *bench);
    int rc = !campaign || !bench         ? GON_E_SYSTEM
             : !strcmp(kind, "campaign") ? campaign_config_load(path, sink, campaign, NULL)
                                         : load_bench(path, bench, sink);
    free(campaign);
    free(bench);
    if (o.json)
        print_report(path, kind, c.list);
    else if (rc < 0)
        say_count(c.count, "mend them and check again.");
    else
        fprintf(stderr, "%s: a good %s file\n", path, kind);
    return rc < 0 ? EXIT_INPUT : EXIT_OK;
}

const struct verb verb_check = {
    "check",
    "FILE.cfg",
    "validate a campaign or bench file, nothing else",
    "Reports every mistake with file and line. Whether it is a campaign or a bench file is seen "
    "from its groups. A campaign's meaning, with its estimated time: gonio plan FILE.cfg. A file "
    "of the simulator is checked by goniosim itself when it starts: goniosim --run-dir DIR "
    "--config FILE.cfg says what is wrong with it and ends with status 2.\n",
    rows,
    run_check};
