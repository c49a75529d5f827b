// SPDX-License-Identifier: MIT
#include "cli/out.h"
#include "cli/profile_check.h"
#include "cli/profile_sim.h"
#include "cli/verb.h"

#include <string.h>

static const struct {
    const char *word;
    int (*run)(int argc, char **argv);
} words[] = {{"check", profile_check_files}, {"doc", profile_doc},           {"list", profile_list},
             {"sim", profile_sim},           {"settings", profile_settings}, {NULL, NULL}};

static int run_profile(const struct verb *verb, int argc, char **argv)
{
    (void)verb;
    for (int i = 0; argc > 1 && words[i].word; i++)
        if (strcmp(argv[1], words[i].word) == 0)
            return words[i].run(argc - 1, argv + 1);
    out_say("profile: needs check, doc, list, settings or sim; see: gonio help profile");
    return EXIT_INPUT;
}

const struct verb verb_profile = {
    "profile",
    "check|doc|list|settings|sim [PROFILE]",
    "instruments by their profiles",
    "PROFILE is a file, or the name of one that is known. check reports every mistake with file "
    "and "
    "line, plays the golden entries through the code that talks to instruments, and prints what is "
    "in the profile; it takes several. doc prints the reference page of the instrument as "
    "Markdown. "
    "list names the profiles that are known. settings prints what a profile may say. sim serves "
    "the "
    "instrument on a pty and on TCP, and says how to reach it: to try a script, or a bench before "
    "the instrument is there; Ctrl-C ends it, and only it has options.\n",
    profile_sim_options,
    run_profile};
