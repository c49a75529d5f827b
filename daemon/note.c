// SPDX-License-Identifier: MIT
#include "daemon/note.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (p)
        return p;
    fputs("goniod: out of memory\n", stderr);
    abort(); // a thread that cannot speak cannot be told to stop either
}

struct note *note_new(enum note_kind kind)
{
    struct note *n = must(calloc(1, sizeof *n));
    n->letter.kind = kind;
    return n;
}

void note_free(struct note *n)
{
    if (!n)
        return;
    if (n->thing)
        (n->drop ? n->drop : free)(n->thing);
    free(n->text);
    free(n->name);
    free(n->by);
    free(n);
}

void note_drop(struct letter *l)
{
    note_free((struct note *)l);
}

void note_post(struct mail *to, struct note *n)
{
    mail_post(to, &n->letter);
}

struct note *note_take(struct mail *m)
{
    return (struct note *)mail_take(m);
}

struct note *note_wait(struct mail *m, int timeout_ms)
{
    return (struct note *)mail_wait(m, timeout_ms, NULL);
}

char *note_text(const char *text)
{
    return text ? must(strdup(text)) : NULL;
}

void *note_steal(struct note *n)
{
    void *thing = n->thing;
    n->thing = NULL;
    return thing;
}
