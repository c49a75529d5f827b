// SPDX-License-Identifier: MIT
// The reference page of an instrument as Markdown: everything that its profile says. What has no
// place of its own in a table is shown by its row of the schema, so that nothing is left out.
#pragma once
#include <stdio.h>

struct profile;

void profile_page_print(FILE *out, const struct profile *p);
