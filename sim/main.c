// SPDX-License-Identifier: MIT
// goniosim: the simulated bench on real wires, or one instrument made from its profile.
#include "base/options.h"
#include "base/standard.h"
#include "sim/actor_served.h"
#include "sim/bench_served.h"
#include "sim/profiles.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

enum { MOST_SETS = 64 };

struct arguments {
    const char *run_dir, *config, *set, *profile;
    long seed, unit;
    bool fast, with_parent, help, version, options, settings;
    char *sets[MOST_SETS];
    int set_count;
    pid_t parent; // 0: does not matter
};

static const struct option_row rows[] = {
    {"--run-dir", OPTION_TEXT, offsetof(struct arguments, run_dir), "DIR", 0, 0,
     "where wires and files appear; required for the bench"},
    {"--profile", OPTION_TEXT, offsetof(struct arguments, profile), "PROFILE", 0, 0,
     "instead of the bench: one instrument by its profile, a file or a name"},
    {"--unit", OPTION_INT, offsetof(struct arguments, unit), "N", 1, 247,
     "Modbus address of that instrument"},
    {"--config", OPTION_TEXT, offsetof(struct arguments, config), "FILE", 0, 0, "a sim.cfg"},
    {"--set", OPTION_TEXT, offsetof(struct arguments, set), "NAME=VALUE", 0, 0,
     "one setting of sim.cfg; may be repeated"},
    {"--seed", OPTION_INT, offsetof(struct arguments, seed), "N", 0, 2147483647,
     "of everything random"},
    {"--fast", OPTION_FLAG, offsetof(struct arguments, fast), NULL, 0, 0,
     "quick axes, filter and warm-up; no baud timing"},
    {"--exit-with-parent", OPTION_FLAG, offsetof(struct arguments, with_parent), NULL, 0, 0,
     "end when the parent process ends"},
    {"--help", OPTION_FLAG, offsetof(struct arguments, help), NULL, 0, 0, "this text"},
    {"--version", OPTION_FLAG, offsetof(struct arguments, version), NULL, 0, 0, "name and version"},
    {"--options", OPTION_FLAG, offsetof(struct arguments, options), NULL, 0, 0,
     "this list for the manual page"},
    {"--settings", OPTION_FLAG, offsetof(struct arguments, settings), NULL, 0, 0,
     "the settings of sim.cfg for the manual page"},
    {0}};

static int fail(const struct gon_error *err)
{
    fprintf(stderr, "goniosim: %s\n", err->text);
    return err->code == GON_E_INPUT ? 2 : err->code == GON_E_REFUSED ? 4 : 1;
}

static void say(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

// --set may come more than once, which the table of options does not know: taken out before.
static int take_sets(int argc, char **argv, struct arguments *a, struct gon_error *err)
{
    int kept = 0;
    for (int i = 0; i < argc; i++) {
        char *value = strncmp(argv[i], "--set=", 6) == 0 ? argv[i] + 6 : NULL;
        if (strcmp(argv[i], "--set") == 0)
            value = i + 1 < argc ? argv[++i] : (char *)"";
        if (!value) {
            argv[kept++] = argv[i];
            continue;
        }
        if (a->set_count == MOST_SETS || !strchr(value, '='))
            return gon_fail(err, GON_E_INPUT, "--set %s: must be NAME=VALUE, at most %d times",
                            value, MOST_SETS);
        a->sets[a->set_count++] = value;
    }
    argv[kept] = NULL;
    return kept;
}

static int configure(struct sim_config *c, struct arguments *a, struct gon_error *err)
{
    int rc = sim_config_defaults(c, err);
    if (rc == 0 && a->config && sim_config_file(c, a->config, (struct cfg_sink){say, NULL}))
        rc = gon_fail(err, GON_E_INPUT, "%s is not usable; nothing was started", a->config);
    if (rc == 0 && a->fast)
        sim_config_fast(c);
    if (rc == 0 && a->seed >= 0)
        c->seed = (int)a->seed;
    for (int i = 0; i < a->set_count && rc == 0; i++) {
        char *equals = strchr(a->sets[i], '=');
        *equals = 0;
        rc = sim_config_set(c, a->sets[i], equals + 1, err);
    }
    sim_config_finish(c);
    return rc ? rc : profiles_of_bench(c, (struct cfg_sink){say, NULL}, err);
}

static void run(struct server *server, const struct arguments *a)
{
    printf("ready\n");
    if (fflush(stdout) == 0 || !a->with_parent) // else whoever waits for it is gone
        server_run(server, a->parent);
    server_close(server);
}

static int serve_bench(struct arguments *a, struct gon_error *err)
{
    struct sim_config config = {.seed = 0};
    struct server *server;
    int rc = configure(&config, a, err);
    struct served *bench = rc == 0 ? bench_served_new(&config) : NULL;
    if (rc == 0 && !bench)
        rc = gon_fail(err, GON_E_SYSTEM, "out of memory");
    if (rc == 0)
        rc = server_open(bench, a->run_dir, &server, err);
    if (rc == 0)
        printf("goniosim %s: %s, seed %d%s\n", GONIO_VERSION, a->run_dir, config.seed,
               a->fast ? ", fast" : "");
    if (rc == 0)
        run(server, a);
    profiles_free(&config);
    return rc;
}

// --- one instrument ------------------------------------------------------------------------------

// The folder of the run when none was given, to be removed afterwards.
static int make_folder(char *ret_path, size_t size, struct gon_error *err)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    snprintf(ret_path, size, "%s/goniosim-XXXXXX", runtime && *runtime ? runtime : "/tmp");
    if (!mkdtemp(ret_path))
        return gon_fail(err, GON_E_SYSTEM, "folder %s: %s", ret_path, strerror(errno));
    return 0;
}

