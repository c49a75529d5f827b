// SPDX-License-Identifier: MIT
#include "sim/control.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct request {
    const struct control *c;
    json_t *in, *out;
    int64_t t_ns;
    char error[200]; // "" while all is well
};

static void refuse(struct request *r, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
static void refuse(struct request *r, const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(r->error, sizeof r->error, fmt, ap);
    va_end(ap);
}

static int name_index(struct request *r, const char *key, const char *const *names, int count)
{
    const char *text = json_string_value(json_object_get(r->in, key));
    char all[120] = "";
    for (int i = 0; i < count; i++) {
        if (text && strcmp(text, names[i]) == 0)
            return i;
        size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "", names[i]);
    }
    refuse(r, "'%s' must be one of %s", key, all);
    return -1;
}

static struct wire *the_wire(struct request *r)
{
    int i = name_index(r, "wire", bench_port_names, BENCH_PORTS);
    return i < 0 ? NULL : &r->c->wires[i];
}

static struct sim_az *the_axis(struct request *r)
{
    int i = name_index(r, "axis", world_axis_names, world_axes(&r->c->bench->world.spec));
    return i < 0 ? NULL : &r->c->bench->az[i];
}

// --- what is asked -------------------------------------------------------------------------------

static json_t *axes_state(const struct request *r)
{
    json_t *all = json_object();
    for (int i = 0; i < world_axes(&r->c->bench->world.spec); i++) {
        const struct sim_az *z = &r->c->bench->az[i];
        struct motion_state s = motion_at(&r->c->bench->world.axis[i], r->t_ns);
        json_object_set_new(all, world_axis_names[i],
                            json_pack("{s:f,s:f,s:f,s:b,s:b,s:i,s:i,s:I,s:I}", "motor", s.motor,
                                      "load", s.load, "speed", s.speed, "moving", s.moving, "homed",
                                      z->homed, "alarm", z->alarm, "steps",
                                      (int)sim_az_position_steps(z, r->t_ns), "moves",
                                      (json_int_t)z->moves, "ignored", (json_int_t)z->ignored));
    }
    return all;
}

static json_t *time_or_null(int64_t t_ns)
{
    return t_ns == INT64_MIN ? json_null() : json_integer(t_ns);
}

static json_t *laser_state(const struct request *r)
{
    const struct sim_laser *l = &r->c->bench->world.laser;
    return json_pack("{s:b,s:I,s:f,s:f,s:i,s:i,s:b,s:b,s:b,s:o,s:o,s:I,s:I,s:I}", "emission",
                     sim_laser_emits(l), "since_ns", (json_int_t)l->emission_since_ns, "power_w",
                     sim_laser_power_w(l), "setpoint_w", l->setpoint_w, "state", l->state, "fault",
                     l->fault, "key", l->key, "needs_key_cycle", l->needs_key_cycle,
                     "interlock_closed", l->interlock_closed, "last_off_ns",
                     time_or_null(l->last_off_ns), "last_on_ns", time_or_null(l->last_on_ns),
                     "offs", (json_int_t)l->offs, "ons", (json_int_t)l->ons, "too_early",
                     (json_int_t)r->c->bench->laser.too_early);
}

static json_t *detector_state(const struct request *r)
{
    const struct lockin *l = &r->c->bench->world.lockin;
    return json_pack("{s:f,s:f,s:i,s:f,s:i}", "input_v",
                     world_input_v(&r->c->bench->world, r->t_ns), "time_constant_s",
                     l->time_constant_s, "poles", l->poles, "full_scale_v", l->full_scale_v,
                     "condition", (int)l->condition);
}

