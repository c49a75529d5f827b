// SPDX-License-Identifier: MIT
// control: who runs the bench; taking it and giving it back.
#include "cli/out.h"
#include "cli/remote.h"
#include "cli/verb.h"

#include <jansson.h>
#include <string.h>
#include <time.h>

struct options {
    struct remote_options remote;
    const char *reason, *from;
};

static const struct option_row rows[] = {
    {"--reason", OPTION_TEXT, offsetof(struct options, reason), "TEXT", 0, 0,
     "with take: what for, for the others"},
    {"--from", OPTION_TEXT, offsetof(struct options, from), "NAME", 0, 0,
     "with take: from the colleague who has it"},
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

static int show(const struct options *o, json_t *reply)
{
    const json_t *c = json_object_get(reply, "control");
    if (o->remote.json) {
        out_json(reply);
    } else if (json_is_null(c)) {
        printf("nobody has control; everybody may command\n");
    } else {
        char since[40];
        const time_t s = json_integer_value(json_object_get(c, "since_utc_ms")) / 1000;
        const char *reason = json_string_value(json_object_get(c, "reason"));
        struct tm tm;
        strftime(since, sizeof since, "%Y-%m-%d %H:%M", localtime_r(&s, &tm));
        printf("%s has control since %s%s%s\n", json_string_value(json_object_get(c, "name")), since,
               *reason ? ": " : "", reason);
    }
    json_decref(reply);
    return out_finish(EXIT_OK);
}

// {"do", "reason", "from"}; NULL after saying what is wrong.
static json_t *request(const struct options *o, const char *what)
{
    const bool take = !strcmp(what, "take");
    if (!take && strcmp(what, "release")) {
        out_say("control '%s': take or release; without either it shows who has it", what);
        return NULL;
    }
    if (!take && (o->reason || o->from)) {
        out_say("--reason and --from are for control take");
        return NULL;
    }
    json_t *body = json_pack("{s:s}", "do", what);
    if (o->reason)
        json_object_set_new(body, "reason", json_string(o->reason));
    if (o->from)
        json_object_set_new(body, "from", json_string(o->from));
    return body;
}

static int run_control(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *what;
    int status = EXIT_OK;
    const int count = verb_take(verb, argc, argv, &o, &what, 0, 1);
    if (count < 0)
        return EXIT_INPUT;
    json_t *body = count ? request(&o, what) : NULL;
    if (count && !body)
        return EXIT_INPUT;
    json_t *reply =
        remote_call(&o.remote, count ? "POST" : "GET", "/api/v1/control", body, &status);
    json_decref(body);
    return reply ? show(&o, reply) : status;
}

const struct verb verb_control = {
    "control",
    "[take | release]",
    "who runs the bench",
    "Shows who has control. take makes it you, by the name in GONIO_NAME or your login; while you "
    "have it the commands of others are refused, with your name and reason. release gives it back. "
    "Nobody needs it to watch, and gonio stop is everybody's. A colleague who went home is named with "
    "--from.\n"
    "It keeps people out of each other's way and is no defence. It ends with goniod.\n",
    rows,
    run_control};
