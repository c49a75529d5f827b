// SPDX-License-Identifier: MIT
// The part of show that prints the instruments' profiles kept in a campaign file. 0 or a gon_code.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct store;

int show_profiles(struct store *s, bool json, struct gon_error *err); // a row each
// Of a name the newest, or of a number the one; its text as it was read, nothing added.
int show_profile(struct store *s, const char *name, bool json, struct gon_error *err);
