// SPDX-License-Identifier: MIT
// A profile's text patterns from the instrument's side: a command is matched, an answer is written.
// The simulator's own code; what patterns look like is in drivers/profile_text.h. Thread: any.
#pragma once
#include "sim/actor_values.h"

enum actor_fit {
    ACTOR_OTHER,  // another command
    ACTOR_BEYOND, // this one, but a value in it cannot be
    ACTOR_FITS
};

// Whether a line (without terminator) is the command that the pattern describes. What it carries is
// put into v when it fits; otherwise v may be half filled.
enum actor_fit actor_text_match(struct actor_values *v, const char *pattern, const char *line);
bool actor_text_has_values(const char *pattern);
// Cut off when there is no room. Optional parts are written; {} is 0, and nothing where it is
// optional.
void actor_text_write(const struct actor_values *v, const char *pattern, char *ret_text,
                      size_t size);
// A text that a glob is like: without its stars.
void actor_text_unglob(const char *glob, char *ret_text, size_t size);
