// SPDX-License-Identifier: MIT
// Files that people write, checked before anything is done with them.
#pragma once

// Reads and checks a campaign file; says every mistake on stderr. EXIT_OK with the file's text (malloc'ed;
// ret_text may be NULL), or EXIT_INPUT.
int check_campaign(const char *path, char **ret_text);
