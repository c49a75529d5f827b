// SPDX-License-Identifier: MIT
#include "drivers/profile_token.h"

#include <string.h>

#define BLANKS " \t"
#define SIGNS "=!<>~|*,"

static struct profile_token token(enum profile_token_kind kind, const char *text, size_t size)
{
    struct profile_token t = {.kind = kind};
    if (size >= sizeof t.text)
        t.kind = PROFILE_TOKEN_BAD;
    else
        memcpy(t.text, text, size);
    return t;
}

struct profile_token profile_token_next(const char **at)
{
    const char *p = *at + strspn(*at, BLANKS);
    size_t size;
    if (!*p) {
        *at = p;
        return token(PROFILE_TOKEN_END, p, 0);
    }
    if (*p == '\'') {
        const char *end = strchr(p + 1, '\'');
        *at = end ? end + 1 : p + strlen(p);
        return end ? token(PROFILE_TOKEN_QUOTED, p + 1, (size_t)(end - p - 1))
                   : token(PROFILE_TOKEN_BAD, p, 0);
    }
    if (strchr(SIGNS, *p)) {
        size = strchr("!<>", *p) && (p[1] == '=' || (*p == '!' && p[1] == '~')) ? 2 : 1;
        *at = p + size;
        return token(PROFILE_TOKEN_SIGN, p, size);
    }
    size = strcspn(p, BLANKS SIGNS "'");
    *at = p + size;
    return token(PROFILE_TOKEN_WORD, p, size);
}

bool profile_token_is(const struct profile_token *t, const char *text)
{
    return (t->kind == PROFILE_TOKEN_WORD || t->kind == PROFILE_TOKEN_SIGN) &&
           strcmp(t->text, text) == 0;
}
