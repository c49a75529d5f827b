// SPDX-License-Identifier: MIT
#include "cli/ask.h"

#include "cli/client.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct ask {
    struct client *client;
    int run;
    void (*event)(void *ctx, const json_t *event);
    void *ctx;
    json_t *last; // answer that was told; NULL: none
};

int ask_new(const char *socket, int interrupt_fd, int run,
            void (*event)(void *ctx, const json_t *event), void *ctx, struct ask **ret_ask,
            struct gon_error *err)
{
    struct ask *a = calloc(1, sizeof *a);
    if (!a)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    *a = (struct ask){.run = run, .event = event, .ctx = ctx};
    int rc = client_new(socket, &a->client, err);
    if (rc < 0) {
        ask_free(a);
        return rc;
    }
    client_interrupt_by(a->client, interrupt_fd);
    *ret_ask = a;
    return GON_OK;
}

void ask_free(struct ask *a)
{
    if (!a)
        return;
    client_free(a->client);
    json_decref(a->last);
    free(a);
}

bool ask_is_end(const char *state)
{
    return !strcmp(state, "done") || !strcmp(state, "stopped") || !strcmp(state, "failed");
}

static const char *state_of(const json_t *run)
{
    const char *state = json_string_value(json_object_get(run, "state"));
    return state ? state : "";
}

static bool differs(const json_t *a, const json_t *b, const char *key)
{
    return !json_equal(json_object_get(a, key), json_object_get(b, key));
}

// As the stream words it: the kind, then all of the run but its fit.
static void tell(const struct ask *a, const char *kind, json_t *run)
{
    json_t *e = json_pack("{s:s}", "event", kind);
    json_object_update(e, run);
    json_object_del(e, "fit");
    a->event(a->ctx, e);
    json_decref(e);
}

static void tell_fit(const struct ask *a, const json_t *run)
{
    json_t *e = json_pack("{s:s, s:i, s:O, s:b, s:O}", "event", "fit", "run", a->run, "sweep",
                          json_object_get(run, "sweep"), "last", !strcmp(state_of(run), "done"),
                          "fit", json_object_get(run, "fit"));
    if (e)
        a->event(a->ctx, e);
    json_decref(e);
}

// A daemon that was started since then knows how much was done, but no sweep and no reading.
// The state last: after an end nothing follows.
static void tell_changes(struct ask *a, json_t *now)
{
    if (differs(a->last, now, "sweep") && json_integer_value(json_object_get(now, "sweep")) > 0)
        tell(a, "sweep", now);
    if (differs(a->last, now, "done") && !json_is_null(json_object_get(now, "theta_r_deg")))
        tell(a, "reading", now);
    if (!json_is_null(json_object_get(now, "fit")) && differs(a->last, now, "fit"))
        tell_fit(a, now);
    if (differs(a->last, now, "state") || differs(a->last, now, "text"))
        tell(a, "state", now);
    json_decref(a->last);
    a->last = json_incref(now);
}

static int answer(struct ask *a, bool only_end, struct gon_error *err)
{
    char path[60];
    json_t *now = NULL;
    snprintf(path, sizeof path, "/api/v1/runs/%d", a->run);
    int rc = client_request(a->client, "GET", path, NULL, &now, err);
    if (rc == 0 && (!only_end || ask_is_end(state_of(now))))
        tell_changes(a, now);
    json_decref(now);
    return rc;
}

int ask_changes(struct ask *a, struct gon_error *err)
{
    return answer(a, false, err);
}

int ask_end(struct ask *a, struct gon_error *err)
{
    return answer(a, true, err);
}
