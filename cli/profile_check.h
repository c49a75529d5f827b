// SPDX-License-Identifier: MIT
// `gonio profile check`, `doc`, `list` and `settings`: what profiles say, and whether it is right.
// Each: argv[0] is the word; returns an exit_status.
#pragma once

int profile_check_files(int argc, char **argv);
int profile_doc(int argc, char **argv);
int profile_list(int argc, char **argv);
int profile_settings(int argc, char **argv); // as manual text

struct profile;
// By its file or its name, read and checked; mistakes go to stderr. NULL: there were some.
struct profile *profile_take(const char *name, char *ret_path, unsigned long size);