static int serve_in(const struct profile *p, const char *folder, const struct arguments *a,
                    struct gon_error *err)
{
    const struct actor_spec spec = {.profile = p, .unit = (int)a->unit, .enforce = !a->fast};
    struct served *served;
    struct server *server;
    int rc = actor_served_new(&spec, &served, err);
    if (rc == 0)
        rc = server_open(served, folder, &server, err);
    if (rc)
        return rc;
    printf("goniosim %s: %s\n", GONIO_VERSION, p->title);
    actor_served_links(served, stdout);
    printf("control: %s/control.sock\n", folder);
    run(server, a);
    return 0;
}

static int serve_profile(const struct arguments *a, struct gon_error *err)
{
    char folder[PATH_MAX] = "";
    struct profile *p = NULL;
    if (a->config || a->set_count > 0 || a->seed >= 0)
        return gon_fail(err, GON_E_INPUT,
                        "--config, --set and --seed are of the bench, not of --profile");
    int rc = profiles_load(a->profile, (struct cfg_sink){say, NULL}, &p, NULL, err);
    if (rc == 0 && !a->run_dir)
        rc = make_folder(folder, sizeof folder, err);
    if (rc == 0)
        rc = serve_in(p, a->run_dir ? a->run_dir : folder, a, err);
    if (*folder)
        rmdir(folder);
    free(p);
    return rc;
}

// What is only asked about the program. True when that was all.
static bool describe(const struct arguments *a)
{
    if (a->help)
        printf("goniosim --run-dir DIR [options]: a simulated BRDF bench on ptys, TCP and a\n"
               "control socket\n"
               "goniosim --profile PROFILE [options]: one instrument the same way\n");
    if (a->help)
        options_describe(stdout, rows);
    else if (a->version)
        printf("goniosim %s\n", GONIO_VERSION);
    else if (a->options)
        options_manual(stdout, rows);
    else if (a->settings)
        cfg_describe(stdout, sim_config_schema);
    else
        return false;
    return true;
}

int main(int argc, char **argv)
{
    struct gon_error err = {.text = ""};
    struct arguments a = {.seed = -1, .unit = 1};
    const char *operands[1];
    standard_hold();
    argc = take_sets(argc, argv, &a, &err);
    int rc = argc < 0 ? argc : options_take(argc, argv, rows, &a, operands, 0, &err);
    if (rc < 0)
        return fail(&err);
    if (describe(&a))
        return 0;
    if (!a.run_dir && !a.profile) {
        gon_fail(&err, GON_E_INPUT, "--run-dir DIR is missing; see --help");
        return fail(&err);
    }
    if (a.with_parent) {
        a.parent = getppid();
        prctl(PR_SET_PDEATHSIG, SIGTERM);
    }
    rc = a.profile ? serve_profile(&a, &err) : serve_bench(&a, &err);
    return rc ? fail(&err) : 0;
}
