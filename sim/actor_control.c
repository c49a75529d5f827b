// SPDX-License-Identifier: MIT
#include "sim/actor_control.h"
#include "sim/request.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static struct actor *the(const struct request *r)
{
    return r->subject;
}

// --- what is asked -------------------------------------------------------------------------------

static void do_state(struct request *r)
{
    const struct actor *a = the(r);
    actor_meet(the(r), r->t_ns);
    json_object_set_new(r->out, "now_ns", json_integer(r->t_ns));
    json_object_set_new(r->out, "commands", json_integer((json_int_t)a->commands));
    json_object_set_new(r->out, "too_early", json_integer((json_int_t)a->too_early));
    json_object_set_new(r->out, "refused", json_integer((json_int_t)a->refused));
    json_object_set_new(r->out, "wires", request_wires(r));
}

// Infinite and unknown numbers are null: JSON has none.
static json_t *as_json(const struct actor_values *v, int value)
{
    const struct profile_value *p = &v->profile->values[value];
    const char *word = actor_values_name(v, value, v->number[value]);
    if (p->type == PROFILE_STRING)
        return json_string(v->text[value]);
    if (p->type == PROFILE_WORD && word)
        return json_string(word);
    return isfinite(v->number[value]) ? json_real(v->number[value]) : json_null();
}

void actor_control_values(struct request *r, struct actor *a)
{
    const struct actor_values *v = &a->now;
    json_t *all = json_object();
    actor_meet(a, r->t_ns);
    for (int i = 0; i < v->profile->values_count; i++)
        json_object_set_new(all, v->profile->values[i].name, as_json(v, i));
    json_object_set_new(r->out, "values", all);
}

static void do_values(struct request *r)
{
    actor_control_values(r, the(r));
}

// --- what is done --------------------------------------------------------------------------------

static void do_power_cycle(struct request *r)
{
    actor_power_cycle(the(r), r->t_ns);
}

static void set_value(struct request *r, struct actor *a, const char *name, const json_t *v)
{
    char text[PROFILE_TEXT];
    struct gon_error err = {.text = ""};
    int n = 0;
    if (json_is_string(v))
        n = snprintf(text, sizeof text, "%s = '%s'", name, json_string_value(v));
    else if (json_is_number(v) || json_is_boolean(v))
        n = snprintf(text, sizeof text, "%s = %.17g", name,
                     json_is_number(v) ? json_number_value(v) : (double)json_is_true(v));
    if (n <= 0 || (size_t)n >= sizeof text)
        request_refuse(r, "'%.40s' must be a number, true, false or a short text", name);
    else if (actor_set(a, text, r->t_ns, &err))
        request_refuse(r, "%.190s", err.text);
}

void actor_control_set(struct request *r, struct actor *a, json_t *values)
{
    const char *name;
    json_t *v;
    if (!json_is_object(values))
        request_refuse(r, "'values' must be an object: {\"NAME\": 1}");
    json_object_foreach(values, name, v)
    {
        if (!*r->error)
            set_value(r, a, name, v);
    }
}

static void set_values(struct request *r, json_t *values)
{
    actor_control_set(r, the(r), values);
}

static void do_set(struct request *r)
{
    static const struct request_key keys[] = {{"values", set_values},
                                              {"drop", request_set_drop},
                                              {"delay_ms", request_set_delay},
                                              {"wire", NULL},
                                              {0}};
    request_set(r, keys);
}

char *actor_control_answer(struct actor *actor, struct wire *wires, int wires_count,
                           const char *line, int64_t t_ns)
{
    static const struct request_verb verbs[] = {{"state", do_state},
                                                {"values", do_values},
                                                {"plug", request_plug},
                                                {"unplug", request_unplug},
                                                {"mute", request_mute},
                                                {"unmute", request_unmute},
                                                {"set", do_set},
                                                {"power-cycle", do_power_cycle},
                                                {0}};
    const struct request about = {.wires = wires, .wires_count = wires_count, .subject = actor};
    return request_answer(&about, verbs, line, t_ns);
}
