// SPDX-License-Identifier: MIT
// Settings as Markdown, by their table (base/cfg.h): every row whose value is not its default is
// shown, so that a row that is added to a table shows by itself. Thread: any.
#pragma once
#include "base/cfg.h"

#include <stdbool.h>
#include <stdio.h>

// `as it stands`, with control characters seen; nothing for "". cell: in a table, which bars end.
void settings_code(FILE *out, const char *text, bool cell);
// The rows of a group or list of groups by its name.
const struct cfg_row *settings_group(const struct cfg_row *rows, const char *name);
// "scale 0.1, over 9.9e+37": what is not as its default. but: names that are not shown, with blanks
// between. How many were shown.
int settings_inline(FILE *out, const struct cfg_row *rows, const void *at, const char *but);
// The same as a list with a line each and what it means; groups as lists within.
void settings_list(FILE *out, const struct cfg_row *rows, const void *at, const char *but);
