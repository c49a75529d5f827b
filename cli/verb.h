// SPDX-License-Identifier: MIT
// The verbs of the command: each is a row of main.c's table and says here what `gonio help` prints.
#pragma once
#include "base/options.h"

// What the shell sees; scripts depend on it.
enum exit_status {
    EXIT_OK = 0,
    EXIT_FAILED = 1, // the instrument or the fit failed
    EXIT_INPUT = 2,  // bad arguments, configuration or input file
    EXIT_NO_DAEMON = 3,
    EXIT_REFUSED = 4, // busy, interlock, somebody else has control
    EXIT_INTERRUPTED = 130
};

struct verb {
    const char *name;
    const char *operands; // "FILE.cfg"
    const char *summary;  // a few words for the list of verbs
    const char *about;    // a paragraph for `gonio help VERB`, which fills the lines
    const struct option_row *options;
    // argv[0] is the verb; returns exit_status.
    int (*run)(const struct verb *verb, int argc, char **argv);
};

extern const struct verb verb_plan, verb_check;
extern const struct verb verb_devices, verb_doctor;
extern const struct verb verb_run, verb_watch;
extern const struct verb verb_status, verb_stop, verb_pause, verb_resume, verb_ack, verb_remeasure;
extern const struct verb verb_queue, verb_control;
extern const struct verb verb_list, verb_show, verb_verify, verb_backup;
extern const struct verb verb_exclude, verb_restore;
extern const struct verb verb_fit, verb_model;
extern const struct verb verb_profile;
extern const struct verb verb_laser;

// Options into target, operands into operands: their count, or -1 after saying what was wrong.
int verb_take(const struct verb *verb, int argc, char **argv, void *target, const char **operands,
              int least, int most);

#define VERB_OPTIONS_END                                                                           \
    {                                                                                              \
        NULL, OPTION_FLAG, 0, NULL, 0, 0, NULL                                                     \
    }
