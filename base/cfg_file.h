// SPDX-License-Identifier: MIT
// Private to base/cfg*.c: a parsed file, and how its mistakes are worded.
#pragma once
#include "base/cfg.h"

#include <libconfig.h>

struct cfg_file {
    config_t tree;
    char *text; // as it was read
    char *name; // of the file, for messages
    struct cfg_sink sink;
};

enum { CFG_PATH = 240, CFG_VALUE = 64 };

// One line to the sink: "name:line: " and the text. Returns 1, the number of mistakes it is.
int cfg_say(struct cfg_file *f, int line, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

// The setting's value as a person would write it, shortened; "" for none.
void cfg_show(const struct cfg_file *f, const config_setting_t *s, char *text, size_t size);

// The line a setting stands on, at least 1; of its nearest ancestor when libconfig knows none.
int cfg_line(const config_setting_t *s);