static json_t *wires_state(const struct request *r)
{
    json_t *all = json_object();
    for (int i = 0; i < BENCH_PORTS; i++) {
        const struct wire *w = &r->c->wires[i];
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

static void do_state(struct request *r)
{
    world_see(&r->c->bench->world, r->t_ns);
    json_object_set_new(r->out, "now_ns", json_integer(r->t_ns));
    json_object_set_new(r->out, "axes", axes_state(r));
    json_object_set_new(r->out, "laser", laser_state(r));
    json_object_set_new(r->out, "detector", detector_state(r));
    json_object_set_new(r->out, "wires", wires_state(r));
}

static void do_truth(struct request *r)
{
    const struct world_spec *w = &r->c->bench->world.spec;
    const struct optics_spec *o = &w->optics;
    json_object_set_new(r->out, "seed", json_integer((json_int_t)w->seed));
    json_object_set_new(r->out, "sample",
                        json_pack("{s:f,s:f,s:f,s:f,s:f,s:s}", "n", o->sample.n, "k", o->sample.k,
                                  "sigma", o->sample.sigma, "ks", o->sample.ks, "kd", o->sample.kd,
                                  "diffuse",
                                  o->diffuse == BRDF_DIFFUSE_PAPER ? "paper" : "lambert"));
    json_object_set_new(r->out, "optics",
                        json_pack("{s:f,s:f,s:f,s:f}", "aperture_radius_mm", o->aperture_radius_mm,
                                  "distance_mm", o->distance_mm, "solid_angle_sr",
                                  optics_solid_angle_sr(o), "transmission", o->transmission));
    json_object_set_new(r->out, "detector",
                        json_pack("{s:f,s:f,s:f,s:f,s:f}", "responsivity_v_per_w",
                                  w->responsivity_v_per_w, "offset_v", w->offset_v,
                                  "noise_v_per_rthz", w->noise_v_per_rthz, "monitor_v_per_w",
                                  w->monitor_v_per_w, "monitor_dark_v", w->monitor_dark_v));
}

// --- what is done --------------------------------------------------------------------------------

static void do_plug(struct request *r)
{
    struct gon_error err = {.text = ""};
    struct wire *w = the_wire(r);
    if (w && wire_plug(w, &err))
        refuse(r, "%.180s", err.text);
}

static void do_unplug(struct request *r)
{
    struct wire *w = the_wire(r);
    if (w)
        wire_unplug(w);
}

static void do_mute(struct request *r)
{
    struct wire *w = the_wire(r);
    if (w)
        w->port->mute = true;
}

static void do_unmute(struct request *r)
{
    struct wire *w = the_wire(r);
    if (w)
        w->port->mute = false;
}

static void do_power_cycle(struct request *r)
{
    struct sim_az *z = the_axis(r);
    if (z)
        sim_az_power_cycle(z, r->t_ns);
}

static const char *const interlock_words[] = {"open", "closed"};
static const char *const key_words[] = {"off", "on"};

static void set_interlock(struct request *r, json_t *v)
{
    (void)v;
    int i = name_index(r, "interlock", interlock_words, 2);
    if (i >= 0)
        sim_laser_set_interlock(&r->c->bench->world.laser, i == 1);
}

static void set_key(struct request *r, json_t *v)
{
    (void)v;
    int i = name_index(r, "key", key_words, 2);
    if (i >= 0)
        sim_laser_set_key(&r->c->bench->world.laser, i == 1);
}

static bool truth(struct request *r, const char *key, json_t *v)
{
    if (!json_is_boolean(v))
        refuse(r, "'%s' must be true or false", key);
    return json_is_true(v);
}

static void set_ignore_off(struct request *r, json_t *v)
{
    bool on = truth(r, "ignore_off", v);
    if (!*r->error)
        r->c->bench->world.laser.ignores_off = on;
}

static void set_saturate(struct request *r, json_t *v)
{
    bool on = truth(r, "saturate", v);
    if (!*r->error)
        r->c->bench->world.saturate = on;
}

static void set_drop(struct request *r, json_t *v)
{
    struct wire *w = the_wire(r);
    json_int_t n = json_integer_value(v);
    if (!json_is_integer(v) || n < 0 || n > 1000000)
        refuse(r, "'drop' must be a whole number, 0..1000000");
    else if (w)
        w->port->drop = (unsigned)n;
}

static void set_delay(struct request *r, json_t *v)
{
    struct wire *w = the_wire(r);
    double ms = json_number_value(v);
    if (!json_is_number(v) || !(ms >= 0 && ms <= 60000))
        refuse(r, "'delay_ms' must be a number, 0..60000 ms");
    else if (w)
        w->port->delay_ns = (int64_t)(ms * 1e6);
}

static void set_alarm(struct request *r, json_t *v)
{
    struct sim_az *z = the_axis(r);
    json_int_t code = json_integer_value(v);
    if (!json_is_integer(v) || code < 1 || code > 255)
        refuse(r, "'alarm' must be a whole number, 1..255");
    else if (z)
        sim_az_raise(z, (int)code, r->t_ns);
}

static void set_term(struct request *r, json_t *v)
{
    const char *name = json_string_value(v);
    int i = name ? optics_term(name) : -1;
    json_t *on = json_object_get(r->in, "on");
    unsigned *off = &r->c->bench->world.spec.optics.off;
    if (i < 0)
        refuse(r, "'term' must be one of the optics' terms: %s, %s", optics_term_name(0),
               optics_term_name(1));
    else if (truth(r, "on", on))
        *off &= ~(1u << i);
    else if (!*r->error)
        *off |= 1u << i;
}

static void do_set(struct request *r)
{
    static const struct {
        const char *key;
        void (*set)(struct request *r, json_t *v); // NULL: belongs to another key
    } keys[] = {{"interlock", set_interlock},
                {"key", set_key},
                {"ignore_off", set_ignore_off},
                {"saturate", set_saturate},
                {"drop", set_drop},
                {"delay_ms", set_delay},
                {"alarm", set_alarm},
                {"term", set_term},
                {"do", NULL},
                {"wire", NULL},
                {"axis", NULL},
                {"on", NULL}};
    enum { KEYS = sizeof keys / sizeof keys[0] };
    const char *key;
    json_t *v;
    int done = 0;
    json_object_foreach(r->in, key, v)
    {
        int i = 0;
        while (i < KEYS && strcmp(key, keys[i].key))
            i++;
        if (i == KEYS)
            refuse(r, "'set' does not know '%s'", key);
        if (*r->error)
            return;
        done += keys[i].set != NULL;
    }
    if (done == 0)
        refuse(r, "'set' needs something to set: interlock, key, ignore_off, saturate, drop, "
                  "delay_ms, alarm, term");
    world_see(&r->c->bench->world, r->t_ns);
    for (int i = 0; i < KEYS && !*r->error; i++)
        if (keys[i].set && (v = json_object_get(r->in, keys[i].key)))
            keys[i].set(r, v);
}

// --- one line ------------------------------------------------------------------------------------

static const struct {
    const char *verb;
    void (*run)(struct request *r);
} verbs[] = {
    {"state", do_state}, {"truth", do_truth},   {"plug", do_plug}, {"unplug", do_unplug},
    {"mute", do_mute},   {"unmute", do_unmute}, {"set", do_set},   {"power-cycle", do_power_cycle},
};

static void run(struct request *r)
{
    const char *verb = json_string_value(json_object_get(r->in, "do"));
    for (size_t i = 0; verb && i < sizeof verbs / sizeof verbs[0]; i++)
        if (strcmp(verb, verbs[i].verb) == 0) {
            verbs[i].run(r);
            return;
        }
    refuse(r,
           "'do' must be one of state, truth, plug, unplug, mute, unmute, set, power-cycle, not "
           "'%.40s'",
           verb ? verb : "");
}

char *control_answer(const struct control *c, const char *line, int64_t t_ns)
{
    json_error_t e;
    struct request r = {.c = c, .t_ns = t_ns, .out = json_object()};
    r.in = json_loads(line, JSON_REJECT_DUPLICATES, &e);
    if (json_is_object(r.in))
        run(&r);
    else
        refuse(&r, "not a JSON object: %.120s", r.in ? "another type" : e.text);
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
