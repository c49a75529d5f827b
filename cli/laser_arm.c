// SPDX-License-Identifier: MIT
#include "cli/laser_arm.h"

#include "base/err.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <jansson.h>
#include <string.h>

int laser_time(const char *text, double *ret_s)
{
    static const struct {
        const char *unit;
        double s;
    } units[] = {{"h", 3600}, {"min", 60}, {"s", 1}, {"d", 86400}};
    char number[32];
    const size_t digits = strspn(text, "0123456789.");
    if (digits == 0 || digits >= sizeof number)
        return GON_E_INPUT;
    memcpy(number, text, digits);
    number[digits] = 0;
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (!strcmp(text + digits, units[i].unit)) {
            const int rc = options_real(number, ret_s);
            *ret_s *= rc < 0 ? 1 : units[i].s;
            return rc;
        }
    return GON_E_INPUT;
}

// NULL after saying what is wrong.
static json_t *request(const char *what, const char *time, const char *reason, double power_w)
{
    double for_s = 0;
    const bool arm = !strcmp(what, "arm"), align = !strcmp(what, "align");
    if (!arm && !align && strcmp(what, "disarm")) {
        out_say("laser '%s': arm, disarm, align or off; a run switches it on: gonio run FILE.cfg", what);
        return NULL;
    }
    if (align ? !time || reason || !(power_w > 0) : power_w > 0 || (!arm && (time || reason))) {
        out_say("--for and --reason are for laser arm; align wants --power W and --for TIME");
        return NULL;
    }
    if (time && (laser_time(time, &for_s) < 0 || !(for_s > 0))) {
        out_say("--for '%s': a number with h, min or s, as 8h", time);
        return NULL;
    }
    json_t *body = json_pack("{s:s}", "do", what);
    if (align)
        json_object_set_new(body, "power_w", json_real(power_w));
    if (time)
        json_object_set_new(body, "for_s", json_real(for_s));
    if (reason)
        json_object_set_new(body, "reason", json_string(reason));
    return body;
}

static int show(const struct remote_options *remote, json_t *reply)
{
    const char *light = json_string_value(json_object_get(reply, "light"));
    if (remote->json)
        out_json(reply);
    else
        printf("%s\nlight: %s%s\n", json_string_value(json_object_get(reply, "text")), light,
               json_is_object(json_object_get(reply, "align")) ? ", alignment" : "");
    json_decref(reply);
    return out_finish(EXIT_OK);
}

int laser_ask(const struct remote_options *remote, const char *what, const char *time,
              const char *reason, double power_w)
{
    int status = EXIT_OK;
    json_t *body = what ? request(what, time, reason, power_w) : NULL;
    if (what ? !body : (time || reason || power_w > 0)) {
        if (!what)
            out_say("--for and --reason are for laser arm");
        return EXIT_INPUT;
    }
    json_t *reply = remote_call(remote, what ? "POST" : "GET", "/api/v1/laser", body, &status);
    json_decref(body);
    return reply ? show(remote, reply) : status;
}
