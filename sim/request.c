// SPDX-License-Identifier: MIT
#include "sim/request.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS_MOST = 32 };

void request_refuse(struct request *r, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(r->error, sizeof r->error, fmt, ap);
    va_end(ap);
}

static void list(const char *const *words, int count, char *ret, size_t size)
{
    size_t used = 0;
    *ret = 0;
    for (int i = 0; i < count && used < size; i++)
        used += (size_t)snprintf(ret + used, size - used, "%s%s", i ? ", " : "", words[i]);
}

int request_choice(struct request *r, const char *key, const char *const *words, int count)
{
    const char *text = json_string_value(json_object_get(r->in, key));
    char all[120];
    for (int i = 0; i < count; i++)
        if (text && strcmp(text, words[i]) == 0)
            return i;
    list(words, count, all, sizeof all);
    request_refuse(r, "'%s' must be one of %s", key, all);
    return -1;
}

bool request_truth(struct request *r, const char *key, json_t *v)
{
    if (!json_is_boolean(v))
        request_refuse(r, "'%s' must be true or false", key);
    return json_is_true(v);
}

// --- wires ---------------------------------------------------------------------------------------

struct wire *request_wire(struct request *r)
{
    const char *names[WORDS_MOST];
    for (int i = 0; i < r->wires_count; i++)
        names[i] = r->wires[i].name;
    int i = request_choice(r, "wire", names, r->wires_count);
    return i < 0 ? NULL : &r->wires[i];
}

json_t *request_wires(const struct request *r)
{
    json_t *all = json_object();
    for (int i = 0; i < r->wires_count; i++) {
        const struct wire *w = &r->wires[i];
        json_object_set_new(
            all, w->name,
            json_pack("{s:s,s:b,s:b,s:b,s:I,s:I,s:I,s:I,s:I,s:I}", "address", w->address, "plugged",
                      w->plugged, "client", w->plugged && w->ops->client(w) >= 0, "mute",
                      w->port->mute, "clients", (json_int_t)w->clients, "frames_in",
                      (json_int_t)w->port->frames_in, "frames_out", (json_int_t)w->port->frames_out,
                      "lost", (json_int_t)w->port->lost, "bytes_in", (json_int_t)w->bytes_in,
                      "bytes_out", (json_int_t)w->bytes_out));
    }
    return all;
}

void request_plug(struct request *r)
{
    struct gon_error err = {.text = ""};
    struct wire *w = request_wire(r);
    if (w && wire_plug(w, &err))
        request_refuse(r, "%.180s", err.text);
}

void request_unplug(struct request *r)
{
    struct wire *w = request_wire(r);
    if (w)
        wire_unplug(w);
}

void request_mute(struct request *r)
{
    struct wire *w = request_wire(r);
    if (w)
        w->port->mute = true;
}

void request_unmute(struct request *r)
{
    struct wire *w = request_wire(r);
    if (w)
        w->port->mute = false;
}

// --- settings ------------------------------------------------------------------------------------

void request_set_drop(struct request *r, json_t *v)
{
    struct wire *w = request_wire(r);
    json_int_t n = json_integer_value(v);
    if (!json_is_integer(v) || n < 0 || n > 1000000)
        request_refuse(r, "'drop' must be a whole number, 0..1000000");
    else if (w)
        w->port->drop = (unsigned)n;
}

void request_set_delay(struct request *r, json_t *v)
{
    struct wire *w = request_wire(r);
    double ms = json_number_value(v);
    if (!json_is_number(v) || !(ms >= 0 && ms <= 60000))
        request_refuse(r, "'delay_ms' must be a number, 0..60000 ms");
    else if (w)
        w->port->delay_ns = (int64_t)(ms * 1e6);
}

static const struct request_key *find(const struct request_key *keys, const char *key)
{
    while (keys->key && strcmp(keys->key, key))
        keys++;
    return keys->key ? keys : NULL;
}

static void refuse_empty(struct request *r, const struct request_key *keys)
{
    const char *names[WORDS_MOST];
    char all[160];
    int count = 0;
    for (; keys->key; keys++)
        if (keys->set)
            names[count++] = keys->key;
    list(names, count, all, sizeof all);
    request_refuse(r, "'set' needs something to set: %s", all);
}

void request_set(struct request *r, const struct request_key *keys)
{
    const char *key;
    json_t *v;
    int done = 0;
    json_object_foreach(r->in, key, v)
    {
        const struct request_key *k = find(keys, key);
        if (!k && strcmp(key, "do")) {
            request_refuse(r, "'set' does not know '%s'", key);
            return;
        }
        done += k && k->set;
    }
    if (done == 0)
        refuse_empty(r, keys);
    for (; keys->key && !*r->error; keys++)
        if (keys->set && (v = json_object_get(r->in, keys->key)))
            keys->set(r, v);
}

// --- one line ------------------------------------------------------------------------------------

static void run(struct request *r, const struct request_verb *verbs)
{
    const char *verb = json_string_value(json_object_get(r->in, "do")), *names[WORDS_MOST];
    char all[120];
    int count = 0;
    for (; verbs->verb; verbs++) {
        if (verb && strcmp(verb, verbs->verb) == 0) {
            verbs->run(r);
            return;
        }
        names[count++] = verbs->verb;
    }
    list(names, count, all, sizeof all);
    request_refuse(r, "'do' must be one of %s, not '%.40s'", all, verb ? verb : "");
}

char *request_answer(const struct request *about, const struct request_verb *verbs,
                     const char *line, int64_t t_ns)
{
    json_error_t e;
    struct request r = *about;
    r.t_ns = t_ns;
    r.out = json_object();
    r.in = json_loads(line, JSON_REJECT_DUPLICATES, &e);
    if (json_is_object(r.in))
        run(&r, verbs);
    else
        request_refuse(&r, "not a JSON object: %.120s", r.in ? "another type" : e.text);
    if (*r.error) {
        json_object_clear(r.out);
        json_object_set_new(r.out, "error", json_string(r.error));
    }
    json_object_set_new(r.out, "ok", json_boolean(!*r.error));
    char *text = json_dumps(r.out, JSON_COMPACT | JSON_REAL_PRECISION(12));
    char *answer = NULL;
    if (text && asprintf(&answer, "%s\n", text) < 0)
        answer = NULL;
    free(text);
    json_decref(r.in);
    json_decref(r.out);
    return answer;
}
