// SPDX-License-Identifier: MIT
// What check.c and check_devices.c share; nobody else includes it. path and text: of the file that
// is checked. Each says a mistake with its line and returns GON_E_INPUT, or 0.
#pragma once
#include "base/cfg.h"
#include "drivers/link.h"
#include "drivers/profile.h"

struct bench_config;

int check_line_of(const char *text, const char *word); // where the word stands first
int check_link(const char *path, const char *text, const char *link, enum link_use use,
               struct cfg_sink sink);
// A device's profile has to be there, right, and of such a device.
int check_profile(const char *path, const char *text, const struct bench_config *bench,
                  const char *name, enum profile_role role, struct cfg_sink sink);
// Monitor, selectors with the names of their positions, inputs.
int check_devices(const char *path, const char *text, const struct bench_config *bench,
                  struct cfg_sink sink);
