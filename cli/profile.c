// SPDX-License-Identifier: MIT
#include "cli/out.h"
#include "cli/profile_check.h"
#include "cli/profile_record.h"
#include "cli/profile_sim.h"
#include "cli/verb.h"

#include <string.h>

static const struct {
    const char *word;
    int (*run)(int argc, char **argv);
} words[] = {{"check", profile_check_files},
             {"doc", profile_doc},
             {"list", profile_list},
             {"sim", profile_sim},
             {"settings", profile_settings},
             {"record", profile_record},
             {NULL, NULL}};

static int run_profile(const struct verb *verb, int argc, char **argv)
{
    (void)verb;
    for (int i = 0; argc > 1 && words[i].word; i++)
        if (strcmp(argv[1], words[i].word) == 0)
            return words[i].run(argc - 1, argv + 1);
    out_say("profile: needs check, doc, list, record, settings or sim; see: gonio help profile");
    return EXIT_INPUT;
}

// Each word takes its own; here they are only described.
static const struct option_row all_options[] = {
    {"--run-dir", OPTION_TEXT, 0, "DIR", 0, 0,
     "sim: where its pty and control socket appear; else a folder of its own"},
    {"--fast", OPTION_FLAG, 0, NULL, 0, 0, "sim: no baud timing"},
    {"--unit", OPTION_INT, 0, "N", 1, 247, "sim, record: Modbus address of the instrument; else 1"},
    {"--out", OPTION_TEXT, 0, "PATH", 0, 0,
     "record: a new file for the entries; else standard output"},
    {"--set", OPTION_TEXT, 0, "NAME=VALUE", 0, 0,
     "record: afterwards set this value, and record that, too; may be repeated"},
    {"--do", OPTION_TEXT, 0, "NAME", 0, 0,
     "record: afterwards do what has this name, an exchange or a write, also if it moves "
     "something; 'NAME: a = 1, b = 2' gives it values; may be repeated"},
    {"--interactive", OPTION_FLAG, 0, NULL, 0, 0,
     "record: instead of asking everything run lines from standard input"},
    {"--json", OPTION_FLAG, 0, NULL, 0, 0, "check, list: all of it as JSON"},
    VERB_OPTIONS_END};

const struct verb verb_profile = {
    "profile",
    "check|doc|list|record|settings|sim [PROFILE]",
    "instruments by their profiles",
    "PROFILE is a file, or the name of one that is known. check reports every mistake with file "
    "and line, plays the golden entries through the code that talks to instruments, and prints "
    "what is in the profile; it takes several. doc prints the reference page of the instrument as "
    "Markdown. list names the profiles that are known. record PROFILE LINK asks a real instrument "
    "everything that the profile can ask and writes each exchange, byte by byte, as entries for "
    "the profile's golden list; what sets or moves something only when it is named; never what "
    "switches emission on. settings prints what a profile may say. sim serves the instrument on a "
    "pty and on TCP, and says how to reach it: to try a script, or a bench before the instrument "
    "is there; Ctrl-C ends it. Of the options --run-dir and --fast are sim's, --unit is sim's and "
    "record's, --json is check's and list's, the others are record's.\n",
    all_options,
    run_profile};
