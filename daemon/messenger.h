// SPDX-License-Identifier: MIT
// Tells somebody who is not there: the bench file's command, run when a run is paused, failed or
// done. It is started without a shell, in a session of its own, with the sentence as its last
// argument and the details in its environment; one at a time, killed with its children after its
// time. What happens meanwhile waits, at most MESSENGER_WAITING messages. Nothing here waits for it:
// measuring goes on. Thread: main.
#pragma once
#include "base/err.h"

enum { MESSENGER_WAITING = 16 };

struct log;
struct loop;
struct messenger;

struct messenger_command {
    const char *const *argv; // argv[0] a path; NULL at its end; borrowed
    double limit_s;
};

struct message {
    int run;
    const char *event;    // "paused", "failed", "done"
    const char *campaign; // its name
    const char *file;
    const char *text; // why; "" when there is nothing to say
};

int messenger_new(struct loop *loop, const struct messenger_command *command, struct log *log,
                  struct messenger **ret_messenger, struct gon_error *err);
void messenger_free(struct messenger *m); // kills what runs; NULL is fine

// Does nothing with NULL. The environment gets GONIO_EVENT, GONIO_RUN, GONIO_CAMPAIGN, GONIO_FILE
// and GONIO_TEXT. What goes wrong is in the log.
void messenger_tell(struct messenger *m, const struct message *what);
