// SPDX-License-Identifier: MIT
// Files that people write, checked before anything is done with them.
#pragma once

struct bench_config;
struct campaign_config;

// Reads and checks a campaign file; says every mistake on stderr. EXIT_OK with the configuration
// and the file's text (malloc'ed; ret_text may be NULL), or EXIT_INPUT.
int check_campaign(const char *path, struct campaign_config *ret_config, char **ret_text);
int check_bench(const char *path, struct bench_config *ret_bench);
