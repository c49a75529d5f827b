// SPDX-License-Identifier: MIT
#include "daemon/decision.h"

#include "campaign/store_exclude.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static char *copy(const char *text)
{
    return text ? strdup(text) : NULL;
}

static int verb_of(const char *what)
{
    static const char *const names[] = {"exclude", "restore", "remeasure"};
    for (int i = 0; i < 3; i++)
        if (!strcmp(what, names[i]))
            return i;
    return -1;
}

static int take(json_t *body, const char *who, struct decision *d, struct gon_error *err)
{
    json_error_t e;
    const char *what, *which = NULL, *reason = NULL;
    int sweep = -1;
    if (json_unpack_ex(body, &e, JSON_STRICT, "{s:s, s?s, s?i, s?s}", "do", &what, "readings",
                       &which, "sweep", &sweep, "reason", &reason) < 0)
        return gon_fail(err, GON_E_INPUT,
                        "the request's body: %s; send {\"do\": \"exclude\"|\"restore\", "
                        "\"readings\": text, \"reason\": text} or {\"do\": \"remeasure\", "
                        "\"sweep\": number, \"reason\": text}",
                        e.text);
    const int verb = verb_of(what);
    if (verb < 0)
        return gon_fail(err, GON_E_INPUT, "\"do\": \"%.40s\"; use exclude, restore or remeasure",
                        what);
    const bool again = verb == DECISION_REMEASURE;
    if (again ? which || sweep < 0 : !which || sweep >= 0)
        return gon_fail(err, GON_E_INPUT, "\"do\": \"%s\" takes %s", what,
                        again ? "\"sweep\": number; without \"readings\""
                              : "\"readings\": text; without \"sweep\"");
    *d = (struct decision){(enum decision_verb)verb, sweep, copy(which), copy(reason), copy(who)};
    return GON_OK;
}

int decision_parse(const char *body, size_t size, const char *who, struct decision **ret_decision,
                   struct gon_error *err)
{
    json_error_t e;
    json_t *o = json_loadb(body, size, JSON_REJECT_DUPLICATES, &e);
    struct decision *d = calloc(1, sizeof *d);
    int rc = !d  ? gon_fail(err, GON_E_SYSTEM, "out of memory")
             : o ? take(o, who, d, err)
                 : gon_fail(err, GON_E_INPUT,
                            "the request's body, line %d column %d: %s; send one "
                            "JSON object",
                            e.line, e.column, e.text);
    json_decref(o);
    if (rc < 0)
        decision_free(d);
    else
        *ret_decision = d;
    return rc;
}

int decision_make(const struct decision *d, struct store *s, int64_t t_utc_ms,
                  struct gon_error *err)
{
    const struct store_decision how = {t_utc_ms, d->reason, d->who};
    switch (d->verb) {
    case DECISION_EXCLUDE: return store_exclude(s, d->which, &how, err);
    case DECISION_RESTORE: return store_restore(s, d->which, &how, err);
    default: return store_remeasure(s, d->sweep, &how, err);
    }
}

void decision_free(void *decision)
{
    struct decision *d = decision;
    if (!d)
        return;
    free(d->which);
    free(d->reason);
    free(d->who);
    free(d);
}
