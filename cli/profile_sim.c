// SPDX-License-Identifier: MIT
#include "cli/profile_sim.h"
#include "base/paths.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

struct options {
    const char *run_dir;
    long unit;
    bool fast;
};

static const struct option_row profile_sim_options[] = {
    {"--run-dir", OPTION_TEXT, offsetof(struct options, run_dir), "DIR", 0, 0,
     "where its pty and control socket appear; else a folder of its own"},
    {"--unit", OPTION_INT, offsetof(struct options, unit), "N", 1, 247,
     "Modbus address of the instrument"},
    {"--fast", OPTION_FLAG, offsetof(struct options, fast), NULL, 0, 0, "no baud timing"},
    VERB_OPTIONS_END};

static const struct verb verb = {"profile sim",
                                 "PROFILE",
                                 "an instrument by its profile, simulated",
                                 "Serves the instrument that the profile (a file, or the name of "
                                 "one that is known) describes on "
                                 "a pty and on TCP, and says how to reach it. Ctrl-C ends it.\n",
                                 profile_sim_options,
                                 NULL};

static int become(char **argv)
{
    char program[PATH_MAX];
    paths_program("goniosim", program, sizeof program);
    argv[0] = program;
    execvp(program, argv);
    out_say("profile sim: %s does not start: %s; build it with make, or install it", program,
            strerror(errno));
    return EXIT_FAILED;
}

int profile_sim(int argc, char **argv)
{
    struct options o = {.unit = 1};
    const char *profile;
    char unit[16];
    if (verb_take(&verb, argc, argv, &o, &profile, 1, 1) < 0)
        return EXIT_INPUT;
    snprintf(unit, sizeof unit, "%ld", o.unit);
    char *args[9] = {NULL, (char *)"--profile", (char *)profile, (char *)"--unit", unit};
    int count = 5;
    if (o.run_dir) {
        args[count++] = (char *)"--run-dir";
        args[count++] = (char *)o.run_dir;
    }
    if (o.fast)
        args[count++] = (char *)"--fast";
    return become(args);
}
