// SPDX-License-Identifier: MIT
#include "cli/out.h"
#include "cli/profile_sim.h"
#include "cli/verb.h"

#include <string.h>

static int run_profile(const struct verb *verb, int argc, char **argv)
{
    (void)verb;
    if (argc > 1 && strcmp(argv[1], "sim") == 0)
        return profile_sim(argc - 1, argv + 1);
    out_say("profile: needs 'sim'; see: gonio help profile");
    return EXIT_INPUT;
}

const struct verb verb_profile = {
    "profile",
    "sim PROFILE",
    "instruments by their profiles",
    "sim serves the instrument that the profile (a file, or the name of one that is known) "
    "describes on a pty and on TCP, and says how to reach it: to try a script, or a bench before "
    "the instrument is there. Ctrl-C ends it.\n",
    profile_sim_options,
    run_profile};
