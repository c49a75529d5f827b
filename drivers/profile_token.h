// SPDX-License-Identifier: MIT
// The words that conditions and assignments are made of: names and numbers, texts in '...', and the
// signs = != < <= > >= ~ !~ | * , between them. Thread: any.
#pragma once
#include "drivers/profile.h"

#include <stdbool.h>

enum profile_token_kind {
    PROFILE_TOKEN_END,
    PROFILE_TOKEN_WORD,   // name, number, word
    PROFILE_TOKEN_QUOTED, // without its quotes
    PROFILE_TOKEN_SIGN,
    PROFILE_TOKEN_BAD // a quote that does not end, or longer than PROFILE_TEXT
};

struct profile_token {
    enum profile_token_kind kind;
    char text[PROFILE_TEXT];
};

// The next token of *at, which moves on behind it.
struct profile_token profile_token_next(const char **at);
// Whether it is this word or sign.
bool profile_token_is(const struct profile_token *t, const char *text);
